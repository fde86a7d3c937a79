"""Draft of a robot file from a URDF, an MJCF or a table: frames, limits, marks for missing values.

A URDF contains no gears, rotors, torque constants and accelerations, and a table of
Denavit-Hartenberg parameters usually only frames. The user replaces the marks of the missing
values. Link parameters are all ten of each link: leave out those that symmetry makes zero.
Identification of imported recordings needs none of the missing values: `robot_as_stated` leaves
them unknown, including rotor inertias, which are then identified.
"""

from __future__ import annotations

import math
import re
import unicodedata
from typing import TYPE_CHECKING

import numpy as np

from checked_files.foreign_text import one_line
from checked_files.yaml_file import UNSTATED
from checked_files.yaml_text import comment, mark_unstated, number, scalar
from hil.model.drive_train_file import UNKNOWN
from hil.model.frames import QUARTER, ROUNDED_OFF
from hil.model.readers.axes_to_frames import find_frames
from hil.model.readers.limits import FARTHEST
from hil.model.readers.urdf import PARALLELOGRAM, UrdfChain
from hil.model.robot_file import EARTH

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.model.readers.axes_to_frames import Frames
    from hil.model.readers.dh_table import DhRobot
    from hil.model.readers.limits import LimitedJoint

    _Rest = Callable[[LimitedJoint], Iterator[str]]

NOT_TAKEN = "not taken: "
"""Beginning of a comment about contents of the source."""
_UNITS = {"revolute": ("rad", "N m"), "prismatic": ("m", "N")}
_ABOUT_MARKS = (
    f"# Unknown values are marked {UNSTATED}: replace each mark and its text by a",
    "# value. Leave out link parameters that symmetry makes zero: parameters: [Izz, m].",
    "# SI, joint side; rotor_inertia and torque_constant on the motor's side.",
)


def draft_robot(source: UrdfChain | DhRobot, gravity: Sequence[float] | None = None) -> str:
    """Draft the text of a robot file.

    Parameters
    ----------
    source : UrdfChain or DhRobot
        Chain of a URDF or MJCF, or table.
    gravity : sequence of three floats, optional
        Gravity in the URDF's base link, in the MJCF's world, or in the table's frame 0 [m/s^2]. By
        default that of the MJCF, or of the earth: along -z of the URDF's root, turned by the joints
        above the base link, or of frame 0.

    Raises
    ------
    FileError
        See `hil.model.readers.urdf.UrdfChain.gravity`.
    """
    if isinstance(source, UrdfChain):
        title = [
            comment(f"Robot {_ends(source)}, drafted from {source.format}."),
            *_warn_of_loops(source),
            *_ABOUT_MARKS,
        ]
        return _text(source, gravity, title, _limits_to_state)
    title = [
        comment(
            f"Robot {one_line(source.name)}, drafted from a table of {source.notation}"
            " Denavit-Hartenberg"
        ),
        "# parameters. Here d and r are what the table calls a and d.",
        *_ABOUT_MARKS,
    ]
    return _text(source, gravity, title, _limits_to_state)


def robot_as_stated(
    chain: UrdfChain, gravity: Sequence[float] | None = None, weighed: Sequence[int] = ()
) -> str:
    """Convert a URDF or MJCF to a robot file with unknown values, sufficient for identification.

    Parameters
    ----------
    gravity : sequence of three floats, optional
        As in `draft_robot`.
    weighed : sequence of int
        Slides along which gravity is constant, from 0: their masses include the rotors' inertias.

    Raises
    ------
    FileError
        As in `draft_robot`.
    """
    title = [
        comment(f"Robot {_ends(chain)}, from {chain.format}."),
        *_warn_of_loops(chain),
        "# To move it, state what is unknown; an unknown rotor_inertia is identified.",
    ]
    slides = {chain.joints[axis].name for axis in weighed}

    def rest(joint: LimitedJoint) -> Iterator[str]:
        # an unlimited revolute joint gets two turns
        endless = {"q_min": -FARTHEST, "q_max": FARTHEST}
        for key, value, _ in _limits(joint):
            stated = endless.get(key, math.nan) if math.isnan(value) else value
            yield f"    {key}: {UNKNOWN if math.isnan(stated) else number(stated)}"
        if joint.name in slides:
            yield "    # gravity is constant here: the mass includes the rotor, unless stated"
            yield "    drive: {rotor_inertia: 0, torque_constant: unknown}"

    return _text(chain, gravity, title, rest)


def _ends(chain: UrdfChain) -> str:
    return f"{one_line(chain.robot)}, from {one_line(chain.base)} to {one_line(chain.tip)}"


def _warn_of_loops(chain: UrdfChain) -> Iterator[str]:
    """Yield a comment on a tree: a format without loops may show a loop as two branches."""
    if "," in chain.tip:
        yield comment(
            f"several last links: {one_line(chain.tip)}. If they meet in one body: {PARALLELOGRAM}"
        )


