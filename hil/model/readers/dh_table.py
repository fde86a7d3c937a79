"""Robot frames from a table in standard or modified Denavit-Hartenberg notation.

Both describe the transformation from joint to joint by rotations and shifts about x and z (Rx, Tx,
Rz, Tz). A row of the modified notation (Khalil and Kleinfinger 1986; Craig) is

    Rx(alpha) Tx(a) Rz(theta) Tz(d),

as in robot files; one of the standard notation (Denavit and Hartenberg 1955) is

    Rz(theta) Tz(d) Tx(a) Rx(alpha).

So a standard table is a modified one with a and alpha of the previous row. In the last row a and
alpha place the tool on the last link and concern no joint.

A CSV table is converted to YAML with each row on its original line, so that errors name the line as
in other files.
"""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from checked_files.yaml_file import FileError, FileModel, parse_yaml, read_text, refuse
from hil.model.frames import QUARTER, snap_angle
from hil.model.polynomial import parse
from hil.model.readers.axes_to_frames import Frames
from hil.model.readers.limits import LimitedJoint
from hil.model.readers.urdf import ROUNDED
from hil.model.robot_file import MOST_JOINTS

if TYPE_CHECKING:
    from collections.abc import Iterator

Notation = Literal["standard", "modified"]
FARTHEST = 20.0
"""Longest plausible shift [m]."""
_VARIABLES = {"revolute": "theta", "prismatic": "d"}
_TYPES = {"r": "revolute", "p": "prismatic"}
KEYS = ("alpha", "a", "d", "theta", "type")
"""Columns of a table; the default type is revolute."""
LIMITS = ("q_min", "q_max", "velocity_limit", "acceleration_limit", "torque_limit")
_HEAD = re.compile(r"\s*([^\[\](]+?)\s*(?:[\[(]\s*(\w+)\s*[\])])?\s*")
_GREEK = {"α": "alpha", "θ": "theta"}
_UNITS = {"alpha": "angles", "theta": "angles", "a": "lengths", "d": "lengths"}
_COMMENT = "#"


class DhRow(FileModel):
    """Row of the table for a joint, with optional limits.

    Angles and lengths are in the table's units, limits in those of the joint.
    """

    type: Literal["revolute", "prismatic"] = "revolute"
    alpha: float
    a: float
    d: float = Field(default=0.0, validate_default=True)
    theta: float = Field(default=0.0, validate_default=True)
    name: str | None = None
    q_min: float = math.nan
    q_max: float = math.nan
    velocity_limit: float = math.nan
    acceleration_limit: float = math.nan
    torque_limit: float = math.nan

    @field_validator("type", mode="before")
    @classmethod
    def _initial(cls, value: object) -> object:
        return _TYPES.get(value.lower(), value.lower()) if isinstance(value, str) else value

    @field_validator("alpha", "a", "d", "theta", mode="before")
    @classmethod
    def _constant(cls, value: object, info: ValidationInfo) -> float:
        return _constant(value, str(info.field_name), info.data.get("type", "revolute"))

    @field_validator("q_max", "velocity_limit", "acceleration_limit", "torque_limit")
    @classmethod
    def _rises(cls, value: float, info: ValidationInfo) -> float:
        least = info.data.get("q_min", math.nan) if info.field_name == "q_max" else 0.0
        if value <= least:
            raise ValueError(f"{value:g} must be greater than {least:g}")
        return value


def _constant(value: object, key: str, kind: str) -> float:
    """Parse the number in a cell, without the joint's variable: ``q2 - 90`` is -90."""
    variable = _VARIABLES[kind]
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ValueError(f"{value!r} must be a number")  # noqa: TRY004 - pydantic expects ValueError
    found = parse(str(value).replace("*", "") if str(value).endswith("*") else str(value))
    names = found.names
    if names and (key != variable or len(names) > 1 or found.terms.get(tuple(names)) != 1.0):
        raise ValueError(
            f"{value!r} must be a number; only {variable} of a {kind} joint may hold the joint's"
            " variable, once and without a factor: q2 - 90"
        )
    if len(found.terms) > len(names) + (() in found.terms):
        raise ValueError(f"{value!r} must be linear in the joint's variable")
    return found.terms.get((), 0.0)


class DhTable(FileModel):
    """Denavit-Hartenberg table with units of angles and lengths."""

    angles: Literal["rad", "deg"]
    lengths: Literal["m", "mm"] = "m"
    name: str | None = None
    joints: tuple[DhRow, ...] = Field(min_length=1, max_length=MOST_JOINTS)


@dataclass(frozen=True, slots=True, eq=False)
class DhRobot:
    """Robot read from a table.

    Attributes
    ----------
    notation : {"standard", "modified"}
    frames : Frames
        Frames in modified notation; frame 0 is that of the table.
    rounded : float
        Largest change of an angle by rounding to quarter turns [rad].
    """

    name: str
    notation: Notation
    joints: tuple[LimitedJoint, ...]
    frames: Frames
    rounded: float


def read_dh(path: str | Path, notation: Notation) -> DhRobot:
    """Read a table from YAML, or from CSV for any other file ending.

    Raises
    ------
    FileError
        An unreadable or invalid table: one line for each problem, with its place.
    """
    text, source = read_text(path), str(path)
    if Path(path).suffix.lower() not in (".yaml", ".yml"):
        text = convert_table(text, source)
    table = parse_yaml(text, DhTable, source)
    rows = enumerate(table.joints)
    refuse(source, text, chain.from_iterable(_implausible(*row, table) for row in rows))
    return _robot(table, table.name or Path(path).stem, notation)


