"""A few minutes with a load: the measurements that show it best beside a run without it.

Both runs share base parameters p, torque ripple and friction of the transmitted torque; the loaded
one has p + K phi and offsets of its own, since friction's asymmetry changes from day to day. Its
normal equations over the unknowns x of `hil.least_squares.terms` become those of both runs by

    x = E z,    z = (x of the run without, phi, offsets of the loaded run).

Chosen is whatever adds most in its time to log det of the information about phi, all else
eliminated, which no scale of mass or inertia sways.

What the axes must give in a measurement is computed with the loads that are possible; strokes of
acceleration that call for too much are made slower.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.terms import N_COMMON, n_unknowns
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.planning.design.by_counts import TRAVEL, as_plan
from hil.planning.design.by_minutes import lasting, nearest_first, numbered
from hil.planning.design.candidates import judged
from hil.planning.design.tour import guarded_tour
from hil.planning.prediction.predicted_samples import forecast
from hil.planning.timetable import SETTLING, travel_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.design.candidates import Option
    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise
    from hil.planning.workspace import Workspace

    Array = NDArray[np.float64]
    Worth = Sequence[tuple[NDArray[np.intp], Array]]

OFFSETS = 2
"""Of the common terms of an axis those that each run has by itself: a constant, one with |qd|."""
HOLD = 0.9
"""Share of an axis's torque limit that a measurement may call for."""
SLOWER = (1.0, 0.7, 0.5, 0.35, 0.25)
"""Shares of a candidate's acceleration that are tried, velocity by its root."""
_INSTANT = 0.02
"""Between instants at which torques are looked at [s]."""


def embedding(robot: Robot, shown: Array) -> Array:
    """E, shape (n_unknowns, n_unknowns + n_free + OFFSETS n_joints).

    Parameters
    ----------
    shown : ndarray, shape (n_base, n_free)
        Change of the base parameters by each free parameter of the load.
    """
    n, n_base, n_free = n_unknowns(robot), len(base_parameters(robot)), shown.shape[1]
    E = np.hstack([np.eye(n), np.zeros((n, n_free + OFFSETS * robot.n_joints))])
    E[:n_base, n : n + n_free] = shown
    for axis in range(robot.n_joints):
        for k in range(OFFSETS):
            at = n_base + axis * N_COMMON + k
            E[at, at], E[at, n + n_free + OFFSETS * axis + k] = 0.0, 1.0
    return E


def of_load(information: Array, load: slice) -> Array:
    """Information about the unknowns of `load` alone, all others eliminated."""
    inside = np.zeros(len(information), dtype=bool)
    inside[load] = True
    across = information[np.ix_(inside, ~inside)]
    others = information[np.ix_(~inside, ~inside)]
    left: Array = information[np.ix_(inside, inside)] - across @ np.linalg.solve(others, across.T)
    return left


def within_torque(
    robot: Robot,
    options: Sequence[Option],
    loaded: Sequence[Array],
    friction: Array,
    period: float,
    noise: Noise,
) -> list[Option]:
    """Options that all axes can carry out with every one of the loads, slower where need be.

    Parameters
    ----------
    loaded : sequence of ndarray, shape (n_base,)
        Base parameters with each load.
    friction : ndarray, shape (n_joints,)
        Highest friction of each axis [N m].
    period, noise
        By which slower ones are judged anew.
    """
    found = []
    for option in options:
        for share in SLOWER[:1] if is_slow(option.measurement) else SLOWER:
            slower = _slowed(option.measurement, share)
            if all(strain(robot, slower, p, friction) <= HOLD for p in loaded):
                anew = option.worth if share == 1.0 else judged(robot, slower, period, noise)
                found.append(replace(option, measurement=slower, worth=anew))
                break
    return found


def is_slow(measurement: ParameterMeasurement) -> bool:
    """Whether torques are read at constant velocity alone."""
    return not measurement.streamed and not any(measurement.unit_acceleration)


def strain(robot: Robot, measurement: ParameterMeasurement, p: Array, friction: Array) -> float:
    """Largest torque of any axis in a measurement, as share of its limit."""
    planned = forecast(measurement, _INSTANT)
    motion = planned.q, planned.qd, planned.qdd
    tau = inverse_dynamics(robot, p, *motion) + motor_torque(robot, *motion)
    return float(((np.abs(tau) + friction) / robot.torque_limit).max())


def _slowed(measurement: ParameterMeasurement, share: float) -> ParameterMeasurement:
    if share == 1.0 or measurement.streamed:
        return measurement
    slow = {
        "velocity": np.sqrt(share) * measurement.velocity,
        "acceleration": share * measurement.acceleration,
    }
    if not measurement.partners:
        return measurement.model_copy(update=slow)
    (partner,) = measurement.partners
    slow = {
        "velocity": np.sqrt(share) * partner.velocity,
        "acceleration": share * partner.acceleration,
    }
    return measurement.model_copy(update={"partner": partner.model_copy(update=slow)})


def choose(
    robot: Robot,
    options: Sequence[Option],
    E: Array,
    known: Array,
    load: slice,
    seconds: float,
    workspace: Workspace | None,
) -> tuple[Plan, Array]:
    """Choose measurements within `seconds`, ways included.

    Parameters
    ----------
    known : ndarray, shape (n_z, n_z)
        Information about z so far, of full rank.
    load : slice
        Where phi stands in z.

    Returns
    -------
    plan : Plan
    information : ndarray, shape (n_z, n_z)
        With what was chosen.

    Raises
    ------
    ValueError
        Not even one measurement fits.
    """
    worth = [embedded(option.worth, E) for option in options]
    starts = np.array([option.measurement.start for option in options])
    durations = np.array([option.measurement.duration for option in options]) + SETTLING
    free, chosen = np.ones(len(options), dtype=bool), list[int]()
    order: list[ParameterMeasurement] = []
    while free.any():
        gains = np.array([_log_det(known + each, load) for each in worth]) - _log_det(known, load)
        here = starts[chosen] if chosen else np.zeros((1, robot.n_joints))
        ways = np.min([travel_times(robot, each, starts, TRAVEL) for each in here], axis=0)
        best = int(np.argmax(np.where(free, gains / (durations + ways), -np.inf)))
        free[best] = False
        tried = _order(robot, [options[k].measurement for k in (*chosen, best)], workspace)
        if lasting(robot, tried) > seconds:
            break
        chosen.append(best)
        order, known = tried, known + worth[best]
    if not order:
        raise ValueError(
            f"{seconds:.0f} s are too short for a measurement and the way to it; give more minutes"
        )
    return as_plan(robot, numbered(order, set()), 0.0, workspace), known


def _order(
    robot: Robot, chosen: Sequence[ParameterMeasurement], workspace: Workspace | None
) -> list[ParameterMeasurement]:
    if workspace:
        return guarded_tour(robot, workspace, chosen, TRAVEL)
    return nearest_first(robot, chosen)


def embedded(worth: Worth, E: Array) -> Array:
    """Information about z of a measurement with the load, shape (n_z, n_z)."""
    total = np.zeros((E.shape[1], E.shape[1]))
    for at, each in worth:
        total += E[at].T @ each @ E[at]
    return total


def _log_det(information: Array, load: slice) -> float:
    return float(np.linalg.slogdet(of_load(information, load))[1])
