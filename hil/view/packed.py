"""Compressed data of a page: segments of the time line and tracks of quantities.

Every kind of page has one object of data; ``web/src/recorded.js`` reads it. Parts without data on a
page are null.

``robot``, ``workspace``
    Results of `hil.view.visuals.robot_data` and `workspace_data`.
``kinds``
    For each kind of segment ``name``, ``colour`` and whether it ``moves`` between measurements.
``segments``
    One after the other on the time of the page [s]: ``id`` of the recording, or "", ``kind`` by its
    number, ``words``, ``begin``, ``end``, ``axes`` from 0, ``recorded``, ``problem``.
``planned``
    Tracks of the planned positions, a joint each.
``measured``
    ``position``, ``velocity`` and ``torque``, tracks of each joint; torque after the low-pass of
    the prediction, where there is one.
``predicted``, ``band``, ``prediction``
    Tracks of the predicted torque of each joint and of the half-width of its interval of 95 %, and
    a description of the prediction.
``distance``
    The least distance to a box, a track with the ``link`` and ``box`` of each knot.
``parameters``
    Base parameters by name: ``title``, and ``by``, the recordings that carry it, with their
    shares [%].

A track is ``time``, ``value`` and, of planned motions, ``slope``, each packed: a ``step``, and
``differences`` of successive multiples of it, null where nothing is known. Curves need no more
digits than a screen shows. The lines of a running measurement (`hil.live.lines`) have the same
names for the same quantities, and the same format of tracks for torques.
"""

from __future__ import annotations

from ctypes import CDLL, c_double, c_int64
from dataclasses import dataclass
from itertools import chain, repeat
from typing import TYPE_CHECKING

import numpy as np

from hil.machine_code import library, pointer
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import KINDS, ElementKind

try:
    _LIBRARY: CDLL | None = library(__file__, "_simplify")
except ModuleNotFoundError:
    _LIBRARY = None

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import ArrayLike

    from hil.arrays import Array, Mask
    from hil.planning.measurement import RecordedMotion


@dataclass(frozen=True, slots=True)
class Segment:
    """Segment of the time line.

    Attributes
    ----------
    kind : str
        Kind of measurement, or ``travel`` or ``warm-up``.
    words : str
        Description for readers.
    begin, end : float
        Start and end [s].
    axes : tuple of int
        Axes, from 0, whose torque is read.
    recorded : bool
        True for a measurement.
    problem : str, optional
        Reason for a refusal by the dry run.
    id : str
        Id of the measurement.
    """

    kind: str
    words: str
    begin: float
    end: float
    axes: tuple[int, ...] = ()
    recorded: bool = False
    problem: str | None = None
    id: str = ""


RECORDED_ELSEWHERE = str(FreeMotion.model_fields["kind"].default)
BETWEEN = {"travel": "#6b7885", "warm-up": "#94722f"}
"""Motion between measurements, with colours."""
_FURTHER = ("#7a7a1e", "#0f7c8a", "#a3354f")
"""Colours of kinds without a colour of their own."""


def shown_kinds(occurring: Iterable[str]) -> list[dict[str, object]]:
    """Return name and colour of the occurring kinds, measurements first."""
    wanted = set(occurring)
    further = chain(_FURTHER, repeat(_FURTHER[-1]))
    colours = {
        name: kind.colour if isinstance(kind, ElementKind) else next(further)
        for name, kind in KINDS.items()
    }
    colours |= {RECORDED_ELSEWHERE: next(further), **BETWEEN}
    return [
        {"name": name, "colour": colour, "moves": name in BETWEEN}
        for name, colour in colours.items()
        if name in wanted
    ]


def packed(values: ArrayLike, step: float) -> dict[str, object]:
    """Encode numbers as differences of successive multiples of `step`."""
    given = np.ravel(np.asarray(values, dtype=float))
    there = np.isfinite(given)
    differences = np.full(len(given), None, dtype=object)
    differences[there] = np.diff(np.rint(given[there] / step).astype(np.int64), prepend=0).tolist()
    return {"step": step, "differences": differences.tolist()}


INSTANT = 1e-4
"""Resolution of time in a page [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Knots of a quantity, joined by lines, or by cubics if slopes are given.

    Attributes
    ----------
    time, value : array (n,)
        Time [s], and value in the quantity's unit.
    slope : array (n,), optional
        Rate of the value [unit/s].
    """

    time: Array
    value: Array
    slope: Array | None = None

    def data(self, step: float) -> dict[str, object]:
        """Convert to the page's data, with values rounded to `step`."""
        found: dict[str, object] = {
            "time": packed(self.time, INSTANT),
            "value": packed(self.value, step),
        }
        return found if self.slope is None else found | {"slope": packed(self.slope, step)}


def simplify(time: Array, value: Array, tolerance: float) -> Track:
    """Simplify samples to a polyline within `tolerance` (swinging door algorithm).

    The range of slopes from a knot that pass all later samples within the tolerance narrows from
    sample to sample; when it is empty, the previous sample becomes the next knot.
    """
    finite = np.isfinite(value)
    t, x = (np.asarray(each[finite], dtype=np.float64) for each in (time, value))
    if not len(t):
        return Track(t, x)
    kept = np.zeros(len(t), dtype=bool)
    if _LIBRARY is None:
        swinging_door(t.tolist(), x.tolist(), tolerance, kept)
    else:
        arguments = pointer(t), pointer(x), c_int64(len(t)), c_double(tolerance), pointer(kept)
        _LIBRARY.swinging_door(*arguments)
    return Track(t[kept], x[kept])


def swinging_door(t: list[float], x: list[float], tolerance: float, kept: Mask) -> None:
    """Mark the samples kept by `simplify`; ``simplify.c`` is the compiled version."""
    begin, low, high = 0, -np.inf, np.inf
    kept[[0, -1]] = True
    for i in range(1, len(t)):
        way = t[i] - t[begin]
        if way > 0 and not low <= (x[i] - x[begin]) / way <= high:
            begin, low, high = i - 1, -np.inf, np.inf
            kept[begin] = True
            way = t[i] - t[begin]
        if way > 0:
            low = max(low, (x[i] - tolerance - x[begin]) / way)
            high = min(high, (x[i] + tolerance - x[begin]) / way)


def simplify_with_gaps(time: Array, value: Array, tolerance: float) -> Track:
    """Simplify samples as in `simplify`, with a NaN knot in every gap."""
    there = np.isfinite(value)
    runs = np.split(np.arange(len(time)), np.flatnonzero(np.diff(there)) + 1)
    parts = [
        simplify(time[own], value[own], tolerance)
        if there[own[0]]
        else Track(time[own[:1]], value[own[:1]])
        for own in runs
    ]
    return Track(*(np.concatenate([getattr(p, n) for p in parts]) for n in ("time", "value")))


def simplify_columns(
    time: Array,
    values: Array,
    tolerance: float | None = None,
    share: float = 1e-3,
    by: Callable[[Array, Array, float], Track] = simplify,
) -> tuple[Track, ...]:
    """Simplify columns of values (n, n_joints), by default within a share of the maximum."""
    greatest = np.where(np.isfinite(values), np.abs(values), 0.0).max(axis=0, initial=1e-9)
    allowed = share * greatest if tolerance is None else np.full_like(greatest, tolerance)
    return tuple(
        by(time, column, most) for column, most in zip(values.T, allowed.tolist(), strict=True)
    )


def describe_motion(motion: RecordedMotion) -> str:
    """Format id, kind and axes of a motion."""
    return f"{motion.id}: {motion.kind}, {motion.axes_in_words}"
