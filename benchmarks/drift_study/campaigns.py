"""Plans of a study: campaigns of equal duration, one for each way of identification.

two-step
    the designed plan of gravity, inertia and coupling measurements;
trajectory
    an exciting trajectory, friction being estimated jointly;
mixed
    the most informative strokes and trajectories together;
compensated
    a friction sweep, then the trajectory in the remaining time; if less than half of a stated
    duration remains, the sweep counts as a separate session, and the trajectory takes the whole
    duration;
warmed
    "compensated" after half an hour of motion, which does not count as measuring time.

All but the warmed ones begin cold. A single trajectory is repeated: with several successive
trajectories, the drift of friction would appear as a difference between them, and harm methods with
one friction for all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.model.base_parameters import base_parameters
from hil.planning.design.by_counts import design
from hil.planning.design.by_minutes import design_within
from hil.planning.design.friction import sweep
from hil.planning.design.trajectories import PERIOD, design_trajectory
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.plan import Plan, PlannedRobot, WarmUp, dump_plan, load_plan
from hil.planning.prediction.noise import stated_noise
from hil.planning.timetable import timetable
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.trajectory import Trajectory

KINDS = ("two-step", "mixed", "trajectory", "compensated", "warmed")
SPEEDS, SLOWEST = 12, 0.01
"""Number of speeds of the friction sweep, and its slowest speed as a share of the limit; no
compensation uses the peak at standstill.
"""
WARM_UP = 1800.0
"""Duration of the warm-up motion [s]."""
TRAVEL_AND_REST = 3.5
"""Approximate duration of travel and rest of the trajectory [s]."""


def campaigns(
    robot: Robot, share: float, folder: Path, minutes: float | None = None
) -> dict[str, Plan]:
    """Return the plans of a study; existing files in `folder` are read, missing ones written.

    Parameters
    ----------
    share : float
        Share of the number of measurements chosen by `hil plan`.
    folder : Path
    minutes : float, optional
        Duration of every campaign [min]; by default that of the two-step plan. With `minutes`,
        `share` is ignored.

    Raises
    ------
    FileError
        Plans of another robot, or a full disk.
    ValueError
        With this share or duration, trajectories do not fit, or the two-step plan does not identify
        all parameters.
    """
    paths = {kind: folder / f"{kind}.yaml" for kind in KINDS}
    found = {kind: load_plan(path, robot) for kind, path in paths.items() if path.exists()}
    if len(found) < len(KINDS):
        for kind, plan in _designed(robot, share, minutes, found.get("two-step")).items():
            if kind not in found:
                write_file(paths[kind], dump_plan(plan).encode())
                found[kind] = plan
    return {kind: found[kind] for kind in KINDS}


def duration(robot: Robot, plan: Plan) -> float:
    """Return the expected duration of a plan's measurements and travels [s]."""
    return sum(e.travel + e.duration for e in timetable(plan, robot, plan.measurements))


def _designed(
    robot: Robot, share: float, minutes: float | None, given: Plan | None
) -> dict[str, Plan]:
    """Return all plans; without `minutes`, their duration is that of the two-step plan."""
    two_step = given or _two_step(robot, share, minutes)
    beforehand = sweep(robot, speeds=SPEEDS, slowest=SLOWEST)
    wave = design_trajectory(robot, name="t1")
    time = duration(robot, two_step) if minutes is None else 60 * minutes
    left = time - duration(robot, beforehand)
    if minutes is not None and left < time / 2:
        left = time
    compensated = [*beforehand.measurements, _filling(wave, left)]
    noise = stated_noise(robot)
    return {
        "two-step": two_step,
        "mixed": design_within(robot, time / 60, noise, with_trajectories=True),
        "trajectory": _plan(robot, [_filling(wave, time)]),
        "compensated": _plan(robot, compensated),
        "warmed": _plan(robot, compensated, WarmUp(duration=WARM_UP)),
    }


def _two_step(robot: Robot, share: float, minutes: float | None) -> Plan:
    if minutes is not None:
        return design_within(robot, minutes, stated_noise(robot))
    groups = base_parameters(robot).groups
    counts = {
        name: max(round(share * kind.count), len(groups[kind.group]))
        for name, kind in ELEMENT_KINDS.items()
    }
    return design(robot, counts)


def _filling(wave: Trajectory, time: float) -> Trajectory:
    """Return the trajectory with the number of periods for the available time."""
    periods = int((time - TRAVEL_AND_REST) / PERIOD)
    if periods < 1:
        raise ValueError(
            f"{max(time, 0.0) / 60:.1f} min left for the trajectory must be at least"
            f" {(PERIOD + TRAVEL_AND_REST) / 60:.1f}; raise --share or --minutes"
        )
    return wave.model_copy(update={"cycles": periods})


def _plan(robot: Robot, measurements: Sequence[Measurement], warm_up: WarmUp | None = None) -> Plan:
    return Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        warm_up=warm_up,
        measurements=tuple(measurements),
    )
