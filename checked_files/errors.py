"""Root of all errors with a remedy for the user.

The class is in this package because all packages may import it. A handler of `HilError` thus
catches errors of files, drives, runs and arguments alike.
"""

from __future__ import annotations


class HilError(Exception):
    """Error with a remedy; the message states value, bound and remedy."""
