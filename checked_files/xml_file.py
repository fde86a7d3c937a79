"""XML files as elements with line numbers; errors state file and line."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from checked_files.budget import refuse_beyond
from checked_files.foreign_text import one_line, whole_line
from checked_files.yaml_file import FileError, read_text

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


ELEMENT, ATTRIBUTE = 460, 300
"""Maximum memory of an element, including its copy in an MJCF, and of an attribute [bytes]."""
_DECLARATION = re.compile(r"(?<=\s)<\?xml\s[^>]*\?>|(?<=-->)<\?xml\s[^>]*\?>")
"""XML declaration after blanks or a comment, as left by editors; it states nothing for a text."""
DEEPEST = 200
"""Deepest nesting of elements: an MJCF of 30 joints has some three elements a joint."""


def _blanks(found: re.Match[str]) -> str:
    """Return as many blanks, so that lines and offsets stay."""
    return re.sub(r"\S", " ", found[0])


class XmlFile:
    """The elements of an XML file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    FileError
        The file is not XML, declares entities, which can exhaust the memory, or nests too deeply.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lines: dict[int, int] = {}
        self._offsets: dict[int, int] = {}
        text = read_text(path)
        elements = text.count("<") - text.count("</")
        refuse_beyond(path, ELEMENT * elements + ATTRIBUTE * text.count("="), "its elements")
        ahead = text.partition("<")[0].strip()
        if ahead and "<" in text:
            raise FileError(
                f"{path}:1: invalid XML: starts with {one_line(ahead, 60)!r}; remove what stands "
                "before <?xml, or before the first element"
            )
        self.root = self._tree(_DECLARATION.sub(_blanks, text, count=1))

    def wrong(self, element: Element, what: str) -> FileError:
        """Return an error about an element, with file and line."""
        return FileError(f"{self.path}:{self.line(element)}: {what}")

    def line(self, element: Element) -> int:
        """Return the first line of an element, from 1."""
        return self._lines[id(element)]

    def offset(self, element: Element) -> int:
        """Return the offset of an element's start tag, in bytes of UTF-8 without a BOM."""
        return self._offsets[id(element)]

    def named(self, tag: str) -> dict[str, Element]:
        """Return the named children of the root with a tag.

        Raises
        ------
        FileError
            Two elements have one name, or an element has none.
        """
        found: dict[str, Element] = {}
        for element in self.root.findall(tag):
            name = element.get("name")
            if not name or name in found:
                raise self.wrong(element, f"<{tag}> needs a name of its own, not {name!r}")
            found[name] = element
        return found

    def numbers(self, element: Element, key: str, count: int) -> list[float] | None:
        """Return the numbers of an attribute; None if the attribute is missing.

        Raises
        ------
        FileError
            The attribute does not hold `count` finite numbers.
        """
        text = element.get(key)
        if text is None:
            return None
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or not all(map(math.isfinite, values)):
            raise self.wrong(element, f"{key} {text!r} must be {count} finite numbers")
        return values

    def _tree(self, text: str) -> Element:
        builder, parser = TreeBuilder(), expat.ParserCreate()
        open_elements: list[str] = []

        def start(tag: str, attributes: dict[str, str]) -> None:
            lines = {name: whole_line(value) for name, value in attributes.items()}
            element = builder.start(tag, lines)
            self._lines[id(element)] = parser.CurrentLineNumber
            self._offsets[id(element)] = parser.CurrentByteIndex
            open_elements.append(tag)
            if len(open_elements) > DEEPEST:
                raise FileError(
                    f"{self.path}:{parser.CurrentLineNumber}: <{tag}> is nested "
                    f"{len(open_elements)} deep, at most {DEEPEST} levels allowed; flatten the "
                    "file"
                )

        def end(tag: str) -> None:
            builder.end(tag)
            open_elements.pop()

        def refused(*_: object) -> None:
            raise FileError(
                f"{self.path}:{parser.CurrentLineNumber}: declares an entity; write out its text"
            )

        handlers: dict[str, Callable[..., object]] = {
            "StartElementHandler": start,
            "EndElementHandler": end,
            "CharacterDataHandler": builder.data,
            "EntityDeclHandler": refused,
        }
        for name, handler in handlers.items():
            setattr(parser, name, handler)
        try:
            parser.Parse(text, True)
            return builder.close()
        except expat.ExpatError as error:
            raise FileError(
                f"{self.path}:{error.lineno}: invalid XML: {expat.ErrorString(error.code)}"
            ) from error
