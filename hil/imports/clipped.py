"""Clipped positions: a register or a filter ends where the joint moves on.

A clipped position arrives at a bound with full speed, has exactly the same value for some samples,
and leaves with full speed. A joint that stops and returns would need the change of speed of both
corners within a sample, whereas the change of speed everywhere else is that of its motion. So a
bound clips if both corners of at least two plateaus at the greatest or at the least position are
sharper than the motion anywhere else. A joint that rests at a programmed position or against a stop
starts from rest: its plateaus have a corner at the beginning at most.

Positions of straight pieces (commands, poor interpolation) have such corners at rests. But the
hidden way of a clipped motion has an acceleration like the rest of the motion: with steps s1 before
and s2 after m samples, (s1 + s2) / m is at most `STRONGER` times the greatest second difference at
the lag m elsewhere, over m^2; straight pieces have none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Suspicion
from hil.imports.spikes import GREATEST, positions
from hil.imports.tables import ROWS
from hil.least_squares.standstill import NOISY, extent, moving
from hil.model.frames import ROUNDED_OFF

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.instants import Stretch
    from hil.imports.samples import Samples
    from hil.model.robot import Robot

    Plateau = tuple[float, float, int]  # less sharp corner, steps before and after, samples

TWICE = 2
"""Minimum number of plateaus with two sharp corners: one may be a collision with a stop."""
STRONGER = 4.0
"""Maximum acceleration on the hidden way, over that elsewhere. A sinusoid clipped at the share k of
its amplitude has 2 sqrt(1 - k^2) / (k (pi - 2 asin k)): 3.6 at k = 0.2."""
PLATEAU = 3
"""Minimum length of a plateau in samples: a smooth maximum between two samples has two equal ones.
"""


def clipped_positions(
    samples: Samples, stretches: Sequence[Stretch], robot: Robot
) -> Iterator[Suspicion]:
    """Yield suspicions of positions clipped at a bound."""
    parts = [(x.min(axis=1), x.max(axis=1)) for x in _parts(samples, stretches)]
    ends = np.array(parts)  # (n_parts, 2, n_joints)
    bounds = np.stack([ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)])
    number = np.zeros(bounds.shape, dtype=np.int64)
    for rows, there in zip(_rows(stretches), _equal(ends, bounds), strict=True):
        for end, joint in zip(*np.nonzero(there), strict=True):
            x = samples.read(rows)[:, joint].clip(-GREATEST, GREATEST)
            number[end, joint] += np.count_nonzero(_equal(x, bounds[end, joint]))
    likely = number.max(axis=0) >= TWICE * PLATEAU
    if likely.any():  # an axis at rest, or with one increment of noise, has plateaus at both ends
        likely = _moving(samples, stretches, np.ptp(bounds, axis=0), likely)
    corners = {joint: _Corners(*bounds[:, joint]) for joint in np.flatnonzero(likely).tolist()}
    for part in _parts(samples, stretches) if corners else ():
        for joint, each in corners.items():
            each.add(part[joint])
    for joint, each in corners.items():
        found = {
            bound: sum(length for *_, length in plateaus)
            for bound, plateaus in each.sharp.items()
            if _continues_motion(_parts(samples, stretches), joint, each.bounds, plateaus)
        }
        if found:
            unit, n = robot.position_unit(joint), sum(len(each.rows) for each in stretches)
            values = " and ".join(f"{bound:.6g}" for bound in found)
            yield Suspicion(
                "range",
                ("joints", joint, "position"),
                f"is clipped at {values} {unit} in {sum(found.values()) / n:.0%} of the rows: it "
                "arrives and leaves with full speed and is constant in between, as with the end "
                "of a register; record a wider register, or choose rows without these",
            )


def _moving(samples: Samples, stretches: Sequence[Stretch], ways: Array, likely: Mask) -> Mask:
    """Return the `likely` joints that move; all arguments by joint, shape (n_joints,)."""
    period, columns = stretches[0].period, _parts(samples, stretches)
    # the noise of a part is at most that of all
    likely &= ways > NOISY * extent(next(columns).T, period).noise
    # axes move relative to the widest range
    some = likely | (np.arange(len(ways)) == ways.argmax())
    if likely.any():
        extents = [extent(x[some].T, period) for x in _parts(samples, stretches) if x.size]
        likely[some] &= moving(extents)
    return likely


def _rows(stretches: Sequence[Stretch]) -> Iterator[Integers]:
    """Yield rows of parts of the stretches."""
    for stretch in stretches:
        for begin in range(0, len(stretch.rows), ROWS):
            yield stretch.rows[begin : begin + ROWS]


def _parts(samples: Samples, stretches: Sequence[Stretch]) -> Iterator[Array]:
    """Yield positions of parts of the stretches, shape (n_joints, n)."""
    return (positions(samples, rows) for rows in _rows(stretches))


class _Corners:
    """Plateaus of a column at least and greatest position, and the greatest corner elsewhere."""

    def __init__(self, *bounds: float) -> None:
        self.bounds = bounds
        self._plateaus: dict[float, list[Plateau]] = {bound: [] for bound in bounds}
        self._ordinary = 0.0

    def add(self, x: Array) -> None:
        """Add a part of the column, shape (n,)."""
        bend, smooth = np.zeros(len(x)), np.ones(len(x), dtype=bool)
        bend[1:-1] = np.abs(np.diff(x, 2))
        for bound, plateaus in self._plateaus.items():
            edges = np.flatnonzero(np.diff(_equal(x, bound).astype(np.int8), prepend=0, append=0))
            for begin, end in edges.reshape(-1, 2).tolist():
                if end - begin < PLATEAU:
                    continue
                smooth[max(begin - 1, 0) : end + 1] = False
                if begin < 2 or end > len(x) - 2:  # cut by the end of the part
                    continue
                # the bound is reached between two samples, which share the corner
                sides = slice(begin - 1, begin + 1), slice(end - 1, end + 1)
                corner = min(float(bend[side].max()) for side in sides)
                steps = abs(x[begin - 1] - x[begin - 2]) + abs(x[end + 1] - x[end])
                plateaus.append((corner, float(steps), end - begin))
        self._ordinary = max(self._ordinary, float(bend[smooth].max(initial=0.0)))

    @property
    def sharp(self) -> dict[float, list[Plateau]]:
        """Plateaus at each bound with at least `TWICE` that have two sharp corners."""
        return {
            bound: plateaus
            for bound, plateaus in self._plateaus.items()
            if sum(corner > self._ordinary for corner, *_ in plateaus) >= TWICE
        }


def _equal(x: Array, bound: float | Array) -> Mask:
    return np.asarray(np.abs(x - bound) <= ROUNDED_OFF * np.abs(bound))


def _continues_motion(
    parts: Iterable[Array], joint: int, bounds: tuple[float, ...], plateaus: Sequence[Plateau]
) -> bool:
    """Return True if the hidden ways have accelerations like the motion elsewhere."""
    m = int(np.median([length for *_, length in plateaus]))
    hidden, greatest = float(np.median([steps / length for _, steps, length in plateaus])), 0.0
    for part in parts:
        x = part[joint]
        if len(x) > 2 * m:
            bend = np.abs(x[2 * m :] - 2.0 * x[m:-m] + x[: -2 * m]) / m**2
            at = np.concatenate([[0], np.cumsum(_equal(x, bounds[0]) | _equal(x, bounds[1]))])
            free = at[2 * m + 1 :] == at[: -2 * m - 1]  # no sample at a bound in the window
            greatest = max(greatest, float(bend[free].max(initial=0.0)))
    return hidden <= STRONGER * greatest
