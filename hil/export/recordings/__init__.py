"""The recordings of a run for other tools: a module a format, listed in `hil.export.formats`."""
