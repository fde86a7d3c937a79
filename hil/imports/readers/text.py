"""Text tables: CSV, TSV, columns of blanks, also compressed; read block by block.

A cell is missing (NaN) if it is empty or reads nan, na, null, none or inf; any other text in a
wanted column is an error with its place. Instants, such as 2026-01-31 12:00:00.005, 31.01.2026
12:00:00 or 12:00:00.005, become ns.
"""

from __future__ import annotations

import codecs
import gzip
import io
import math
import re
import warnings
import zlib
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import IO, TYPE_CHECKING, Any, cast

import numpy as np

from checked_files.budget import PASSED, refuse_beyond
from checked_files.foreign_text import one_line
from checked_files.yaml_file import FileError
from hil.imports.readers.arrow import plain_rows
from hil.imports.readers.diadem import is_diadem, open_diadem
from hil.imports.readers.layout import (
    DATE,
    MISSING,
    Layout,
    LongLayout,
    NoNumbers,
    cells,
    decoded,
    instant,
    layout_of,
)
from hil.imports.readers.lists import LIST, flat, layout_of_lists
from hil.imports.readers.stacked import Channels, is_stacked, open_stacked
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.imports.map_file import Format
    from hil.imports.tables import Table


BLOCK = 1 << 23
"""Bytes read at a time."""
PIECE, AS_TEXT = 1 << 20, 1 << 26
"""Size of a block with more than plain numbers, and maximum memory of its cells as an array of
text, in which the longest cell determines the size of all cells [bytes].
"""
_HEAD = 1 << 16
MOST_SIGNALS = 200
"""Maximum number of signals of a recording in lines: some six for each of the joints of a chain."""
_CAN_FRAMES = re.compile(r"\(\d+\.\d+\) +\w+ +[0-9A-F]+#")
"""Pattern of the first frame in a log of candump."""


