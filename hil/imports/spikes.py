"""Spikes: outliers that no motion of a joint can produce.

A spike comes and goes in one step, within a few samples, unlike any motion of a robot. Unlike noise
or a step, it exceeds the samples `REACH` before and after by far more than the ordinary change of
values, and by a part of the whole range of the column. Angles are inspected after unwrapping; a
jump by several turns that is reversed at once is a spike too.

A column that is rounded to increments flickers: noise takes a sample and its neighbour by half an
increment each way across a bound, so two increments are ordinary.

Recorders drop a sample now and then, and a few small spikes do no harm. Least squares counts
squares: spikes refuse the import if their squares outweigh all others, for torques and velocities
in the values, for positions in the second differences, since positions are differentiated twice.
Positions and velocities of a joint at rest have no motion to outweigh: their contribution to the
torques is compared with the motion of the moving joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Suspicion
from hil.imports.segments import FARTHER, jumps_of
from hil.imports.signs import overflow_of
from hil.imports.tables import ROWS
from hil.least_squares.standstill import extent, increment, moving

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.instants import Stretch
    from hil.imports.samples import Samples
    from hil.model.robot import Robot


REACH = 3
"""Samples after which a spike is over."""
OFTEN = 0.95
"""Share of ordinary samples."""
MIDDLE = (0.5 - OFTEN / 2, 0.5 + OFTEN / 2)
"""Quantiles of ordinary samples."""
ONE_STEP = 0.75
"""Minimum share of one step in the change to a spike: between 1, and 1/2 of a sine of six samples.
"""
TURNS = 3 * np.pi
"""Minimum excursion that cannot be a wrap-around of an angle, by one turn."""
STATED, REFUSED = 0.01, 0.5
"""Share of spikes in the sum of squares: reported from a tenth in rms on, refused above a half."""
LEAST = 1e-4
"""Least spike, relative to the widest range of the axes: smaller ones are noise of resting axes."""
GREATEST = 1e100
"""Maximum value with a finite sum of squares."""


@dataclass
class _Spikes:
    """Spikes of a column: count, first row, and sums of squares.

    Further fields are the largest excursion, and the width of the ordinary range.
    """

    count: int = 0
    first: int = -1
    of_spikes: float = 0.0
    of_all: float = 0.0
    farthest: float = 0.0
    width: float = 0.0


def spike_suspicions(
    samples: Samples, stretches: Sequence[Stretch], robot: Robot
) -> Iterator[Suspicion]:
    """Yield suspicions of columns with spikes, with their count and first row."""
    n = robot.n_joints
    overflows = dict(_overflows(samples, stretches))
    for column, width in overflows.items():
        kind, joint = divmod(column, n)
        yield Suspicion(
            "spikes",
            ("joints", joint, ("position", "torque", "velocity")[kind]),
            f"jumps by some {width:.6g} {_units(robot, joint)[kind]} and goes on from the other "
            "end: a register of this range overflows; record a wider register, or add its range "
            "from each jump to the next one back",
            certain=False,
            first=True,
        )
    if not any(out.any() for *_, (_, out) in _columns(samples, stretches)):
        return
    found = [_Spikes() for _ in range(3 * n)]
    for rows, column, x, (excursion, out) in _columns(samples, stretches):
        _add(found[column], rows, x, excursion, out, position=column < n)
    moves = _moving(samples, stretches)
    for column, spikes in enumerate(found):
        if column in overflows:
            continue
        kind, joint = divmod(column, n)
        alike = found[kind * n : (kind + 1) * n]
        all_else = spikes.of_all
        if kind != 1 and moves.any() and not moves[joint]:
            same = robot.revolute == robot.revolute[joint]
            all_else = max(each.of_all for each, fits in zip(alike, same, strict=True) if fits)
        share = min(spikes.of_spikes / all_else, 1.0) if spikes.count else 0.0
        # noise of joints at rest is small compared with the motion of other joints
        if share < STATED or spikes.farthest < LEAST * max(each.width for each in alike):
            continue
        value = float(samples.values[spikes.first, column])
        file = int(np.searchsorted(samples.begins, spikes.first, side="right")) - 1
        many = "samples differ" if spikes.count > 1 else "sample differs"
        yield Suspicion(
            "spikes",
            ("joints", joint, ("position", "torque", "velocity")[kind]),
            f"{spikes.count} {many} from neighbouring samples, the first with {value:.4g} "
            f"{_units(robot, joint)[kind]} in row {spikes.first - samples.begins[file] + 1} of its "
            f"file: {100 * share:.2g} % of the sum of squares of all "
            f"{'accelerations' if kind == 0 else 'values'}; remove these rows, or choose others",
            certain=share > REFUSED,
        )


def _units(robot: Robot, joint: int) -> tuple[str, str, str]:
    """Return the units of position, torque and velocity."""
    unit = robot.position_unit(joint)
    return unit, "N m" if unit == "rad" else "N", f"{unit}/s"


def _overflows(samples: Samples, stretches: Sequence[Stretch]) -> Iterator[tuple[int, float]]:
    """Yield columns of torques and velocities that overflow, and the ranges of their registers."""
    longest = max(stretches, key=lambda stretch: len(stretch.rows)).rows[:ROWS]
    for column in range(samples.n_joints, samples.values.shape[1]):
        x = samples.recorded(longest)[:, column].clip(-GREATEST, GREATEST)
        if np.isfinite(x).all() and (width := overflow_of(x)):
            yield column, width


def jump_suspicions(
    samples: Samples, stretches: Sequence[Stretch], robot: Robot
) -> Iterator[Suspicion]:
    """Yield suspicions of joints whose position jumps, unlike a motion, and stays there."""
    found: dict[int, list[tuple[int, float]]] = {}
    for stretch in stretches:
        for begin in range(0, len(stretch.rows), ROWS):
            part = slice(begin, begin + ROWS)
            rows, instants = stretch.rows[part], stretch.instants[part]
            q = positions(samples, rows)
            for joint, x in enumerate(q if len(rows) > 2 * REACH else ()):
                for row in jumps_of(x, instants, stretch.period).tolist():
                    found.setdefault(joint, []).append((int(rows[row]), float(x[row + 1] - x[row])))
    if not found:
        return
    parts = [rows for rows, _ in _parts(stretches)]
    bends = sum((np.diff(positions(samples, rows), 2) ** 2).sum(axis=1) for rows in parts)
    for joint, jumps in found.items():
        # a jump bends twice; a joint at rest has no motion to compare with
        alike = bends[robot.revolute == robot.revolute[joint]].max()
        share = min(2 * sum(step**2 for _, step in jumps) / alike, 1.0)
        if share < STATED:
            continue
        row, step = jumps[0]
        file = int(np.searchsorted(samples.begins, row, side="right")) - 1
        row -= samples.begins[file] - 1
        times = f", and {len(jumps)} times in all" if len(jumps) > 1 else ""
        yield Suspicion(
            "spikes",
            ("joints", joint, "position"),
            f"jumps by {step:.4g} {robot.position_unit(joint)} from row {row} to {row + 1} of its "
            f"file{times}, by more than {FARTHER:g} of its ordinary steps: an encoder lost counts, "
            "or rows of two recordings are joined; choose rows on one side, or for joined "
            "recordings state both sides as rows",
            certain=share > REFUSED,
        )


def positions(samples: Samples, rows: Integers) -> Array:
    """Return positions of rows, shape (n_joints, n)."""
    q = np.ascontiguousarray(samples.read(rows)[:, : samples.n_joints].T)
    return np.clip(q, -GREATEST, GREATEST, out=q)


def _parts(stretches: Sequence[Stretch]) -> Iterator[tuple[Integers, float]]:
    """Yield rows and period [s] of sufficiently long parts of the stretches."""
    for stretch in stretches:
        for begin in range(0, len(stretch.rows), ROWS):
            rows = stretch.rows[begin : begin + ROWS]
            if len(rows) > 2 * REACH:
                yield rows, stretch.period


def _columns(
    samples: Samples, stretches: Sequence[Stretch]
) -> Iterator[tuple[Integers, int, Array, tuple[Array, Mask]]]:
    """Yield rows, number and values of a complete column, angles unwrapped, and its outliers."""
    turning = samples.n_joints if samples.wraps else 0
    for rows, _ in _parts(stretches):
        values = np.ascontiguousarray(samples.read(rows).T)
        np.clip(values, -GREATEST, GREATEST, out=values)
        for column in np.flatnonzero(np.isfinite(values).all(axis=1)).tolist():
            x, recorded = values[column], None
            if column < turning:
                recorded = samples.recorded(rows)[:, column].clip(-GREATEST, GREATEST)
            yield rows, column, x, _outstanding(x, recorded)


def _moving(samples: Samples, stretches: Sequence[Stretch]) -> Mask:
    """Return the joints that move, shape (n_joints,)."""
    positions = slice(0, samples.n_joints)
    return moving([
        extent(samples.read(rows)[:, positions].clip(-GREATEST, GREATEST), period)
        for rows, period in _parts(stretches)
    ])  # fmt: skip


def _add(
    spikes: _Spikes, rows: Integers, x: Array, excursion: Array, out: Mask, *, position: bool
) -> None:
    """Add the spikes in a part `x` of a column, with angles unwrapped."""
    if out.any() and not spikes.count:
        spikes.first = int(rows[REACH + np.argmax(out)])
    spikes.count += int(out.sum())
    spikes.width = max(spikes.width, float(np.ptp(np.quantile(x, MIDDLE))))
    spikes.farthest = max(spikes.farthest, float(excursion[out].max(initial=0.0)))
    spikes.of_spikes += float((excursion[out] ** 2).sum())
    bent = x[REACH:-REACH] - (x[: -2 * REACH] + x[2 * REACH :]) / 2
    spikes.of_all += float((bent**2).sum() if position else ((x - x.mean()) ** 2).sum())


def _outstanding(x: Array, recorded: Array | None) -> tuple[Array, Mask]:
    """Return excursions and a mask of outliers; `recorded` is the column before unwrapping."""
    excursion, out = _beyond_ordinary(x)
    # a minimum of a hundredth of the ordinary range: turns of a mostly resting joint are as fast
    if out.any():
        out &= excursion > 0.01 * np.ptp(np.quantile(x, MIDDLE))
    # rounding flickers by an increment in either direction; the last digit of a double does not
    # count
    if out.any():
        out &= excursion > (2.0 + 1e-6) * increment(x)
    if recorded is not None:
        turned, turns = _beyond_ordinary(recorded)
        turns &= turned > TURNS
        excursion, out = np.where(turns, turned, excursion), out | turns
    return excursion, out


def _beyond_ordinary(x: Array) -> tuple[Array, Mask]:
    """Return excursions, and a mask of those beyond the ordinary change of samples.

    The arrays have shape (n - 2 REACH,).
    """
    changes = x[REACH:] - x[:-REACH]
    # the usual case, found at once: more than a tenth of a part are a tenth of the greatest change
    some, most = np.abs(changes[::16]), max(changes.max(), -changes.min())
    if np.count_nonzero(some <= most / 10.0) < (2 * OFTEN - 1.0) * len(some):
        n = len(x) - 2 * REACH
        return np.zeros(n), np.zeros(n, dtype=bool)
    steps = np.abs(changes)
    nearer = np.minimum(steps[:-REACH], steps[REACH:])
    # minimum ratio of a spike to ordinary changes: 10 is 28 standard deviations of white noise,
    # since an ordinary change is 1.96 sqrt(2) standard deviations
    if np.count_nonzero(steps <= nearer.max() / 10.0) < OFTEN * (len(steps) - 1):
        return nearer, np.zeros(len(nearer), dtype=bool)  # avoids a sort for the quantile
    # spikes are to one side of both neighbours: the changes before and after have opposite signs
    excursion = np.where((changes[:-REACH] > 0) != (changes[REACH:] > 0), nearer, -nearer)
    # rounding errors of doubles are ordinary, too
    most = max(10.0 * np.quantile(steps, OFTEN), 1e-9 * np.abs(x).max())
    out = np.asarray(excursion > most)
    if out.any():
        longest = np.lib.stride_tricks.sliding_window_view(np.abs(np.diff(x)), REACH).max(axis=1)
        sudden = longest > ONE_STEP * steps
        out &= sudden[:-REACH] & sudden[REACH:]
    return excursion, out
