"""Results of the tests of causes: found, excluded and invisible causes.

Error terms state the part of each cause in the known error of an estimate.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BeforeValidator, model_validator

from checked_files.yaml_file import FileModel
from hil.estimation.excluded.causes import CAUSES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array

RENAMED = {
    "zero": "joint offset",
    "repeats": "torque ripple",
    "late torque": "torque delay",
    "late position": "position delay",
    "play": "backlash",
}
"""Names of causes in model files of versions before 0.2."""


def _cause_name(name: object) -> object:
    """Return the present name of a cause; raise ValueError for an unknown cause."""
    name = RENAMED.get(str(name), name)
    if name not in CAUSES:
        raise ValueError(f"unknown cause {name!r}; identify the run again (hil identify RUN)")
    return name


CauseName = Annotated[str, BeforeValidator(_cause_name)]


class Found(FileModel):
    """Cause shown by the recordings.

    Attributes
    ----------
    cause : str
        One of `hil.estimation.excluded.causes.CAUSES`.
    axes : tuple of int
        Axes from 1; none if the cause concerns none in particular.
    detail : str
        Size with standard error, or evidence; a clause without subject.
    left : float
        Remaining share of the residual sum of squares beside the cause.
    others : tuple of str
        Causes that explain the recordings equally well, with axes and sizes.
    change : tuple of float, optional
        Change of the base parameters by correcting the cause; None if the correction needs other
        parameters.
    other_changes : tuple of tuple of float
        Change for each of `others`.
    size, error : float
        Size and standard error in the cause's unit; the largest of several columns; None without a
        size.

    Examples
    --------
    >>> [(found.cause, found.axes) for found in hil.Model.load("runs/head").excluded.found]
    []
    """

    cause: CauseName
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
        """Remedy of the cause, without remedies of `others`."""
        which = "determine which of these causes applies before any change: " if self.others else ""
        return which + CAUSES[self.cause].remedy

    def __str__(self) -> str:
        same = ": indistinguishable in these data" if self.others else ""
        return "; or ".join((located(self.axes, self.detail), *self.others)) + same


class Limit(FileModel):
    """Exclusion limit of a cause.

    Attributes
    ----------
    cause : str
    axis : int
        Axis from 1; 0 if the cause concerns none in particular.
    part : str
        Column of the cause; empty if all columns are alike.
    unit : str
    size : float or None
        Size that would be found with a probability of 80 %; None if the cause never shows, or is
        not testable.
    torque : float
        Share of the recorded torque due to one unit, on the axis with the largest share.
    testable : bool
        False if the torque of the smallest detectable size exceeds the recorded torque (rms): the
        cause is a part of this torque, so no such size occurs in these motions.

    Examples
    --------
    >>> limit = hil.Model.load("runs/head").excluded.limits[1]
    >>> limit.cause, limit.axis, limit.unit, limit.visible
    ('joint offset', 2, 'degrees', False)
    """

    cause: CauseName
    axis: int
    part: str
    unit: str
    size: float | None
    torque: float
    testable: bool = True

    @model_validator(mode="before")
    @classmethod
    def _drop_impossible_size(cls, values: Any) -> Any:
        match values:
            case {"torque": int() | float() as torque, "size": int() | float() as size}:
                if torque * size > 1.0:
                    return {**values, "size": None, "testable": False}
        return values

    @property
    def usual(self) -> float:
        """Usual size of the cause, 0 if none is known."""
        return CAUSES[self.cause].usual

    @property
    def visible(self) -> bool:
        """True if a cause is detectable at its usual size, or at any size if none is usual."""
        return self.size is not None and (not self.usual or self.size <= self.usual)

    @property
    def unnoticed(self) -> float:
        """Torque share of the smallest detectable size, or of the usual size if not detectable."""
        return self.worth if self.size is None else self.torque * self.size

    @property
    def worth(self) -> float:
        """Unnoticed torque share at the smallest detectable size, or at a smaller usual size."""
        sizes = [each for each in (self.size, self.usual) if each]
        return self.torque * min(sizes, default=0.0)


class Excluded(FileModel):
    """Proof by recordings: found causes and exclusion limits.

    Attributes
    ----------
    found : tuple of Found
        Found causes, the most explaining first.
    limits : tuple of Limit
        Limits of all causes, in the order of the table.
    tests : int
        Number of tested causes.
    unexplained : bool
        True if later recordings differ from the earlier ones beyond any found cause.

    Examples
    --------
    >>> excluded = hil.Model.load("runs/head").excluded
    >>> excluded.found, excluded.limits[0].cause
    ((), 'joint offset')
    """

    found: tuple[Found, ...]
    limits: tuple[Limit, ...]
    tests: int
    unexplained: bool = False

    @property
    def shifts(self) -> tuple[Array, ...]:
        """Changes of the base parameters by correcting the found causes, each of shape (n_base,).

        Causes that data do not distinguish have one change each.
        """
        return tuple(
            np.array(change)
            for each in self.found
            if each.change is not None and not CAUSES[each.cause].accounted
            for change in (each.change, *each.other_changes)
        )

    @property
    def invisible(self) -> tuple[Limit, ...]:
        """Causes with a torque that are invisible at the usual size."""
        return tuple(
            each
            for each in self.limits
            if not each.visible and each.worth > 0 and (each.cause, each.axis) not in self.places
        )

    @property
    def places(self) -> frozenset[tuple[str, int]]:
        """Found causes with axes, from 1; 0 for a cause of no axis."""
        return frozenset((each.cause, axis) for each in self.found for axis in each.axes or (0,))

    def unseen(self, cause: str, axis: int) -> float:
        """Return the detectable over the usual size at an axis (from 1); 1 if unknown."""
        own = (each for each in self.limits if (each.cause, each.axis) == (cause, axis))
        return min((each.size / each.usual for each in own if each.size is not None), default=1.0)


class ErrorTerm(FileModel):
    """Cause of error, as stored in `model.yaml`.

    Attributes
    ----------
    cause : str
        One of `hil.estimation.excluded.causes.CAUSES`.
    axes : tuple of int
        Axes from 1; empty if the cause concerns all axes.
    found : str
        Finding, with its figure.
    torque : float
        Error of the torques on a free motion, relative to the torques, both as root mean squares;
        mean over joints. For an accounted cause, the error without the correction.
    share : float
        Square of `torque` relative to the sum over all terms.
    accounted : bool
        True if the estimate accounts for the cause.
    """

    cause: CauseName
    axes: tuple[int, ...]
    found: str
    torque: float
    share: float
    accounted: bool

    @property
    def remedy(self) -> str:
        """Remedy of the cause."""
        return CAUSES[self.cause].remedy


def located(axes: Sequence[int], words: str) -> str:
    """Prefix words with the axes concerned, from 1."""
    which = (" and " if len(axes) == 2 else ", ").join(map(str, axes))
    return f"{'axis' if len(axes) == 1 else 'axes'} {which}: {words}" if which else words