def _text(
    source: UrdfChain | DhRobot, gravity: Sequence[float] | None, title: Sequence[str], rest: _Rest
) -> str:
    not_taken: tuple[str, ...] = ()
    further: tuple[str, ...] = ()
    if isinstance(source, UrdfChain):
        name, frames, in_base = source.robot, find_frames(source), source.gravity(gravity)
        not_taken, further = source.not_taken, source.further_lines()
    else:
        name, frames = source.name, source.frames
        in_base = np.array(EARTH if gravity is None else gravity, dtype=float)
    in_frame_0 = frames.base[:3, :3].T @ in_base
    lengths = _Lengths()
    lines = [
        line
        for index, joint in enumerate(source.joints)
        for line in (*_joint(joint, frames, index, lengths), *rest(joint))
    ]
    return "\n".join(
        [
            *(comment(f"{NOT_TAKEN}{each}") for each in not_taken),
            *title,
            f"name: {scalar(_plain(name))}",
            f"gravity: [{', '.join(number(round(g, 9)) for g in in_frame_0)}] # m/s2, in frame 0",
            f"lengths: {{{lengths}}} # m",
            "joints:",
            *lines,
            *further,
            "",
        ]
    )


class _Lengths:
    """Names of lengths, reused for equal lengths."""

    def __init__(self) -> None:
        self._known: dict[str, float] = {}

    def expression(self, value: float, name: str) -> str:
        """Format a length for a frame, named `name` unless already known."""
        if not value:
            return "0"
        size = abs(value)
        known = next((n for n, x in self._known.items() if abs(x - size) < ROUNDED_OFF), None)
        if known is None:
            self._known[name] = size
        return ("-" if value < 0 else "") + (known or name)

    def __str__(self) -> str:
        return ", ".join(f"{name}: {number(value)}" for name, value in self._known.items())


def _frame(frames: Frames, index: int, lengths: _Lengths) -> str:
    keys = []
    for key in ("gamma", "b", "alpha", "d", "theta", "r"):
        value = float(getattr(frames, key)[index])
        if key in {"gamma", "alpha", "theta"}:
            stated = _angle(value)
        else:
            stated = lengths.expression(value, f"{key}{index + 1}")
        if value or key == "alpha":
            keys.append(f"{key}: {stated}")
    return ", ".join(keys)


def _joint(joint: LimitedJoint, frames: Frames, index: int, lengths: _Lengths) -> Iterator[str]:
    yield f"  - name: {scalar(one_line(joint.name))}"
    if frames.parents[index] != index - 1:
        yield f"    parent: {frames.parents[index] + 1}"
    yield f"    frame: {{{_frame(frames, index, lengths)}}}"
    if joint.type != "revolute":
        yield f"    type: {joint.type}"


def _limits_to_state(joint: LimitedJoint) -> Iterator[str]:
    """Yield limits and drive train with marks for missing values."""
    for key, value, what in _limits(joint):
        yield f"    {key}: {mark_unstated(what) if math.isnan(value) else number(value)}"
    yield "    drive:"
    per = "" if joint.type == "revolute" else ", motor angle over distance [rad/m]"
    yield f"      gear_ratio: {mark_unstated(f'motor turns per joint turn{per}')}"
    yield f"      rotor_inertia: {mark_unstated('of the motor, 0 for a direct drive [kg m2]')}"
    yield f"      torque_constant: {mark_unstated('of the motor [N m/A]')}"


def _limits(joint: LimitedJoint) -> Iterator[tuple[str, float, str]]:
    """Yield key, value or NaN, and description of the limits."""
    unit, effort = _UNITS[joint.type]
    yield "q_min", joint.lower, f"least position [{unit}]"
    yield "q_max", joint.upper, f"greatest position [{unit}]"
    yield "velocity_limit", joint.velocity, f"greatest speed [{unit}/s]"
    yield "acceleration_limit", joint.acceleration, f"greatest acceleration [{unit}/s2]"
    yield "torque_limit", joint.effort, f"greatest torque [{effort}]"


def _angle(angle: float) -> str:
    quarters = round(angle / QUARTER)
    if angle != quarters * QUARTER:
        return number(angle)
    known = {0: "0", 1: "pi/2", -1: "-pi/2", 2: "pi", -2: "-pi"}
    return known.get(quarters) or f"{quarters}*pi/2"


def _plain(name: str) -> str:
    """Convert a name to the characters permitted in robot files: ö to oe, é to e, others to -."""
    letters = unicodedata.normalize("NFKD", unicodedata.normalize("NFC", name).translate(_SPELT))
    spelt = "".join(each for each in letters if not unicodedata.combining(each))
    return re.sub(r"[^A-Za-z0-9._-]+", "-", spelt).strip("._-") or "robot"


_SPELT = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ø": "o"}
)
"""Spelling of letters that Unicode does not decompose, or that German spells in its own way."""
