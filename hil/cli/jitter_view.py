"""How late a computer woke up, on the terminal: quantiles, and a histogram with a bar a class."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

EDGES = (0.0, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 20e-3)
"""Lower ends of the classes [s]; the last one is open."""
_WIDTH = 40


class Jitter(NamedTuple):
    """How late wake-ups were.

    Attributes
    ----------
    deadlines : int
        How many.
    rate : float
        At which they came [Hz].
    quantiles : sequence of (float, float)
        Share of the wake-ups, and the lateness that it does not exceed [s].
    longest : float
        Greatest lateness [s].
    classes : sequence of int
        How many lie in each class of `EDGES`.
    """

    deadlines: int
    rate: float
    quantiles: Sequence[tuple[float, float]]
    longest: float
    classes: Sequence[int]


def render(jitter: Jitter, console: Console) -> None:
    """Print quantiles and histogram."""
    quantiles = ", ".join(f"{share:.4g} % {_ms(value)}" for share, value in jitter.quantiles)
    console.print(
        f"late for {jitter.deadlines} deadlines at {jitter.rate:.4g} Hz: {quantiles},"
        f" longest {_ms(jitter.longest)}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(_histogram(jitter))


def _histogram(jitter: Jitter) -> Table:
    table = Table("late by", box=None, pad_edge=False)
    table.add_column("wake-ups", justify="right")
    table.add_column("")
    last = max(k for k, number in enumerate(jitter.classes) if number)
    most = max(jitter.classes)
    for k, number in enumerate(jitter.classes[: last + 1]):
        above = EDGES[k + 1] if k + 1 < len(EDGES) else None
        name = f"under {_ms(above)}" if above else f"{_ms(EDGES[k])} or more"
        bar = "#" * max(round(_WIDTH * number / most), 1 if number else 0)
        table.add_row(name, str(number), bar)
    return table


def _ms(value: float) -> str:
    return f"{1000 * value:.3g} ms"
