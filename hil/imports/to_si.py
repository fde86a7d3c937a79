"""Conversion of recorded columns to SI on the joint side: units, signs, gears, coupled motors.

Motor-side values are converted by the robot's motor matrix R, from joint to motor angles: q
= R^-1 q_motor + offset, and tau = R^T tau_motor by equal power. Times come from a column, from the
sum of two, or from a rate. A double resolves only 0.2 us of a date in seconds and 0.1 us in
nanoseconds. So the first row is subtracted from the columns before adding, and the sum is exact to
1 ns.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.tables import JOINT_TYPES, ROWS, SECONDS, STAMP_UNITS, position_factor
from hil.model.robot import DESCRIPTIONS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.map_file import MapFile, Position, Torque, Velocity
    from hil.imports.tables import TimeUnit
    from hil.model.robot import Robot

EPOCH = 1e8
"""Minimum stamp that counts from a date, not from the start of the recording [s]."""


@dataclass(frozen=True, eq=False)
class ColumnsOfKind:
    """Columns of positions, torques or velocities, converted and recorded.

    Attributes
    ----------
    converted : array (n,) of int
        Columns of the converted values.
    recorded : slice
        Columns of the recorded values.
    matrix : array (n, n)
        Matrix that converts recorded values, from the right.
    offset : array (n,)
        Offset added after the conversion.
    """

    converted: Integers
    recorded: slice
    matrix: Array
    offset: Array

    def restore(self, values: Array, place: int) -> Array:
        """Return a column as recorded, from converted values; block by block to save memory."""
        back = np.linalg.inv(self.matrix)[:, place]
        used = np.flatnonzero(back)  # values missing elsewhere do not matter
        columns, offset = self.converted[used], self.offset[used]
        parts = (values[begin : begin + ROWS] for begin in range(0, len(values), ROWS))
        return np.concatenate([(part[:, columns] - offset) @ back[used] for part in parts])

    def add(self, values: Array, place: int, change: Array) -> None:
        """Change converted values by a change of a recorded column."""
        for column, factor in zip(self.converted, self.matrix[place], strict=True):
            if factor:
                values[:, column] += factor * change


class Conversion:
    """Conversion of rows of a map's columns to SI.

    Attributes
    ----------
    turns : array (n_joints, 2)
        One turn of the recorded side, and of the motor, in the unit of the recorded position; NaN
        for an unknown gear ratio.

    Raises
    ------
    FileError
        Number or units of the columns do not fit the robot.
    """

    def __init__(self, the_map: MapFile, robot: Robot) -> None:
        content = the_map.content
        joints = content.joints
        _refuse_unfit(the_map, robot)
        self._n = len(joints)
        self._times = TimeColumns(the_map)
        self._moving = np.array([joint.velocity is not None for joint in joints])
        positions, torques = [j.position for j in joints], [j.torque for j in joints]
        self._driven = np.array([torque is not None for torque in torques])
        velocities = [joint.velocity for joint in joints if joint.velocity]
        q, qd = (
            np.array([p.sign * position_factor(p.unit, p.per_unit) for p in parts])
            for parts in (positions, velocities)
        )
        to_joints = np.diag(q).T
        speeds, efforts = np.diag(qd), np.diag([t.factor if t else 1.0 for t in torques])
        if content.torque_side == "motor":
            _refuse_mixed(the_map, robot)
        if "motor" in {content.position_side, content.torque_side}:
            matrix = _motor_matrix(the_map, robot)
            if content.position_side == "motor":
                inverse = np.linalg.inv(matrix)
                to_joints = to_joints @ inverse.T
                speeds = speeds @ inverse[np.ix_(self._moving, self._moving)].T
            if content.torque_side == "motor":
                efforts = efforts @ matrix
        self._positions, self._speeds, self._efforts = to_joints, speeds, efforts
        self._offset = np.array([position.offset for position in positions])
        gears = np.ones((self._n, 2))
        if content.position_side == "joint":
            gears[:, 1] = np.abs(np.diag(robot.motor_matrix))
        self.turns = 2 * np.pi / np.abs(q)[:, np.newaxis] / gears

    def convert(self, block: Array, row: int) -> tuple[Array, Array]:
        """Return times since `origin` [s] (n,), and positions, torques, velocities (n, 3 n_joints).

        Parameters
        ----------
        block : array (n, n_columns)
            Columns in the order of `hil.imports.samples`.
        row : int
            Number of the first row within its file, from 0.
        """
        n = self._n
        time, rest = self._times.convert(block[:, : self._times.n], row), self.recorded(block)
        if np.isinf(rest).any():
            rest = np.where(np.isinf(rest), np.nan, rest)
        values = np.empty((len(block), 3 * n))
        values[:, 2 * n :][:, ~self._moving] = np.nan
        values[:, :n] = rest[:, :n] @ self._positions + self._offset
        values[:, n : 2 * n] = rest[:, n : 2 * n] @ self._efforts
        values[:, 2 * n :][:, self._moving] = rest[:, 2 * n :] @ self._speeds
        return time, values

    @property
    def n_recorded(self) -> int:
        """Number of recorded positions, torques and velocities."""
        return 2 * self._n + int(self._moving.sum())

    def recorded(self, block: Array) -> Array:
        """Return the recorded positions, torques and velocities of a block; 0 without motor."""
        rest, n = block[:, self._times.n :], self._n
        if self._driven.all():
            return rest
        found, driven = np.zeros((len(block), self.n_recorded)), np.flatnonzero(self._driven)
        found[:, :n], found[:, n + driven] = rest[:, :n], rest[:, n : n + len(driven)]
        found[:, 2 * n :] = rest[:, n + len(driven) :]
        return found

    @property
    def kinds(self) -> dict[str, ColumnsOfKind]:
        """Columns of positions, torques and recorded velocities."""
        n, joints, moving = self._n, np.arange(self._n), np.flatnonzero(self._moving)
        none = np.zeros(n)
        return {
            "positions": ColumnsOfKind(joints, slice(n), self._positions, self._offset),
            "torques": ColumnsOfKind(n + joints, slice(n, 2 * n), self._efforts, none),
            "velocities": ColumnsOfKind(
                2 * n + moving, slice(2 * n, None), self._speeds, none[moving]
            ),
        }

    @property
    def origin(self) -> float:
        """Origin of the times, known after the first conversion [s]; 0 except for dates."""
        return self._times.origin

    def complete(self, values: Array) -> Mask:
        """Return a mask of rows without missing values."""
        recorded = np.concatenate([np.ones(2 * self._n, dtype=bool), self._moving])
        return np.asarray((np.isfinite(values) | ~recorded).all(axis=1))


def _motor_matrix(the_map: MapFile, robot: Robot) -> Array:
    unknown = np.flatnonzero(np.isnan(robot.motor_matrix).any(axis=1))
    if len(unknown):
        key = "position_side" if the_map.content.position_side == "motor" else "torque_side"
        raise the_map.wrong(
            (key,),
            f"motor needs the gear ratio of joint {unknown[0] + 1}, which {robot.source} leaves"
            " unknown; state it there",
        )
    return robot.motor_matrix


def _refuse_mixed(the_map: MapFile, robot: Robot) -> None:
    """Refuse unknown gains of motors acting on two joints: a joint torque would have two gains."""
    for motor, joint, _ in robot.couplings:
        for number in (motor, joint):
            if number in the_map.unknown_gains:
                raise the_map.wrong(
                    ("joints", number, "torque", "gain"),
                    f"motor {motor + 1} acts on joints {joint + 1} and {motor + 1} of {robot.name},"
                    " so torques of unknown gain cannot be brought to the joints; state the gain",
                )


def _refuse_unfit(the_map: MapFile, robot: Robot) -> None:
    content = the_map.content
    if len(content.joints) != robot.n_joints:
        raise the_map.wrong(
            ("joints",),
            f"{len(content.joints)} joints must be {robot.n_joints}, one for each joint of"
            f" {robot.name}, in the robot's order: {', '.join(robot.joint_names)}"
            f"{_shorter_chain(the_map, robot)}",
        )
    problems = []
    for number, joint in enumerate(content.joints):
        kind = "revolute" if robot.revolute[number] else "prismatic"
        for key, side in (
            ("position", content.position_side),
            ("velocity", content.position_side),
            ("torque", content.torque_side),
        ):
            part = getattr(joint, key)
            wanted = kind if side == "joint" else "revolute"
            if part is not None and JOINT_TYPES.get(part.unit, wanted) != wanted:
                problems.append(
                    the_map.wrong(
                        ("joints", number, key, "unit"),
                        f"{part.unit} does not suit joint {number + 1} of {robot.name}, which is"
                        f" {kind}; correct the unit, or the order of the joints"
                        f"{_motor_remedy(part)}",
                    )
                )
    moving = [joint.velocity is not None for joint in content.joints]
    if content.position_side == "motor" and any(moving) and not all(moving):
        at = ("joints", moving.index(False))
        problems.append(
            the_map.wrong(
                at, "has no velocity: on the motor side state velocity for all joints, or none"
            )
        )
    if problems:
        raise FileError("\n".join(map(str, problems)))


def _shorter_chain(the_map: MapFile, robot: Robot) -> str:
    """Return the remedy for a chain or tree that goes on beyond the recorded joints."""
    n, stated = len(the_map.content.joints), the_map.content.robot
    if not 0 < n < robot.n_joints or Path(robot.source).suffix not in DESCRIPTIONS:
        return ""
    if not robot.is_chain:
        return (
            "; for a part of this tree name the last links: robot: {urdf: "
            f"{stated.urdf or stated.name}, to: LINK}}, several in quotes, separated by commas"
        )
    chain = stated.ended(robot, n)
    return f"; if the recording has the first {n}, end the chain: robot: {chain}" if chain else ""


def _motor_remedy(part: Position | Velocity | Torque) -> str:
    """Return the remedy for turns of a motor that moves a prismatic joint."""
    if not part.unit.startswith(("turns", "rev")):
        return ""
    counts = "counts/s" if part.unit.endswith("/s") else "counts"
    return f"; for a motor's turns state {counts} with per_unit, m for one turn"


class TimeColumns:
    """Conversion of the time columns of a map or a format.

    Attributes
    ----------
    n : int
        Number of time columns.
    """

    def __init__(self, the_map: MapFile) -> None:
        self._map, stated = the_map, the_map.content.time
        units: Sequence[TimeUnit] = STAMP_UNITS
        if stated is not None:
            units = (stated.unit,) if stated.plus is None else (stated.unit, stated.plus.unit)
        self._rate = None if stated is None else stated.rate
        self.n = 0 if self._rate is not None else len(units)
        self._units = np.array([SECONDS[unit] for unit in units])
        self._begin: Array | None = None

    @property
    def origin(self) -> float:
        """Origin of the times, known after the first rows [s]; 0 except for dates."""
        return 0.0 if self._begin is None else float(self._begin @ self._units)

    def convert(self, columns: Array, row: int) -> Array:
        """Return times since `origin` [s], shape (n_rows,).

        Parameters
        ----------
        columns : array (n_rows, n)
        row : int
            Number of the first row within its file, from 0.

        Raises
        ------
        FileError
            The second column is not a fraction of the first column's unit.
        """
        if self._rate is not None:
            return (row + np.arange(len(columns))) / self._rate
        if self.n > 1:
            self._refuse_too_great(columns[:, 1])
        if self._begin is None:
            whole = np.isfinite(columns).all(axis=1)
            first = columns[int(np.argmax(whole))]
            if whole.any():
                self._begin = first if abs(first @ self._units) > EPOCH else np.zeros(self.n)
        begin = np.zeros(self.n) if self._begin is None else self._begin
        return np.asarray((columns - begin) @ self._units)

    def _refuse_too_great(self, column: Array) -> None:
        """Refuse a second column beyond a unit of the first."""
        column = column[np.isfinite(column)]
        if not len(column):
            return
        low, high = column.min(), column.max()
        if low < 0 or high * self._units[1] >= self._units[0]:
            raise self._map.wrong(
                ("time", "plus"),
                f"has values from {low:.10g} to {high:.10g}, at least 0 and below "
                f"{self._units[0] / self._units[1]:.10g} (one unit of column) allowed; correct "
                "unit or column, or remove plus where it is a whole stamp",
            )
