"""Found, excluded, invisible: what recordings prove of the causes that may spoil an estimate.

And how much of its error each cause makes that an estimate knows of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.estimation.excluded.causes import CAUSES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array


class Found(FileModel):
    """A cause that the recordings show.

    Attributes
    ----------
    cause : str
        One of `hil.estimation.excluded.causes.CAUSES`.
    axes : tuple of int
        From 1; none where it concerns none in particular.
    detail : str
        Its size with standard error, or its evidence; a clause without subject.
    left : float
        Share of the sum of squares of residuals that remains beside it.
    others : tuple of str
        Causes that explain the recordings as well, with axes and sizes.
    change : tuple of float, optional
        Of the base parameters once it is corrected; None where that takes other parameters.
    other_changes : tuple of tuple of float
        The same of each of `others`.
    size, error : float
        In the cause's unit; of several columns the largest; None where it has none.
    """

    cause: str
    axes: tuple[int, ...]
    detail: str
    left: float = 1.0
    others: tuple[str, ...] = ()
    change: tuple[float, ...] | None = None
    other_changes: tuple[tuple[float, ...], ...] = ()
    size: float | None = None
    error: float | None = None

    @property
    def remedy(self) -> str:
        """What to do about it; nothing about others that explain the recordings as well."""
        which = "find out which before anything is changed: " if self.others else ""
        return which + CAUSES[self.cause].remedy

    def __str__(self) -> str:
        same = ": the same in these data" if self.others else ""
        return "; or ".join((located(self.axes, self.detail), *self.others)) + same


class Limit(FileModel):
    """What is excluded of a cause.

    Attributes
    ----------
    cause : str
    axis : int
        From 1; 0 where it concerns none in particular.
    part : str
        Which of its columns; empty where all of them are alike.
    unit : str
    size : float or None
        Size that would be found with a probability of 80 %; None where it never shows.
    torque : float
        Share of the recorded torque that one unit makes, on the axis where that is most.
    """

    cause: str
    axis: int
    part: str
    unit: str
    size: float | None
    torque: float

    @property
    def usual(self) -> float:
        """Size that is usual of it, 0 where none is known."""
        return CAUSES[self.cause].usual

    @property
    def visible(self) -> bool:
        """Whether what is usual of it would be found; true where nothing is usual."""
        return self.size is not None and (not self.usual or self.size <= self.usual)

    @property
    def unnoticed(self) -> float:
        """Share of the torque of the smallest size that is found; of a usual one if none is."""
        return self.worth if self.size is None else self.torque * self.size

    @property
    def worth(self) -> float:
        """Share of the torque that may go unnoticed: of the smallest size, or of a usual one."""
        sizes = [each for each in (self.size, self.usual) if each]
        return self.torque * min(sizes, default=0.0)


class Excluded(FileModel):
    """What recordings prove.

    Attributes
    ----------
    found : tuple of Found
        The one that explains most first.
    limits : tuple of Limit
        Of all causes, in the order of the table.
    tests : int
        Causes that were tested.
    """

    found: tuple[Found, ...]
    limits: tuple[Limit, ...]
    tests: int

    @property
    def shifts(self) -> tuple[Array, ...]:
        """Change of the base parameters by the correction of each cause found, shape (n_base,).

        Of causes that data do not distinguish, by the correction of each.
        """
        return tuple(
            np.array(change)
            for each in self.found
            if each.change is not None and not CAUSES[each.cause].accounted
            for change in (each.change, *each.other_changes)
        )

    @property
    def invisible(self) -> tuple[Limit, ...]:
        """Causes that do not show in the size that is usual of them, and make torque."""
        return tuple(
            each
            for each in self.limits
            if not each.visible and each.worth > 0 and (each.cause, each.axis) not in self.places
        )

    @property
    def places(self) -> frozenset[tuple[str, int]]:
        """Causes that were found with their axes, from 1; 0 for a cause of no axis."""
        return frozenset((each.cause, axis) for each in self.found for axis in each.axes or (0,))

    def unseen(self, cause: str, axis: int) -> float:
        """Share of a cause's usual size that may go unnoticed at an axis, from 1; at most 1."""
        own = (each for each in self.limits if (each.cause, each.axis) == (cause, axis))
        return min((each.size / each.usual for each in own if each.size is not None), default=1.0)


class ErrorTerm(FileModel):
    """One cause of error, as `model.yaml` keeps it.

    Attributes
    ----------
    cause : str
        One of `hil.estimation.excluded.causes.CAUSES`.
    axes : tuple of int
        From 1; none where it concerns all.
    found : str
        What was found, with its figure.
    torque : float
        Error of the torques on a free motion, mean over joints of its root mean square over that of
        the torque; if the cause is accounted for, the error without that.
    share : float
        Of the sum of squares.
    accounted : bool
        Whether the estimate takes it into account.
    """

    cause: str
    axes: tuple[int, ...]
    found: str
    torque: float
    share: float
    accounted: bool

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return CAUSES[self.cause].remedy


def located(axes: Sequence[int], words: str) -> str:
    """Words about axes, from 1."""
    which = " and ".join(map(str, axes))
    return f"{'axis' if len(axes) == 1 else 'axes'} {which}: {words}" if which else words
