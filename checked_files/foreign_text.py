"""Foreign text, from files and devices, made safe for terminals, messages, files and pages.

Names of columns, joints and objects are foreign text. A control character moves the operator's
cursor or renames the terminal. A line break forges a line of a message or a key of a file. A
direction mark changes the displayed order of a line. A text of 100 kB hides the message around it.
"""

from __future__ import annotations

import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Container

LONGEST = 200
"""Maximum length of a displayed foreign text: two lines of a terminal of 100 columns."""
LINE, LINES = 4000, 500
"""Maximum length of a line and maximum number of lines of a displayed message: twice our longest
line, and one line for each joint, column or object of a file that is wrong throughout."""
_WRITTEN_OUT = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories replaced by their codes: control characters, format characters (with direction
marks), surrogates, line and paragraph separators."""


def printable(text: str, kept: str = "\n\t") -> str:
    r"""Replace control characters by their codes, such as ``\x1b``.

    Parameters
    ----------
    text : str
    kept : str
        Control characters left unchanged: line ends and tabs of our own messages.
    """
    if text.isprintable():
        return text
    return "".join(
        _code(c) if c not in kept and unicodedata.category(c) in _WRITTEN_OUT else c for c in text
    )


def one_line(text: str, longest: int = LONGEST) -> str:
    """Return a foreign text as one line, cut after `longest` characters.

    Blanks and line ends become one blank, other control characters their codes. A cut line ends
    with the length of the text.
    """
    line = printable(" ".join(text[: 2 * longest].split()), kept="")
    if len(line) <= longest and len(text) <= 2 * longest:
        return line
    return f"{line[:longest]}... ({len(text)} characters)"


def whole_line(text: str) -> str:
    """Return a foreign text as one line of at most `LINE` characters.

    Readers apply this function to names and sentences from files and devices. Messages that quote
    such a text then keep their lines.
    """
    return text if text.isprintable() else one_line(text, LINE)


def whole_lines(value: object, verbatim: Container[object]) -> object:
    """Return the content of a file with texts on one line, except for `verbatim` keys."""
    if isinstance(value, dict):
        return {
            whole_lines(key, ()): each if key in verbatim else whole_lines(each, verbatim)
            for key, each in value.items()
        }
    if isinstance(value, list):
        return [whole_lines(each, verbatim) for each in value]
    # a delimiter may be a tab
    return whole_line(value) if isinstance(value, str) and value != "\t" else value


def shown(message: str) -> str:
    """Return a message for a terminal: control characters replaced, long lines and tails cut."""
    lines = [_cut(line) for line in printable(message).split("\n")]
    more = len(lines) - LINES
    return "\n".join([*lines[:LINES], f"... and {more} lines more"] if more > 0 else lines)


def _cut(line: str) -> str:
    return line if len(line) <= LINE else f"{line[:LINE]}... ({len(line)} characters)"


def _code(character: str) -> str:
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}"
