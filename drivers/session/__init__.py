"""Session on a bus: connection, motion and supervision of the axes, and its end."""
