"""Update of a user's URDF or MJCF with the values of a model; everything else stays byte for byte.

Attributes of inertials and of joints change: armature, damping and dry friction. Unchanged numbers
keep their text. Quantities without influence on the torques keep their value:

- Standard parameters with a column of zeros in the base parameters' matrix.
- The rotor of an axis with an inertia equivalent to the link's own about the axis, or to its mass
  along it: the link takes the difference (`find_near_bodies`).

Links welded to a link of the chain, or on it by joints that are not of the chain, keep their
inertials, and the link of the chain takes the rest, if the rest is a possible body. Otherwise all
of them are transformed alike.
"""

from __future__ import annotations

import os
import re
from contextlib import nullcontext, suppress
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from checked_files.xml_file import XmlFile
from checked_files.xml_patch import XmlPatch
from hil.errors import Mismatch, NotRealisable
from hil.estimation.consistent.nearest import nearest_robot
from hil.estimation.prior import Stated
from hil.export.exported import Exported
from hil.export.mjcf_file import FULL, IMPEDANCE, STEP, quaternion
from hil.export.patched_values import remarks_on, table_of, values_of
from hil.export.simple_friction import damping_remarks, friction_remarks
from hil.export.simulated_robot import moved_to_frames, number, numbers, simulated_robot
from hil.export.urdf_file import (
    INERTIA,
    NO_CHAIN,
    NO_TREE,
    given_urdf,
    inertial_faults,
    stated_body,
    urdf_remarks,
)
from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.model.base_parameters import base_parameters
from hil.model.frames import body_parameters, inverse, parameter_map, pseudo_inertia
from hil.model.readers.axes_to_frames import difference

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.estimation.consistent.conditions import BodyBounds
    from hil.export.patched_values import Patched
    from hil.export.simulated_robot import SimulatedJoint, SimulatedRobot
    from hil.export.urdf_file import Given
    from hil.model.robot import Robot
    from hil.results.model import Model

SAME = 1e-7
"""Difference, relative to the largest number of a group, below which numbers are kept."""
_IZZ, _MASS = 5, 9
ORIENTATIONS = ("axisangle", "xyaxes", "zaxis", "euler")
"""Attributes of an MJCF replaced by a quaternion."""


class Body(NamedTuple):
    """Mass [kg], centre [m] and inertia about it [kg m^2] along given axes, shapes (3,), (3, 3)."""

    mass: float
    centre: Array
    inertia: Array

    @classmethod
    def create(cls, parameters: Array, rotation: Array) -> Body:
        """Create a body from standard parameters (10,); inertia along the rotation's columns."""
        J = pseudo_inertia(parameters)
        centre = J[:3, 3] / J[3, 3]
        spread = J[:3, :3] - J[3, 3] * np.outer(centre, centre)
        inertia = np.trace(spread) * np.eye(3) - spread
        return cls(float(J[3, 3]), centre, rotation.T @ inertia @ rotation)


def patched_file(path: Path, robot: Robot) -> Patched:
    """Read the user's file, and find the chain of a robot in it.

    Raises
    ------
    FileError
        Neither URDF nor MJCF, or inertials that no body has.
    Mismatch
        Another robot's file.
    """
    if XmlFile(path).root.tag == "mujoco":
        return _Mjcf(path, robot)
    return _Urdf(given_urdf(path, robot), robot)


def stated_parameters(model: Model, given: Patched) -> Stated:
    """Return the bodies and rotors in the user's file as knowledge beside a model."""
    rotors = {f"Ia{k}": value for k, value in enumerate(given.rotors().tolist(), start=1)}
    added = np.array([rotors.get(name, 0.0) for name in model.robot.added_parameters])
    return Stated.create(model.robot, given.bodies(), added)


def stated_model(model: Model, given: Patched) -> Model:
    """Return a model with the bodies, rotors and friction in the user's file."""
    known, laws = stated_parameters(model, given), []
    for each in given.friction().tolist():
        terms = {
            name: TermValue(value=value, standard_error=0.0)
            for name, value in zip(("Coulomb", "viscous"), each, strict=True)
        }
        laws.append(AxisLaw(law="classical", speed=1.0, terms=terms, plain=terms, held_out={}))
    return replace(
        model,
        values=known.matrix @ known.values,
        friction_law=FrictionLaw(axes=tuple(laws)),
        consistent=None,
    )