class TextTable:
    """Text table (see `hil.imports.tables.Table`).

    Attributes
    ----------
    headers : list of int
        Rows, from 0, that repeat the header, found while blocks are read; the values are missing.
    """

    time: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: Mapping[str, str] = MappingProxyType({})

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path = path
        self.names = layout.names
        self._layout = layout
        self.headers: list[int] = []

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block."""
        row, line, long = 0, 1 + self._layout.skipped, False
        self.headers = []
        texts = _whole_lines(self.path, self._layout.skipped)
        if self._layout.lists:
            texts = flat(texts, self._layout.delimiter.encode(), self.path, BLOCK)
        for text in texts:
            long |= len(text) >= BLOCK  # reading a block takes as long as importing Arrow
            plain = self._layout.join_thousands(text)
            block = self._read_plain(plain, columns) if long else None
            if block is None:
                block = self._read(plain, columns, row, line)
            row, line = row + len(block), line + _count(plain, b"\n")
            if len(block):
                yield block

    def _read_plain(self, text: bytes, columns: Sequence[int]) -> Array | None:
        """Read rows of plain numbers fast; return None for comments or quotation marks."""
        layout = self._layout
        if layout.decimal == ",":
            text = text.replace(b",", b".")
        bare = not any(mark in text for mark in (b'"', layout.comment.encode()))
        # Arrow would end a row at a single CR
        lone = b"\r" in text and text.count(b"\r") > text.count(b"\r\n")
        if layout.delimiter == " " or not bare or lone:
            return None
        return plain_rows(text, layout.delimiter, layout.width, columns)

    def _read(self, text: bytes, columns: Sequence[int], row: int, line: int) -> Array:
        with suppress(ValueError):  # a missing cell, or an instant
            block = self._cells(text, columns, np.float64)
            self._refuse_longer_rows(text, len(block), line)
            return block
        blocks = []
        for piece in _pieces(text):
            try:
                block = self._read_as_text(piece, columns)
                self._refuse_longer_rows(piece, len(block), line)
            # Arrow states no line numbers, for example for rows that are too short
            except ValueError:
                block = self._read_row_by_row(piece, columns, row, line)
            if len(block):
                blocks.append(block)
            row, line = row + len(block), line + _count(piece, b"\n")
        return np.concatenate([np.empty((0, len(columns))), *blocks])

    def _read_as_text(self, text: bytes, columns: Sequence[int]) -> Array:
        ends = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n"))
        longest = int(np.diff(ends, prepend=-1, append=len(text)).max())
        if 4 * longest * (len(ends) + 1) * len(columns) > AS_TEXT:
            raise ValueError
        found = self._cells(text, columns, np.str_)
        return np.stack([_numbers(column) for column in found.T], axis=1)

    def _cells(self, text: bytes, columns: Sequence[int], kind: type) -> NDArray[Any]:
        layout = self._layout
        if layout.decimal == ",":
            text = text.replace(b",", b".")
        if not text.strip():
            return np.empty((0, len(columns)))
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "(?i).*contained no data")
            return np.loadtxt(
                io.BytesIO(text),
                dtype=kind,
                delimiter=None if layout.delimiter == " " else layout.delimiter,
                comments=layout.comment if layout.comment.encode() in text else None,
                quotechar='"' if b'"' in text else None,
                usecols=columns,
                ndmin=2,
                encoding="utf-8",
            )

    def _refuse_longer_rows(self, text: bytes, n: int, line: int) -> None:
        """Refuse rows with more cells than the first: a delimiter within a number shifts the rest.

        Lines are inspected only if there are too many delimiters.
        """
        layout = self._layout
        if layout.delimiter == " " or b'"' in text:
            return
        if text.count(layout.delimiter.encode()) <= n * (layout.width - 1):
            return
        for number, content in self._rows(text):
            extra = cells(content.partition(layout.comment)[0], layout.delimiter)[layout.width :]
            if any(extra):
                raise FileError(
                    f"{self.path}:{line + number}: has {layout.width + len(extra)} cells, the first"
                    f" row {layout.width}; a decimal comma or a separator of thousands shifts the"
                    " columns: state delimiter and decimal in format, or remove it"
                )

    def _read_row_by_row(self, text: bytes, columns: Sequence[int], row: int, line: int) -> Array:
        """Read single cells: empty cells are missing, other text is an error with line and column.

        Cells beyond the end of a short row are missing.
        """
        rows: list[list[float]] = []
        for number, content in self._rows(text):
            found = cells(content, self._layout.delimiter)
            at, this = f"{self.path}:{line + number}", row + len(rows) + 1
            if self._is_header(found):
                self.headers.append(this - 1)
                found = []
            rows.append([self._number(found, column, at, this) for column in columns])
        return np.array(rows).reshape(-1, len(columns))

    def _is_header(self, found: Sequence[str]) -> bool:
        words = set(filter(None, found))
        return bool(words) and words <= self._layout.header and not any(map(_is_number, words))

    def _rows(self, text: bytes) -> Iterator[tuple[int, str]]:
        """Yield the rows among the lines, with line numbers from 0."""
        for number, content in enumerate(text.decode("utf-8", "replace").split("\n")):
            stripped = content.strip()
            if stripped and not stripped.startswith(self._layout.comment):
                yield number, content

    def _number(self, cells: Sequence[str], column: int, at: str, row: int) -> float:
        cell = cells[column] if column < len(cells) else ""
        if cell.lower() in MISSING:
            return np.nan
        with suppress(ValueError):
            return float(cell.replace(self._layout.decimal, "."))
        if DATE.match(cell):
            with suppress(ValueError):
                return float(_nanoseconds([cell])[0])
        name = f" ({self.names[column]})" if self.names[column] else ""
        remedy = "choose another column, remove the row, or state the file's layout in format"
        if _is_number(cell.replace(",", "")):
            remedy = "a decimal comma or a separator of thousands? export numbers without it"
        raise FileError(
            f"{at}: '{one_line(cell, 40)}' in column {column + 1}{name}, row {row}, is not a "
            f"number; {remedy}"
        )


def _is_number(cell: str) -> bool:
    with suppress(ValueError):
        return math.isfinite(float(cell))
    return False


def _numbers(cells: NDArray[np.str_]) -> Array:
    """Convert the cells of a column in a single call, with the rules of `TextTable`."""
    with suppress(ValueError):
        return cells.astype(np.float64)
    cells = np.char.strip(cells)
    missing = np.isin(np.char.lower(cells), list(MISSING))
    with suppress(ValueError):
        return np.where(missing, "nan", cells).astype(np.float64)
    if not all(map(DATE.match, cells[~missing])):
        raise ValueError
    found = np.full(len(cells), np.nan)
    found[~missing] = _nanoseconds(cells[~missing].tolist())
    return found


def _nanoseconds(cells: Sequence[str]) -> Array:
    """Return instants, with or without an offset from UTC, as numbers [ns]."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "no explicit representation of timezones")
        instants = np.array([instant(cell) for cell in cells], dtype="datetime64[ns]")
    return instants.astype(np.float64)


