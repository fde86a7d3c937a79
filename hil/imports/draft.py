"""Draft of a map from a file, with marks for values known only to the user.

Columns are matched to joints by their names. A unit is written where the file states one: joint
states of ROS, a unit in the column's name, dates. Elsewhere the unit is marked, with a guess from
names and magnitudes in the mark's text, so that no guess goes unread.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

import numpy as np

from checked_files.foreign_text import one_line
from checked_files.yaml_file import UNSTATED, FileError
from checked_files.yaml_text import comment, mark_unstated, quoted
from hil.imports.column_names import (
    COMPUTED,
    NANOSECOND_WORDS,
    OTHER,
    SECOND_WORDS,
    is_time,
    meaning_of,
    stated_unit,
    unit_in,
    words_of,
)
from hil.imports.map_file import Format, MappedRobot
from hil.imports.readers import open_table
from hil.imports.tables import SECONDS, listed, units_of_date

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.tables import Table
    from hil.model.robot import Robot

    Named = tuple["SeenColumn", set[str], list[str]]
    """Column, words of its name, and the numbers in the name."""

_ROBOT = "a robot file, a URDF, or the name of a robot"
_UNITS = {
    "position": "rad, deg, m, mm, turns or counts",
    "velocity": "rad/s, deg/s, rpm, m/s, mm/s, turns/s or counts/s",
    "torque": "N m, N, A, V or per mille",
}


LOOKED_AT = 1 << 16
"""Approximate number of inspected rows: a minute at 1 kHz."""


def draft_map(
    path: Path,
    name: str,
    robot: Robot | None = None,
    chain: MappedRobot | None = None,
    layout: Format | None = None,
) -> str:
    """Return the text of a first map.

    Parameters
    ----------
    path : Path
        Path of a recording.
    name : str
        Name of the file in the map.
    robot : Robot, optional
        Robot whose joints give the order, if the columns' names contain the joints' names.
    chain : MappedRobot, optional
        The robot in the map, by default the source of `robot`. A chain of a URDF ends before
        joints without columns.
    layout : Format, optional
        Layout of the file, where it cannot be detected.

    Raises
    ------
    FileError
        The file cannot be read, or holds no columns of numbers.
    """
    layout = layout or Format()
    table = open_table(path, layout)
    columns, looked_at, empty = look(table)
    if not columns:
        left_out = listed({**empty, **table.left_out})
        raise FileError(f"{path}: holds no columns of numbers{left_out}")
    time = _time_of(table, columns)
    rest = [column for column in columns if column not in time]
    joints = _joints(rest)
    if robot is not None:
        chain = chain or MappedRobot(name=robot.source)
        joints = _sort_joints(robot, joints)
        n = max((k for k, joint in enumerate(joints, start=1) if joint), default=0)
        if shorter := chain.ended(robot, n):
            chain, joints = shorter, joints[:n]
    others = {**_not_placed(rest, joints), **empty, **table.left_out}
    return "\n".join(
        [
            comment(f"Map of {name}, drafted from its first {looked_at} rows."),
            *(comment(f"{note.capitalize()}.") for note in table.notes),
            f"# Values that the file does not state are marked {UNSTATED}: replace each mark and "
            "its text.",
            "# Columns and what they hold:",
            *(f"#   {one_line(described(column), 400)}" for column in columns),
            *_left_out_lines(others),
            f"robot: {chain if robot else mark_unstated(_ROBOT)}",
            f"files: [{quoted(name)}]",
            *_format_lines(layout),
            *_time_lines(time, from_format=bool(table.time)),
            *_segment_lines(time, looked_at),
            "joints: # in the robot's order, as many as it has",
            *(
                line
                for axis, joint in enumerate(joints)
                for line in _joint(joint, robot, axis, from_ros=bool(table.time))
            ),
            "torque_side: joint # or motor",
            "position_side: joint # or motor",
            "kind: free # or {back_and_forth: JOINT}",
            "",
        ]
    )


def _format_lines(layout: Format) -> Iterator[str]:
    if stated := layout.model_dump(exclude_unset=True):
        yield "format:"
        yield from (f"  {key}: {json.dumps(value)}" for key, value in stated.items())


def _left_out_lines(left_out: Mapping[str, str]) -> Iterator[str]:
    if left_out:
        yield "# Left out:"
        yield from (f"#   {one_line(f'{name}: {what}', 400)}" for name, what in left_out.items())


def _time_of(table: Table, columns: Sequence[SeenColumn]) -> tuple[SeenColumn, ...]:
    """Return the time column, or two columns to be added; none if no time is found."""
    if table.time:
        return tuple(column for column in columns if column.number - 1 in table.time)
    if pair := _stamp_in_two(columns):
        return pair
    rising = [column for column in columns if column.rises]
    # stamps that restart with each episode rise within an episode
    again = [column for column in columns if column.begins]
    named = [c for c in (*rising, *again) if is_time(c.name)]
    # the first column of an array, as written by Simulink
    unnamed = [column for column in rising if not column.name or column.name.endswith("/1")]
    dated = [c for c in rising if units_of_date(c.low) and units_of_date(c.high)]
    timed = [c for c in rising if stated_unit("time", c.name)]
    return tuple([*named, *timed, *unnamed, *dated][:1])


def _stamp_in_two(columns: Sequence[SeenColumn]) -> tuple[SeenColumn, ...]:
    """Return columns of seconds and nanoseconds with otherwise equal names, or without names."""
    seconds = {}
    for column in columns:
        words = words_of(column.name)
        if SECOND_WORDS.intersection(words):
            seconds[tuple(word for word in words if word not in SECOND_WORDS)] = column
    for column in columns:
        words = words_of(column.name)
        rest = tuple(word for word in words if word not in NANOSECOND_WORDS)
        is_part = 0 <= column.low <= column.high < 1e9
        if len(rest) < len(words) and is_part and rest in seconds:
            return seconds[rest], column
    for first, second in pairwise(columns):  # as by ros2 topic echo --csv
        dates = [units_of_date(each) for each in (first.low, first.high)]
        whole = first.held and first.rises and all("s" in units for units in dates)
        named = first.name or second.name
        if whole and not named and 0 <= second.low < 1e8 < second.high < 1e9:
            return first, second
    return ()


def _time_lines(time: Sequence[SeenColumn], *, from_format: bool) -> Iterator[str]:
    if not time:
        yield "time:"
        yield f"  rate: {mark_unstated('samples per second [Hz]')}"
    elif from_format:
        yield "time: {column: sec, unit: s, plus: {column: nanosec, unit: ns}}"
    elif len(time) > 1:
        yield "time:"
        yield f"  column: {time[0].key}"
        yield "  unit: s"
        yield "  plus:"
        yield f"    column: {time[1].key}"
        yield "    unit: ns"
    else:
        step = time[0].step
        rates = {unit: 1 / (step * s) for unit, s in SECONDS.items() if step > 0}
        likely = {unit: f"{rate:.4g} Hz" for unit, rate in rates.items() if 15 < rate < 1e5}
        by_name = stated_unit("time", time[0].name)
        dates = [each for each in units_of_date(time[0].low).items() if each[0] in likely]
        yield "time:"
        yield f"  column: {time[0].key}"
        if time[0].held:
            repeating = "s, ms, us or ns; most stamps repeat: add the column of their fractions"
            yield f"  unit: {mark_unstated(repeating)}"
        elif by_name in likely:
            yield f"  unit: {by_name} # by its name: {likely[by_name]}"
        elif len(dates) == 1:
            ((unit, year),) = dates
            yield f"  unit: {unit} # since {year}: {likely[unit]}"
        else:
            # only dates count in 100 ns
            guesses = [f"{unit} if {rate}" for unit, rate in likely.items() if unit != "100 ns"]
            yield f"  unit: {mark_unstated(', '.join(guesses or SECONDS))}"


def _segment_lines(time: Sequence[SeenColumn], looked_at: int) -> Iterator[str]:
    """Yield lines of a map with the rows of each segment, if stamps restart."""
    if len(time) != 1 or not time[0].begins:
        return
    if looked_at >= LOOKED_AT:
        rows = ", ".join(str(begin + 1) for begin in time[0].begins[:5])
        yield (
            f"rows: {UNSTATED} segments, such as [[1, 500], ...]; time stamps restart in row {rows}"
        )
        return
    edges = [0, *time[0].begins, looked_at]
    segments = ", ".join(f"[{first + 1}, {last}]" for first, last in pairwise(edges))
    yield f"rows: [{segments}] # time stamps restart with each"


def _joints(columns: Sequence[SeenColumn]) -> list[dict[str, SeenColumn]]:
    """Match columns to joints by names; return a joint without columns if none match.

    Velocities and torques go to the position whose name has the same numbers and the most common
    words. Where torques are found, positions without a torque are joints if their names are equal
    except for an unused number. Otherwise torques are the only other columns with the numbers of
    all positions.
    """
    kinds: dict[str, list[Named]] = {}
    for column in columns:
        kind, rest = meaning_of(column.name, rises=column.rises)
        numbers = [each for each in rest if each.isdigit()]
        kinds.setdefault(kind, []).append((column, set(rest), numbers))
    if "torque" not in kinds:
        kinds["torque"] = _numbered_alike(kinds.get("", ()), kinds.get("position", ()))
    joints = [{"position": column} for column, *_ in kinds.get("position", ())]
    of_positions = [numbers for *_, numbers in kinds.get("position", ())]
    for kind in ("velocity", "torque"):
        # numbers count in order, and not as in names of joints, if one has no position
        bare = (numbers for _, own, numbers in kinds.get(kind, ()) if own == set(numbers))
        apart = any(numbers not in of_positions for numbers in bare)
        pairs = [
            (
                not COMPUTED & own,
                len(words & own) - 0.1 * len(own ^ words),
                -column.number,
                -joint,
                column,
            )
            for column, own, numbers in kinds.get(kind, ())
            for joint, (_, words, others) in enumerate(kinds.get("position", ()))
            if numbers == others and (not apart or own != set(numbers) or words == set(others))
        ]
        taken: set[int] = set()
        for *_, joint, column in sorted(pairs, reverse=True, key=lambda pair: pair[:4]):
            if kind not in joints[-joint] and column.number not in taken:
                joints[-joint][kind] = column
                taken.add(column.number)
    positions = kinds.get("position", ())
    named = [(numbers, words.difference(numbers)) for _, words, numbers in positions]
    whole = [names for names, joint in zip(named, joints, strict=True) if "torque" in joint]
    numbered, alike = ([names[k] for names in whole] for k in (0, 1))
    return [
        joint
        for (numbers, words), joint in zip(named, joints, strict=True)
        if not whole or "torque" in joint or (words in alike and numbers not in numbered)
    ] or [{}]


def _sort_joints(
    robot: Robot, joints: Sequence[dict[str, SeenColumn]]
) -> list[dict[str, SeenColumn]]:
    """Return the columns of each joint of a robot, by joint names if columns have such names."""
    found: list[dict[str, SeenColumn]] = []
    for name in robot.joint_names:
        words = set(words_of(name))
        alike = [j for j in joints if j and words <= set(words_of(j["position"].name))]
        found.append(alike[0] if len(alike) == 1 else {})
    if not any(found):
        found = [*joints, *({} for _ in robot.joint_names)]
    return found[: robot.n_joints]


def _numbered_alike(others: Sequence[Named], positions: Sequence[Named]) -> list[Named]:
    """Return columns with equal names and the numbers of the positions, if the name is unique."""
    families: dict[frozenset[str], list[Named]] = {}
    for each in others:
        families.setdefault(frozenset(each[1].difference(each[2])), []).append(each)
    wanted = sorted(numbers for *_, numbers in positions)
    found = [each for each in families.values() if sorted(n for *_, n in each) == wanted]
    return found[0] if len(found) == 1 else []


def _not_placed(
    columns: Sequence[SeenColumn], joints: Sequence[Mapping[str, SeenColumn]]
) -> dict[str, str]:
    """Return the columns without a joint, with the reason."""
    placed = {column.number for joint in joints for column in joint.values()}
    found: dict[str, list[str]] = {}
    for column in columns:
        if column.number not in placed:
            kind = meaning_of(column.name, rises=column.rises)[0]
            found.setdefault(kind, []).append(column.name or str(column.number))
    if not any(column.name for column in columns) and found:
        (numbers,) = found.values()
        successive = int(numbers[-1]) - int(numbers[0]) == len(numbers) - 1 > 1
        listed = f"{numbers[0]} to {numbers[-1]}" if successive else ", ".join(numbers)
        what = "the file has no names of columns; write the numbers of positions and torques above"
        return {f"column{'s' * (len(numbers) > 1)} {listed}": what}
    if_one = "if measured, write one above as column"
    reasons = {
        "": f"meaning of the name unknown; {if_one} of a joint's position, velocity or torque",
        OTHER: f"set point or time, by the name; {if_one}",
        "position": "position by the name, without a torque of equal number or a joint of the "
        f"robot; {if_one}",
    }
    alone = f"by the name, without a position of equal number or beside another {{}}; {if_one}"
    return {
        ", ".join(_families(names)): reasons.get(kind, f"{kind} {alone.format(kind)}")
        for kind, names in found.items()
    }


def _families(names: Sequence[str]) -> Iterator[str]:
    """Yield names, successive columns of an array as the first and the last."""
    for stem, family in groupby(names, lambda name: re.sub(r"\d+$", "", name)):
        first, *rest = family
        yield (
            f"{first} to {rest[-1]}"
            if stem != first and len(rest) > 1
            else ", ".join((first, *rest))
        )


def _joint(
    joint: dict[str, SeenColumn], robot: Robot | None, axis: int, *, from_ros: bool
) -> Iterator[str]:
    start, name = "  - ", f" # {one_line(robot.joint_names[axis])}" if robot else ""
    for key in ("position", "velocity", "torque"):
        column = joint.get(key)
        if column is None and key == "velocity":
            continue
        yield f"{start}{key}:{name}"
        start, name = "    ", ""
        lacking = f"number or name of the column of its {key}s"
        yield f"      column: {column.key if column else mark_unstated(lacking)}"
        if from_ros:
            yield f"      unit: {_ros_unit(key, robot, axis)}"
            continue
        unit = stated_unit(key, column.name) if column else ""
        if column and unit:
            written = quoted(unit) if unit == "%" else unit
            yield f"      unit: {written} # by its name; up to {column.most:.4g}"
        else:
            yield f"      unit: {mark_unstated(f'{_UNITS[key]}{_guess(key, column)}')}"
        if unit.startswith("counts"):
            yield f"      per_unit: {mark_unstated('rad (m) for one count')}"
        if key == "torque" and unit not in ("N m", "N"):
            gain = "N m, or N, for one unit; or unknown"
            yield (
                f"      gain: {mark_unstated(gain)}"
                if unit
                else f"      # gain: {gain}; for other units than N m and N"
            )


def _ros_unit(key: str, robot: Robot | None, axis: int) -> str:
    """Return the unit of joint states, that of a revolute joint for an unknown robot."""
    if robot is None:
        turning = {"position": "rad", "velocity": "rad/s", "torque": "N m"}[key]
        return f"{turning} # ROS unit of revolute joints"
    q = robot.position_unit(axis)
    return {"position": q, "velocity": f"{q}/s", "torque": robot.torque_unit(axis)}[key]


def _guess(key: str, column: SeenColumn | None) -> str:
    """Return a guess of the unit from name and magnitude, in words."""
    if column is None:
        return ""
    most = column.most
    if unit := unit_in(column.name)[0]:
        return f"; up to {most:.4g}, and its name says {one_line(unit, 40)}"
    if key != "position":
        guessed = (
            ""
            if meaning_of(column.name, rises=column.rises)[0]
            else ", guessed: numbered like the positions"
        )
        return f"; up to {most:.4g}{guessed}"
    likely = "rad or m" if most < 7 else "deg" if most <= 400 else "counts or mm"
    return f"; up to {most:.4g} looks like {likely}"


@dataclass(frozen=True)
class SeenColumn:
    """Inspected column: number from 1, name, and extremes of the values.

    `begins` are the rows, from 0, with a falling value, for a column that rises in nearly all rows;
    `held` is True if most values repeat.
    """

    number: int
    name: str
    low: float
    high: float
    rises: bool
    step: float
    begins: tuple[int, ...] = ()
    held: bool = False

    @property
    def most(self) -> float:
        """Largest absolute value."""
        return max(abs(self.low), abs(self.high))

    @property
    def key(self) -> str:
        """Name or number for the map."""
        return quoted(self.name) if self.name else str(self.number)


def look(table: Table) -> tuple[list[SeenColumn], int, dict[str, str]]:
    """Inspect the columns of numbers; return columns, number of rows read, and left-out columns."""
    every, empty = list(range(len(table.names))), {}
    try:
        values = _first_rows(table, every)
        columns = dict(zip(every, values.T, strict=True))
    except FileError:  # text in a column, or columns of different lengths: read column by column
        columns = {}
        for index in every:
            try:
                columns[index] = _first_rows(table, [index])[:, 0]
            except FileError as error:
                name = table.names[index] or f"column {index + 1}"
                if not any(other.startswith((f"{name}/", f"{name}.")) for other in table.names):
                    empty[name] = _reason(error, table.path)
    looked_at = max(map(len, columns.values()), default=0)
    seen = []
    for index, values in columns.items():
        if np.isfinite(values).any():
            seen.append(_seen(index, table.names[index], values[np.isfinite(values)]))
        else:
            name = table.names[index] or f"column {index + 1}"
            empty[name] = f"no number in any of its first {len(values)} rows"
    return seen, looked_at, empty


def _reason(error: FileError, path: Path) -> str:
    """Return the fault of a column without file, line and remedy for a map."""
    return re.sub(r"^:(\d+:)? ", "", str(error).removeprefix(str(path))).split(";")[0]


def _first_rows(table: Table, columns: Sequence[int]) -> Array:
    blocks, n = [np.empty((0, len(columns)))], 0
    for block in table.blocks(columns):
        blocks.append(block)
        n += len(block)
        if n >= LOOKED_AT:
            break
    return np.concatenate(blocks)


def _seen(index: int, name: str, values: Array) -> SeenColumn:
    steps = np.diff(values)
    rises = bool(len(steps) and np.all(steps >= 0) and values[-1] > values[0])
    step = (values[-1] - values[0]) / max(1, len(steps))
    # stamps restart if the mean length of a segment is at least 100 rows
    begins = np.flatnonzero(steps < 0) + 1
    if rises or not 0 < len(begins) <= 0.01 * len(steps):
        begins = begins[:0]
    else:
        step = float(np.median(steps))
    extremes = float(values.min()), float(values.max())
    held = bool(len(steps) and np.mean(steps == 0) > 0.5)
    return SeenColumn(index + 1, name, *extremes, rises, float(step), tuple(begins.tolist()), held)


def described(column: SeenColumn) -> str:
    """Describe a column for a comment."""
    name = f" {one_line(column.name)}" if column.name else ""
    rising = ", rising" if column.rises else ""
    return f"{column.number}{name}: {column.low:.6g} to {column.high:.6g}{rising}"