def write_patched(model: Model, given: Patched) -> Exported:
    """Return the user's file with the values of a model with bodies (`find_near_bodies`)."""
    robot, known = simulated_robot(model, given.chain), stated_parameters(model, given)
    values, name = values_of(model, given, known, robot), f"{given.path.stem}.values.csv"
    remarks = list(remarks_on(values, name, tuple(model.details.rest)))
    for k, joint in enumerate(robot.joints):
        if kept := list(given.patch(k, joint)):
            remarks.append(f"{joint.link}, {joint.name}: kept as they were: {', '.join(kept)}")
    files = given.files() | {name: table_of(values)}
    return Exported(files, (*remarks, *given.remarks(model, robot)))


def find_near_bodies(model: Model, given: Patched, bounds: BodyBounds) -> Model:
    """Return the model with the possible bodies nearest to those of a file.

    Parameters without influence on the torques keep the values of the file, and what the recordings
    leave open stays near them (`Stated`). A rotor with the same effect as its link takes the value
    of the file before bodies are fitted. Otherwise the link would be fitted with the rotor's
    inertia included. If this leaves the links less than half of their value in the file, the links
    keep the file's value and the rotor takes the rest. If the rotors of the file leave no possible
    body near the estimate, beyond a chi-square of 1, one standard error, they are fitted with the
    bodies.
    """
    robot, stated = model.robot, given.bodies()
    base, n, rotors = base_parameters(robot), robot.n_joints, np.zeros(len(robot.added_parameters))
    file = stated_parameters(model, given)
    open_ = file.widened(model.covariance, model.combination)
    values, covariance = file.completed(model.values, open_)
    acts_as = [10 * axis + (_IZZ if robot.revolute[axis] else _MASS) for axis in range(n)]
    links, of_rotors = np.split(base.matrix, [10 * n], axis=1)
    axes = {}
    for k, name in enumerate(robot.added_parameters):
        axis = int(name[2:]) - 1 if re.fullmatch(r"Ia[0-9]+", name) else None
        if axis is not None and np.array_equal(of_rotors[:, k], links[:, acts_as[axis]]):
            row = int(np.argmax(np.abs(of_rotors[:, k])))
            whole, own = float(values[row]), float(links[row] @ stated.ravel())
            kept = float(given.rotors()[axis])
            # too large a rotor inertia would leave less to the link than any possible body has
            axes[name] = axis
            rotors[k] = kept if whole - kept > own / 2 else max(whole - own, 0.0)
    known = covariance, bounds, stated, f"the inertials of {given.path}"
    shift, consistent = of_rotors @ rotors, None
    with suppress(NotRealisable):
        consistent = nearest_robot(robot, values - shift, *known)
    if consistent is None or consistent.distance > 1.0:
        with suppress(NotRealisable) if consistent is not None else nullcontext():
            open_rotors = nearest_robot(robot, values, *known)
            if consistent is None or consistent.distance > open_rotors.distance + 1.0:
                consistent, shift, axes = open_rotors, 0.0 * shift, {}
    bodies, added = consistent.bodies.copy(), dict(consistent.added)
    for name, axis in axes.items():
        whole = bodies[axis].copy()
        whole[acts_as[axis] % 10] += added[name]
        if _possible(whole):
            bodies[axis], added[name] = whole, 0.0
        added[name] += float(rotors[robot.added_parameters.index(name)])
    for axis in range(n):
        free = ~links[:, 10 * axis : 10 * axis + 10].any(axis=0)
        kept = np.where(free, stated[axis], bodies[axis])
        if _possible(kept):
            bodies[axis] = kept
    changed = {
        "values": tuple((consistent.p + shift).tolist()),
        "added": added,
        "links": tuple(
            link.model_copy(update={"parameters": tuple(body.tolist())})
            for link, body in zip(consistent.links, bodies, strict=True)
        ),
    }
    return replace(model, consistent=consistent.model_copy(update=changed))


def _possible(body: Array) -> bool:
    return bool(np.linalg.eigvalsh(pseudo_inertia(body))[0] > 0)


