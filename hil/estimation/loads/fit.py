"""Fit of a load, from runs without and with the load: up to ten additional columns (`joint`).

A change dp of all base parameters in place of the load tests whether anything but a rigid load
changed: the part of dp that no load explains should not exceed its covariance (Hotelling's T^2).
The same test of the load itself shows whether the load exceeds its error. A short run does not
determine dp.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg, special

from hil.estimation.intervals import MANY
from hil.estimation.loads.figures import Chance, Load
from hil.estimation.loads.joint import JointRuns, Runs, Terms
from hil.least_squares.solving import inverse
from hil.model.load import MASS, load_columns
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array
    from hil.estimation.loads.evidence import Evidence
    from hil.least_squares.regression import Covariance
    from hil.model.robot import Robot

PASSES = 2
"""Number of passes: friction of the transmitted torque includes the load of the previous pass."""


def fit_load(
    robot: Robot,
    bare: Sequence[Evidence],
    with_load: Callable[[Array], Sequence[Evidence]],
    mass: float | None = None,
    *,
    gains: bool = False,
    covariance: Covariance = "CR2",
) -> Load:
    """Fit a load to runs without and with the load.

    Parameters
    ----------
    bare : sequence of Evidence
        Evidence of runs without the load, one of each kind.
    with_load : callable
        Function of the load's change of the base parameters: evidence of runs with the load;
        friction may depend on this change.
    mass : float, optional
        Known mass of the load, fixed in the fit [kg].
    gains : bool
        True to estimate the gains of all axes too, for a known mass.
    covariance : str
        Kind of covariance (`hil.least_squares.regression`).

    Raises
    ------
    NoLoad
        The robot file states no parameter of the last link affected by a load.
    """
    load = load_columns(robot)
    known, free = np.zeros(10), load.free
    if mass is not None:
        known[MASS], free = mass, load.massless_columns
    terms = Terms(load.K @ known, load.K @ free, "load")
    change = terms.known
    before: list[Evidence] = []
    for _ in range(PASSES):
        runs = Runs(bare, with_load(change))
        if list(map(id, runs.loaded)) != list(map(id, before)):
            before = list(runs.loaded)
            unknown = {axis for run in runs.every for axis in run.unknown}
            wanted = list(range(robot.n_joints)) if gains else sorted(unknown)
            joint = _determined(robot, runs, terms, mass, wanted)
            change = terms.known + terms.columns @ joint.values("load")
    return _described(joint, wanted, mass, known, free, covariance)


def _described(
    joint: JointRuns,
    wanted: list[int],
    mass: float | None,
    known: Array,
    free: Array,
    covariance: Covariance,
) -> Load:
    load = load_columns(joint.robot)
    base, at, gains = (joint.places(kind) for kind in ("base", "load", "gain"))
    V, degrees = joint.uncertainty(covariance)
    errors = np.zeros(joint.robot.n_joints)
    errors[wanted] = np.inf
    errors[joint.axes] = np.sqrt(np.diag(V)[gains])
    lost = joint.undetermined("load")
    seen = np.where(lost, 0.0, 1.0)
    of_base = V[np.ix_(base, base)]
    V = V[np.ix_(at, at)] * np.outer(seen, seen)
    is_open = zip(LINK_PARAMETERS, np.abs(free) @ lost > 0, strict=True)
    return Load(
        p=joint.values("base"),
        p_covariance=of_base,
        p_degrees=np.maximum(degrees[base], 1.0),
        phi=known + free @ (seen * joint.values("load")),
        covariance=free @ V @ free.T,
        degrees=np.where(free.any(axis=1), np.maximum(np.abs(free) @ degrees[at], 1.0), MANY),
        stated_mass=mass,
        unseen=load.absent,
        unidentifiable=tuple(name for name, each in is_open if each or name in load.dark),
        gains=joint.gains[-1],
        gain_errors=errors,
        present=_test(joint.values("load"), V, joint.n_groups),
        rigid=_rigid(joint, covariance),
        misfit=joint.misfit(),
    )


def _determined(
    robot: Robot, runs: Runs, terms: Terms, mass: float | None, wanted: Sequence[int]
) -> JointRuns:
    """Solve the regression with the determined gains among the wanted gains."""
    start, kinds = np.array([run.gains for run in runs.every]), [run.kind for run in runs.every]
    for kind in dict.fromkeys(kinds):
        alike = np.array([each == kind for each in kinds])
        start[alike] = np.exp(np.mean(np.log(start[alike]), axis=0))
    if mass is not None and wanted and any(run.scale_open for run in runs.every):
        # one gain was fixed at an arbitrary value and is now scaled by the known mass
        load = load_columns(robot)
        whole = Terms(np.zeros(len(load.K)), load.shown, "load")
        found = float((load.free @ JointRuns(robot, runs, whole, (), start).values("load"))[MASS])
        start *= mass / found if found > 0 else 1.0
    joint = JointRuns(robot, runs, terms, wanted, start)
    lost = joint.undetermined("gain")
    if not lost.any():
        return joint
    return JointRuns(robot, runs, terms, np.array(wanted)[~lost].tolist(), start)


def _rigid(joint: JointRuns, covariance: Covariance) -> Chance:
    """Test a free change of the base parameters against the changes by a rigid load."""
    known, columns, _ = joint.terms
    any_change = Terms(known, np.eye(len(known)), "change")
    free = JointRuns(joint.robot, joint.runs, any_change, (), joint.gains)
    if free.undetermined("change").any():
        return Chance(0.0, 0, 1.0)
    at, other = free.places("change"), linalg.null_space(columns.T)
    V = free.uncertainty(covariance)[0][np.ix_(at, at)]
    return _test(other.T @ free.values("change"), other.T @ V @ other, free.n_groups)


def _test(x: Array, V: Array, groups: int) -> Chance:
    """Test x = 0, with the covariance V estimated from a number of groups of samples."""
    shown = np.diag(V) > 0
    x, V, k = x[shown], V[np.ix_(shown, shown)], int(shown.sum())
    if not k:
        return Chance(0.0, 0, 1.0)
    square = float(x @ inverse(V) @ x)
    rest = max(groups - k, 1)
    p_value = float(special.fdtrc(k, rest, square * rest / (k * max(groups - 1, 1))))
    return Chance(square, k, p_value)
