"""Flaws of a plant, and of what was recorded of one: how they come about, and what to say of them.

`mistakes` measures what is said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Plant = dict[str, Any]
    Change = Callable[[Array, Array, Array], None]


@dataclass(frozen=True)
class Case:
    """A flaw, what should be said of it, and how it comes about.

    Attributes
    ----------
    words : tuple of str
        Words that are right; *good* is one where the flaw cannot show, if its stated error holds.
    name : str or None
        None where it cannot show.
    axes : tuple of int
        From 1; none where it concerns none in particular.
    plant : callable, optional
        Changes the plant's file.
    recorded : callable, optional
        Changes positions and torques as they were recorded.
    later : callable, optional
        Changes the plant's file for a second half of the campaign.
    """

    words: tuple[str, ...]
    name: str | None
    axes: tuple[int, ...]
    plant: Callable[[Plant], None] | None = None
    recorded: Change | None = None
    later: Callable[[Plant], None] | None = None


def drive(axis: int, **factors: float) -> Callable[[Plant], None]:
    """Multiply values of a drive."""

    def change(plant: Plant) -> None:
        own = plant["axes"][axis - 1]["drive"]
        for key, factor in factors.items():
            own[key] = type(own[key])(own[key] * factor)

    return change


def zero(axis: int, degrees: float) -> Callable[[Plant], None]:
    """Shift what the encoder shows at q = 0."""

    def change(plant: Plant) -> None:
        own = plant["axes"][axis - 1]["drive"]
        turns = own["direction"] * own["gear_ratio"] * degrees / 360
        own["zero"] += round(turns * own["increments"])
        own["range_deg"] += abs(degrees)  # the drive's own limits move along with its zero

    return change


def tilted(roll: float, pitch: float) -> Callable[[Plant], None]:
    """Let gravity come from elsewhere than the robot file says [degrees]."""

    def change(plant: Plant) -> None:
        a, b = math.radians(roll), math.radians(pitch)
        g = -9.81
        plant["gravity"] = [g * math.sin(b), -g * math.sin(a) * math.cos(b),
                            g * math.cos(a) * math.cos(b)]  # fmt: skip

    return change


def load(mass: float, centre: tuple[float, float, float]) -> Callable[[Plant], None]:
    """Bolt a body to the last link."""

    def change(plant: Plant) -> None:
        plant["payload"] = {"mass": mass, "centre": list(centre),
                            "Ixx": 0.02, "Iyy": 0.02, "Izz": 0.02}  # fmt: skip

    return change


def backlash(axis: int, angle: float, hertz: float) -> Callable[[Plant], None]:
    """Let a gear be soft, so that its load swings with `hertz`, and have play [rad]."""

    def change(plant: Plant) -> None:
        own = plant["axes"][axis - 1]["drive"]
        own["stiffness"] = own["load_inertia"] * (2 * math.pi * hertz) ** 2
        own["backlash"] = angle

    return change


def torque_sign(axis: int) -> Change:
    """Count torques the other way."""

    def change(_q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] *= -1

    return change


def position_sign(axis: int) -> Change:
    """Count positions the other way."""

    def change(q: Array, _tau: Array, _time: Array) -> None:
        q[:, axis - 1] *= -1

    return change


def both_signs(axis: int) -> Change:
    """Count positions and torques the other way."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        q[:, axis - 1] *= -1
        tau[:, axis - 1] *= -1

    return change


def exchanged(one: int, other: int) -> Change:
    """Give two axes each other's columns."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        for x in (q, tau):
            x[:, [one - 1, other - 1]] = x[:, [other - 1, one - 1]]

    return change


def shifted(axis: int, degrees: float) -> Change:
    """Shift positions."""

    def change(q: Array, _tau: Array, _time: Array) -> None:
        q[:, axis - 1] -= math.radians(degrees)

    return change


def geared(axis: int, ratio: float) -> Change:
    """Let a gear ratio be `ratio` times the stated one; drives that know theirs are refused."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        q[:, axis - 1] *= ratio
        tau[:, axis - 1] /= ratio

    return change


def constant(axis: int, factor: float) -> Change:
    """Let a torque constant be `factor` times the stated one."""

    def change(_q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] /= factor

    return change


def drifting(axis: int, share: float) -> Change:
    """Let a torque constant fall by `share` in eight minutes."""

    def change(_q: Array, tau: Array, time: Array) -> None:
        tau[:, axis - 1] /= 1 - share * time / 480.0

    return change


