"""What is drawn: shapes, meshes, markers, colours; the scene that holds it, and the commands that
it is made of.
"""

__all__: list[str] = []  # its modules are imported by name
