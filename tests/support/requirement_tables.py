"""Tables of the documentation, generated from the table of requirements.

`python tests/support/requirement_tables.py` rewrites these tables, each between its two marks.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.canopen.rules import REQUIREMENTS
from drivers.commissioning.requirements import EXACT, Lack, Use
from drivers.ethercat.rules import REQUIREMENTS as OVER_ETHERCAT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from drivers.commissioning.requirements import Requirement
    from drivers.fieldbus import Entry

DOCS = Path(__file__).parents[2] / "docs"
BUSES = {"CAN": REQUIREMENTS, "EtherCAT": OVER_ETHERCAT}
USES = {
    Use.ASK: "compared",
    Use.READ: "read",
    Use.READ | Use.SEND: "read, in a TPDO",
    Use.WRITE | Use.RECEIVE: "written, in an RPDO",
    Use.WRITE | Use.VARY: "written",
    Use.SET: "set",
    Use.SET | Use.VARY: "set each motion",
}


def needed() -> str:
    """Return required objects, their use, the consequence of their absence, and the place of the
    check.
    """

    def follows(row: Requirement) -> tuple[str, str, str]:
        sentence = row.without if row.lack is Lack.SILENT else f"{row.lack.value}: {row.without}"
        named = [name for name, rows in BUSES.items() if row.entry in rows]
        return USES[row.use], sentence, "both" if len(named) > 1 else named[0]

    rows = {**OVER_ETHERCAT, **REQUIREMENTS}
    ordered = [*REQUIREMENTS, *(entry for entry in OVER_ETHERCAT if entry not in REQUIREMENTS)]
    head = ("object", "use", "if missing", "bus")
    return _table(head, _grouped([rows[entry] for entry in ordered], follows))


def kept() -> str:
    """Return permitted differences between a written value and its readback."""
    rows = [row for row in REQUIREMENTS.values() if row.kept is not EXACT or row.serves]
    lines = [*_grouped(rows, lambda row: (_words(row),), _alone), ("all others", EXACT.words)]
    return _table(("object", "accepted"), lines)


TABLES: dict[tuple[str, str], Callable[[], str]] = {
    ("reference/can.md", "requirements"): needed,
    ("reference/drives.md", "kept values"): kept,
}
"""Tables by file and name of the mark."""


def insert_tables(file: str) -> str:
    """Return the text of a file with its tables regenerated."""
    text = (DOCS / file).read_text()
    for (name, mark), made in TABLES.items():
        if name == file:
            begin = f"<!-- {mark}: made by tests/support/{Path(__file__).name} -->\n"
            parts = re.fullmatch(f"(.*{re.escape(begin)}).*?(<!-- end -->.*)", text, re.S)
            assert parts, f"{file} has no marks for {mark}"
            text = f"{parts[1]}\n{made()}\n{parts[2]}"
    return text


def _alone(row: Requirement) -> str:
    return _index(row.entry)


def _name_substitutes(row: Requirement) -> str:
    """Return the index of an object, and the indices of its substitutes."""
    mutual = row.instead and row.entry in REQUIREMENTS[row.instead[0]].instead
    entries = sorted((row.entry, *row.instead), key=_index) if mutual else (row.entry, *row.instead)
    first, *others = (_index(entry) for entry in entries)
    return f"{first} or {' and '.join(others)}" if others else first


def _index(entry: Entry) -> str:
    return f"{entry.index:04X}"


def _grouped(
    rows: Iterable[Requirement],
    describe: Callable[[Requirement], tuple[str, ...]],
    named: Callable[[Requirement], str] = _name_substitutes,
) -> Iterator[tuple[str, ...]]:
    """Yield a line for all objects with equal entries."""
    groups: dict[tuple[str, ...], list[Requirement]] = {}
    for row in rows:
        groups.setdefault(describe(row), []).append(row)
    for described, group in groups.items():
        yield (", ".join(dict.fromkeys(map(named, group))), *described)


def _words(row: Requirement) -> str:
    if row.kept is not EXACT:
        return row.kept.words
    if isinstance(row.serves, range):
        return "any value"
    values = sorted({*row.serves, *(() if row.value is None else (row.value,))})
    hexadecimal = any(value > 0xFFFF for value in values)
    *some, last = (f"{value:X}h" if hexadecimal else f"{value}" for value in values)
    return f"{', '.join(some)} or {last}"


def _table(head: tuple[str, ...], lines: Iterable[tuple[str, ...]]) -> str:
    rows = (head, ("---",) * len(head), *lines)
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


if __name__ == "__main__":
    for each, _ in TABLES:
        (DOCS / each).write_text(insert_tables(each))
