"""Lags of torques, soft gears and presliding of free motions, found beside all terms of friction.

What they are, and how blocks follow them, is in `hil.estimation.nuisances`. What lies between two
presliding distances is left to the column of how the direction bends with the distance, which the
estimate itself has.

Beside a law of friction that is too poor, either makes up for what the law lacks: of 3 minutes of
an arm without any lag, lags of -1.9 and -4.4 ms were found beside Coulomb's friction at all speeds,
and torques of its bodies 1.1 % off; beside all terms and above the least dead zone, 0.4 ± 0.4 ms.
So a lag is looked for on fast samples, where friction after a reversal cannot be taken for it, and
then soft gears, after which lags are looked for anew, since either looks like the other, and then
presliding, with lags taken back, on all samples, where it shows. All are admitted one axis after
the other: that which predicts held-out blocks best, if it does so certainly better than without it
(`hil.least_squares.choice`), all that was admitted being found anew with it. Once one gear is
admitted, all may give way, and those stay that certainly do: one that is taken as rigid would make
others seem softer than they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import side_by_side
from hil.estimation.condensed import ROTOR
from hil.estimation.drive_train import CERTAIN, LAG_OF_TORQUE, MOST_TWIST, twist_edge
from hil.estimation.free_motion.accumulation import (
    SPEEDS,
    Groups,
    division,
    every_axis,
    pieces_of,
    recorded_products,
)
from hil.estimation.free_motion.choice import dead_zone_of, usual
from hil.estimation.free_motion.columns import shared_names
from hil.estimation.free_motion.motion import filtered_motion, low_passed
from hil.estimation.free_motion.scaling import Scaling
from hil.estimation.intervals import Edge
from hil.estimation.nuisances import AROUND, Search, State, over_names, shift_names
from hil.estimation.options import NUISANCES
from hil.friction.terms import COLUMNS
from hil.least_squares.choice import FOLDS
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.motion import Motion, Processing
    from hil.estimation.free_motion.survey import Survey
    from hil.least_squares.blocks import Blocks
    from hil.model.robot import Robot

SURE = 3.0
"""Standard errors that a lag or a compliance is at least: every axis is tried, and each looks like
the other."""
DISTANCES = 2.0 ** np.arange(-15.0, -9.75, 0.5)
"""Presliding distances that are tried, as ways at the axis's speed [s]: gears and bearings turn
round within 1e-5 to 1e-3 rad (twins of seven robots: 5e-5 to 3e-4 s). Over less, friction turns
round between two samples, and what seems to follow is a better sign of a slow velocity."""
GROUPS = 4 * FOLDS
"""Pieces of time, at most: some in each part that is held out."""


@dataclass(frozen=True, slots=True, eq=False)
class Nuisances:
    """What was found, as a fit takes it.

    Attributes
    ----------
    processing : Processing
        With lags, soft gears and presliding distances.
    lag_error : ndarray, shape (n_joints,)
        Standard errors of the lags [s]; 0 where there is none.
    plain : ndarray, shape (n_joints,), optional
        Mean square of what weighted least squares leaves without presliding; None where friction
        turns round at once.
    edges : tuple of Edge
        Lags and compliances that end at the edge of their search range, and are not taken.
    """

    processing: Processing
    lag_error: Array
    plain: Array | None = None
    edges: tuple[Edge, ...] = ()


def find_nuisances(
    robot: Robot, found: Survey, processing: Processing, wanted: Collection[str] = NUISANCES
) -> Nuisances:
    """Lags, soft gears and presliding distances of every axis that moves.

    Where gains are unknown there are none.
    """
    none = Nuisances(processing, np.zeros(robot.n_joints))
    motions = [filtered_motion(each, processing) for each in found.stretches]
    motions = [motion for motion in motions if motion.used.sum() > 1]
    if found.unknown_gains or not motions or not set(wanted) - {"drift"}:
        return none
    first = np.zeros(len(base_parameters(robot)))
    divided = division(processing, found.duration)
    products = Scaling.known(np.ones(robot.n_joints)).applied(
        recorded_products(robot, motions, divided, first)
    )
    plain = usual(products.pieces[0])
    slowest = max(dead_zone_of(products, plain.weights), 1)
    # largest lag, either way: beyond 0.03 s a log's columns do not belong together, beyond half a
    # period of the equation's cut-off frequency Gauss and Newton's method may end a period off
    most = min(0.03, 0.5 / processing.band)
    first = plain.solution[: len(first)]
    times = _times(processing.band, most)
    gears = tuple(range(robot.n_joints)) if "compliance" in wanted else ()
    whole, fast = (
        Search(each, times, (-most, most), DISTANCES)
        for each in _condensed(robot, motions, first, slowest, times, gears)
    )
    axes = [axis for axis in range(robot.n_joints) if axis not in found.still]
    state, error, edges = State.of(robot.n_joints), none.lag_error, list[Edge]()
    if "lag" in wanted:
        state, error = _sure(fast, fast.grown(state, axes, fast.with_lag), "late")
    if "compliance" in wanted:
        state, edges = _with_soft_gears(robot, fast, state, axes)
    if state.soft.any() and "lag" in wanted:
        in_time = replace(State.of(robot.n_joints), soft=state.soft)
        state, error = _sure(fast, fast.grown(in_time, axes, fast.with_lag), "late")
    if "lag" in wanted:
        edges += [
            Edge(axis=axis + 1, what=LAG_OF_TORQUE, value=1e3 * lag, bound=1e3 * most, unit="ms")
            for axis, lag in fast.edges(state).items()
        ]
    if "presliding" in wanted:
        state = whole.grown(state, axes, whole.with_distance)
    distance = np.append(0.0, DISTANCES)[state.direction] * processing.speed
    return Nuisances(
        replace(
            processing,
            lag=state.lag,
            presliding=distance,
            soft=tuple(np.flatnonzero(state.soft).tolist()),
        ),
        error,
        plain.blocks.mean_squares(plain.solution) if distance.any() else None,
        tuple(edges),
    )


def _with_soft_gears(
    robot: Robot, search: Search, state: State, axes: Sequence[int]
) -> tuple[State, list[Edge]]:
    """State with the gears that certainly give way, if one does, and those that twist too far."""
    if not search.grown(state, axes, search.with_soft).soft.any():
        return state, []
    every = np.isin(np.arange(len(state.soft)), axes)
    found, _ = _sure(search, replace(state, soft=every), "soft")
    compliance, error = search.values("soft", found, "jackknife", FOLDS)
    # what twists further is no gear, but makes up for something else, and so may the others
    twist = np.where(found.soft, compliance, 0.0) * robot.torque_limit
    edges = [
        twist_edge(robot, axis, twist[axis])
        for axis in np.flatnonzero((twist >= MOST_TWIST) & (compliance > CERTAIN * error)).tolist()
    ]
    possible = twist[found.soft] < MOST_TWIST  # false where no limit is known
    return found if found.soft.any() and possible.all() else state, edges


def _sure(search: Search, state: State, what: str) -> tuple[State, Array]:
    """State with the `late` or `soft` axes that are sure, and the standard errors."""
    while (held := getattr(state, what)).any():
        value, error = search.values(what, state, "jackknife", FOLDS)
        # a torque may come early, but no gear is stiffer than rigid
        size = np.abs(value) if what == "late" else value
        size = np.where(held, size / np.where(held, error, 1.0), np.inf)
        least = int(np.argmin(size))
        if size[least] > SURE:
            return state, error
        state = search.converged(state.with_one(what, least, 0))
    return state, np.zeros(len(state.lag))


def _condensed(
    robot: Robot,
    motions: Sequence[Motion],
    first: Array,
    slowest: int,
    times: Array,
    soft: tuple[int, ...],
) -> tuple[Blocks, Blocks]:
    """Torques at all shifts, columns, directions over all distances: all samples, and fast ones."""
    shared = (*shared_names(robot, soft), ROTOR)
    own = (*shift_names(times), *COLUMNS, *over_names(DISTANCES))
    n, k = robot.n_joints, 1 + len(shared)
    duration = sum(motion.duration for motion in motions)
    found = []
    for motion in motions:
        parts = pieces_of(motion, duration / GROUPS)
        found.append(Groups.empty(len(parts), n, k + len(own), n_bounds=1))
        time = np.repeat(np.arange(len(parts)), [part.stop - part.start for part in parts])
        fast = (motion.slowest[motion.used] >= SPEEDS[slowest - 1]).astype(np.intp)
        used, every = slice(parts[0].start, parts[-1].stop), motion.rates.fine * motion.rates.coarse
        of = motion.recording.tau, motion.recording.period, motion.processing.band, every
        tau = np.stack([low_passed(*of, ahead=np.full(n, s))[0] for s in times], axis=-1)
        for axis, rows in enumerate(every_axis(robot, motion, first, tau[..., 0], COLUMNS, soft)):
            ways = DISTANCES * motion.processing.speed[axis]
            z = side_by_side(*(motion.direction_after(axis, way) for way in ways))
            each = rows[:, :k], tau[:, axis, 1:], rows[:, k:], motion.passed(z)
            found[-1].add(axis, side_by_side(*(x[used] for x in each)), time, fast[:, axis])
    of_all, of_fast = (each.grouped(GROUPS) for each in Groups.joined(found).by_speed(shared, own))
    return of_all, of_fast


def _times(band: float, most: float) -> Array:
    """Instants by which the torque is condensed later [s]."""
    # condensed shifts of the torque in a period of the cut-off frequency: six of them interpolate
    # the torque at it within 1e-4
    n = int(np.ceil(most * 8.0 * band))
    return np.arange(-n - AROUND, n + AROUND + 1) * most / n
