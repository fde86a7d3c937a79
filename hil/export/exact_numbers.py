"""Numbers, rotations and comments as XML files have them, exact to the last digit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_STRAIGHT = 1e-12


def number(value: float) -> str:
    """The shortest text that is read back as the same number."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """Numbers with spaces between them."""
    return " ".join(number(float(value)) for value in values)


def roll_pitch_yaw(rotation: Array) -> Array:
    """Angles about the fixed x, y and z axes, shape (3,) [rad].

    Yaw is zero where the x axis stands upright, so that roll and yaw are one.
    """
    across = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = np.arctan2(-rotation[2, 0], across)
    if across < _STRAIGHT:
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    return np.array([roll, pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def comment(lines: Sequence[str]) -> str:
    """Lines inside an XML comment, which two hyphens in a row would end."""
    safe = (line.replace("--", "- -") for line in lines)
    return "\n" + "".join(f"  {line}\n" for line in safe)
