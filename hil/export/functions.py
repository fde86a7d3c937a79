"""The functions that a model is exported as, in whatever language: names, arguments, results.

They are those of `hil.results.model.Model`, one sample at a time, and give the same numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hil.export import drives
from hil.export.expressions import Expression, Graph
from hil.export.rigid_bodies import joints, rigid_bodies
from hil.model.base_parameters import base_parameters
from hil.results.warmth import known_warmth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.export.rigid_bodies import Scalar
    from hil.results.model import Model

Vector = list[Expression]


class Function(NamedTuple):
    """One function.

    Attributes
    ----------
    name : str
    purpose : str
        A sentence.
    arguments : dict of str to str
        Their names and what they are; arrays of one value a joint.
    results : tuple of Expression
        One a joint, or the rows of a square matrix one after the other.
    """

    name: str
    purpose: str
    arguments: dict[str, str]
    results: tuple[Expression, ...]


POSITION, VELOCITY, ACCELERATION = "positions", "velocities", "accelerations"
WARMTH = "warmth of the gears"
WEIGHTLESS = (0.0, 0.0, 0.0)


def functions(model: Model) -> tuple[Function, ...]:
    """All functions that the model has enough known of."""
    made = (
        gravity, rigid, mass_matrix, friction, friction_at_warmth, warmth_rate, torque, current,
    )  # fmt: skip
    return tuple(found for each in made if (found := each(model)) is not None)


def gravity(model: Model) -> Function:
    """Gravity torques g(q), springs among them."""
    graph = Graph()
    q = _symbols(graph, model, "q")
    still = [0.0] * len(q)
    found = _rigid(graph, model, q, still, still)
    purpose = "Gravity torques g(q), with springs where there are any."
    return _function(graph, "gravity", purpose, {"q": POSITION}, found)


def rigid(model: Model) -> Function:
    """Torques of the rigid bodies."""
    graph = Graph()
    q, qd, qdd = (_symbols(graph, model, name) for name in ("q", "qd", "qdd"))
    purpose = "Torques of the rigid bodies: M(q) qdd + c(q, qd) + g(q)."
    arguments = {"q": POSITION, "qd": VELOCITY, "qdd": ACCELERATION}
    found = _rigid(graph, model, q, qd, qdd)
    return _function(graph, "rigid_bodies", purpose, arguments, found)


def mass_matrix(model: Model) -> Function:
    """Mass matrix of the rigid bodies, column by column."""
    graph = Graph()
    q, n = _symbols(graph, model, "q"), model.robot.n_joints
    still, chain, bodies = [0.0] * n, joints(graph, model.robot, q), _bodies(model)
    constant = drives.identified_inertia(model).tolist()
    columns = []
    for j in range(n):
        unit = [float(k == j) for k in range(n)]
        found = rigid_bodies(chain, bodies, still, unit, WEIGHTLESS)
        columns.append([value + constant[i][j] for i, value in enumerate(found)])
    rows = [columns[max(i, j)][min(i, j)] for i in range(n) for j in range(n)]
    purpose = "Mass matrix M(q) of the rigid bodies, row by row; motors add to its diagonal."
    return _function(graph, "mass_matrix", purpose, {"q": POSITION}, rows)


def friction(model: Model) -> Function | None:
    """Friction, where the model has a law of it."""
    if not _has_friction(model):
        return None
    graph = Graph()
    q, qd, load = (_symbols(graph, model, name) for name in ("q", "qd", "load"))
    purpose = f"Torques of friction{_of_known(model)}; at rest their offset alone."
    arguments = {"q": POSITION, "qd": VELOCITY, "load": "torques of the rigid bodies"}
    return _function(graph, "friction", purpose, arguments, _friction(graph, model, q, qd, load))


def friction_at_warmth(model: Model) -> Function | None:
    """Friction at a stated warmth, where the model has a law of it and knows of any warmth."""
    if not _has_friction(model) or not any(known_warmth(model)):
        return None
    graph = Graph()
    q, qd, load, warmth = (_symbols(graph, model, each) for each in ("q", "qd", "load", "warmth"))
    purpose = "Torques of friction at a warmth of the gears from 0 cold to 1 warm."
    arguments = {"q": POSITION, "qd": VELOCITY, "load": "torques of the rigid bodies"}
    found = _friction(graph, model, q, qd, load, warmth)
    return _function(graph, "friction_at_warmth", purpose, arguments | {"warmth": WARMTH}, found)


def warmth_rate(model: Model) -> Function | None:
    """How warmth changes in time, where the model knows of any."""
    if not _has_friction(model) or not any(known_warmth(model)):
        return None
    graph = Graph()
    qd, warmth = _symbols(graph, model, "qd"), _symbols(graph, model, "warmth")
    assert model.friction_law is not None  # noqa: S101 - asked for before
    found = drives.warmth_rate(graph, model.friction_law, qd, warmth)
    purpose = "Change of the warmth in time [1/s]; 0 where it is not identified. Begin at 0, cold."
    return _function(graph, "warmth_rate", purpose, {"qd": VELOCITY, "warmth": WARMTH}, found)


def torque(model: Model) -> Function:
    """What the drives have to give: all parts that the model has."""
    graph = Graph()
    q, qd, qdd = (_symbols(graph, model, name) for name in ("q", "qd", "qdd"))
    parts = "rigid bodies, motors"
    parts += f" and friction{_of_known(model)}" if _has_friction(model) else "; no friction"
    load = [graph.lifted(each) for each in _rigid(graph, model, q, qd, qdd)]
    reflected = model.robot.reflected_inertia.tolist()
    found = [tau + inertia * dv for tau, inertia, dv in zip(load, reflected, qdd, strict=True)]
    if _has_friction(model):
        rub = _friction(graph, model, q, qd, load)
        found = [tau + each for tau, each in zip(found, rub, strict=True)]
    arguments = {"q": POSITION, "qd": VELOCITY, "qdd": ACCELERATION}
    return _function(graph, "torque", f"Torques of the drives: {parts}.", arguments, found)


def current(model: Model) -> Function | None:
    """Motor currents, where gear ratios and torque constants are known."""
    graph = Graph()
    tau = _symbols(graph, model, "tau")
    found = drives.current(model.robot, tau)
    if found is None:
        return None
    purpose = "Motor currents [A] for torques of the drives."
    return _function(graph, "current", purpose, {"tau": "torques of the drives"}, found)


def _rigid(
    graph: Graph, model: Model, q: Vector, qd: Sequence[Scalar], qdd: Sequence[Scalar]
) -> list[Scalar]:
    """Torques of the rigid bodies with what was identified beside them."""
    robot = model.robot
    chain, bodies = joints(graph, robot, q), _bodies(model)
    found = rigid_bodies(chain, bodies, qd, qdd, robot.gravity.tolist())
    constant, bent = drives.identified_inertia(model).tolist(), drives.springs(graph, model, q)
    return [
        tau + bent[i] + sum((H * dv for H, dv in zip(constant[i], qdd, strict=True)), start=0.0)
        for i, tau in enumerate(found)
    ]


def _friction(
    graph: Graph, model: Model, q: Vector, qd: Vector, load: Vector, warmth: Vector | None = None
) -> list[Scalar]:
    assert model.friction_law is not None  # noqa: S101 - asked for before
    return drives.friction(graph, model.robot, model.friction_law, q, qd, load, warmth)


def _has_friction(model: Model) -> bool:
    return len(model.axes_without_friction) < model.robot.n_joints


def _of_known(model: Model) -> str:
    lack = ", ".join(map(str, model.axes_without_friction))
    return f", which is unknown and left out of axis {lack}" if lack else ""


def _bodies(model: Model) -> list[list[float]]:
    """Ten parameters of each link that act as the base parameters do."""
    n = model.robot.n_joints
    standard = base_parameters(model.robot).placement @ model.values
    bodies: list[list[float]] = standard[: 10 * n].reshape(n, 10).tolist()
    return bodies


def _symbols(graph: Graph, model: Model, name: str) -> Vector:
    return [graph.symbol(f"{name}[{k}]") for k in range(model.robot.n_joints)]


def _function(
    graph: Graph, name: str, purpose: str, arguments: dict[str, str], results: Sequence[Scalar]
) -> Function:
    return Function(name, purpose, arguments, tuple(graph.lifted(each) for each in results))
