"""Torques along a planned motion, by a model."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import FrictionUnknown, Mismatch
from hil.results.drive_torque import drive_torque
from hil.view.track import SHARE, Track, simplified

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.results.model import Model

    Array = NDArray[np.float64]

_CHUNK = 4096


class Predicted(NamedTuple):
    """Torque of each joint, and what it consists of."""

    tracks: tuple[Track, ...]
    words: str


def predicted(model: Model, time: Array, q: Array, qd: Array, qdd: Array) -> Predicted:
    """Predict the torques at instants (n,) of a motion (n, n_joints)."""
    parts = [slice(i, i + _CHUNK) for i in range(0, len(time), _CHUNK)]
    lack, n = model.axes_without_friction, model.robot.n_joints
    if len(lack) == n:
        torque = [model.torque(q[p], qd[p], qdd[p], ("rigid bodies", "motors")) for p in parts]
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FrictionUnknown)  # the words say so
            torque = [drive_torque(model, q[p], qd[p], qdd[p]) for p in parts]
    of = "" if len(lack) == n else f" of axis {', '.join(map(str, lack))}"
    words = f"predicted, without friction{of}" if lack else "predicted"
    tau = np.concatenate(torque)
    tolerance = SHARE * np.maximum(np.abs(tau).max(axis=0), 1e-9)
    tracks = (simplified(time, tau[:, j], float(tolerance[j])) for j in range(tau.shape[1]))
    return Predicted(tuple(tracks), words)


def refuse_other_robot(model: Model, robot: Robot, source: str) -> None:
    """Refuse a model of another robot file.

    Raises
    ------
    Mismatch
        Both by name and digest.
    """
    if model.robot.digest != robot.digest:
        raise Mismatch(
            f"{source}: was identified with another robot file ({model.robot.name}"
            f" {model.robot.digest[:12]}) than that of {robot.name} {robot.digest[:12]}; give the"
            " model of this robot with --model"
        )
