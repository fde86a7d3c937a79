"""Colours of what charts show, by name, so that a page can show them on light and on dark paper."""

from __future__ import annotations

INK, MUTED, GRID = "#1f2933", "#7b8794", "#e4e7eb"
MEASURED, MODEL = "#1f5fa8", "#d9730d"
GREEN, PURPLE = "#3f8f5f", "#8a5fb0"
NAMES = {
    INK: "ink", MUTED: "faint", MEASURED: "measured", MODEL: "model", GREEN: "green",
    PURPLE: "purple",
}  # fmt: skip
"""Classes of the style sheets; other colours are drawn as they are."""
_STOPS = ((124, 104, 214), (62, 130, 204), (32, 150, 140), (92, 160, 72), (192, 146, 40))


def in_turn(n: int) -> list[str]:
    """Colours of `n` things that have an order, from violet to amber, on light and dark paper."""
    return [_between(k * (len(_STOPS) - 1) / max(n - 1, 1)) for k in range(n)]


def _between(place: float) -> str:
    first = min(int(place), len(_STOPS) - 2)
    share = place - first
    pairs = zip(_STOPS[first], _STOPS[first + 1], strict=True)
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in pairs)
