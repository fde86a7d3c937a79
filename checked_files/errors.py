"""Root of all errors with a remedy for the user.

It stands beside the reader of files, which all packages may see, so that whoever catches it catches
what is wrong with a file, a drive, a run or an argument alike.
"""

from __future__ import annotations


class HilError(Exception):
    """Error with a remedy; the message states value, bound and remedy."""
