"""A robot of which no more is known than its URDF says: enough to identify what was recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.model.robot_draft import robot_of
from hil.model.urdf import read_urdf

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.model.robot import Robot

EARTH = (0.0, 0.0, -9.81)
"""Gravity where the base link stands upright [m/s^2]."""


def robot_from_urdf(
    path: Path | str,
    base: str | None = None,
    tip: str | None = None,
    gravity: Sequence[float] = EARTH,
) -> Robot:
    """Make a robot of the chain between two links of a URDF.

    Parameters
    ----------
    path : path
    base, tip : str, optional
        Names of links; by default those of the chain with most joints that move.
    gravity : sequence of three floats
        In the link `base` [m/s^2].

    Raises
    ------
    FileError
        No URDF, no such link, or a chain with a joint that cannot be driven by itself.
    """
    return robot_of(read_urdf(path, base, tip), gravity, str(path))
