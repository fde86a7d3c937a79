"""Values of a user's file before and after an update, with intervals and their evidence.

The file is knowledge beside the recordings, each value within its whole size, and both are combined
by Bayes' rule (`hil.estimation.prior.Stated`). With standard parameters phi = phi_0 + R u, u has
the covariance 1 before, and

    C = 1 - R' K' (K R R' K' + V)^-1 K R

after the recordings, for base parameters K phi with the covariance V. A value of the file with the
gradient g by u has the variance g' C g, and 1 - g' C g / g' g is the share of its uncertainty
removed by the recordings. With V = 0 it is the share that any motion could remove: torques at a
fixed base never show the mass of most links alone.
"""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from scipy import special

from hil.export.mjcf_file import FULL
from hil.export.simulated_robot import about_centre, placed
from hil.model.frames import parameter_map
from hil.show.rounding import count

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.estimation.prior import Stated
    from hil.export.simulated_robot import SimulatedJoint, SimulatedRobot
    from hil.model.readers.urdf import UrdfChain
    from hil.results.model import Model

SHOWN = 0.5
"""Least removed share of the variance of a value that counts as shown by the recordings."""
NORMAL = float(special.ndtri(0.975))
"""Half-width of a 95 % interval in standard deviations."""
SMALL = 1e-6
"""Step of difference quotients, relative to the size of the parameter."""
OF_LINK = (
    ("mass", "kg"),
    *((f"centre {axis}", "m") for axis in "xyz"),
    *((f"inertia {'xyz'[i]}{'xyz'[j]}", "kg m^2") for i, j in FULL),
)
SIGNED = {"centre x", "centre y", "centre z", "inertia xy", "inertia xz", "inertia yz"}
"""Quantities of either sign."""


class Patched(Protocol):
    """User's file with the chain of a robot."""

    path: Path
    is_mjcf: bool

    @property
    def chain(self) -> UrdfChain:
        """Joints of the robot."""

    def bodies(self) -> Array:
        """Return the bodies in the file, shape (n_joints, 10), in the robot's frames."""

    def rotors(self) -> Array:
        """Return the rotor inertias in the file, shape (n_joints,)."""

    def friction(self) -> Array:
        """Return Coulomb and viscous friction in the file, shape (n_joints, 2)."""

    def patch(self, k: int, joint: SimulatedJoint) -> Iterator[str]:
        """Write a joint and its link; yield the names of unchanged quantities."""

    def remarks(self, model: Model, robot: SimulatedRobot) -> Iterator[str]:
        """Yield remarks: quantities missing in the format, or to be set separately."""

    def files(self) -> dict[str, str]:
        """Return the contents of changed files, by paths from the main file's folder."""


class Value(NamedTuple):
    """Value of a link or joint, with its 95 % interval after the update, if known.

    Attributes
    ----------
    shown, possible : float
        Share of the uncertainty removed by the recordings, and by the best motion.
    """

    of: str
    quantity: str
    unit: str
    file: float
    model: float
    low: float
    high: float
    shown: float
    possible: float


def values_of(model: Model, given: Patched, known: Stated, robot: SimulatedRobot) -> list[Value]:
    """Return the values of all links and joints; `robot` has those after the update.

    A link includes what is welded to it. What is unknown of friction is left out.
    """
    names, bodies, rotors = model.robot.added_parameters, given.bodies(), given.rotors()
    open_ = known.widened(model.covariance, model.combination)
    after = np.eye(known.root.shape[1]) - known.gain(open_) @ known.shown
    never = np.eye(len(after)) - np.linalg.pinv(known.shown, 1e-9) @ known.shown
    found = []

    def add(of: str, quantity: tuple[str, str], file: float, value: float, g: Array) -> None:
        size = max(float(g @ g), 1e-300)
        left, least = (max(float(g @ C @ g), 0.0) for C in (after, never))
        width = NORMAL * float(np.sqrt(left))
        shares = 1.0 - left / size, 1.0 - least / size
        found.append(
            Value(of, *quantity, file, value, *_interval(quantity[0], value, width), *shares)
        )

    for k, (joint, place) in enumerate(
        zip(robot.joints, placed(model.robot, given.chain), strict=True)
    ):
        to_link, own = parameter_map(place.mdh), known.root[10 * k : 10 * k + 10]
        inertia = float(joint.body[[0, 3, 5]].max())
        kinds = inertia, np.sqrt(inertia * joint.mass), joint.mass
        quotients = []
        for step in np.diag(SMALL * np.repeat(kinds, (6, 3, 1))):
            forth, back = (body_values(joint.body + side * step) for side in (1.0, -1.0))
            quotients.append((forth - back) / (2.0 * step.max()))
        gradients = np.transpose(quotients) @ to_link @ own
        stated, now = body_values(to_link @ bodies[k]), body_values(joint.body)
        for quantity, *each in zip(OF_LINK, stated.tolist(), now.tolist(), gradients, strict=True):
            add(joint.link, quantity, *each)
        unit, rotor = ("kg m^2" if joint.revolute else "kg"), f"Ia{k + 1}"
        if given.is_mjcf and rotor in names:
            g = known.root[bodies.size + names.index(rotor)]
            add(joint.name, ("armature", unit), float(rotors[k]), joint.armature, g)
        found += _friction_values(model, given, k, joint)
    return found


