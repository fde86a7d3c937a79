"""Import of recorded arrays as a run in memory, with the same checks as a file."""

from __future__ import annotations

import hashlib
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from checked_files.yaml_file import FileError, place, problems
from hil.errors import InvalidArray, InvalidValue
from hil.imports.map_file import MapFile, RecordingMap
from hil.imports.one_map import interpret, measured_motions
from hil.imports.samples import Samples
from hil.imports.statement import Statement
from hil.planning.plan import PlannedRobot, RecordedMotions
from hil.runs.journal import Journal, Session, now
from hil.runs.recording_file import Measured
from hil.runs.run import MemoryRun, Run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.free_motion import FreeMotion

_numbers = count(1)
_ARGUMENTS = {"position": "q", "torque": "tau", "velocity": "qd"}
_OF_MAPS = {
    " in the map": "",
    " of its file": ", counted from 1",
    "name the column of its torque, or write torque: 0 if the joint has no motor": (
        "pass its torque, or state rotor_inertia: 0 in the robot file if the joint has no motor"
    ),
    "name the column of its torque": "pass its torque",
    "name another column, or record it": "pass another column",
    "write kind: free": "omit alone=",
    "check unit, per_unit and position_side": "check that they are in SI, on the joint side",
    "check unit, gain and torque_side": "check that they are in SI, on the joint side",
}
"""Words in messages about maps, and their replacements for arrays."""


class _Arrays(MapFile):
    """Substitute for a map file, with arrays as columns; messages name arguments."""

    accepting = "pass accept=['{}']"

    def named(self, location: tuple[str | int, ...]) -> str:
        """Return the name of an argument, with its column."""
        match location:
            case ("joints", int(joint), str(key), *_):
                return f"{_ARGUMENTS[key]}[:, {joint}]"
            case ("joints", int(joint)):
                return f"joint {joint + 1}"
            case ("time", *_):
                return "t"
            case ("kind", *_):
                return "alone"
        return place(location)

    def worded(self, message: str) -> str:
        """Return a message with the words for arrays."""
        for word, other in _OF_MAPS.items():
            message = message.replace(word, other)
        return message

    def wrong(self, location: tuple[str | int, ...], message: str) -> FileError:
        """Return the error for a part of the arrays."""
        return FileError(f"{self.named(location)}: {self.worded(message)}")


def run_from_arrays(
    robot: Robot,
    t: ArrayLike | Sequence[ArrayLike],
    q: ArrayLike | Sequence[ArrayLike],
    tau: ArrayLike | Sequence[ArrayLike],
    qd: ArrayLike | Sequence[ArrayLike] | None,
    alone: int | None,
    cut_off: float | None,
    accept: Sequence[str],
) -> MemoryRun:
    """Make a run from arrays, in memory; see `hil.Run.import_arrays`."""
    recordings = _recordings(robot, t, q, tau, qd)
    the_map = _map(robot, qd is not None, alone, cut_off, accept)
    measured: dict[str, Measured] = {}
    planned: list[FreeMotion] = []
    notes: list[str] = []
    warnings: list[str] = []
    for number, samples in enumerate(recordings, start=1):
        stem = f"r{number}"
        try:
            timing, numbered, found, _ = interpret(the_map, robot, samples)
        except FileError as error:
            lines = [f"recording {number}: {line}" for line in str(error).splitlines()]
            raise InvalidArray("\n".join(lines)) from error
        made = list(measured_motions(the_map, samples, numbered, stem))
        motions = tuple(motion for motion, _ in made)
        moves = (qd is not None,) * robot.n_joints
        statement = Statement(the_map, timing, samples.wraps, moves, motions, found)
        notes += statement.lines()
        warnings += [
            f"recording {number}: {the_map.wrong(s.location, s.message)}; if this is correct,"
            f" {the_map.accepting.format(s.check)}"
            for s in statement.doubts
        ]
        measured |= {each[0].id: Measured(*each) for each in made}
        planned += motions
    plan = RecordedMotions(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        map_digest=hashlib.sha256(the_map.content.model_dump_json().encode()).hexdigest(),
        measurements=tuple(planned),
    )
    session = Session(
        started=now(), ended=now(), reason="arrays", bus="arrays", simulated=False,
        notes=tuple(notes), warnings=tuple(warnings),
    )  # fmt: skip
    journal = Journal(plan_digest=plan.digest, robot_digest=robot.digest).add_session(session)
    return MemoryRun(Path(f"arrays-{next(_numbers)}"), plan, robot, journal, measured)