def spring(axis: int, stiffness: float) -> Change:
    """Let a spring pull [N m/rad]."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] += stiffness * q[:, axis - 1]

    return change


def meshing(axis: int, size: float, order: int) -> Change:
    """Let a torque repeat so many times a turn [N m]."""

    def change(q: Array, tau: Array, _time: Array) -> None:
        tau[:, axis - 1] += size * np.sin(order * q[:, axis - 1])

    return change


def clipped(axis: int, most: float) -> Change:
    """Let the drive report no more than a torque [N m]."""

    def change(_q: Array, tau: Array, _time: Array) -> None:
        np.clip(tau[:, axis - 1], -most, most, out=tau[:, axis - 1])

    return change


FAILED, DOUBTFUL, GOOD = ("failed",), ("doubtful",), ("good",)
SEEN = (*DOUBTFUL, *FAILED)
"""Of a flaw of a size that some parameters survive: how many is a matter of the seed."""
CASES = {
    "axis 3 counts the other way": Case(
        FAILED, "wrong direction of an axis", (3,), drive(3, direction=-1)
    ),
    "axis 5 counts the other way": Case(
        FAILED, "wrong direction of an axis", (5,), drive(5, direction=-1)
    ),
    "sign of position, axis 2": Case(
        FAILED, "wrong sign of a position", (2,), recorded=position_sign(2)
    ),
    "sign of position, axis 5": Case(
        FAILED, "wrong sign of a position", (5,), recorded=position_sign(5)
    ),
    "sign of torque, axis 3": Case(FAILED, "wrong sign of a torque", (3,), recorded=torque_sign(3)),
    "sign of torque, axis 4": Case(FAILED, "wrong sign of a torque", (4,), recorded=torque_sign(4)),
    "axes 2 and 3 exchanged": Case(FAILED, "two axes exchanged", (2, 3), recorded=exchanged(2, 3)),
    "axes 4 and 5 exchanged": Case(FAILED, "two axes exchanged", (4, 5), recorded=exchanged(4, 5)),
    "axes 5 and 6 exchanged": Case(FAILED, "two axes exchanged", (5, 6), recorded=exchanged(5, 6)),
    "zero of axis 3, 20 degrees": Case(FAILED, "zero", (3,), zero(3, 20)),
    "zero of axis 5, 90 degrees": Case(FAILED, "zero", (5,), zero(5, 90)),
    "zero of axis 5, 2 degrees": Case(GOOD, None, (), zero(5, 2)),
    "gravity, 10 degrees": Case(FAILED, "gravity", (), tilted(10, 0)),
    "gravity, on a wall": Case(FAILED, "gravity", (), tilted(0, 90)),
    "gear of axis 2, 50 for 100": Case(FAILED, "gear ratio", (2,), recorded=geared(2, 0.5)),
    "gear of axis 3, 101 for 100": Case(SEEN, "gear ratio", (3,), recorded=geared(3, 1.01)),
    "gear of axis 4, 102 for 100": Case(GOOD, None, (), recorded=geared(4, 1.02)),
    "torque constant of axis 2, 30 %": Case(
        FAILED, "torque constant", (2,), drive(2, torque_constant=1.3)
    ),
    "torque constant of axis 5, 30 %": Case(
        SEEN, "torque constant", (5,), drive(5, torque_constant=1.3)
    ),
    "torque constant of axis 1, 5 %": Case(GOOD, None, (), recorded=constant(1, 1.05)),
    "torque constant of axis 2 falls by 4 %": Case(
        SEEN, "drift of torque constant", (2,), recorded=drifting(2, 0.04)
    ),
    "load of 2 kg": Case(SEEN, "load", (6,), load(2.0, (0.1, 0.0, 0.1))),
    "load of 5 kg": Case(SEEN, "load", (6,), load(5.0, (0.05, 0.0, 0.12))),
    "load of 6 kg": Case(SEEN, "load", (6,), load(6.0, (0.0, 0.15, 0.2))),
    "spring of 10 N m/rad, axis 3": Case(FAILED, "spring", (3,), recorded=spring(3, 10.0)),
    "spring of 10 N m/rad, axis 5": Case(FAILED, "spring", (5,), recorded=spring(5, 10.0)),
    "torque of 3 N m sin 12 q, axis 4": Case(SEEN, "repeats", (4,), recorded=meshing(4, 3, 12)),
    "backlash of 1 mrad at 45 Hz, axis 4": Case(GOOD, None, (), backlash(4, 1e-3, 45.0)),
    "saturation of axis 2": Case(SEEN, "torque at its limit", (2,), recorded=clipped(2, 500)),
    "saturation of axis 4": Case(SEEN, "torque at its limit", (4,), recorded=clipped(4, 45)),
    "slip of axis 3, 5 degrees": Case(SEEN, "slip", (3,), later=zero(3, 5)),
    "slip of axis 5, 10 degrees": Case(GOOD, None, (), later=zero(5, 10)),
}
ON_EVERY_AXIS: dict[str, Callable[[int], Change]] = {
    "direction": both_signs,
    "sign of position": position_sign,
    "sign of torque": torque_sign,
    "zero, 20 degrees": lambda axis: shifted(axis, 20.0),
    "gear, 101 for 100": lambda axis: geared(axis, 1.01),
    "gear, 50 for 100": lambda axis: geared(axis, 0.5),
    "torque constant, 130 %": lambda axis: constant(axis, 1.3),
}
