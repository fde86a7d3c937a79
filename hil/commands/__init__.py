"""What a user asks for, one module a use: from options to an `hil.show.outcome.Outcome`.

A module computes, keeps what users find again as a file, and states how it is shown: tables, plots,
verdicts. Nothing here prints; `hil.cli` has the options, `hil.show` writes what was found.
"""
