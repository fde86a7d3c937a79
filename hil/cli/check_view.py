"""What a check of drives found, line by line as it comes, and how late this computer woke up."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

    from drivers.commissioning.verdict import Verdict
    from drivers.operator_tools.wake_ups import WakeUps

STYLES = {"ok": "green", "warning": "yellow", "refused": "bold red"}
EDGES = (0.0, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 20e-3)
"""Lower ends of the classes of lateness [s]; the last one is open."""


def show(verdicts: Iterable[Verdict], console: Console) -> bool:
    """Print verdicts as they come, by axis, and how many have each grade; whether none refuses."""
    counts: Counter[str] = Counter()
    place = ""
    for verdict in verdicts:
        if verdict.place != place:
            place = verdict.place
            console.print(f"\n{place}", style="bold", highlight=False, markup=False)
        counts[verdict.grade.value] += 1
        console.print(_text(verdict), soft_wrap=True, highlight=False)
    total = ", ".join(f"{counts[grade]} {grade}" for grade in STYLES)
    console.print(f"\n{total}", highlight=False)
    return not counts["refused"]


def _text(verdict: Verdict) -> Text:
    grade = verdict.grade.value
    text = Text(f"{grade:<9}", style=STYLES[grade])
    text.append(f"{verdict.check:<32} {verdict.found}", style="none")
    if verdict.bound:
        text.append(f"  ({verdict.bound})", style="dim")
    if verdict.remedy:
        text.append(f"\n{'':9}-> {verdict.remedy}", style="none")
    return text


def show_wake_ups(found: WakeUps, in_time: float, console: Console) -> None:
    """Print quantiles of the lateness, that of a share `in_time` last, and a bar for each class."""
    shares = {share: _ms(found.quantile(share)) for share in (0.5, 0.99, in_time)}
    quantiles = ", ".join(f"{100 * share:.4g} % {late}" for share, late in shares.items())
    console.print(
        f"late for {len(found.late)} deadlines at {1 / found.period:.4g} Hz: {quantiles},"
        f" longest {_ms(found.longest)}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(_histogram(found))


def _histogram(found: WakeUps) -> Table:
    import numpy as np

    classes = np.histogram(found.late, [*EDGES, math.inf])[0].tolist()
    table = Table("late by", box=None, pad_edge=False)
    table.add_column("wake-ups", justify="right")
    table.add_column("")
    last, most = max(k for k, number in enumerate(classes) if number), max(classes)
    for low, high, number in zip(EDGES, (*EDGES[1:], None), classes[: last + 1], strict=False):
        name = f"under {_ms(high)}" if high else f"{_ms(low)} or more"
        table.add_row(name, str(number), "#" * max(round(40 * number / most), 1 if number else 0))
    return table


def _ms(value: float) -> str:
    return f"{1000 * value:.3g} ms"