def _friction_values(
    model: Model, given: Patched, k: int, joint: SimulatedJoint
) -> Iterator[Value]:
    """Yield dry friction and damping of a joint: two terms in place of its law.

    The misfit of both counts as a standard deviation. Damping with a further term has no interval.
    """
    friction, law = joint.friction, model.friction_law.axes[k]
    if friction is None or law is None:
        return
    coulomb, viscous, further, misfit = friction.coulomb, friction.viscous, 0.0, friction.misfit
    if given.is_mjcf:
        coulomb, viscous, further, _, misfit = friction.coasting
    dry, damping = given.friction()[k].tolist()
    of_coulomb, of_viscous = (
        law.plain[term].standard_error if term in law.plain else np.nan
        for term in ("Coulomb", "viscous")
    )
    torque, position = model.robot.torque_unit(k), model.robot.position_unit(k)
    name, fastest = "frictionloss" if given.is_mjcf else "friction", friction.speeds[-1]
    for quantity, unit, before, value, error in (
        (name, torque, dry, coulomb, np.hypot(of_coulomb, misfit)),
        (
            "damping", f"{torque} s/{position}", damping, viscous,
            np.nan if further else np.hypot(of_viscous, misfit / fastest),
        ),
    ):  # fmt: skip
        ends = _interval(quantity, value, NORMAL * float(error))
        yield Value(joint.name, quantity, unit, before, value, *ends, 1.0, 1.0)


def _interval(quantity: str, value: float, width: float) -> tuple[float, float]:
    """Return the ends of an interval, none negative where no value is."""
    least = -np.inf if quantity in SIGNED else 0.0
    return max(value - width, least), value + width


def body_values(body: Array) -> Array:
    """Return mass, centre and inertia about it of a body (10,), in the order of `OF_LINK`."""
    inertia = about_centre(body)
    return np.array([body[9], *(body[6:9] / body[9]), *(inertia[at] for at in FULL)])


def table_of(values: Sequence[Value]) -> str:
    """Return values as CSV."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    shares = "shown by recordings, %", "by any motion, %"
    rows.writerow(["of", "quantity", "unit", "file", "model", "low 95 %", "high 95 %", *shares])
    for each in values:
        numbers = (f"{x:.6g}" if np.isfinite(x) else "" for x in each[3:7])
        rows.writerow([*each[:3], *numbers, *(round(100.0 * x) for x in each[7:])])
    return text.getvalue()


def remarks_on(values: Sequence[Value], name: str, at_rest: Sequence[int]) -> Iterator[str]:
    """Yield remarks on values shown by the recordings, by another motion only, and by none.

    Parameters
    ----------
    name : str
        File of the values.
    at_rest : sequence of int
        Axes at rest in all recordings, from 1.
    """
    shown = [each for each in values if each.shown >= SHOWN]
    yield (
        f"{name}: values before and after, with 95 % intervals; the recordings show "
        f"{len(shown)} of {count(len(values), 'value')}"
    )
    if lacking := [each for each in values if each.shown < SHOWN <= each.possible]:
        moved = "that is faster or reaches further"
        if at_rest:
            moved = f"of axis {', '.join(map(str, at_rest))} too"
        yield (
            f"{_listed(lacking)}: not shown by these recordings, and near the file's; a motion "
            f"{moved} shows them (hil plan --kind trajectory)"
        )
    if never := [each for each in values if each.possible < SHOWN]:
        yield (
            f"{_listed(never)}: no motion on this base shows them alone; near the file's where the "
            "torques allow"
        )


def _listed(values: Sequence[Value]) -> str:
    """Name three values, and the number of the others."""
    first = ", ".join(f"{each.quantity} of {each.of}" for each in values[:3])
    return first if len(values) <= 3 else f"{first} and {len(values) - 3} more"
