"""What the time line distinguishes: the kinds of measurement, and motion that is not recorded."""

from __future__ import annotations

from itertools import chain, repeat
from typing import TYPE_CHECKING

from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import KINDS, ElementKind

if TYPE_CHECKING:
    from collections.abc import Iterable

RECORDED_ELSEWHERE = str(FreeMotion.model_fields["kind"].default)
BETWEEN = {"travel": "#6b7885", "warm-up": "#94722f"}
"""Motion between measurements, and its colours."""
_FURTHER = ("#8b4fb0", "#0f7c8a", "#a3354f")
"""Colours of kinds whose row states none."""


def shown_kinds(occurring: Iterable[str]) -> list[dict[str, object]]:
    """Name and colour of the kinds that occur, measurements first."""
    wanted = set(occurring)
    further = chain(_FURTHER, repeat(_FURTHER[-1]))
    colours = {
        name: kind.colour if isinstance(kind, ElementKind) else next(further)
        for name, kind in KINDS.items()
    }
    colours |= {RECORDED_ELSEWHERE: next(further), **BETWEEN}
    return [
        {"name": name, "colour": colour, "moves": name in BETWEEN}
        for name, colour in colours.items()
        if name in wanted
    ]
