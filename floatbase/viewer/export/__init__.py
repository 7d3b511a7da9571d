"""Scenes that need no running program: recordings, films and images, thumbnails in stored
notebooks.
"""

__all__: list[str] = []  # its modules are imported by name
