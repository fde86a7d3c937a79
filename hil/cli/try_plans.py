"""Plans of `hil try`: a short campaign over all parameters, and a slow motion.

A friction law holds for the measured speeds. Axes without gravity, which a design only moves fast,
get additional slow strokes, so that the law of every axis starts at creep speed.
"""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.design.by_counts import COUNTS, design
from hil.planning.design.measurable_elements import gravity_motion
from hil.planning.design.trajectories import Basis
from hil.planning.measurement import FOR_A_LAW, Gravity, Inertia
from hil.planning.plan import make_plan

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan

SHARE = 0.35
"""Share of the usual number of measurements: 54 for 14 parameters, and 60 with slow strokes of all
axes, in some 15 minutes of robot time."""
PERIOD, HARMONICS = 10.0, 4
"""Period [s] and harmonics of the pushed motion: slow enough for the mouse to follow."""
CYCLES = 2
"""Periods per recording; after a stop, completed recordings are kept."""


def measured_plan(robot: Robot) -> Plan:
    """Create a plan with early information about every parameter, regardless of travel times."""
    counts = {kind: round(SHARE * number) for kind, number in COUNTS.items()}
    measurements = list(design(robot, counts).measurements)
    # strokes at gravity-measurement speed for axes without gravity measurements
    slow = {axis for each in measurements if isinstance(each, Gravity) for axis in each.moved}
    for each in tuple(measurements):
        axis = each.moved[0]
        if isinstance(each, Inertia) and axis not in slow:
            slow.add(axis)
            motion = gravity_motion(robot, axis)
            measurements += [
                Gravity(id=f"s{axis + 1}{k + 1}", axis=axis + 1, q=each.q, **motion)
                for k in range(FOR_A_LAW)
            ]
    return make_plan(robot, interleave(measurements))


def interleave(measurements: Sequence[Measurement]) -> list[Measurement]:
    """Interleave kinds, axes and configurations of measurements.

    Within a kind and axis the order follows the golden section, which leaves no part of a sequence
    unvisited for long; kinds and axes are spread evenly.
    """
    by_axis: dict[tuple[str, tuple[int, ...]], list[Measurement]] = {}
    for each in measurements:
        by_axis.setdefault((each.kind, each.moved), []).append(each)
    placed = [
        ((k + 0.5) / len(own), own[i])
        for own in by_axis.values()
        # fractional parts of multiples of the golden section are evenly spread at any length
        for k, i in enumerate(sorted(range(len(own)), key=lambda i: i * 0.6180339887 % 1.0))
    ]
    return [each for _, each in sorted(placed, key=lambda pair: pair[0])]


def pushed_plan(robot: Robot, duration: float) -> tuple[Plan, int]:
    """Plan a slow, unmeasured motion of all axes; return plan and number of passes.

    There is one attempt: a push is the result, and no reason to repeat.
    """
    # fraction of the velocity limit for the motion
    basis = Basis(robot, PERIOD, HARMONICS, 0.3 * robot.velocity_limit)
    drawn = basis.random(np.random.default_rng(2))
    plan = make_plan(robot, [basis.trajectory(drawn, CYCLES, "motion")])
    rounds = ceil(duration / (CYCLES * PERIOD))
    return plan.model_copy(update={"attempts": 1}), rounds
