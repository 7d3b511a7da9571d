"""How a scene gets to a page: the window and its server, the notebook's widget, and the connections
to the pages.
"""

__all__: list[str] = []  # its modules are imported by name
