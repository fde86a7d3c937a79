"""The root of all errors that a user can mend.

It stands beside the reader of files, which all packages may see, so that whoever catches it catches
what is wrong with a file, a drive, a run or an argument alike.
"""

from __future__ import annotations


class HilError(Exception):
    """Something that the user can mend; the message states what is wrong, the bound, the remedy."""
