"""Find lags of torques, soft gears and presliding of free motions.

The models of these nuisances, as columns of blocks, are in `hil.estimation.nuisances`. Values
between two candidate presliding distances are left to the bend column, the change of the direction
with the distance, which is part of the estimate.

With a friction law that is too poor, lag and compliance compensate for the missing terms. On 3
minutes of an arm without any lag, Coulomb friction at all speeds gave lags of -1.9 and -4.4 ms and
rigid-body torques wrong by 1.1 %; all terms above the least dead zone gave a lag of 0.4 ± 0.4 ms.
The search therefore starts with lags on fast samples, where friction after a reversal cannot be
mistaken for a lag. Soft gears follow, then lags again, since the two are similar, and then
presliding, with compensated lags, on all samples, where presliding shows. Lags are then found anew:
friction of a slow axis that reverses over some distance resembles a delay. Nuisances are admitted
one axis at a time: the one with the best prediction of held-out blocks, if the improvement is
certain (`hil.least_squares.choice`); all admitted nuisances are then estimated anew. Once one gear
is admitted as soft, all gears are freed, and those with a certain compliance stay soft: a soft gear
modelled as rigid would make others seem softer than they are.
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
    remove_levels,
)
from hil.estimation.free_motion.choice import dead_zone_of, usual
from hil.estimation.free_motion.columns import shared_names
from hil.estimation.free_motion.motion import filtered_motion, filtered_torque
from hil.estimation.free_motion.scaling import Scaling
from hil.estimation.intervals import Edge
from hil.estimation.nuisances import AROUND, Search, State, direction_names, shift_names
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
"""Smallest ratio of a lag or a compliance to its standard error: every axis is tested, and lag and
compliance are similar."""
DISTANCES = 2.0 ** np.arange(-15.0, -9.75, 0.5)
"""Candidate presliding distances, as distances at the axis's speed [s]: the friction of gears and
bearings reverses within 1e-5 to 1e-3 rad (twins of seven robots: 5e-5 to 3e-4 s). Over shorter
distances friction reverses between two samples; an apparent effect then only shows that the sign of
slow velocities is inaccurate.
"""
GROUPS = 4 * FOLDS
"""Largest number of pieces of time, with several pieces in every held-out part."""


@dataclass(frozen=True, slots=True, eq=False)
class Nuisances:
    """Estimated nuisances: input of a fit.

    Attributes
    ----------
    processing : Processing
        Settings with lags, soft gears and presliding distances.
    lag_error : ndarray, shape (n_joints,)
        Standard errors of the lags [s]; 0 without a lag.
    plain : ndarray, shape (n_joints,), optional
        Mean squared residual of weighted least squares without presliding; None if no presliding
        was found.
    edges : tuple of Edge
        Rejected lags and compliances at the edge of the search range.
    """

    processing: Processing
    lag_error: Array
    plain: Array | None = None
    edges: tuple[Edge, ...] = ()


def find_nuisances(
    robot: Robot, found: Survey, processing: Processing, wanted: Collection[str] = NUISANCES
) -> Nuisances:
    """Find lags, soft gears and presliding distances of the moving axes.

    With unknown gains, no nuisances are estimated.
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
    # largest lag in either direction: up to 0.1 s, model errors of KR300 and LWR4+ passed for lags
    # of 31 to 76 ms of single axes, different in each recording; beyond half a period of the
    # equation's cut-off frequency Gauss-Newton may converge to a wrong period
    most = min(0.03, 0.5 / processing.band)
    first = plain.solution[: len(first)]
    # shifts of the condensed torque per period of the cut-off frequency: six shifts interpolate the
    # torque at that frequency within 1e-4
    n = int(np.ceil(most * 8.0 * processing.band))
    times = np.arange(-n - AROUND, n + AROUND + 1) * most / n
    gears = tuple(range(robot.n_joints)) if "compliance" in wanted else ()
    whole, fast = (
        Search(each, times, (-most, most), DISTANCES)
        for each in _condensed(robot, motions, first, slowest, times, gears)
    )
    moving = [axis for axis in range(robot.n_joints) if axis not in found.still]
    axes = fast.shown(moving)
    state, error, edges = State.start(robot.n_joints), none.lag_error, list[Edge]()
    if "lag" in wanted:
        state, error = _sure(fast, fast.grown(state, axes, fast.add_lag), "late")
    if "compliance" in wanted:
        state, edges = _find_soft_gears(robot, fast, state, axes)
    if state.soft.any() and "lag" in wanted:
        in_time = replace(State.start(robot.n_joints), soft=state.soft)
        state, error = _sure(fast, fast.grown(in_time, axes, fast.add_lag), "late")
    ended = fast.edges(state)
    if "presliding" in wanted:
        state = whole.grown(state, moving, whole.add_presliding)
        if state.direction.any() and state.late.any():
            in_time = replace(
                State.start(robot.n_joints), soft=state.soft, direction=state.direction
            )
            state, error = _sure(fast, fast.grown(in_time, axes, fast.add_lag), "late")
    if "lag" in wanted:
        edges += [
            Edge(axis=axis + 1, what=LAG_OF_TORQUE, value=1e3 * lag, bound=1e3 * most, unit="ms")
            for axis, lag in (fast.edges(state) if ended else {}).items()
            if axis in ended
        ]
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


