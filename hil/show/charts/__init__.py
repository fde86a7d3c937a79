"""Charts as data and the one way in which they are drawn: as SVG, in a page or as a file."""
