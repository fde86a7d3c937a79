"""Results as tables, one module per subject, for commands, notebooks and reports."""
