"""Proof by recordings: rows of evidence, tests of causes, and torques at the limit."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.excluded.evidence import measured
from hil.estimation.excluded.finding import LEAVES, excluded
from hil.estimation.excluded.result import Found
from hil.estimation.excluded.saturation import saturated
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import shows_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.drive_train import DriveTrain
    from hil.estimation.excluded.result import Excluded
    from hil.estimation.signals import Prepared, Signals
    from hil.estimation.simultaneous import Joint
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion
    from hil.runs.recording import Recorded, Recording

ENOUGH = 600.0
"""Maximum total duration of several free motions [s]: longer recordings give no further rows, since
`evidence.MOST` rows of an axis are four rows per second by then.
"""
APART = 60.0
"""Assumed time between the earlier and the later recordings [s]; no cause depends on this value."""


def proved(
    robot: Robot,
    recorded: Recorded,
    p: Array | None = None,
    drive_train: DriveTrain | None = None,
    joint: Joint | None = None,
    smoothed: Callable[[Recording], Recording] | None = None,
) -> Excluded | None:
    """Test recordings for all causes; return None if too little was recorded for a contradiction.

    Parameters
    ----------
    recorded : iterable of (RecordedMotion, Recording)
        Read again if a cause is found.
    p : ndarray, shape (n_base,), optional
        Base parameters, if they were estimated.
    drive_train : DriveTrain, optional
        Transmission between currents and arm, if known.
    joint : Joint, optional
        Regression of the recordings, if there is one.
    smoothed : callable, optional
        Low-pass of the positions of free motions: above its cut-off frequency the noise exceeds
        the motion, and accelerations of encoder steps would explain other readings.
    """
    if joint is None:
        prepared: Prepared = list(_prepared(recorded, smoothed))
        if drive_train is not None:
            prepared = [(motion, drive_train.applied(robot, s)) for motion, s in prepared]
        try:
            solver = SimultaneousFit(robot, prepared)
        except NotIdentifiable:
            return None
    else:
        solver, prepared = joint.solver, joint.prepared
    imported = any(isinstance(motion, FreeMotion) for motion, _ in prepared)
    evidence = replace(measured(robot, solver, prepared), imported=imported)
    leaves = LEAVES if imported else 1.0
    found = excluded(robot, solver.solve() if p is None else p, evidence, leaves)
    limit = saturated(recorded, robot.n_joints) if found.found else None
    if limit is None:
        large = [each for each in found.found if each.left <= leaves]
        return found.model_copy(update={"found": tuple(large)})
    # a torque at its limit follows no model, and any other cause may only describe this
    axis, share, top = limit
    words = f"{share:.0%} of its samples have the same maximum torque, {top:.3g}"
    first = Found(
        cause="torque at its limit",
        axes=(axis + 1,),
        detail=f"{words} {robot.torque_unit(axis)}",
        size=100.0 * share,
    )
    return found.model_copy(update={"found": (first,)})


def changed(
    robot: Robot,
    before: Recorded,
    after: Recorded,
    known: Sequence[str] = (),
) -> Excluded | None:
    """Find causes of a change between recordings; return None if too little was recorded.

    Base parameters are fitted to all recordings, and causes act in the later recordings alone. So
    causes that parameters would absorb in one run show here: a torque constant, a rotor, all of a
    load. Columns of causes use the parameters of the earlier recordings, since the parameters of
    all recordings contain part of the change. With known causes the columns use the parameters of
    all recordings, since the earlier recordings contain no load. Friction is fitted to each
    measurement separately; changed friction has a test of its own, with the parameters of all
    recordings.

    Parameters
    ----------
    known : sequence of str
        Causes known to be new, fitted together with every tested cause.
    """
    earlier = list(_prepared(before))
    if not earlier:
        return None
    begin = max(float(s.time[-1]) for _, s in earlier) + APART
    later = [(motion, replace(s, time=s.time + begin)) for motion, s in _prepared(after)]
    try:
        solver = SimultaneousFit(robot, [*earlier, *later])
        both = solver.solve()
        p = both if known else SimultaneousFit(robot, earlier).solve()
    except NotIdentifiable:
        return None
    evidence = measured(robot, solver, [*earlier, *later], rates=True)
    after_change = {s for _, s in later}
    shown = np.array([s in after_change for s in evidence.signals])[evidence.source]
    if shown.all() or not shown.any():
        return None
    found = excluded(robot, p, replace(evidence, later=shown), known=known, both=both)
    # each cause once, as first found
    named = {(each.cause, each.axes): each for each in reversed(found.found)}
    causes = [each for each in found.found if named.get((each.cause, each.axes)) is each]
    return found.model_copy(update={"found": tuple(causes)})


def _prepared(
    recorded: Recorded, smoothed: Callable[[Recording], Recording] | None = None
) -> Iterator[tuple[ParameterMotion, Signals]]:
    free: list[tuple[FreeMotion, Recording]] = []
    seen, every = 0, 1  # step between samples of free motions
    for measurement, recording in recorded:
        if not isinstance(measurement, FreeMotion):
            if shows_parameters(measurement):
                yield from _signals(measurement, recording)
        elif not measurement.unknown_gains:
            if seen % every == 0:
                free.append((measurement, recording))
            if len(free) > 1 and sum(motion.duration for motion, _ in free) > ENOUGH:
                free, every = free[::2], 2 * every
            seen += 1
    for motion, recording in free:
        yield from _signals(motion, smoothed(recording) if smoothed else recording)


def _signals(
    measurement: ParameterMotion, recording: Recording
) -> Iterator[tuple[ParameterMotion, Signals]]:
    with suppress(NotEnoughData):
        yield measurement, signals(recording)
