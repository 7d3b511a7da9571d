"""Transport of a scene to its pages: window, server, notebook widget and connections."""

__all__: list[str] = []  # its modules are imported by name
