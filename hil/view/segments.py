"""Stretches of the time line: measurements, and the ways to them; their kinds and colours."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, repeat
from typing import TYPE_CHECKING

from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import KINDS, ElementKind

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True)
class Segment:
    """One stretch of time.

    Attributes
    ----------
    kind : str
        Of measurement, or ``travel`` or ``warm-up``.
    words : str
        What happens, for readers.
    begin, end : float
        [s].
    axes : tuple of int
        Whose torque is read, from 0.
    recorded : bool
        Whether it is a measurement.
    problem : str, optional
        Why the dry run refuses it.
    """

    kind: str
    words: str
    begin: float
    end: float
    axes: tuple[int, ...] = ()
    recorded: bool = False
    problem: str | None = None


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
