"""Meanings of base parameters in words: gravity or inertia of an axis, product of inertia.

A base parameter is a sum, and its head, the standard parameter that names it, determines its role
in the torques: ``sx2`` in the gravity torques is the gravity of axis 2, ``Izz3`` of a revolute
joint the inertia about its own axis. So the words follow for any robot.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

from hil.model.dependencies import GRAVITY

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot

_ADDED = {
    "Ia": "rotor inertia of axis {}",
    "Iam": "rotor inertia of coupled motor {}",
    "k": "spring of axis {}",
    "kc": "spring of axis {}, cosine",
    "ks": "spring of axis {}, sine",
}
"""Meanings of added parameters (`hil.model.added_parameters`)."""


def meanings(
    robot: Robot, heads: Sequence[str], matrix: Array, groups: Mapping[str, Collection[int]]
) -> tuple[str, ...]:
    """Describe every base parameter by unique words.

    Parameters
    ----------
    robot : Robot
    heads : sequence of str, length n_base
        Standard parameters at the head of each base parameter.
    matrix : ndarray, shape (n_base, n_standard)
        Matrix from standard to base parameters.
    groups : mapping
        As in `hil.model.base_parameters.BaseParameters`.
    """
    gravity = [heads[k] for k in groups.get(GRAVITY, ())]
    found = [_meaning(robot, head, matrix[k], gravity) for k, head in enumerate(heads)]
    several = Counter(found)
    return tuple(
        f"{words}, {head}" if several[words] > 1 else words
        for words, head in zip(found, heads, strict=True)
    )


def _meaning(robot: Robot, head: str, row: Array, gravity: Sequence[str]) -> str:
    letters, link = re.fullmatch(r"([A-Za-z]+)(\d+)", head).groups()  # type: ignore[union-attr]
    if letters in _ADDED:
        return _ADDED[letters].format(link)
    if letters.startswith("s"):
        return _first_moment(letters[1], link, gravity)
    return f"mass moved by axis {link}" if letters == "m" else _inertia(robot, head, row)


def _first_moment(along: str, link: str, gravity: Sequence[str]) -> str:
    if f"s{along}{link}" not in gravity:
        return f"mass times {along} of link {link}"
    alone = sum(each in (f"sx{link}", f"sy{link}", f"sz{link}") for each in gravity) == 1
    return f"gravity of axis {link}" + ("" if alone else f", {along}")


def _inertia(robot: Robot, head: str, row: Array) -> str:
    one, other, link = head[1], head[2], head[3:]
    if one != other:
        return f"product of inertia {one}{other} of link {link}"
    if one == "z" and robot.revolute[int(link) - 1]:
        return f"inertia of axis {link}"
    names = robot.standard_parameters
    less = [each for each in "xyz" if each != one and row[names.index(f"I{each}{each}{link}")] < 0]
    if not less:
        return f"inertia {one}{one} of link {link}"
    return f"inertia {' - '.join(2 * each for each in (one, *less))} of link {link}"
