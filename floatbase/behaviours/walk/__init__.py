"""Walking: gaits, footholds, plans, and `Walk`, which follows them."""

__all__: list[str] = []  # its modules are imported by name
