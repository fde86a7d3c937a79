"""A first robot file from a URDF: its frames and limits, and marks where only you know more.

A URDF says nothing of gears, rotors, torque constants and accelerations, so these lines are marked
as in a first drives file. Link parameters are all ten of each link: what is zero by symmetry is
yours to leave out.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import UNSTATED
from hil.model.axes_to_frames import PARALLEL, frames_of
from hil.model.urdf import QUARTER

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.model.axes_to_frames import Frames
    from hil.model.urdf import UrdfChain, UrdfJoint

    Array = NDArray[np.float64]

_UNITS = {"revolute": ("rad", "N m"), "prismatic": ("m", "N")}


def draft_robot(chain: UrdfChain, gravity: Sequence[float]) -> str:
    """Text of a robot file.

    Parameters
    ----------
    chain : UrdfChain
    gravity : sequence of three floats
        In the base link [m/s^2].
    """
    frames = frames_of(chain)
    in_frame_0 = frames.base[:3, :3].T @ np.asarray(gravity, dtype=float)
    lengths = _Lengths()
    joints = [
        line
        for number, joint in enumerate(chain.joints)
        for line in _joint(joint, _frame(frames, number, lengths))
    ]
    return "\n".join(
        [
            f"# Robot {chain.robot}, from {chain.base} to {chain.tip}, drafted from a URDF.",
            f"# What it does not say is marked {UNSTATED}: replace each mark and its text by a",
            "# value. Leave out link parameters that symmetry makes zero: parameters: [Izz, m].",
            "# SI, joint side; rotor_inertia and torque_constant on the motor's side.",
            f"name: {_name(chain.robot)}",
            f"gravity: [{', '.join(_number(round(g, 9)) for g in in_frame_0)}] # m/s2, in frame 0",
            f"lengths: {{{lengths}}} # m",
            "joints:",
            *joints,
            "",
        ]
    )


class _Lengths:
    """Names of lengths; one that comes again keeps its name."""

    def __init__(self) -> None:
        self._known: dict[str, float] = {}

    def expression(self, value: float, name: str) -> str:
        """A length as frames state it, named `name` unless it is known."""
        if not value:
            return "0"
        size = abs(value)
        known = next((n for n, x in self._known.items() if abs(x - size) < PARALLEL), None)
        if known is None:
            self._known[name] = size
        return ("-" if value < 0 else "") + (known or name)

    def __str__(self) -> str:
        return ", ".join(f"{name}: {_number(value)}" for name, value in self._known.items())


def _frame(frames: Frames, number: int, lengths: _Lengths) -> str:
    keys = [f"alpha: {_angle(frames.alpha[number])}"]
    for key, value in (("d", frames.d[number]), ("r", frames.r[number])):
        if value:
            keys.append(f"{key}: {lengths.expression(float(value), f'{key}{number + 1}')}")
    if frames.theta[number]:
        keys.insert(1 + bool(frames.d[number]), f"theta: {_angle(frames.theta[number])}")
    return ", ".join(keys)


def _joint(joint: UrdfJoint, frame: str) -> Iterator[str]:
    unit, effort = _UNITS[joint.type]
    yield f"  - frame: {{{frame}}} # {_comment(joint.name)}"
    if joint.type != "revolute":
        yield f"    type: {joint.type}"
    yield f"    q_min: {_stated(joint.lower, f'least position [{unit}]')}"
    yield f"    q_max: {_stated(joint.upper, f'greatest position [{unit}]')}"
    velocity = joint.velocity if joint.velocity > 0 else math.nan
    yield f"    velocity_limit: {_stated(velocity, f'greatest speed [{unit}/s]')}"
    yield f"    acceleration_limit: {UNSTATED} greatest acceleration [{unit}/s2]"
    torque = joint.effort if joint.effort > 0 else math.nan
    yield f"    torque_limit: {_stated(torque, f'greatest torque [{effort}]')}"
    yield "    drive:"
    per = "" if joint.type == "revolute" else ", motor angle over way [rad/m]"
    yield f"      gear_ratio: {UNSTATED} motor turns per joint turn{per}"
    yield f"      rotor_inertia: {UNSTATED} of the motor, 0 for a direct drive [kg m2]"
    yield f"      torque_constant: {UNSTATED} of the motor [N m/A]"


def _stated(value: float, what: str) -> str:
    return f"{UNSTATED} {what}" if math.isnan(value) else _number(value)


def _angle(angle: float) -> str:
    quarters = round(angle / QUARTER)
    if angle != quarters * QUARTER:
        return _number(angle)
    return {0: "0", 1: "pi/2", -1: "-pi/2", 2: "pi", -2: "-pi"}[quarters]


def _number(value: float) -> str:
    return repr(float(value) + 0.0).removesuffix(".0")


def _name(stated: str) -> str:
    """A name as robot files may have it."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", stated).strip("._-") or "robot"


def _comment(stated: str) -> str:
    return " ".join(re.sub(r"[^\x20-\x7e\xa0-\uffff]", " ", stated).split())
