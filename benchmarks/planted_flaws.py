"""Planted flaws of a stated size: in recordings, in a robot file, or in a plant."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from hil.estimation.excluded.columns import across_gravity
from hil.model.robot import Robot, parse_robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Plant = dict[str, Any]
    Change = Callable[[Array, Array, Array, int, float], None]

ARM = 0.2
"""Distance of a load from the last axis [m]."""
STIFF = 80.0
"""Natural frequency of a gear with backlash and blocked motor: highest value for a step of 1 ms
[Hz]."""
HALF_WAY = 240.0
"""Middle of a campaign [s]."""
MESH = 12
"""Periods of a periodic torque per turn of the joint."""


# Errors of a map, a drives file or a machine in positions and torques of an axis, from 0; sizes in
# the units of the table of causes.
def _zero(q: Array, _tau: Array, _time: Array, k: int, size: float) -> None:
    q[:, k] -= math.radians(size)


def _scale(q: Array, _tau: Array, _time: Array, k: int, size: float) -> None:
    q[:, k] /= 1 + size / 100


def _gear(q: Array, tau: Array, _time: Array, k: int, size: float) -> None:
    q[:, k] *= 1 + size / 100
    tau[:, k] /= 1 + size / 100


def _constant(_q: Array, tau: Array, _time: Array, k: int, size: float) -> None:
    tau[:, k] /= 1 + size / 100


def _drift(_q: Array, tau: Array, time: Array, k: int, size: float) -> None:
    tau[:, k] /= 1 + size / 100 * time / 3600


def _late(q: Array, _tau: Array, time: Array, k: int, size: float) -> None:
    q[:, k] = np.interp(time - size / 1000, time, q[:, k])


def _torque_late(_q: Array, tau: Array, time: Array, k: int, size: float) -> None:
    tau[:, k] = np.interp(time - size / 1000, time, tau[:, k])


def _slip(q: Array, _tau: Array, time: Array, k: int, size: float) -> None:
    if time[0] > HALF_WAY:
        q[:, k] -= math.radians(size)


def _spring(q: Array, tau: Array, _time: Array, k: int, size: float) -> None:
    tau[:, k] += size * q[:, k]


def _mesh(q: Array, tau: Array, _time: Array, k: int, size: float) -> None:
    tau[:, k] += size * np.sin(MESH * q[:, k])


def _clip(_q: Array, tau: Array, _time: Array, k: int, size: float) -> None:
    np.clip(tau[:, k], -size, size, out=tau[:, k])


def _flip(*which: int) -> Change:
    def change(*given: Any) -> None:
        for place in which:
            given[place][:, given[3]] *= -1

    return change


def _swap(q: Array, tau: Array, _time: Array, k: int, _size: float) -> None:
    for x in (q, tau):
        x[:, [k, k + 1]] = x[:, [k + 1, k]]


RECORDED: dict[str, Change] = {
    "joint offset": _zero, "position scale": _scale, "gear ratio": _gear,
    "torque constant": _constant, "drift of torque constant": _drift, "position delay": _late,
    "torque delay": _torque_late, "slip": _slip, "spring": _spring, "torque ripple": _mesh,
    "torque at its limit": _clip,
    "wrong direction of an axis": _flip(0, 1), "wrong sign of a position": _flip(0),
    "wrong sign of a torque": _flip(1), "two axes exchanged": _swap,
}  # fmt: skip


# Errors of a robot file for an unchanged machine.
def _turned(robot: Robot, _axis: int, size: float) -> Robot:
    a, down = math.radians(size), np.array(robot.gravity)
    other = np.cos(a) * down - np.sin(a) * np.linalg.norm(down) * across_gravity(robot)[0]
    return _restated(robot, {"gravity": other.tolist()})


def _rotor(robot: Robot, axis: int, size: float) -> Robot:
    joints = yaml.safe_load(robot.text)["joints"]
    inertia = float(joints[axis]["drive"]["rotor_inertia"]) / (1 + size / 100)
    joints[axis]["drive"]["rotor_inertia"] = inertia
    return _restated(robot, {"joints": joints})


def _restated(robot: Robot, keys: dict[str, Any]) -> Robot:
    return parse_robot(yaml.safe_dump(yaml.safe_load(robot.text) | keys), robot.source)


STATED = {"gravity": _turned, "rotor inertia": _rotor}


# Changes of a plant.
def _load(plant: Plant, _axis: int, size: float) -> None:
    plant["payload"] = {"mass": size / ARM, "centre": [ARM, 0, 0]}


def _play(plant: Plant, axis: int, size: float) -> None:
    own = plant["axes"][axis - 1]["drive"]
    own["stiffness"] = own["load_inertia"] * (math.tau * STIFF) ** 2
    own["backlash"] = 2 * math.radians(size)


def _rub(plant: Plant, axis: int, size: float) -> None:
    plant["axes"][axis - 1]["friction"]["load"] = size / 100


def _soften(plant: Plant, _axis: int, size: float) -> None:
    plant["step"] = 0.0005  # a single link between two gears has a frequency several times as high
    for each in plant["axes"]:
        own = each["drive"]
        own["stiffness"] = own["load_inertia"] * (math.tau * size) ** 2


def _coarsen(plant: Plant, _axis: int, size: float) -> None:
    for each in plant["axes"]:
        each["drive"]["increments"] = int(size)


PLANTS: dict[str, Callable[[Plant, int, float], None]] = {
    "load": _load, "backlash": _play, "friction of the load": _rub, "gears": _soften,
    "encoders": _coarsen,
}  # fmt: skip
