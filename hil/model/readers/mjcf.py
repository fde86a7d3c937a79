"""Joints of an MJCF file, a chain or a tree, compiled by MuJoCo.

The compiler resolves defaults, classes, frames, angles in degrees and all orientations. Axes come
from the compiled model; names of files and lines come from the text (`MjcfText`), whose bodies and
joints are in the compiler's order. Joints are those of a URDF (`hil.model.readers.urdf`): the
frame of a joint has its origin at the joint's anchor and the body's directions; bodies without
joints belong to the link below them.

Positions count as in MuJoCo: at `ref` a body is at the position in the file. Links between two
joints of one body have no separate body.

The format: mujoco.readthedocs.io, XML reference.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from checked_files.yaml_file import FileError
from hil.model.frames import inverse
from hil.model.readers.limits import drop_placeholders
from hil.model.readers.mjcf_text import MjcfText
from hil.model.readers.urdf import ENDS, PARALLELOGRAM, ROUNDED, UrdfChain, UrdfJoint, split_names
from hil.model.robot_file import MOST_JOINTS
from hil.optional_packages import needed_for

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.model.readers.mjcf_text import Placed
    from hil.model.robot_arrays import RobotArrays

_REFUSED = {
    "freejoint": "a robot with a free base is not modelled: fix its base for the recording, and"
    " remove the joint",
    "free": "a robot with a free base is not modelled: fix its base for the recording, and remove"
    " the joint",
    "ball": "a ball joint has no single motor: replace it by three hinge joints, or end the chain"
    " before it with --to (tip of hil.Robot.load)",
}


@dataclass(frozen=True, slots=True, eq=False)
class MjcfChain(UrdfChain):
    """Joints of a chain or tree, with further contents of the MJCF file.

    Attributes
    ----------
    bodies, dofs : tuple of int
        Number of the body and of the degree of freedom of each joint, as compiled.
    stated_gravity : tuple of float
        Gravity in the world frame [m/s^2].
    springs : tuple of int
        Joints, from 1, with a stiffness.
    """

    text: MjcfText
    model: Any
    bodies: tuple[int, ...]
    dofs: tuple[int, ...]
    stated_gravity: tuple[float, ...]
    springs: tuple[int, ...]
    format: ClassVar[str] = "an MJCF"

    def further_lines(self) -> tuple[str, ...]:
        """Return the line of springs of a robot file."""
        springs = ", ".join(f"{{joint: {joint}}}" for joint in self.springs)
        return (f"springs: [{springs}]",) if springs else ()

    def gravity(self, stated: Sequence[float] | None = None) -> Array:
        """Return gravity in the world frame, by default that of the file, shape (3,) [m/s^2]."""
        return np.array(self.stated_gravity if stated is None else stated, dtype=float)


def read_mjcf(path: str | Path, base: str | None = None, tip: str | None = None) -> MjcfChain:
    """Read the chain between two bodies, or the tree between a body and several.

    Parameters
    ----------
    base, tip : str, optional
        Names of bodies, several tips separated by commas; by default the world, and the body at the
        end of the longest chain, or the whole tree if several chains are as long.

    Raises
    ------
    FileError
        The file is not an MJCF, MuJoCo does not compile it or is not installed, a body does not
        exist, or there is a closed loop, a free joint or a ball joint.
    """
    return _reader(Path(path)).chain(base, split_names(tip))


def read_chains(path: Path, robot: RobotArrays) -> Iterator[MjcfChain]:
    """Yield the chains from the world, or the tree, that may be `robot`; errors of `read_mjcf`."""
    reader = _reader(path)
    chains = [[tip] for tip in reader.tips(robot.n_joints)]
    tree = reader.tips_of(robot)
    for tips in chains if robot.is_chain else [tree] if len(tree) == robot.n_joints else []:
        yield reader.chain(None, tips)


def _reader(path: Path) -> _Reader:
    text = MjcfText(path)
    with needed_for(path, "mujoco"):
        import mujoco  # noqa: PLC0415 - optional, and slow to load
    try:
        model = mujoco.MjModel.from_xml_string(*text.reduce())
    except ValueError as error:
        why = " ".join(str(error).split())
        raise FileError(f"{path}: cannot be compiled by MuJoCo: {why}") from error
    if len(text.bodies) != model.nbody:
        raise FileError(
            f"{path}: {len(text.bodies) - 1} bodies in the text, {model.nbody - 1} in the "
            "compiled model; save the compiled file with mujoco.mj_saveLastXML"
        )
    return _Reader(text, model)


class _Reader:
    """Chains of a compiled model."""

    def __init__(self, text: MjcfText, model: Any) -> None:
        self.text, self.model = text, model

    def name(self, body: int) -> str:
        return str(self.model.body(body).name) or f"body{body}"

    def chain(self, base: str | None, tips: Sequence[str]) -> MjcfChain:
        within, tips = self._bodies(base, tips)
        for each in self.text.equalities:
            if each.element.tag in ("connect", "weld") and each.element.get("active") != "false":
                raise each.wrong(f"<{each.element.tag}> closes a loop; {PARALLELOGRAM}")
        joints: list[UrdfJoint] = []
        parents, bodies, dofs, notes = [], [], [], []
        start = int(self.model.body_parentid[within[0]])
        place = {start: (-1, np.eye(4))}  # of a body: joint that moves it, pose in its frame
        for body in within:
            carrier, here = place[int(self.model.body_parentid[body])]
            here = here @ _pose(self.model.body_pos[body], self.model.body_quat[body])
            placed = self.text.bodies[body][1]
            first, number = int(self.model.body_jntadr[body]), int(self.model.body_jntnum[body])
            for k in range(number):
                joint, before = self._joint(first + k, placed[k], body, here, last=k + 1 == number)
                parents.append(carrier)
                carrier = len(joints)
                joints.append(joint)
                bodies.append(body)
                dofs.append(int(self.model.jnt_dofadr[first + k]))
                here = before
            place[body] = carrier, here
            if self.model.body_gravcomp[body]:
                notes.append(
                    str(
                        self.text.bodies[body][0].wrong(
                            "gravcomp: ignored; the torques of the recordings must include gravity"
                        )
                    )
                )
        if not 1 <= len(joints) <= MOST_JOINTS:
            raise FileError(
                f"{self.text.path}: {len(joints)} joints must be 1 to {MOST_JOINTS}; {ENDS}"
            )
        stiff = np.atleast_2d(self.model.jnt_stiffness.reshape(self.model.njnt, -1))
        springs = [
            k for k, dof in enumerate(dofs, start=1) if stiff[int(self.model.dof_jntid[dof])].any()
        ]
        limited, unknown = drop_placeholders(joints)
        name = self.text.files[self.text.path].root.get("model") or self.text.path.stem
        return MjcfChain(
            robot=name, base=base or "world", tip=", ".join(tips),
            joints=limited, parents=tuple(parents), rounded=0.0, mount=np.eye(3), tilting="",
            text=self.text, model=self.model, bodies=tuple(bodies), dofs=tuple(dofs),
            stated_gravity=tuple(self.model.opt.gravity.tolist()), springs=tuple(springs),
            not_taken=(*notes, *unknown),
        )  # fmt: skip

    def _counts(self) -> Indices:
        """Count the joints from the world to every body."""
        counts = np.zeros(self.model.nbody, dtype=np.intp)
        for body in range(1, self.model.nbody):
            counts[body] = counts[self.model.body_parentid[body]] + self.model.body_jntnum[body]
        return counts

    def tips(self, n_joints: int) -> list[str]:
        """Return names of bodies at the end of `n_joints` joints."""
        there = (self._counts() == n_joints) & (self.model.body_jntnum > 0)
        return [self.name(body) for body in np.flatnonzero(there).tolist()]

    def tips_of(self, robot: RobotArrays) -> list[str]:
        """Return the bodies moved by the joints with the names of a robot's, in its order."""
        moved = {
            self.model.jnt(k).name: self.name(int(self.model.jnt_bodyid[k]))
            for k in range(self.model.njnt)
        }
        return [moved[name] for name in robot.joint_names if name in moved]

    def _last(self) -> list[str]:
        """Return the last bodies with joints of all chains, without loose objects."""
        carriers: set[int] = set()
        last: list[str] = []
        for body in reversed(range(1, self.model.nbody)):
            number, first = self.model.body_jntnum[body], self.model.body_jntadr[body]
            if body not in carriers and number and self.model.jnt_type[first] != 0:
                last.insert(0, self.name(body))
            if body in carriers or number:
                carriers.add(int(self.model.body_parentid[body]))
        return last

    def _bodies(self, base: str | None, tips: Sequence[str]) -> tuple[list[int], Sequence[str]]:
        """Return the bodies from below the base to the tips, parents first, and the tips."""
        names = {self.name(body): body for body in range(self.model.nbody)}
        for each in filter(None, (base, *tips)):
            if each not in names:
                known = ", ".join(names)
                raise FileError(f"{self.text.path}: no body {each!r}; bodies are {known}")
        counts = self._counts()
        longest = self.tips(max(1, int(counts.max())))
        tips = tips or (longest if len(longest) == 1 else self._last())
        stop = names[base] if base else 0
        found: dict[int, None] = {}
        for tip in tips:
            path: list[int] = []
            here = names[tip]
            while here != stop:
                if here == 0:
                    raise FileError(
                        f"{self.text.path}: {tip!r} is not below {base!r}; name a body above it"
                    )
                path.insert(0, here)
                here = int(self.model.body_parentid[here])
            found |= dict.fromkeys(path)
        if base and counts[stop]:
            raise FileError(
                f"{self.text.path}: {base!r} moves by {counts[stop]} joints above it, and tilts "
                "the chain; omit --from"
            )
        if not found:
            raise FileError(
                f"{self.text.path}: has no joints from {base or 'the world'} to "
                f"{', '.join(map(repr, tips)) or 'any body'}; {ENDS}"
            )
        return list(found), tips

    def _joint(
        self, k: int, placed: Placed, body: int, here: Array, *, last: bool
    ) -> tuple[UrdfJoint, Array]:
        """Return joint `k` of MuJoCo, and the pose of its body relative to the joint.

        `here` is the pose of the body relative to the previous joint, `last` marks the body's
        last joint.
        """
        model = self.model
        kind = placed.element.get("type", "free" if placed.element.tag == "freejoint" else "hinge")
        kind = {0: "free", 1: "ball"}.get(int(model.jnt_type[k]), kind)
        if kind in _REFUSED:
            name = model.jnt(k).name
            raise placed.wrong(f"joint {name!r} of body {self.name(body)!r}: {_REFUSED[kind]}")
        turns = int(model.jnt_type[k]) == 3
        axis = _snap(np.array(model.jnt_axis[k]))
        anchor = np.eye(4)
        anchor[:3, 3] = model.jnt_pos[k]
        joint = UrdfJoint(
            name=str(model.jnt(k).name) or f"joint{k + 1}",
            type="revolute" if turns else "prismatic",
            lower=_limit(model.jnt_limited[k], model.jnt_range[k, 0]),
            upper=_limit(model.jnt_limited[k], model.jnt_range[k, 1]),
            velocity=np.nan,
            acceleration=np.nan,
            effort=_limit(model.jnt_actfrclimited[k], model.jnt_actfrcrange[k, 1]),
            link=self.name(body) if last else f"{self.name(body)}/{k}",
            before=np.eye(4),
            axis=axis,
            place=str(placed.wrong(f"joint {model.jnt(k).name!r}")),
        )
        before = here @ anchor @ joint.motion(-float(model.qpos0[model.jnt_qposadr[k]]))
        exact = before.copy()
        exact[:3, :3] = _snap(before[:3, :3])
        return replace(joint, before=exact), inverse(anchor)


def _snap(directions: Array) -> Array:
    """Return directions, rounded to coordinate axes within the tolerance."""
    nearest = np.round(directions)
    return nearest + 0.0 if np.abs(directions - nearest).max() < ROUNDED else directions


def _pose(position: Array, quaternion: Array) -> Array:
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - takes long to load

    found = np.eye(4)
    found[:3, :3] = Rotation.from_quat(np.roll(quaternion, -1)).as_matrix()
    found[:3, 3] = position
    return found


def _limit(limited: int, value: float) -> float:
    return float(value) if limited else np.nan