def _implausible(
    number: int, row: DhRow, table: DhTable
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    for key in ("alpha", "theta"):
        angle = getattr(row, key)
        if table.angles == "rad" and abs(angle) > 2 * math.pi + ROUNDED:
            yield (
                ("joints", number, key),
                f"{angle:g} rad must be within +-2 pi: it looks like degrees; state deg",
            )
        quarters = round(angle / QUARTER)
        near = 0 < abs(quarters) <= 4 and abs(angle - quarters * QUARTER) < ROUNDED
        if table.angles == "deg" and near:
            yield (
                ("joints", number, key),
                f"{angle:g} degrees look like {quarters}*pi/2 rad; state rad, or write degrees",
            )
    for key in ("a", "d"):
        length = getattr(row, key)
        if abs(length * _metres(table)) > FARTHEST:
            yield (
                ("joints", number, key),
                f"{length:g} {table.lengths} must be within +-{FARTHEST:g} m: state mm if it is"
                " in millimetres",
            )


def _metres(table: DhTable) -> float:
    return 1e-3 if table.lengths == "mm" else 1.0


def _robot(table: DhTable, name: str, notation: Notation) -> DhRobot:
    radians = math.pi / 180 if table.angles == "deg" else 1.0
    rows = table.joints
    stated = np.array([[row.alpha, row.theta] for row in rows]).T * radians
    alpha, theta = exact = np.array([[snap_angle(x, ROUNDED) for x in row] for row in stated])
    a, d = np.array([[row.a, row.d] for row in rows]).T * _metres(table)
    if notation == "standard":
        alpha, a = (np.concatenate([[0.0], column[:-1]]) for column in (alpha, a))
    zero, parents = np.zeros_like(a), tuple(range(-1, len(rows) - 1))
    frames = Frames(alpha, a, theta, d, gamma=zero, b=zero, parents=parents, base=np.eye(4))
    joints = tuple(_make_joint(row, f"joint {k}", table) for k, row in enumerate(rows, start=1))
    return DhRobot(name, notation, joints, frames, float(np.max(np.abs(exact - stated))))


def _make_joint(row: DhRow, name: str, table: DhTable) -> LimitedJoint:
    turning = row.type == "revolute"
    unit = (math.pi / 180 if table.angles == "deg" else 1.0) if turning else _metres(table)
    return LimitedJoint(
        name=row.name or name,
        type=row.type,
        lower=row.q_min * unit,
        upper=row.q_max * unit,
        velocity=row.velocity_limit * unit,
        acceleration=row.acceleration_limit * unit,
        effort=row.torque_limit,
    )


def convert_table(text: str, source: str) -> str:
    """Convert a CSV to YAML of `hil.model.readers.dh_table.DhTable`, line by line.

    Raises
    ------
    FileError
        A header without the columns or their units, or a row of another length.
    """
    lines = text.splitlines()
    used = [
        (k, line)
        for k, line in enumerate(lines)
        if line.strip(" \t,;") and not line.lstrip().startswith(_COMMENT)
    ]
    if len(used) > 1 + MOST_JOINTS:
        raise FileError(
            f"{source}:{used[1 + MOST_JOINTS][0] + 1}: {len(used) - 1} rows must be at most "
            f"{MOST_JOINTS}, one per joint; remove the others"
        )
    if not used:
        raise FileError(f"{source}:1: has no rows; the first is {','.join(KEYS)}")
    delimiter = max(";\t,", key=used[0][1].count)
    (head, names), *rows = [(k, _cells(line, delimiter)) for k, line in used]
    at = f"{source}:{head + 1}"
    keys, units = _header(names, at)
    found = [""] * len(lines)
    stated = "".join(f"{key}: {unit}, " for key, unit in units.items())
    found[head] = f"{{{stated}joints: ["
    for k, cells in rows:
        if len(cells) != len(keys):
            raise FileError(
                f"{source}:{k + 1}: {len(cells)} cells must be {len(keys)}, as in the head"
            )
        # format a row as a mapping; empty cells are left out
        words = [key in ("type", "name") for key in keys]
        pairs = [
            f"{key}: {json.dumps(cell if is_word or delimiter == ',' else cell.replace(',', '.'))}"
            for key, cell, is_word in zip(keys, cells, words, strict=True)
            if cell
        ]
        found[k] = f"  {{{', '.join(pairs)}}},"
    return "\n".join([*found, "]}"])


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _header(names: list[str], at: str) -> tuple[list[str], dict[str, str]]:
    """Return the keys of the columns, and the units of angles and lengths."""
    keys: list[str] = []
    units: dict[str, str] = {}
    for name in names:
        match = _HEAD.fullmatch(name)
        key, unit = (match[1].lower(), match[2]) if match else (name, None)
        key = _GREEK.get(key, key)
        if key not in (*KEYS, *LIMITS, "name") or (unit and key not in _UNITS):
            raise FileError(
                f"{at}: {name[:40]!r} must be one of {', '.join((*KEYS, *LIMITS))} or name; "
                "units follow alpha, theta, a and d: alpha [deg]"
            )
        if key in keys:
            raise FileError(f"{at}: {key} is stated twice; remove one of the columns")
        keys.append(key)
        if unit and units.setdefault(_UNITS[key], unit) != unit:
            raise FileError(
                f"{at}: {unit} of {key} must be {units[_UNITS[key]]}, as in another column"
            )
    missing = [key for key in KEYS[:4] if key not in keys]
    if missing:
        raise FileError(f"{at}: has no column {missing[0]}; the first row is {','.join(KEYS)}")
    if "angles" not in units:
        raise FileError(f"{at}: the unit of angles is missing; write alpha [rad] or alpha [deg]")
    return keys, units
