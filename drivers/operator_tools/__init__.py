"""What operators do with drives: scan, draft a drives file, check, jog, home, monitor, restore."""
