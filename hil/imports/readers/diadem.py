"""Traces in the format of DIAdem, as written by KUKA's controllers: a text header and value files.

The header (`.dat`) has a line ``KEY,VALUE`` for each property of a channel: 200 name, 202 unit, 210
explicit or implicit, 211 file of the values, 213 storage, 214 type, 220 number of values, 221 place
of the first value, from 1, 240 offset, 241 factor, 254 value that stands for none. An implicit
channel, such as time, is offset + factor k. Values of explicit channels are in a file (`.r64`,
`.r32`, `.i16` ...), channel by channel (CHANNEL), or sample by sample of all its channels (BLOCK).

Columns are called ``NAME [UNIT]``.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from checked_files.budget import allowed, refuse_beyond
from checked_files.foreign_text import one_line
from checked_files.yaml_file import FileError
from hil.imports.tables import ArrayTable, listed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path
    from typing import NoReturn

    from hil.arrays import Array
    from hil.imports.map_file import Format

    Header = dict[str, str]

_MARK, _BEGIN, _END = "DIAEXTENDED", "#BEGINCHANNELHEADER", "#ENDCHANNELHEADER"
CHANNEL, PROPERTY, CHARACTER = 2000, 300, 5
"""Maximum memory of a channel, of a property of a channel, and of a property's character [bytes].

By tracemalloc: 1160 for a channel of five properties, 81 for a further property, 4.2 in UCS-4.
"""
_TYPES = {
    "REAL64": "f8", "REAL32": "f4", "INT16": "i2", "INT32": "i4",
    "WORD8": "u1", "WORD16": "u2", "WORD32": "u4",
}  # fmt: skip


class _NotRead(Exception):
    """Reason for leaving out a channel, with the remedy."""


def is_diadem(head: str) -> bool:
    """Return True if a file starting with `head` is a header of DIAdem."""
    return head.lstrip("\ufeff").startswith(_MARK)


def open_values(path: Path, _: Format) -> NoReturn:
    """Refuse a value file, whose channels are named only in its header (`FileError`)."""
    raise FileError(
        f"{path}: holds the values of a trace (KUKA, DIAdem) without their names; import its "
        f"header, {path.with_suffix('.dat').name}, instead, and keep both in one folder"
    )


def open_diadem(path: Path, lines: Iterable[str]) -> ArrayTable:
    """Make a table of a header's channels, from its lines.

    Raises
    ------
    FileError
        No channel has readable values.
    """
    channels, swapped = _channels(path, lines)
    together = Counter((each.get("211"), each.get("213")) for each in channels)
    columns: dict[str, tuple[int, Callable[[slice], object]]] = {}
    left_out: dict[str, str] = {}
    explicit = 0
    for number, channel in enumerate(channels, start=1):
        unit = channel.get("202", "").strip("[] ")
        name = channel.get("200", f"channel {number}") + (f" [{unit}]" if unit else "")
        name = name if name not in columns else f"{name} ({number})"
        try:
            n_stored = together[channel.get("211"), channel.get("213")]
            columns[name] = _column(path, channel, n_stored, swapped)
            explicit += channel["210"].startswith("E")
        except _NotRead as error:
            left_out[name] = str(error)
        except (KeyError, ValueError) as error:
            left_out[name] = f"a channel whose header lacks, or misstates, {one_line(str(error))}"
    if not explicit:
        raise FileError(f"{path}: has no channel with values{listed(left_out)}")
    return ArrayTable(path, columns, left_out)


def _channels(path: Path, lines: Iterable[str]) -> tuple[list[Header], bool]:
    """Return the headers of the channels, and whether values have their high byte first."""
    channels: list[Header] = []
    general: Header = {}
    now, size, most = general, 0, allowed(path)
    for line in map(str.strip, lines):
        if line == _BEGIN:
            channels.append(now := {})
            size += CHANNEL
        elif line == _END:
            now = general
        key, comma, value = line.partition(",")
        if comma:
            now[key.strip()] = value.strip()
            size += PROPERTY + CHARACTER * len(line)
        if size > most:
            refuse_beyond(path, size, "its channels")
    for channel in channels:
        channel.setdefault("254", general.get("111", "nan"))
    return channels, general.get("112", "").replace(" ", "") == "Low->High"


def _column(
    path: Path, channel: Header, n_stored: int, swapped: bool
) -> tuple[int, Callable[[slice], object]]:
    """Return the length of a channel, and a function that reads a slice.

    The channel's file holds `n_stored` channels stored alike; `swapped` values begin with the high
    byte.
    """
    n, offset, factor = int(channel["220"]), float(channel["240"]), float(channel["241"])
    if not channel["210"].startswith("E"):
        return n, lambda part: offset + factor * np.arange(*part.indices(n))
    values, none = _values(path, channel, n_stored, swapped), float(channel["254"])

    def read(part: slice) -> Array:
        found = values[part].astype(np.float64)
        return np.where(found == none, np.nan, offset + factor * found)

    return n, read


def _values(path: Path, channel: Header, n_stored: int, swapped: bool) -> Array:
    """Return the stored values of a channel, mapped from their file, shape (n,)."""
    name, stored, n = channel["211"], channel["214"], int(channel["220"])
    known = stored in _TYPES and channel["213"] in {"BLOCK", "CHANNEL"}
    if not known or int(channel.get("222") or 0):  # a header before the values
        raise _NotRead(
            f"values as {one_line(stored, 20)}, stored by {one_line(channel['213'], 20)}: not "
            "supported; export them as REAL64, or as CSV"
        )
    file, first = _find_file(path, name), int(channel["221"]) - 1
    apart = n_stored if channel["213"] == "BLOCK" else 1
    kind = np.dtype(f"{'>' if swapped else '<'}{_TYPES[stored]}")
    there, last = file.stat().st_size // kind.itemsize, first + apart * (n - 1)
    if not 0 <= first <= last < there:
        raise _NotRead(
            f"{n} values, number {first + 1} to {last + 1} of {one_line(name, 60)}, which holds "
            f"only {there}; copy that file again"
        )
    return np.memmap(file, kind, "r")[first : last + 1 : apart]


def _find_file(path: Path, name: str) -> Path:
    """Find a value file in the header's folder, ignoring the case of its name."""
    if "/" not in name and "\\" not in name:
        for file in path.parent.iterdir():
            if file.name.lower() == name.lower() and file.is_file() and not file.is_symlink():
                return file
    raise _NotRead(f"values in {one_line(name, 60)}; copy that file beside {path.name}")
