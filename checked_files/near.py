"""Suggestions of known names for mistyped names."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

_CLOSE = 0.6


def did_you_mean(given: str, known: Iterable[str]) -> str:
    """Return a clause with the nearest known name; empty if none is near."""
    near = get_close_matches(given, list(known), n=1, cutoff=_CLOSE)
    return f"; did you mean {near[0]}?" if near else ""
