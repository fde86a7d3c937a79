"""Tools for operators: scan, draft of a drives file, check, jog, home, monitor, restore."""
