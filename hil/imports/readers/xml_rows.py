"""Logs in XML with an element per sample, as sent by KUKA's RSI or stored by SINUMERIK.

Columns are named by the elements within a row and their attributes: ``AIPos.A1``, ``IPOC``; or by a
name given in another element: ``<signal id="f1" name="torque"/>``. Rows are the outermost repeated
elements; those of a log of messages need no common root.
"""

from __future__ import annotations

import re
from array import array
from collections import Counter
from typing import TYPE_CHECKING
from xml.parsers import expat

import numpy as np

from checked_files.budget import CHECKED, refuse_beyond
from checked_files.xml_file import DEEPEST
from checked_files.yaml_file import FileError
from hil.imports.readers.arrays import table_of
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from hil.imports.map_file import Format
    from hil.imports.tables import ArrayTable

    Place = tuple[str, ...]

_DECLARATION = re.compile(r"<\?xml[^>]*\?>")
ROWS = 20
"""Minimum number of equal elements in one place that count as rows: more than the signals of a
file.
"""
CELL = 24
"""Maximum memory of a cell while the columns are joined, beside its text [bytes]; by RSS 17 for a
missing cell, 34 with its text of 11 bytes, held twice."""
COLUMN = 800
"""Maximum memory of a name: of a column, of an element, or of a text in the place of a number; by
RSS 580 for 20 000 kinds of elements, and 916 with 20 rows and their text of 316 bytes."""


def open_xml(path: Path, _: Format) -> ArrayTable:
    """Make a table of the repeated elements.

    Raises
    ------
    FileError
        The file is not XML, or has no repeated elements with numbers.
    """
    with file_errors(path, "read"):
        raw = path.read_bytes()
    wide = raw[:2] in {b"\xff\xfe", b"\xfe\xff"}
    try:
        text = raw.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    # messages of a log have no common root, and repeat the XML declaration
    text = f"<log>{_DECLARATION.sub(lambda found: ' ' * len(found[0]), text)}</log>"
    counts: Counter[Place] = Counter()

    def count(place: Place, _: dict[str, str]) -> None:
        if len(place) > DEEPEST:
            raise FileError(
                f"{path}: nests elements deeper than {DEEPEST} levels; flatten the file"
            )
        counts[place] += 1
        if len(counts) % CHECKED == 0:
            refuse_beyond(path, COLUMN * len(counts), f"{len(counts)} kinds of elements")

    _walk(text, count, lambda *_: None)
    found = _Rows(path, _repeated(counts))
    if error := _walk(text, found.begin, found.end):
        found.notes = (f"invalid XML from line {error} on: only the part before is read",)
    columns = {found.names.get(n, n): np.array(values) for n, values in found.columns.items()}
    if not columns:
        where = f"; invalid XML in line {error}" if error else ""
        raise FileError(
            f"{path}: has no repeated elements with numbers{where}; an element for each sample is "
            "needed: export the recording as CSV"
        )
    table = table_of(path, columns, dict.fromkeys(found.words, "text"))
    table.notes = found.notes
    return table


def _walk(
    text: str,
    begin: Callable[[Place, dict[str, str]], object],
    end: Callable[[Place, str], object],
) -> int:
    """Call functions at start and end of all elements; return the line of an error, or 0."""
    place: list[str] = []
    words: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        place.append(tag)
        words.clear()
        begin(tuple(place), attributes)

    def stop(_: str) -> None:
        end(tuple(place), "".join(words))
        words.clear()
        place.pop()

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, stop
    parser.CharacterDataHandler = words.append
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        return error.lineno
    return 0


def _repeated(counts: Counter[Place]) -> Place:
    """Return the place of the outermost often repeated elements."""
    often = [place for place, count in counts.items() if count >= ROWS]
    return min(often or counts, key=lambda place: (len(place), -counts[place]), default=())


class _Rows:
    """Numbers of the elements at a place, as columns."""

    def __init__(self, path: Path, place: Place) -> None:
        self._path, self._place = path, place
        self._row: dict[str, float] = {}
        self._same: Counter[str] = Counter()
        self._n = 0
        self.columns: dict[str, array[float]] = {}
        self.words: dict[str, None] = {}
        self.names: dict[str, str] = {}
        self.notes: tuple[str, ...] = ()

    def begin(self, place: Place, attributes: dict[str, str]) -> None:
        """Store the attributes of an element."""
        if place[: len(self._place)] == self._place:
            within = place[len(self._place) :]
            for name, value in attributes.items():
                self._take((*within, name), value)
        elif "id" in attributes and "name" in attributes:
            self.names[attributes["id"]] = attributes["name"]
            self._check(len(self.names))

    def end(self, place: Place, text: str) -> None:
        """Store the text of an element, or complete a row."""
        if place == self._place:
            self._add()
        elif text.strip() and place[: len(self._place)] == self._place:
            self._take(place[len(self._place) :], text)

    def _take(self, place: Place, text: str) -> None:
        name = plain = ".".join(place)
        if number := self._same[plain]:  # one element per joint
            name = f"{plain}/{number + 1}"
        try:
            self._row[name] = float(text)
            self._same[plain] += 1
            self._check(len(self._row))
        except ValueError:
            self.words[name] = None
            self._check(len(self.words))

    def _check(self, changed: int) -> None:
        """Refuse too many names; check after every `CHECKED` names of a kind."""
        if changed % CHECKED == 0:
            n = len(self.columns) + len(self._row) + len(self.words) + len(self.names)
            refuse_beyond(self._path, COLUMN * n, f"{n} names")

    def _add(self) -> None:
        new = [each for each in self._row if each not in self.columns]
        if new or self._n % CHECKED == 0:
            size = CELL * (len(self.columns) + len(new)) * (self._n + CHECKED)
            refuse_beyond(self._path, size, f"{len(self.columns)} columns")
        for name in new:
            self.columns[name] = array("d", [np.nan]) * self._n
            self._check(len(self.columns))
        for name, column in self.columns.items():
            column.append(self._row.get(name, np.nan))
        self._n += 1
        self._row.clear()
        self._same.clear()