def _map(
    robot: Robot, with_qd: bool, alone: int | None, cut_off: float | None, accept: Sequence[str]
) -> _Arrays:
    if alone is not None and alone not in range(1, robot.n_joints + 1):
        raise InvalidValue(
            f"alone {alone!r} must be a joint of {robot.name}, 1 to {robot.n_joints}"
        )
    joints = []
    for axis in range(robot.n_joints):
        q = robot.position_unit(axis)
        units = {"position": q, "torque": robot.torque_unit(axis), "velocity": f"{q}/s"}
        joints.append({
            key: {"column": f"{name}[:, {axis}]", "unit": units[key]}
            for key, name in _ARGUMENTS.items()
            if with_qd or key != "velocity"
        })  # fmt: skip
    content: dict[str, object] = {
        "robot": robot.name, "files": ["arrays"], "joints": joints, "cut_off": cut_off,
        "accept": (accept,) if isinstance(accept, str) else tuple(accept), "time": {"column": "t"},
    }  # fmt: skip
    if alone is not None:
        content["kind"] = {"back_and_forth": alone}
    try:
        return _Arrays(Path("arrays"), "", RecordingMap.model_validate(content))
    except ValidationError as error:
        raise InvalidValue("\n".join(problems(error))) from error


Run.array_importer = staticmethod(run_from_arrays)


def _recordings(
    robot: Robot,
    t: ArrayLike | Sequence[ArrayLike],
    q: ArrayLike | Sequence[ArrayLike],
    tau: ArrayLike | Sequence[ArrayLike],
    qd: ArrayLike | Sequence[ArrayLike] | None,
) -> list[Samples]:
    groups: list[list[Any]] = [[t], [q], [tau], [qd]]
    if isinstance(t, (list, tuple)) and len(t) > 0 and np.ndim(t[0]) > 0:
        others = {"q": q, "tau": tau, "qd": qd}
        groups = [list(t), *(_listed(*each, len(t)) for each in others.items())]
    found = []
    for number, each in enumerate(zip(*groups, strict=True), start=1):
        try:
            found.append(_samples(robot, *each))
        except InvalidArray as error:
            raise InvalidArray(f"recording {number}: {error}") from error
    return found


def _listed(name: str, arrays: Any, count: int) -> list[Any]:
    found = [None] * count if arrays is None else list(arrays)
    if len(found) != count:
        raise InvalidArray(
            f"{name} has {len(found)} arrays, t has {count}; each recording needs one of both"
        )
    return found


def _samples(
    robot: Robot, t: ArrayLike, q: ArrayLike, tau: ArrayLike, qd: ArrayLike | None
) -> Samples:
    time, n = np.array(t, dtype=float), robot.n_joints
    if time.ndim != 1 or len(time) == 0:
        raise InvalidArray(f"t has shape {time.shape}; it must be (n_samples,)")
    columns = [_columns(name, each, len(time), n) for name, each in (("q", q), ("tau", tau))]
    velocity = np.full((len(time), n), np.nan)
    columns.append(velocity if qd is None else _columns("qd", qd, len(time), n))
    values = np.hstack(columns)
    needed = values[:, : 2 * n] if qd is None else values
    complete = np.isfinite(time) & np.isfinite(needed).all(axis=1)
    steps = np.abs(np.diff(values[:, :n], axis=0))
    numbers = np.isfinite(np.column_stack([time, needed])).sum(axis=0)
    wraps = int(np.count_nonzero(steps > np.pi))
    return Samples(time, values, complete, (0,), False, wraps, tuple(numbers.tolist()))


def _columns(name: str, values: ArrayLike, n_samples: int, n_joints: int) -> Array:
    found = np.array(values, dtype=float)
    if found.ndim == 1 and n_joints == 1:
        found = found[:, None]
    if found.shape != (n_samples, n_joints):
        raise InvalidArray(
            f"{name} has shape {found.shape}; it must be ({n_samples}, {n_joints}): one row per "
            "time stamp, one column per joint"
        )
    return found