def _shared_out(total: Array, parts: Sequence[Array]) -> list[Array]:
    """Distribute a new total over the bodies of a link, shape (10,) each.

    The first body takes the difference if it stays a possible body. Otherwise all change alike:
    their pseudo-inertias J_i become A J_i A, with the symmetric A for which A J A is the new sum.
    """
    own = np.asarray(total - np.sum(parts[1:], axis=0))
    if _possible(own):
        return [own, *parts[1:]]
    root = _root(pseudo_inertia(np.sum(parts, axis=0)))
    back = np.linalg.inv(root)
    A = back @ _root(root @ pseudo_inertia(total) @ root) @ back
    return [np.array(body_parameters(A @ pseudo_inertia(part) @ A)) for part in parts]


def _root(J: Array) -> Array:
    values, vectors = np.linalg.eigh(J)
    return np.asarray((vectors * np.sqrt(values)) @ vectors.T)


def _held(names: Iterable[str]) -> Iterator[str]:
    """Name the joints on the chain that are not its own."""
    if said := ", ".join(names):
        yield (
            f"joints {said}: not of the model; the links on them are counted where the file has"
            " them at position 0, as parts of the link that carries them"
        )


def _kept_or_new(new: Array, old: Array) -> bool:
    """Return True if new and old numbers agree within `SAME`."""
    return bool(np.abs(new - old).max() <= SAME * max(np.abs(old).max(), 1e-300))


class _Urdf:
    """URDF, a format without rotor inertias."""

    is_mjcf = False

    def __init__(self, given: Given, robot: Robot) -> None:
        self.path, self.chain, self._given = given.path, given.chain, given
        if fault := next(inertial_faults(given, robot), ""):
            raise Mismatch(f"{fault}; or export without --patch")
        self._xml = XmlPatch(given.reader.file)
        totals = [
            np.sum([parameter_map(pose) @ body for _, pose, body in self._stated(k)], axis=0)
            for k in range(robot.n_joints)
        ]
        self._bodies = moved_to_frames(given.chain, robot, totals)
        self._elements = given.reader.file.named("joint")

    def bodies(self) -> Array:
        return self._bodies

    def rotors(self) -> Array:
        return np.zeros(len(self.chain.joints))

    def friction(self) -> Array:
        stated = (self._elements[joint.name].find("dynamics") for joint in self.chain.joints)
        keys = ("friction", "damping")
        return np.array(
            [[0.0 if one is None else float(one.get(key, 0)) for key in keys] for one in stated]
        )

    def _stated(self, k: int) -> list[tuple[str, Array, Array]]:
        """Return a link with all carried links: name, pose in the joint's frame, parameters."""
        reader, links = self._given.reader, {joint.link for joint in self.chain.joints}
        return [
            (name, pose, body)
            for name, pose in reader.find_attached(self.chain.joints[k].link, np.eye(4), links)
            if (body := stated_body(reader, name)) is not None
        ]

    def patch(self, k: int, joint: SimulatedJoint) -> Iterator[str]:
        stated = self._stated(k)
        new = _shared_out(joint.body, [parameter_map(pose) @ body for _, pose, body in stated])
        for (name, pose, body), whole in zip(stated, new, strict=True):
            yield from self._inertial(name, body, parameter_map(inverse(pose)) @ whole)
        if joint.friction is None:
            yield "damping and friction"
            return
        values = {
            "damping": number(joint.friction.viscous), "friction": number(joint.friction.coulomb),
        }  # fmt: skip
        element = self._elements[joint.name]
        stands = element.find("dynamics")
        if stands is not None:
            self._xml.set(stands, values)
        else:
            said = " ".join(f'{key}="{value}"' for key, value in values.items())
            self._xml.insert(element, f"<dynamics {said}/>")

    def _inertial(self, name: str, stated: Array, body: Array) -> Iterator[str]:
        """Write the inertial of a link with a stated one; yield names of unchanged quantities."""
        reader = self._given.reader
        element = next(reader.links[name].iter("inertial"))
        mass, inertia = (next(element.iter(tag)) for tag in ("mass", "inertia"))
        turned = reader.origin(element)[:3, :3]
        old, new = Body.create(stated, turned), Body.create(body, turned)
        origin = element.find("origin")
        if _kept_or_new(np.array([new.mass]), np.array([old.mass])):
            yield f"mass of {name}"
        else:
            self._xml.set(mass, {"value": number(new.mass)})
        if _kept_or_new(new.centre, old.centre):
            yield f"origin of {name}"
        elif origin is not None:
            self._xml.set(origin, {"xyz": numbers(new.centre)})
        else:
            self._xml.insert(element, f'<origin xyz="{numbers(new.centre)}"/>')
        size = np.abs(old.inertia).max()
        for key, at in INERTIA.items():
            if abs(new.inertia[at] - old.inertia[at]) <= SAME * size:
                yield f"{key} of {name}"
            else:
                self._xml.set(inertia, {key: number(new.inertia[at])})

    def remarks(self, model: Model, robot: SimulatedRobot) -> Iterator[str]:
        reader, joints = self._given.reader, self.chain.joints
        links = {joint.link for joint in joints}
        yield from _held(
            str(edge.element.get("name"))
            for joint in joints
            for name, _ in reader.find_attached(joint.link, np.eye(4), links)
            for edge in reader.below.get(name, ())
            if edge.child not in links and edge.element.get("type") != "fixed"
        )
        yield from urdf_remarks(model, robot)

    def files(self) -> dict[str, str]:
        return {self.path.name: self._xml.text}


