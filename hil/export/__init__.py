"""Identified models as files of other tools: a module a format, listed in `formats`."""
