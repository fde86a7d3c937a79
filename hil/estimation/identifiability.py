"""Check that measurements identify every base parameter before an estimate is accepted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotIdentifiable
from hil.least_squares.solving import IDENTIFIABLE, undetermined, undetermined_beside
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import GROUPS
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.prediction.identifiability import eliminate_others

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.local_fits import LocalFit
    from hil.least_squares.regression import Regression
    from hil.model.robot import Robot

BOUND = f"the condition number of their scaled columns exceeds {IDENTIFIABLE**-0.5:.0e}"
"""Reason for parameters not being identified."""


def conditions(
    robot: Robot, fits: Sequence[LocalFit], *, together: bool = True
) -> dict[str, float]:
    """Return the condition number of every measured group; infinite for a rank defect.

    Gravity parameters not determined by gravity alone are judged with the elements of M(q), unless
    `together` is False.
    """
    base = base_parameters(robot)
    condition: dict[str, float] = {}
    for group in GROUPS:
        columns = list(base.groups[group])
        rows = _rows(robot, fits, group)
        if not (columns and len(rows)):
            continue
        hidden = together and base.dependencies.hidden[columns].any()
        N, size = rows.T @ rows, None
        if hidden:
            # gravity elements of an axis are one kind, elements of M(q) the other
            axes = [f.axis if ELEMENT_KINDS[f.kind].symbol == "g" else -1 for f in fits]
            every = np.array([f.row / robot.torque_limit[f.axis] for f in fits])
            N, size = eliminate_others(every, np.array(axes), columns)
        lost = undetermined(N, IDENTIFIABLE, size).any()
        condition[group] = np.inf if lost else float(np.sqrt(np.linalg.cond(N)))
    return condition


def _rows(robot: Robot, fits: Sequence[LocalFit], group: str) -> Array:
    """Return the observation matrix of a group, rows weighted by eq. (16)."""
    columns = list(base_parameters(robot).groups[group])
    kinds = _kinds(group)
    rows = [f.row[columns] / robot.torque_limit[f.axis] for f in fits if f.kind in kinds]
    return np.array(rows).reshape(len(rows), len(columns))


def _kinds(group: str) -> list[str]:
    return [name for name, kind in ELEMENT_KINDS.items() if kind.group == group]


def require_all_groups(robot: Robot, fits: Sequence[LocalFit], condition: dict[str, float]) -> None:
    """Raise an error for groups not identified by the corresponding measurements.

    Raises
    ------
    NotIdentifiable
    """
    base = base_parameters(robot)
    for group in GROUPS:
        columns = base.groups[group]
        if columns and not np.isfinite(condition.get(group, np.inf)):
            names, found = ", ".join(base.names[c] for c in columns), len(_rows(robot, fits, group))
            why = "" if found < len(columns) else f": {BOUND}"
            raise NotIdentifiable(
                f"{found} usable {' and '.join(_kinds(group))} measurements do not identify "
                f"{names}{why}; measure more configurations of this kind (see: hil dry-run), or "
                "finish the run with --resume"
            )


def require_rank(robot: Robot, regression: Regression, what: str) -> None:
    """Raise an error for base parameters not determined by the recordings together.

    Parameters
    ----------
    regression : Regression
        Regression with the base parameters as first unknowns.
    what : str
        Description of the recordings for the message.

    Raises
    ------
    NotIdentifiable
    """
    names = base_parameters(robot).names
    lost = undetermined_beside(regression.normal.information, len(names))
    if lost.any():
        listed = ", ".join(name for name, each in zip(names, lost, strict=True) if each)
        raise NotIdentifiable(
            f"{what} do not identify {listed}: {BOUND}; measure more configurations (see: hil"
            " dry-run), or finish the run with --resume"
        )
