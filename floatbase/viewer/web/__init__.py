"""The page: its JavaScript and CSS, and the HTML that holds them."""

__all__: list[str] = []  # its module is imported by name
