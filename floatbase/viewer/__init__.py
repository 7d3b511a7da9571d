"""The viewer: the picture of a state in the page, played, plotted and saved."""
