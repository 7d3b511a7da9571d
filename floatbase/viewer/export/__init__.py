"""Scenes without a running program: recordings, films, images, and thumbnails in notebooks."""

__all__: list[str] = []  # its modules are imported by name
