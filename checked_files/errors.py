"""Root of all errors with a remedy for the user.

The class is in this package because all packages may import it. A handler of `HilError` thus
catches errors of files, drives, runs and arguments alike.
"""

from __future__ import annotations


class HilError(Exception):
    """Error with a remedy; the message states value, bound and remedy."""

    @property
    def lines(self) -> str:
        """Message, with notes about later failures below.

        Examples
        --------
        >>> error = HilError("joint 2: no answer; check its supply")
        >>> error.add_note("powering off is incomplete")
        >>> print(error.lines)
        joint 2: no answer; check its supply
        powering off is incomplete
        """
        return "\n".join([str(self), *getattr(self, "__notes__", ())])
