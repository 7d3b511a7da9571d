"""Robots that live in a web page: the compiled tick as WebAssembly, and robots as data."""

__all__: list[str] = []  # its modules are imported by name
