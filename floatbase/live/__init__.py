"""The robot in a web page: MuJoCo and the compiled controller run in the reader's browser."""

__all__: list[str] = []  # its modules are imported by name
