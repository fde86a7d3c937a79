"""Charts as data, drawn as SVG in a page or a file."""