def open_text(path: Path, stated: Format) -> Table:
    """Open a text table.

    Raises
    ------
    FileError
        The file cannot be read, or is not text with rows of numbers.
    """
    with _opened(path) as file:
        head = file.read(_HEAD)
    _refuse_binary(path, head)
    if b"\r" in head and b"\n" not in head:
        raise FileError(f"{path}: has lines that end in only CR; convert them to LF or CR LF")
    if len(head) == _HEAD:
        head = head.rpartition(b"\n")[0] or head
    text = decoded(head)
    if _CAN_FRAMES.match(text):
        raise FileError(
            f"{path}: is a log of CAN frames without decoded values; record with hil run, or save"
            " positions and currents as columns"
        )
    if not LIST.search(head):
        mark = next((d for d in ";\t," if d in text), " ")
        _refuse_exchanged(path, text, stated.delimiter or mark)
    for belongs, opened in ((is_stacked, open_stacked), (is_diadem, open_diadem)):
        if belongs(text):
            return opened(path, _lines(path))
    try:
        layout = layout_of_lists(head, stated) if LIST.search(head) else layout_of(text, stated)
    except LongLayout as error:
        raise FileError(f"{path}: {str(error).replace('(FILE', f'({path.name!r}')}") from error
    except NoNumbers as error:
        raise FileError(
            f"{path}: {error}; state header, delimiter, decimal, comment or skip in format, or"
            " with --draft by --format KEY=VALUE, or convert the file to CSV, a column a signal"
        ) from error
    table = TextTable(path, layout)
    return Channels(table, layout.clocks) if layout.clocks else table


def _refuse_exchanged(path: Path, head: str, delimiter: str) -> None:
    """Refuse a table with a line a signal: few lines, each with far more cells."""
    first = cells(head.partition("\n")[0], delimiter)
    if len(first) <= MOST_SIGNALS:
        return
    lines = sum(_count(block, b"\n") for block in _whole_lines(path, 0))
    if lines > min(MOST_SIGNALS, len(first) // 2):
        return
    named = not _is_number(first[0])
    read = "index_col=0" if named else "index_col=False"
    blanks = delimiter.replace(" ", r"\s+")
    sep = "" if delimiter == "," else f", sep={blanks!r}"
    sep += ", decimal=','" if sep and re.search(r"\d,\d", head) else ""
    raise FileError(
        f"{path}: has {lines} lines of {len(first)} cells: rows and columns are exchanged; make a "
        f"column of each signal, as by pandas: pandas.read_csv({path.name!r}, header=None, {read}"
        f"{sep}).T.to_csv('columns.csv', index=False, header={named})"
    )


def _lines(path: Path) -> Iterator[str]:
    """Yield the lines of a text."""
    for block in _whole_lines(path, 0):
        yield from decoded(block).removesuffix("\n").split("\n")


def _pieces(text: bytes) -> Iterator[bytes]:
    """Yield whole lines of a text, `PIECE` bytes or a line at a time."""
    begin = 0
    while begin < len(text):
        end = 1 + text.find(b"\n", begin + PIECE) or len(text)
        yield text[begin:end]
        begin = end


def _whole_lines(path: Path, skipped: int) -> Iterator[bytes]:
    """Yield blocks of whole lines after the first `skipped` lines."""
    with _opened(path) as file:
        for _ in range(skipped):
            file.readline()
        begin = b"" if skipped else file.read(len(codecs.BOM_UTF8)).removeprefix(codecs.BOM_UTF8)
        while block := begin + file.read(BLOCK):
            end = b"" if block.endswith(b"\n") else file.readline(BLOCK)
            block, begin = block + end, b""
            _refuse_binary(path, block)
            if len(end) == BLOCK:
                raise FileError(f"{path}: has a line of more than {BLOCK} bytes: not a table")
            yield block


def _count(text: bytes, mark: bytes) -> int:
    """Count a character; for frequent characters three times as fast as `bytes.count`."""
    return int(np.count_nonzero(np.frombuffer(text, np.uint8) == mark[0]))


def _refuse_binary(path: Path, block: bytes) -> None:
    if b"\0" in block:
        raise FileError(
            f"{path}: holds NUL bytes: not UTF-8 text; save a text as UTF-8, export a binary log "
            "as CSV with the program that wrote it, or name the file with the extension of its "
            "format"
        )


class _Counted(io.RawIOBase):
    """Unpacked content of a file, held block by block."""

    def __init__(self, path: Path, stored: io.BufferedIOBase) -> None:
        self._path, self._stored, self._size = path, stored, 0

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Read into a buffer; return the number of bytes."""
        read = self._stored.readinto(buffer)
        self._size += read
        refuse_beyond(self._path, self._size, "its text", times=PASSED)
        return read


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a file, decompress it and convert UTF-16 to UTF-8; all errors become a `FileError`."""
    with file_errors(path, "read"):
        try:
            with (
                gzip.open(path) if path.suffix == ".gz" else path.open("rb") as stored,
                io.BufferedReader(_Counted(path, stored), _HEAD) as file,
            ):
                wide = file.peek(2)[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
                yield cast(
                    "IO[bytes]", codecs.EncodedFile(file, "utf-8", "utf-16") if wide else file
                )
        except (EOFError, zlib.error, gzip.BadGzipFile, UnicodeError) as error:
            raise FileError(
                f"{path}: cannot be unpacked: {error}; copy or download it again"
            ) from error
