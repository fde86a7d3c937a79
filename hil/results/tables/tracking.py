"""How closely axes follow a trajectory, with neither, velocity and both fed forward."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.rounding import significant
from hil.results.tables.table import Column, Part, Table, figures
from hil.results.tracking import PASSES

if TYPE_CHECKING:
    from hil.results.tables.table import Row
    from hil.results.tracking import AxisErrors, Tracking

WRONG_DELAY = 0.25
"""SYNC periods by which the stated delay may differ from the one that the recording shows."""


def tracking(found: Tracking) -> Table:
    """Following errors of all axes."""
    by_size = {
        "rms": {axis.axis: axis.rms for axis in found.axes},
        "peak": {axis.axis: axis.peak for axis in found.axes},
    }
    return Table(
        title="Following errors, by what is fed forward",
        columns=(Column("axis"), *figures(*PASSES, "factor"), Column("unit")),
        parts=tuple(
            Part(tuple(_row(axis, errors[axis.axis]) for axis in found.axes), name)
            for name, errors in by_size.items()
        ),
        explanation=(
            "What was planned less what was measured while the trajectory was in motion, with"
            " neither velocity nor torque fed forward, with velocity, and with both; factor by"
            " which torque makes the error of velocity alone smaller."
        ),
        notes=notes(found),
    )


def notes(found: Tracking) -> tuple[str, ...]:
    """What the passes show beside their figures, and what restricts these."""
    lines = [
        f"median over the axes: velocity makes errors {found.gain('neither', 'velocity'):.3g} times"
        f" smaller, torque beside it {found.gain('velocity', 'both'):.3g} times more"
    ]
    if abs(found.shown_delay - found.delay) > WRONG_DELAY:
        lines.append(
            f"the recordings show a delay of {found.shown_delay:.2f} SYNC periods instead of"
            f" {found.delay:g}: repeat with --delay {found.shown_delay:.2f}"
        )
    worse = [axis.axis for axis in found.axes if axis.rms["velocity"] > axis.rms["neither"]]
    if worse:
        lines.append(
            f"axis {', '.join(map(str, worse))}: velocity makes the errors larger; the drive feeds"
            " its demand's velocity forward by itself: set that to zero with the maker's tool"
        )
    return tuple(lines)


def _row(axis: AxisErrors, errors: dict[str, float]) -> Row:
    cells = (significant(1e3 * errors[name], 3) for name in PASSES)
    factor = errors["velocity"] / errors["both"]
    return (str(axis.axis), *cells, f"{factor:.1f}", f"m{axis.unit}")
