"""The page: JavaScript and CSS in `src`, built into `dist`, and the HTML that contains them."""

__all__: list[str] = []  # its module is imported by name
