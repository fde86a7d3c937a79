"""What all axes show, side by side, and which of them have news for their drive.

Every SYNC latches all axes, and nearly always nothing has happened that a drive must react to. So
what each drive already knows is kept here in columns, and one look over all axes tells whether any
has changed its events or left the range of positions in which its drive has nothing to tell.
"""

from __future__ import annotations

from operator import gt, lt
from typing import TYPE_CHECKING

from sim_plant.axis import Reading

if TYPE_CHECKING:
    from collections.abc import Sequence

WIDTH = len(Reading._fields)
STATUSWORD = WIDTH
"""Where the statusword stands for `AxisImage.slot`: behind the fields of a `Reading`."""

_POSITION, _EVENTS = Reading._fields.index("position"), Reading._fields.index("events")
_FAR = 1 << 62


class ProcessImage:
    """Present values of all axes.

    Parameters
    ----------
    n_axes : int

    Attributes
    ----------
    values : list of int
        The fields of every axis's `Reading`, axis after axis, then all statuswords; changed in
        place.
    events : list of int
        `AxisEvent` bits that each drive knows of.
    lowest, highest : list of int
        Between which positions [increments] there is nothing to tell, for each drive.
    """

    def __init__(self, n_axes: int) -> None:
        self.values = [0] * (n_axes * (WIDTH + 1))
        self.events = [0] * n_axes
        self.lowest, self.highest = [-_FAR] * n_axes, [_FAR] * n_axes
        self._readings = slice(0, n_axes * WIDTH)

    def latch(self, readings: Sequence[int]) -> bool:
        """Take what `sim_plant.axis.Machine.read` returned; tell whether any axis has news."""
        self.values[self._readings] = readings
        positions = readings[_POSITION::WIDTH]
        return (
            readings[_EVENTS::WIDTH] != self.events
            or any(map(lt, positions, self.lowest))
            or any(map(gt, positions, self.highest))
        )

    def news(self) -> list[int]:
        """Return which axes have news, in order."""
        values = self.values[self._readings]
        rows = zip(
            values[_POSITION::WIDTH],
            values[_EVENTS::WIDTH],
            self.events,
            self.lowest,
            self.highest,
            strict=True,
        )
        return [
            axis
            for axis, (position, events, known, low, high) in enumerate(rows)
            if events != known or not low <= position <= high
        ]


class AxisImage:
    """One drive's view of a process image.

    Parameters
    ----------
    image : ProcessImage
    axis : int
        From 0.
    """

    def __init__(self, image: ProcessImage, axis: int) -> None:
        self.values = image.values
        self._image = image
        self._axis = axis
        self._first = axis * WIDTH
        self._statusword = len(image.events) * WIDTH + axis

    def slot(self, field: int) -> int:
        """Where in `values` a field of the `Reading`, or the `STATUSWORD`, stands."""
        return self._statusword if field == STATUSWORD else self._first + field

    @property
    def reading(self) -> Reading:
        """What was latched last."""
        return Reading(*self.values[self._first : self._first + WIDTH])

    @property
    def statusword(self) -> int:
        """Object 6041h."""
        return self.values[self._statusword]

    @statusword.setter
    def statusword(self, word: int) -> None:
        self.values[self._statusword] = word

    @property
    def events(self) -> int:
        """`AxisEvent` bits that the drive knows of."""
        return self._image.events[self._axis]

    @events.setter
    def events(self, bits: int) -> None:
        self._image.events[self._axis] = bits

    def expect_anything(self) -> None:
        """Have news at every SYNC."""
        self.expect_within(_FAR, -_FAR)

    def expect_nothing(self) -> None:
        """Have news of events only, wherever the axis goes."""
        self.expect_within(-_FAR, _FAR)

    def expect_within(self, low: int, high: int) -> None:
        """Have news of events, and while the position is not within bounds [increments]."""
        self._image.lowest[self._axis], self._image.highest[self._axis] = low, high
