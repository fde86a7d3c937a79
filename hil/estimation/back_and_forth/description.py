"""Residuals and restrictions of a solution, in the words of `model.yaml`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.back_and_forth.halves import FIRST, TORQUE, unknown_places
from hil.estimation.back_and_forth.result import Combination
from hil.estimation.back_and_forth.solution import friction_levels
from hil.estimation.free_motion.result import LOOSE
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.estimation.back_and_forth.halves import Halves
    from hil.estimation.back_and_forth.solution import Solution
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

FAINT = 1e-3
"""Coefficient in a sum, over its largest, below which a parameter is not stated."""


def residuals(
    robot: Robot, recordings: Sequence[Halves], solution: Solution
) -> tuple[Array, tuple[float | None, ...], float]:
    """Of all samples used: root mean squares, those over the torque's, and that of all axes.

    The first is NaN, the second None, for axes that were not moved.
    """
    left, torque, n = (np.zeros(robot.n_joints) for _ in range(3))
    for each in recordings:
        around = np.concatenate([
            [1.0, -1.0],
            -solution.x[unknown_places(robot, each.axis)],
            -friction_levels(robot, each, solution),
        ])  # fmt: skip
        left[each.axis] += max(float(around @ each.samples @ around), 0.0)
        torque[each.axis] += float(each.samples[TORQUE, TORQUE])
        n[each.axis] += each.n_samples
    moved = n > 0
    rms = np.where(moved, np.sqrt(left / np.maximum(n, 1.0)), np.nan)
    shares = np.sqrt(left / np.maximum(torque, 1e-300))
    relative = tuple(float(r) if m else None for r, m in zip(shares, moved, strict=True))
    return rms, relative, float(np.sqrt(left.sum() / torque.sum()))


def combinations(robot: Robot, solution: Solution) -> tuple[Combination, ...]:
    """What parameters stand for that were identified together with others."""
    names = base_parameters(robot).names
    return tuple(
        Combination(name=names[k], stands_for=" ".join([names[k], *map(_term, parts)]))
        for k in map(int, solution.excitation.kept)
        if (parts := [(names[j], share) for j, share in _noticeable(solution.excitation.parts(k))])
    )


def _noticeable(parts: Sequence[tuple[int, float]]) -> list[tuple[int, float]]:
    largest = max((1.0, *(abs(share) for _, share in parts)))
    return [(j, share) for j, share in parts if abs(share) > FAINT * largest]


def _term(part: tuple[str, float]) -> str:
    name, share = part
    sign, size = "-" if share < 0 else "+", abs(share)
    return f"{sign} {name}" if round(size, 3) == 1.0 else f"{sign} {size:.3g} {name}"


def remarks(robot: Robot, recordings: Sequence[Halves], solution: Solution) -> tuple[str, ...]:
    """What restricts the estimate."""
    return tuple(
        remark
        for each in (
            _still_axes(robot, recordings),
            _few_pairs(recordings),
            _moved_along(recordings),
            _loose(robot, recordings, solution),
        )
        for remark in each
    )


def _still_axes(robot: Robot, recordings: Sequence[Halves]) -> Iterator[str]:
    moved = {each.axis for each in recordings}
    never = [str(axis + 1) for axis in range(robot.n_joints) if axis not in moved]
    if never:
        yield (
            f"no strokes of axis {', '.join(never)}: its torque is not used, since static friction"
            " bears an unknown part of it; record strokes of it too"
        )


def _few_pairs(recordings: Sequence[Halves]) -> Iterator[str]:
    single = sum(each.n_pairs == 1 for each in recordings)
    if single:
        yield (
            f"{single} of {len(recordings)} recordings have one pair of strokes: what friction does"
            " between forth and back does not show there; two pairs or more show it"
        )


def _moved_along(recordings: Sequence[Halves]) -> Iterator[str]:
    moved = [each.id for each in recordings if each.also_moving]
    if moved:
        axes = sorted({axis + 1 for each in recordings for axis in each.also_moving})
        yield (
            f"beside the axis that is to move alone, axis {', '.join(map(str, axes))} moved in"
            f" {', '.join(moved)}; its motion is in the model's columns"
        )


def _loose(robot: Robot, recordings: Sequence[Halves], solution: Solution) -> Iterator[str]:
    names = base_parameters(robot).names
    squares = np.zeros((robot.n_joints, len(names)))
    torque, n = np.zeros(robot.n_joints), np.zeros(robot.n_joints)
    for each in recordings:
        own = np.diag(each.samples)
        squares[each.axis] += own[FIRST : FIRST + len(names)]
        torque[each.axis] += own[TORQUE]
        n[each.axis] += each.n_samples
    torque[n == 0] = np.inf
    error = np.sqrt(np.diag(solution.covariance)[: len(names)])
    worst = (error * np.sqrt(squares / torque[:, np.newaxis])).max(axis=0)
    loose = [names[k] for k in np.flatnonzero(worst > LOOSE)]
    if loose:
        yield (
            f"{', '.join(loose)}: a standard error is more than {100 * LOOSE:g} % of an axis's"
            " torque; record strokes at other positions of the axes"
        )
