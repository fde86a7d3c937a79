"""Commands, a module per command: from options to an `hil.show.outcome.Outcome`.

A module computes a result, writes its file, and builds tables, plots and verdicts. No module
prints: `hil.cli` holds the options, `hil.show` writes the outcome.
"""