def _find_soft_gears(
    robot: Robot, search: Search, state: State, axes: Sequence[int]
) -> tuple[State, list[Edge]]:
    """Return the state with significant soft gears, and the gears that twist too far."""
    if not search.grown(state, axes, search.add_soft_gear).soft.any():
        return state, []
    every = np.isin(np.arange(len(state.soft)), axes)
    found, _ = _sure(search, replace(state, soft=every), "soft")
    compliance, error = search.values("soft", found, "jackknife", FOLDS)
    # a larger twist is not that of a gear, but compensates for another model error
    twist = np.where(found.soft, compliance, 0.0) * robot.torque_limit
    edges = [
        twist_edge(robot, axis, twist[axis])
        for axis in np.flatnonzero((twist >= MOST_TWIST) & (compliance > CERTAIN * error)).tolist()
    ]
    possible = twist[found.soft] < MOST_TWIST  # False for an unknown limit (NaN)
    return found if found.soft.any() and possible.all() else state, edges


def _sure(search: Search, state: State, what: str) -> tuple[State, Array]:
    """Return the state with significant `late` or `soft` axes, and the standard errors."""
    while (held := getattr(state, what)).any():
        value, error = search.values(what, state, "jackknife", FOLDS)
        # a torque may come early, but compliances are not negative
        size = np.abs(value) if what == "late" else value
        size = np.where(held, size / np.where(held, error, 1.0), np.inf)
        least = int(np.argmin(size))
        if size[least] > SURE:
            return state, error
        state = search.converged(state.change_axis(what, least, 0))
    return state, np.zeros(len(state.lag))


def _condensed(
    robot: Robot,
    motions: Sequence[Motion],
    first: Array,
    slowest: int,
    times: Array,
    soft: tuple[int, ...],
) -> tuple[Blocks, Blocks]:
    """Condense shifted torques, columns and directions: from all samples, and from fast ones."""
    shared = (*shared_names(robot, soft), ROTOR)
    own = (*shift_names(times), *COLUMNS, *direction_names(DISTANCES))
    n, k = robot.n_joints, 1 + len(shared)
    duration = sum(motion.duration for motion in motions)
    found = []
    for motion in motions:
        parts = pieces_of(motion, duration / GROUPS)
        found.append(Groups.empty(len(parts), n, k + len(own), n_bounds=1))
        time = np.repeat(np.arange(len(parts)), [part.stop - part.start for part in parts])
        fast = (motion.slowest[motion.used] >= SPEEDS[slowest - 1]).astype(np.intp)
        used, every = slice(parts[0].start, parts[-1].stop), motion.rates.fine * motion.rates.coarse
        of = motion.recording, motion.processing.band, every
        lags = (np.full(n, s) for s in times)
        tau = np.stack([filtered_torque(*of, lag, motion.window) for lag in lags], axis=-1)
        for axis, rows in enumerate(every_axis(robot, motion, first, tau[..., 0], COLUMNS, soft)):
            far = DISTANCES * motion.processing.speed[axis]
            z = side_by_side(*(motion.direction_after(axis, way) for way in far))
            late, ways = tau[:, axis, 1:], motion.passed(z, axis)
            joined = remove_levels(motion, axis, side_by_side(rows[:, :k], late, rows[:, k:], ways))
            before = _before_motion(motion, axis)[: len(joined)]
            joined[: len(before)] -= np.outer(before, before @ joined[: len(before)])
            some, joined = motion.telling[used, axis], joined[used]
            if some.any():
                found[-1].add(axis, joined[some], time[some], fast[some, axis])
    of_all, of_fast = (
        each.grouped(GROUPS) for each in Groups.joined(found).speed_classes(shared, own)
    )
    return of_all, of_fast


def _before_motion(motion: Motion, axis: int) -> Array:
    """Return the direction of friction left over from before the recording, (n_used,), of norm 1.

    Its share exp(-|q - q_0| / d) has an unknown factor z_0, so that the torque along it is no
    evidence for or against any d. The largest d serves for all: the equation's low-pass resolves no
    difference. 0 throughout for an axis that moves from the first used sample on, or never.
    """
    away = np.abs(motion.q[:, axis] - motion.q[0, axis])
    share = np.exp(-np.maximum.accumulate(away) / (DISTANCES[-1] * motion.processing.speed[axis]))
    found = motion.passed(share[:, np.newaxis], axis)[: len(motion.used), 0]
    found = np.where(motion.used[: len(found)], found, 0.0)
    # most of it is there in a used sample, and gone at the end
    rests_first = found.max(initial=0.0) > 0.5 > share[-1]
    return found / np.linalg.norm(found) if rests_first else 0.0 * found
