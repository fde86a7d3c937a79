"""Cells of a text table that hold lists of numbers, as Python and NumPy print them.

A list becomes as many cells as it has numbers: ``"[0.1, 0.2]"``, ``[0.1 0.2]``,
also over several lines, and ``array('d', [0.1, 0.2])``.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.imports.readers.layout import cells, decoded, layout_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from hil.imports.map_file import Format
    from hil.imports.readers.layout import Layout

_NUMBER = rb"[-+]?(?>\d[\d.eE+-]*|\.\d[\deE+-]*|nan|inf)"
LIST = re.compile(
    rb'(?<![\w)\]])"?(?:array\((?:\'\w\',\s*)?)?'
    rb"\[(\s*(?:" + _NUMBER + rb"(?:[\s,]+|(?=\])))*)\]"
    rb'(?:(?:,\s*dtype=\w+)?\))?"?'
)
"""Pattern of a list; the name of an array's element, as in ``motor[0].q``, is not a list."""


def _numbers_of(found: re.Match[bytes]) -> list[bytes]:
    return found[1].replace(b",", b" ").split()


def flat(blocks: Iterable[bytes], delimiter: bytes, path: Path, most: int) -> Iterator[bytes]:
    """Yield blocks of whole lines with the numbers of each list as cells of their own.

    Raises
    ------
    FileError
        A list does not end within `most` bytes.
    """
    begun = b""
    for block in blocks:
        text = begun + block
        opened = text.rfind(b"[")
        end = len(text)
        if opened > text.rfind(b"]"):
            end = text.rfind(b"\n", 0, opened) + 1
        text, begun = text[:end], text[end:]
        if len(begun) > most:
            raise FileError(f"{path}: a list of more than {most} bytes: not a table")
        yield LIST.sub(lambda found: delimiter.join(_numbers_of(found)), text)
    if begun:
        yield begun


def layout_of_lists(head: bytes, stated: Format) -> Layout:
    """Return the layout of a file beginning with `head`, each list as columns NAME/1, NAME/2, ...

    Raises
    ------
    NoNumbers
        As by `layout_of`.
    """
    layout = layout_of(decoded(LIST.sub(b"0", head)), stated)
    marked = decoded(LIST.sub(lambda found: b"list%d" % len(_numbers_of(found)), head))
    row = cells(marked.split("\n")[layout.skipped], layout.delimiter)
    names: list[str] = []
    for name, cell in zip(layout.names, row, strict=True):
        n = int(cell.removeprefix("list")) if cell.startswith("list") else 0
        names += [name and f"{name}/{k}" for k in range(1, n + 1)] or [name]
    return replace(layout, names=tuple(names), width=len(names), lists=True)
