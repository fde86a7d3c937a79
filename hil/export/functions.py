"""The functions that a model is exported as, in whatever language: names, arguments, results.

They are those of `hil.results.model.Model`, one sample at a time, and give the same numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hil.export import drives
from hil.export.expressions import Expression, Graph
from hil.export.rigid_bodies import joints
from hil.model.base_parameters import base_parameters
from hil.model.newton_euler import rigid_bodies
from hil.results.samples import known_warmth

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


ARGUMENTS = {
    "q": "positions",
    "qd": "velocities",
    "qdd": "accelerations",
    "load": "torques of the rigid bodies",
    "warmth": "warmth of the gears",
    "tau": "torques of the drives",
}
WEIGHTLESS = (0.0, 0.0, 0.0)


def functions(model: Model) -> tuple[Function, ...]:
    """All functions that the model has enough known of."""
    has_friction = len(model.axes_without_friction) < model.robot.n_joints
    lack = ", ".join(map(str, model.axes_without_friction))
    known = f", which is unknown and left out of axis {lack}" if lack else ""
    parts = f"rigid bodies, motors{f' and friction{known}' if has_friction else '; no friction'}"
    found = [
        _made(model, "gravity", "Gravity torques g(q), with springs where there are any.", "q"),
        rigid(model),
        _made(
            model, "mass_matrix",
            "Mass matrix M(q) of the rigid bodies, row by row; motors add to its diagonal.", "q",
        ),
    ]  # fmt: skip
    if has_friction:
        purpose = f"Torques of friction{known}; at rest their offset alone."
        found.append(_made(model, "friction", purpose, "q", "qd", "load"))
    if has_friction and any(known_warmth(model)):
        purpose = "Torques of friction at a warmth of the gears from 0 cold to 1 warm."
        found.append(_made(model, "friction_at_warmth", purpose, "q", "qd", "load", "warmth"))
        purpose = "Change of the warmth in time [1/s]; 0 where it is not identified. Begin at 0,"
        found.append(_made(model, "warmth_rate", f"{purpose} cold.", "qd", "warmth"))
    found.append(_made(model, "torque", f"Torques of the drives: {parts}.", "q", "qd", "qdd"))
    if drives.shares_of_current(model.robot) is not None:
        found.append(
            _made(model, "current", "Motor currents [A] for torques of the drives.", "tau")
        )
    return tuple(found)


def rigid(model: Model) -> Function:
    """Torques of the rigid bodies."""
    purpose = "Torques of the rigid bodies: M(q) qdd + c(q, qd) + g(q)."
    return _made(model, "rigid_bodies", purpose, "q", "qd", "qdd")


def _made(model: Model, name: str, purpose: str, *arguments: str) -> Function:
    """Run the equations of a function of `_Equations` with symbols in place of numbers."""
    graph, joint_numbers = Graph(), range(model.robot.n_joints)
    symbols = [[graph.symbol(f"{each}[{k}]") for k in joint_numbers] for each in arguments]
    results = getattr(_Equations(graph, model), name)(*symbols)
    stated = {each: ARGUMENTS[each] for each in arguments}
    return Function(name, purpose, stated, tuple(graph.lifted(each) for each in results))


class _Equations:
    """The equations of each function, by its name; arguments as in `ARGUMENTS`."""

    def __init__(self, graph: Graph, model: Model) -> None:
        n = model.robot.n_joints
        standard = base_parameters(model.robot).placement @ model.values
        self._graph, self._model, self._robot = graph, model, model.robot
        # ten parameters of each link that act as the base parameters do
        self._bodies: list[list[float]] = standard[: 10 * n].reshape(n, 10).tolist()
        self._constant = drives.identified_inertia(model).tolist()

    def gravity(self, q: Vector) -> list[Scalar]:
        still = [0.0] * len(q)
        return self.rigid_bodies(q, still, still)

    def rigid_bodies(self, q: Vector, qd: Sequence[Scalar], qdd: Sequence[Scalar]) -> list[Scalar]:
        """With what was identified beside them."""
        chain = joints(self._graph, self._robot, q)
        found = rigid_bodies(chain, self._bodies, qd, qdd, self._robot.gravity.tolist())
        bent = drives.springs(self._graph, self._model, q)
        return [
            tau + spring + sum((H * dv for H, dv in zip(row, qdd, strict=True)), start=0.0)
            for tau, spring, row in zip(found, bent, self._constant, strict=True)
        ]

    def mass_matrix(self, q: Vector) -> list[Scalar]:
        """Column by column."""
        n = len(q)
        still, chain = [0.0] * n, joints(self._graph, self._robot, q)
        columns = []
        for j in range(n):
            unit = [float(k == j) for k in range(n)]
            found = rigid_bodies(chain, self._bodies, still, unit, WEIGHTLESS)
            columns.append([value + self._constant[i][j] for i, value in enumerate(found)])
        return [columns[max(i, j)][min(i, j)] for i in range(n) for j in range(n)]

    def friction(
        self, q: Vector, qd: Vector, load: Vector, warmth: Vector | None = None
    ) -> list[Scalar]:
        law = self._model.friction_law
        assert law is not None  # noqa: S101 - asked for before
        return drives.friction(self._graph, self._robot, law, q, qd, load, warmth)

    friction_at_warmth = friction

    def warmth_rate(self, qd: Vector, warmth: Vector) -> list[Scalar]:
        law = self._model.friction_law
        assert law is not None  # noqa: S101 - asked for before
        return drives.warmth_rate(self._graph, law, qd, warmth)

    def torque(self, q: Vector, qd: Vector, qdd: Vector) -> list[Scalar]:
        """All parts that the model has."""
        load = [self._graph.lifted(each) for each in self.rigid_bodies(q, qd, qdd)]
        reflected = self._robot.reflected_inertia.tolist()
        found = [tau + inertia * dv for tau, inertia, dv in zip(load, reflected, qdd, strict=True)]
        if len(self._model.axes_without_friction) == len(q):
            return list(found)
        rub = self.friction(q, qd, load)
        return [tau + each for tau, each in zip(found, rub, strict=True)]

    def current(self, tau: Vector) -> list[Scalar]:
        rows = drives.shares_of_current(self._robot) or []
        return [sum(k * each for k, each in zip(row, tau, strict=True)) for row in rows]
