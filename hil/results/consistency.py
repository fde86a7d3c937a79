"""Physically consistent robot nearest to a model: bodies, change of torques, and tables."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.consistent.nearest import SHAPES, nearest_robot
from hil.estimation.consistent.result import TorqueCost
from hil.estimation.free_motion.motion import filtered_motion
from hil.estimation.prior import Stated
from hil.estimation.signals import signals
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.model.frames import pseudo_inertia
from hil.planning.free_motion import FreeMotion
from hil.results.recorded_torque import processing_of
from hil.results.tables.parameters import NAMED
from hil.show.rounding import probability, signed, significant, unit
from hil.show.table import Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.estimation.consistent.conditions import BodyBounds
    from hil.estimation.consistent.result import ConsistentRobot, LinkBody
    from hil.model.robot import Robot
    from hil.results.model import Model
    from hil.runs.recording import Recorded
    from hil.show.table import Row


def find_consistent_robot(
    model: Model,
    recorded: Recorded = (),
    bounds: BodyBounds | None = None,
    likely: Array | None = None,
    likely_from: str = SHAPES,
) -> Model:
    """Add the nearest robot with physically possible bodies to a model.

    Parameters
    ----------
    recorded : iterable of (RecordedMotion, Recording)
        Motions over which torques are compared.
    bounds : BodyBounds, optional
    likely : ndarray, shape (n_joints, 10), optional
        Likely bodies; `likely_from` is their source. What the recordings leave open stays near
        them.

    Raises
    ------
    NotRealisable, InvalidValue
        No bodies meet the bounds.
    """
    p, covariance = model.values, model.covariance
    if likely is not None:
        none = np.zeros(len(model.robot.added_parameters))
        stated = Stated.create(model.robot, likely, none)
        p, covariance = stated.completed(p, stated.widened(covariance, model.combination))
    found = nearest_robot(model.robot, p, covariance, bounds, likely, likely_from)
    # up to 100 recordings of about 200 samples, enough for an rms
    runs, most = 100, 200
    n, products = 0, 0.0
    for motion, recording in recorded:
        try:
            if isinstance(motion, FreeMotion):
                filtered = filtered_motion(recording, processing_of(model))
                q, qd, qdd = filtered.q, filtered.qd, filtered.qdd
            else:
                s = signals(recording)
                q, qd, qdd = (s.smoothed(x)[s.valid] for x in (s.q, s.qd, s.qdd))
        except NotEnoughData:
            continue
        if not len(q):
            continue
        some = slice(None, None, max(1, len(q) // most))
        A = regressor(model.robot, q[some], qd[some], qdd[some])
        products = products + np.einsum("nji,njk->jik", A, A, optimize=True)
        n, runs = n + len(A), runs - 1
        if not runs:
            break
    change = found.p - model.values
    costs = tuple(
        TorqueCost(
            change=_root(change @ G @ change),
            standard_error=_root(np.sum(G * model.covariance)),
            torque=_root(model.values @ G @ model.values),
        )
        for G in (np.array(products) / n if n else ())
    )
    return replace(model, consistent=found.model_copy(update={"torque": costs}))


def _root(square: float) -> float:
    return float(np.sqrt(max(float(square), 0.0)))


def tables(robot: Robot, found: ConsistentRobot) -> tuple[Table, ...]:
    """Return the tables of bodies, of changed parameters, and of changed torques."""
    return tuple(each(robot, found) for each in (bodies, changed_parameters, torque_costs))


def bodies(robot: Robot, found: ConsistentRobot) -> Table:
    """Return a table of mass, centre of mass and radii of gyration of every link."""
    binding = {each.name: each.distance_without for each in found.binding}
    return table(
        "Nearest physically consistent robot",
        ("link", *figures("mass, kg", "centre, m", "spread, mm", "without")),
        (_link(number, body, binding) for number, body in enumerate(found.links, start=1)),
        "Links whose base parameters are nearest to the estimate in the metric of its "
        "covariance. Spread: root mean square distance of the mass from its centre, along the "
        "three principal axes. Without: distance without the condition on this link, if active. "
        f"Parameters without effect on torques, such as some masses, come from {found.likely}.",
        tuple(statements(robot, found)),
    )


def changed_parameters(robot: Robot, found: ConsistentRobot, least: float = 0.01) -> Table:
    """Return a table of base parameters changed by at least `least` standard errors."""
    base = base_parameters(robot)
    each = zip(base.names, base.meanings, found.values, found.change, base.units, strict=True)
    return table(
        "Base parameters changed by physical consistency",
        (*NAMED, *figures("value", "change, std. errors"), "unit"),
        (
            (
                name,
                meaning,
                signed(significant(value, 5)),
                f"{change:+.1f}".replace("-", "−"),
                unit(of),
            )
            for name, meaning, value, change, of in each
            if abs(change) > least
        ),
    )


def torque_costs(robot: Robot, found: ConsistentRobot) -> Table:
    """Return a table of the change of torques caused by the change of parameters."""
    costs = enumerate(found.torque if found.binding else ())
    return table(
        "Change of torque by physical consistency",
        ("axis", *figures("change", "std. error", "torque"), "unit"),
        (
            (
                str(axis + 1),
                significant(each.change, 2),
                significant(each.standard_error, 2),
                significant(each.torque, 3),
                robot.torque_unit(axis),
            )
            for axis, each in costs
        ),
        "Root mean squares over the run's motions: change of the rigid-body torques, standard "
        "error of their prediction by the estimate, and the torques themselves.",
    )


def _link(number: int, body: LinkBody, binding: dict[str, float]) -> Row:
    J = pseudo_inertia(np.array(body.parameters))
    mass, centre = J[3, 3], J[:3, 3] / J[3, 3]
    spread = np.sqrt(np.linalg.eigvalsh(J[:3, :3] / mass - np.outer(centre, centre)).clip(0.0))
    without = binding.get(f"link {number}")
    return (
        str(number),
        significant(float(mass), 3),
        " ".join(signed(f"{x:.3f}") for x in centre),
        " ".join(significant(1e3 * float(x), 3) for x in spread),
        "" if without is None else significant(without, 3),
    )


def statements(robot: Robot, found: ConsistentRobot) -> Iterator[str]:
    """Yield sentences on distance, binding conditions and changed torques."""
    if not found.binding:
        yield (
            "the identified base parameters are physically consistent: distance 0, no active "
            "condition"
        )
    else:
        yield from _distance(robot, found)
    if found.open_masses:
        links = ", ".join(map(str, found.open_masses))
        yield (
            f"masses of links {links} are undetermined by torques: masses, centres and inertias "
            f"of these links depend on {found.likely}"
        )
    if found.binding and found.contradicted:
        yield (
            "the data contradict physical consistency: look for effects missing in the model "
            "(hil diagnose) and for wrong torque constants and rotor inertias before an export"
        )


def _distance(robot: Robot, found: ConsistentRobot) -> Iterator[str]:
    titles, order = base_parameters(robot).titles, np.argsort(-np.abs(found.change))[:3]
    binding = [
        f"{each.name} (distance without it {each.distance_without:.4g})" for each in found.binding
    ]
    moved = [f"{titles[k]} by {found.change[k]:+.3g}" for k in order if abs(found.change[k]) > 0.1]
    costs = [
        f"axis {axis + 1} {each.change:.2g} {robot.torque_unit(axis)} (standard error"
        f" {each.standard_error:.2g}, torque {each.torque:.3g})"
        for axis, each in enumerate(found.torque)
    ]
    yield (
        f"nearest physically consistent robot: distance {found.distance:.4g}, a chi-square of at "
        f"most {found.degrees_of_freedom} degrees of freedom, p {probability(found.p_value)}; "
        f"{found.distance_complete:.4g} with all link parameters in the robot file"
    )
    yield f"active conditions: {', '.join(binding)}"
    if moved:
        yield f"moved most, in standard errors: {', '.join(moved)}"
    if costs:
        yield f"torques change, rms over the run's motions: {'; '.join(costs)}"
