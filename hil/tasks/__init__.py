"""What the commands do, as functions: the composition root, for the terminal and for Python."""
