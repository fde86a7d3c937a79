"""Changes in the text of an XML file: attributes and new children; the rest stays byte for byte."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

if TYPE_CHECKING:
    from collections.abc import Mapping
    from xml.etree.ElementTree import Element

    from checked_files.xml_file import XmlFile

_TAG = re.compile(rb"""<(?:[^<>"']|"[^"]*"|'[^']*')*>""")


class XmlPatch:
    """Text of a file with changes.

    Parameters
    ----------
    file : XmlFile
    """

    def __init__(self, file: XmlFile) -> None:
        content = file.path.read_bytes()
        self._file, self._mark = file, content[:3] if content.startswith(b"\xef\xbb\xbf") else b""
        self._content = content[len(self._mark) :]
        self._edits: list[tuple[int, int, bytes]] = []

    def set(self, element: Element, values: Mapping[str, str | None]) -> None:
        """Set attributes in place, new ones at the end of the tag; None removes an attribute."""
        begin, end = self._tag(element)
        closing = end - (2 if self._content[end - 2 : end] == b"/>" else 1)
        for key, value in values.items():
            stands = re.compile(
                rb"(\s+" + re.escape(key).encode() + rb"\s*=\s*)(\"[^\"]*\"|'[^']*')"
            )
            found = stands.search(self._content, begin, closing)
            if found is None:
                if value is not None:
                    at = begin + len(self._content[begin:closing].rstrip())
                    self._edits.append((at, at, f" {key}={quoteattr(value)}".encode()))
            elif value is None:
                self._edits.append((*found.span(), b""))
            else:
                quote = found[2][:1]
                self._edits.append((*found.span(2), quote + value.encode() + quote))

    def insert(self, element: Element, child: str) -> None:
        """Insert a first child on a separate line."""
        begin, end = self._tag(element)
        line = self._content.rfind(b"\n", 0, begin) + 1
        indent = self._content[line:begin] if not self._content[line:begin].strip() else b""
        inner = b"\n" + indent + b"  " + child.encode()
        if self._content[end - 2 : end] == b"/>":
            name = re.match(rb"<([^\s/>]+)", self._content[begin:end])
            assert name is not None  # noqa: S101 - expat has read it
            self._edits.append(
                (end - 2, end, b">" + inner + b"\n" + indent + b"</" + name[1] + b">")
            )
        else:
            self._edits.append((end, end, inner))

    @property
    def changed(self) -> bool:
        """True if the text has changes."""
        return bool(self._edits)

    @property
    def text(self) -> str:
        """Content of the file with all changes."""
        content = self._content
        for begin, end, new in sorted(self._edits, key=lambda each: -each[0]):
            content = content[:begin] + new + content[end:]
        return (self._mark + content).decode()

    def _tag(self, element: Element) -> tuple[int, int]:
        """Return begin and end of a start tag, in bytes."""
        begin = self._file.offset(element)
        found = _TAG.match(self._content, begin)
        assert found is not None  # noqa: S101 - expat has read it
        return begin, found.end()
