"""A session on the bus: what connecting builds, what moves and watches the axes, and leaving."""
