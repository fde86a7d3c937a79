"""Text of foreign files and devices as terminals, files and pages of ours may hold it.

Names of columns, joints and objects come from somebody else. A control character in one would move
the operator's cursor or rename the terminal, a line break would forge a line of a message or a key
of a file, a mark of direction would show a line in another order than it is read, and a text of
100 kB would bury the message that quotes it.
"""

from __future__ import annotations

import unicodedata

LONGEST = 200
"""Characters of a foreign text that are shown: two lines of a terminal of 100 columns."""
LINE, LINES = 4000, 500
"""Characters of a line of a message, and lines of one, that a terminal shows: twice the longest of
ours, and a line for each joint, column or object of a file that is wrong throughout."""
_WRITTEN_OUT = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Categories of Unicode that a terminal obeys or that end a line: controls, formats (marks of
direction among them), surrogates, separators of lines and paragraphs."""


def printable(text: str, kept: str = "\n\t") -> str:
    r"""Return text with each character that a terminal would obey as its code, such as ``\x1b``.

    Parameters
    ----------
    text : str
    kept : str
        Characters that stay as they are: line ends and tabs, which messages of ours have.
    """
    if text.isprintable():
        return text
    return "".join(
        _code(c) if c not in kept and unicodedata.category(c) in _WRITTEN_OUT else c for c in text
    )


def one_line(text: str, longest: int = LONGEST) -> str:
    """Return a foreign text as one line of at most `longest` characters and a mark of the cut.

    Blanks and line ends become one blank, other control characters their codes.
    """
    line = printable(" ".join(text[: 2 * longest].split()), kept="")
    if len(line) <= longest and len(text) <= 2 * longest:
        return line
    return f"{line[:longest]}... ({len(text)} characters)"


def whole_line(text: str) -> str:
    """Return a foreign text as one line, whole unless it exceeds a line of a message.

    Readers apply this to the names and sentences that they take from a file or a device, so that
    whoever prints them forges no line.
    """
    return text if text.isprintable() else one_line(text, LINE)


def shown(message: str) -> str:
    """Return a message as a terminal shows it: printable, and cut where a foreign text fills it."""
    lines = [_cut(line) for line in printable(message).split("\n")]
    more = len(lines) - LINES
    return "\n".join([*lines[:LINES], f"... and {more} lines more"] if more > 0 else lines)


def _cut(line: str) -> str:
    return line if len(line) <= LINE else f"{line[:LINE]}... ({len(line)} characters)"


def _code(character: str) -> str:
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}"
