"""Writer of values, comments and marks in YAML that is put together line by line.

Drafts have comments beside their values, which no YAML library writes. All values of such a file
pass through this module: a name in a foreign file must not become a key, end a comment, or be read
as a number.
"""

from __future__ import annotations

import math
import re

import yaml

from checked_files.foreign_text import one_line
from checked_files.yaml_file import UNSTATED

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")
_SENTENCE = re.compile(r"[A-Za-z][A-Za-z0-9 ,;.()\[\]/-]*")
"""Description that YAML accepts without quotes after the mark of an unstated value."""
_LONGEST = 1000
"""Maximum length of a comment: a line with about ten file names, or the choices for a value."""


def scalar(value: str | float | bool | None) -> str:
    """Return the YAML text of a value, with quotes unless the value is a single word."""
    if isinstance(value, str):
        is_word = _PLAIN.fullmatch(value) and yaml.safe_load(value) == value
        return value if is_word else quoted(value)
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, int) else number(value)


def quoted(text: str) -> str:
    """Return a text in double quotes on one line, with non-printable characters escaped."""
    written: str = yaml.safe_dump(text, default_style='"', width=math.inf, allow_unicode=True)
    return written.rstrip("\n")


def number(value: float) -> str:
    """Return the shortest exact text of a float, without a point for whole numbers."""
    text = repr(float(value) + 0.0).removesuffix(".0")
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa}.0{e}{exponent}" if e and "." not in mantissa else text


def comment(text: str) -> str:
    """Return a text as a comment to the end of its line."""
    return f"# {one_line(text, _LONGEST)}"


def mark_unstated(hint: str) -> str:
    """Return the `!state` mark of an unstated value, with its description."""
    line = one_line(hint, _LONGEST)
    return f"{UNSTATED} {line if _SENTENCE.fullmatch(line) else quoted(line)}"
