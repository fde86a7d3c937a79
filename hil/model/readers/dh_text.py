"""A table of Denavit-Hartenberg parameters as CSV, line by line into YAML.

Each row becomes one line of YAML on the line where it stands, so that whatever is wrong with it is
reported with its line like anything else that users write.
"""

from __future__ import annotations

import csv
import json
import re

from checked_files.yaml_file import FileError

KEYS = ("alpha", "a", "d", "theta", "type")
"""Columns that a table is made of; type is revolute where it is left out."""
LIMITS = ("q_min", "q_max", "velocity_limit", "acceleration_limit", "torque_limit")
_HEAD = re.compile(r"\s*([^\[\](]+?)\s*(?:[\[(]\s*(\w+)\s*[\])])?\s*")
_GREEK = {"α": "alpha", "θ": "theta"}
_UNITS = {"alpha": "angles", "theta": "angles", "a": "lengths", "d": "lengths"}
_COMMENT = "#"


def yaml_of_table(text: str, source: str) -> str:
    """Text of a CSV as YAML of `hil.model.readers.dh_table.DhTable`, on the same lines.

    Raises
    ------
    FileError
        It has no header with the columns and their units, or a row of another length.
    """
    lines = text.splitlines()
    used = [(k, line) for k, line in enumerate(lines) if _is_row(line)]
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
            raise FileError(f"{source}:{k + 1}: {len(cells)} cells must be {len(keys)}, as above")
        found[k] = _row(keys, cells, delimiter)
    return "\n".join([*found, "]}"])


def _is_row(line: str) -> bool:
    return bool(line.strip(" \t,;")) and not line.lstrip().startswith(_COMMENT)


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _header(names: list[str], at: str) -> tuple[list[str], dict[str, str]]:
    """Keys of the columns, and the units of angles and lengths."""
    keys: list[str] = []
    units: dict[str, str] = {}
    for name in names:
        match = _HEAD.fullmatch(name)
        key, unit = (match[1].lower(), match[2]) if match else (name, None)
        key = _GREEK.get(key, key)
        if key not in (*KEYS, *LIMITS, "name") or (unit and key not in _UNITS):
            raise FileError(
                f"{at}: {name[:40]!r} must be one of {', '.join((*KEYS, *LIMITS))} or name; units"
                " stand behind alpha, theta, a and d: alpha [deg]"
            )
        if key in keys:
            raise FileError(f"{at}: {key} stands twice; remove one of the columns")
        keys.append(key)
        if unit and units.setdefault(_UNITS[key], unit) != unit:
            raise FileError(f"{at}: {unit} of {key} must be {units[_UNITS[key]]}, as before")
    missing = [key for key in KEYS[:4] if key not in keys]
    if missing:
        raise FileError(f"{at}: has no column {missing[0]}; the first row is {','.join(KEYS)}")
    if "angles" not in units:
        raise FileError(f"{at}: the unit of angles is missing; write alpha [rad] or alpha [deg]")
    return keys, units


def _row(keys: list[str], cells: list[str], delimiter: str) -> str:
    """A row as a mapping; an empty cell is no key."""
    text = [key in ("type", "name") for key in keys]
    pairs = [
        f"{key}: {json.dumps(cell if is_text or delimiter == ',' else cell.replace(',', '.'))}"
        for key, cell, is_text in zip(keys, cells, text, strict=True)
        if cell
    ]
    return f"  {{{', '.join(pairs)}}},"
