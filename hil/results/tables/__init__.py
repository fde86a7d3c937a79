"""Results as tables, a module per subject, for commands, notebooks and reports."""
