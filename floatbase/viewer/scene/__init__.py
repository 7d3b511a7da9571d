"""Scene: shapes, meshes, markers and colours, and the commands that draw them."""

__all__: list[str] = []  # its modules are imported by name
