"""Evidence for left-out parameters, strongest first, and parameters that are not needed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from hil.results.diagnosis_file import needless
from hil.results.rounding import rounded, signed

if TYPE_CHECKING:
    from rich.console import Console

    from hil.results.diagnosis import Diagnosis

SHOWN = 8
"""Candidates in the table."""


def render(found: Diagnosis, console: Console) -> None:
    """Print the candidates, the verdict, the phase, needless parameters, lags."""
    console.print(_candidates(found))
    for line in [_verdict(found), *_phase(found), *_needless(found), *_lags(found)]:
        console.print(line, highlight=False, soft_wrap=True)


def _candidates(found: Diagnosis) -> Table:
    errors = found.errors
    beside = {c.names: c for c in errors.after}
    table = Table(title=f"{found.robot.name}: what the robot file leaves out",
                  box=box.SIMPLE_HEAD, pad_edge=False)  # fmt: skip
    table.add_column("parameter", no_wrap=True)
    for heading in ("value", "std. error", "t", "p", "t beside found"):
        table.add_column(heading, justify="right", no_wrap=True)
    for c in errors.alone[:SHOWN]:
        s = c.standard_error
        rest = signed(f"{beside[c.names].t:.1f}") if c.names in beside else "found"
        table.add_row(c.label, rounded(c.value, s), rounded(s, s), signed(f"{c.t:.1f}"),
                      f"{c.p_value:.1g}", rest if errors.found else "")  # fmt: skip
    return table


def _verdict(found: Diagnosis) -> str:
    errors = found.errors
    if not errors.found:
        return (
            f"none is significant (p below {errors.threshold:.1g}): the robot file leaves out"
            " nothing that these measurements show"
        )
    names = ", ".join(candidate.label for candidate in errors.found)
    return f"significant (p below {errors.threshold:.1g}): {names}; add it to the robot file"


def _phase(found: Diagnosis) -> list[str]:
    if found.phase is None:
        return []
    phase = found.phase
    return [
        f"it moves the phase of g{phase.axis + 1} over q{phase.over + 1} by"
        f" {signed(f'{math.degrees(phase.shift):.1f}')} degrees where that sinusoid is largest"
    ]


def _needless(found: Diagnosis) -> list[str]:
    names = [f"{each.name} ({each.expression})" for each in needless(found)]
    return [f"not needed by the data: {', '.join(names)}"] if names else []


def _lags(found: Diagnosis) -> list[str]:
    lags = found.estimate.lags
    if lags is None:
        return []
    pairs = zip(lags.lag, lags.standard_error, strict=True)
    text = ", ".join(
        "not told" if math.isnan(error) else signed(f"{1e3 * lag:.2f} ± {1e3 * error:.2f}")
        for lag, error in pairs
    )
    return [f"torque read late by, in ms axis by axis, compensated: {text}"]