class _Mjcf:
    is_mjcf = True

    def __init__(self, path: Path, robot: Robot) -> None:
        from hil.model.readers.mjcf import read_chains  # noqa: PLC0415 - MuJoCo is an extra

        why = NO_CHAIN if robot.is_chain else NO_TREE
        for chain in read_chains(path, robot):
            why = difference(chain, robot)
            if not why:
                break
        else:
            raise Mismatch(
                f"{path}: no chain of {robot.n_joints} joints has the frames of {robot.name}: "
                f"{why}; give the file that the robot was made from"
            )
        self.path, self.chain = path, chain
        self._text, self._model = self.chain.text, self.chain.model
        if self._text.uses_geom_inertias:
            raise Mismatch(
                f'{path}: inertiafromgeom="true" of the compiler: inertials would be ignored; '
                'set it to "auto"'
            )
        for one, other in pairwise(self.chain.bodies):
            if one == other:
                raise Mismatch(
                    f"{self._text.bodies[one][0].wrong('a body with two joints')}: give each joint"
                    " a body of its own, or export without --patch"
                )
        self._xml = {file: XmlPatch(each) for file, each in self._text.files.items()}
        totals = [
            np.sum([stated for _, _, stated in self._parts(body)], axis=0)
            for body in self.chain.bodies
        ]
        self._bodies = moved_to_frames(self.chain, robot, totals)

    def bodies(self) -> Array:
        return self._bodies

    def rotors(self) -> Array:
        return np.array([float(self._model.dof_armature[dof]) for dof in self.chain.dofs])

    def friction(self) -> Array:
        each = self._model.dof_frictionloss, self._model.dof_damping
        return np.array([[float(x[dof]) for x in each] for dof in self.chain.dofs])

    def _stated(self, body: int) -> Array:
        """Return the standard parameters of a body in its own frame."""
        model, pose = self._model, np.eye(4)
        pose[:3, :3] = _rotation(model.body_iquat[body])
        pose[:3, 3] = model.body_ipos[body]
        xx, yy, zz = model.body_inertia[body]
        about = np.array([xx, 0.0, 0.0, yy, 0.0, zz, 0.0, 0.0, 0.0, model.body_mass[body]])
        return np.asarray(parameter_map(pose) @ about)

    def _carrier(self, body: int) -> int:
        """Return the body of the chain that a body is on; 0 for those on the base."""
        while body and body not in self.chain.bodies:
            body = int(self._model.body_parentid[body])
        return body

    def _parts(self, body: int) -> Iterator[tuple[int, Array, Array]]:
        """Yield a body with all carried bodies: number, pose in the joint's frame, parameters."""
        model = self._model
        heavy = np.flatnonzero(model.body_mass > 0).tolist()
        on_it = [each for each in heavy if self._carrier(each) == body]
        for each in sorted(on_it, key=lambda other: other != body):
            pose, here = np.eye(4), each
            while here != body:
                step = np.eye(4)
                step[:3, :3], step[:3, 3] = _rotation(model.body_quat[here]), model.body_pos[here]
                pose, here = step @ pose, int(model.body_parentid[here])
            # the pose of the body in the frame of its joint
            in_joint = np.eye(4)
            in_joint[:3, 3] = -self._model.jnt_pos[self._model.body_jntadr[body]]
            pose = in_joint @ pose
            yield each, pose, parameter_map(pose) @ self._stated(each)

    def patch(self, k: int, joint: SimulatedJoint) -> Iterator[str]:
        body = self.chain.bodies[k]
        parts = list(self._parts(body))
        new = _shared_out(joint.body, [stated for _, _, stated in parts])
        for (each, pose, _), found in zip(parts, new, strict=True):
            yield from self._inertial(each, parameter_map(inverse(pose)) @ found)
        placed, dof, model = self._text.bodies[body][1][0], self.chain.dofs[k], self._model
        stated: dict[str, tuple[Sequence[float], Sequence[float]]] = {
            "armature": ([model.dof_armature[dof]], [joint.armature])
        }
        if joint.friction is None:
            yield from ("damping", "frictionloss")
        else:
            polynomial = model.dof_damping[dof], *model.dof_dampingpoly[dof]
            coulomb = joint.friction.coasting.coulomb
            stated["damping"] = polynomial, joint.friction.damping
            stated["frictionloss"] = [model.dof_frictionloss[dof]], [coulomb]
        values = {}
        for key, (before, now) in stated.items():
            if _kept_or_new(np.pad(now, (0, len(before) - len(now))), np.array(before)):
                yield key
            else:
                values[key] = numbers(now)
        self._xml[placed.file.path].set(placed.element, values)

    def _inertial(self, body: int, found: Array) -> Iterator[str]:
        """Write the inertial of a body; yield the names of unchanged quantities."""
        placed, name = self._text.bodies[body][0], str(self._model.body(body).name) or f"body{body}"
        turned = _rotation(self._model.body_iquat[body])
        old, new = Body.create(self._stated(body), turned), Body.create(found, turned)
        values: dict[str, str | None] = {}
        xml, element = self._xml[placed.file.path], placed.element.find("inertial")
        if _kept_or_new(np.array([new.mass]), np.array([old.mass])):
            yield f"mass of {name}"
        else:
            values["mass"] = number(new.mass)
        if _kept_or_new(new.centre, old.centre):
            yield f"pos of {name}"
        else:
            values["pos"] = numbers(new.centre)
        if _kept_or_new(new.inertia, old.inertia):
            yield f"inertia of {name}"
        elif element is not None and element.get("fullinertia") is not None:
            along = turned @ new.inertia @ turned.T
            values["fullinertia"] = numbers(along[at] for at in FULL)
        else:
            # the principal axes nearest to the old axes, in which the inertia is given
            moments, axes = np.linalg.eigh(new.inertia)
            order = [int(np.argmax(np.abs(axes[i]))) for i in range(3)]
            if sorted(order) == [0, 1, 2]:
                moments, axes = moments[order], axes[:, order] * np.sign(np.diag(axes[:, order]))
            if np.linalg.det(axes) < 0:
                axes[:, 2] *= -1
            values |= {
                key: None for key in ORIENTATIONS if element is not None and key in element.attrib
            }
            values |= {"diaginertia": numbers(moments), "quat": numbers(quaternion(turned @ axes))}
        if element is not None:
            xml.set(element, values)
        elif values:
            own = Body.create(found, np.eye(3))
            full = numbers(own.inertia[at] for at in FULL)
            xml.insert(
                placed.element,
                f'<inertial pos="{numbers(own.centre)}" mass="{number(own.mass)}"'
                f' fullinertia="{full}"/>',
            )

    def remarks(self, model: Model, robot: SimulatedRobot) -> Iterator[str]:
        yield from _held(
            str(self._model.jnt(k).name)
            for k, body in enumerate(self._model.jnt_bodyid.tolist())
            if body not in self.chain.bodies and self._carrier(body)
        )
        yield (
            "joints held by MuJoCo's default friction creep; for friction that holds, give each"
            f' joint solreffriction="0 {number(-IMPEDANCE / STEP)}" and solimpfriction="{IMPEDANCE}'
            f' {IMPEDANCE} 0.001 0.5 2" at a timestep of {STEP} s'
        )
        if robot.coupled:
            yield "coupled motors: the inertia that joints share is left out"
        yield from friction_remarks(model)
        yield from damping_remarks(model)

    def files(self) -> dict[str, str]:
        folder = self.path.parent.resolve()
        return {
            os.path.relpath(file.resolve(), folder): each.text
            for file, each in self._xml.items()
            if each.changed or file == self.path
        }


def _rotation(quaternion: Array) -> Array:
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - takes long to load

    return np.asarray(Rotation.from_quat(np.roll(quaternion, -1)).as_matrix())
