"""Results as tables, one file a subject: commands, notebooks and reports show the same ones."""
