"""Recordings of a run for other tools: a module per format, listed in `hil.export.formats`."""
