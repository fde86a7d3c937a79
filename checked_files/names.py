"""Names for files, messages and terminals."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator

from checked_files.foreign_text import printable, whole_line

_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def _plain(name: str) -> str:
    if not _PLAIN.fullmatch(name):
        raise ValueError(
            f"{name!r} must begin with a letter or digit and hold letters, digits, '.', '_' and '-'"
            " only"
        )
    return name


def _obeyed_by_no_terminal(name: str) -> str:
    if not name or printable(name, kept="") != name:
        raise ValueError(f"{name!r} must have at least one character, and no control characters")
    return name


PlainName = Annotated[str, AfterValidator(_plain)]
"""Name of letters, digits, dots, underscores and hyphens."""
ShownName = Annotated[str, AfterValidator(_obeyed_by_no_terminal)]
"""Name without control characters, safe to show on a terminal."""
Line = Annotated[str, AfterValidator(whole_line)]
"""Text in one line."""
