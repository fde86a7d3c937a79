"""Tasks of the commands as functions: the composition root, for the terminal and for Python."""
