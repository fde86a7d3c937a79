"""Candidate measurements with information and duration.

For drives with streams of set-points, a few different trajectories are included. Each is divided
into blocks of some periods; the number of chosen blocks depends on the time.

For every element of g(q) and M(q) the first configurations of its sequence are taken
(`hil.planning.design.measurable_elements`). Each is planned as a measurement and judged by the
information of the simultaneous estimator (`hil.planning.prediction.information`), so that kinds are
comparable: an inertia measurement also shows gravity.

Least squares does not weight noise that differs within an axis, such as wandering friction. The
effective information of a measurement is I S^-1 I, with information I and scatter S: less than I if
friction wanders.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from hil.friction.equation import place
from hil.least_squares.solving import inverse_root
from hil.model.base_parameters import base_parameters
from hil.planning.design.measurable_elements import ELEMENTS, candidates
from hil.planning.design.trajectories import Search, design_trajectory
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.prediction.information import scatter_of, shares
from hil.planning.timetable import JointBoxes
from hil.planning.workspace import are_clear

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement, ParameterMeasurement
    from hil.planning.prediction.information import Share
    from hil.planning.prediction.noise import Noise
    from hil.planning.workspace import Workspace


DIFFERENT, BLOCK = 2, 3
"""Number of trajectories, and periods per block."""
SEARCH = Search(random=100, refined=2)
THINNED = 2
"""Number of samples averaged into one for judging: faster, equally informative."""


@dataclass(frozen=True, slots=True, eq=False)
class Option:
    """Candidate measurement.

    Attributes
    ----------
    group : str
        Group of base parameters of the measurement's kind; empty for all groups.
    measurement : ParameterMeasurement
        Measurement with a provisional id.
    row : ndarray, shape (n_row,)
        Row of the group's regressor, relative to the torque limit.
    worth : tuple of (indices, matrix)
        Indices of unknowns and information about these, for each moved axis.
    """

    group: str
    measurement: ParameterMeasurement
    row: Array
    worth: tuple[tuple[Indices, Array], ...]


def pool(
    robot: Robot, workspace: Workspace | None, period: float, noise: Noise, each: int = 64
) -> list[Option]:
    """Design and judge `each` measurements of every element, sampled every `period` [s].

    Raises
    ------
    ValueError
        No configuration of an element keeps clear of the workspace's boxes.
    """
    return [
        Option(group, measurement, row, judge(robot, measurement, period, noise))
        for group, measurement, row in strokes(robot, workspace, each)
    ]


def strokes(
    robot: Robot, workspace: Workspace | None, each: int
) -> Iterator[tuple[str, ElementMeasurement, Array]]:
    """Design `each` measurements of every element; yield group, measurement, row (`Option`)."""
    sought = base_parameters(robot).dependencies.sought()
    for name, kind in ELEMENT_KINDS.items():
        for element in ELEMENTS[name](robot, list(sought[kind.group])):
            q = candidates(robot, element, workspace)[:each]
            rows = element.row(q) / robot.torque_limit[element.axis]
            for number, (configuration, row) in enumerate(zip(q, rows, strict=True), start=1):
                turned = element.turn_motors(robot, configuration, number)
                yield kind.group, element.measure(f"{kind.letter}{number}", turned, number), row


def judge(
    robot: Robot, measurement: ParameterMeasurement, period: float, noise: Noise
) -> tuple[tuple[Indices, Array], ...]:
    """Compute the information of a measurement sampled every `period` [s]; see `Option.worth`."""
    noise = noise.sampled(robot, period)
    found = shares(robot, measurement, period, noise.differences, THINNED)
    return worth(robot, found, noise.mean(THINNED))


def trajectories(
    robot: Robot, workspace: Workspace | None, period: float, noise: Noise, minutes: float
) -> list[Option]:
    """Design and judge trajectories, in blocks with a total duration of `minutes` per trajectory.

    Raises
    ------
    ValueError
        No trajectory keeps clear of the workspace's boxes.
    """
    noise = noise.sampled(robot, period)
    mean = noise.mean(THINNED)
    found: list[Option] = []
    for seed, branch in product(range(DIFFERENT), range(len(robot.branches))):
        wave = design_trajectory(
            robot, cycles=BLOCK, seed=seed, search=SEARCH, name=f"t{seed + 1:02d}", branch=branch
        )
        if not keeps_clear(robot, workspace, wave.motion(np.linspace(0.0, wave.period, 1000))[0]):
            continue
        of_block = worth(robot, shares(robot, wave, period, noise.differences, THINNED), mean)
        blocks = max(1, math.ceil(60 * minutes / wave.duration))
        found += [Option("", wave, np.zeros(0), of_block)] * blocks
    if not found:
        raise ValueError(
            "no trajectory keeps clear of the workspace's boxes; plan without trajectories, or"
            " narrow the joint ranges of the workspace to where the arm may move freely"
        )
    return found


def keeps_clear(robot: Robot, workspace: Workspace | None, q: Array) -> bool:
    """Return True if an arm passing configurations (n, n_joints) in turn is clear of the boxes."""
    sweep = JointBoxes(q[:-1], q[1:])
    return workspace is None or bool(are_clear(robot, workspace, sweep).all())


def worth(robot: Robot, found: Sequence[Share], noise: Noise) -> tuple[tuple[Indices, Array], ...]:
    """Compute per share of a measurement the indices of the unknowns, and I S^-1 I."""
    return tuple(
        (
            place(robot, share.axis),
            weigh(share.information / noise.variance[share.axis], scatter_of(share, noise)),
        )
        for share in found
    )


def weigh(information: Array, scatter: Array) -> Array:
    """Compute I S^-1 I, with the pseudoinverse of a singular S."""
    half = inverse_root(scatter).T @ information
    return half.T @ half
