"""Parameters that the robot file leaves out, by evidence, and those that the data do not need."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.results.rounding import signed, uncertain
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.results.diagnosis_file import CandidateRecord, DiagnosisFile
    from hil.results.tables.table import Row

SHOWN = 8
"""Candidates in the ranking."""


def candidates(found: DiagnosisFile) -> Table:
    """Left-out parameters, strongest evidence first."""
    return Table(
        title="What the robot file leaves out, ranked by evidence",
        columns=(
            Column("parameter"),
            *figures("value", "std. error", "t", "p", "t beside found"),
        ),
        parts=(Part(tuple(_candidate(each, found) for each in found.candidates[:SHOWN])),),
        explanation=(
            "Value over standard error, t, and the chance p of one at least as great. The last"
            " column has t again beside those that were found: what only resembled them loses its"
            " evidence."
        ),
    )


def _candidate(each: CandidateRecord, found: DiagnosisFile) -> Row:
    beside = "" if each.beside is None else signed(f"{each.beside:.1f}")
    return (
        each.label,
        *uncertain(each.value, each.standard_error),
        signed(f"{each.t:.1f}"),
        f"{each.p_value:.1g}",
        "found" if each.label in found.found else beside,
    )


def sentences(found: DiagnosisFile) -> tuple[str, ...]:
    """State what is significant and what it moves, and what the data do not need."""
    return tuple(each for each in (_verdict(found), _phase(found), _needless(found)) if each)


def _verdict(found: DiagnosisFile) -> str:
    if not found.found:
        return (
            f"None is significant (p below {found.threshold:.1g}): the robot file leaves out"
            " nothing that these measurements show."
        )
    return (
        f"Significant (p below {found.threshold:.1g}) is {', '.join(found.found)}: add it to the"
        " robot file."
    )


def _phase(found: DiagnosisFile) -> str:
    if found.phase is None:
        return ""
    shift = signed(f"{math.degrees(found.phase.phase().shift):.1f}")
    return (
        f"It moves the phase of g{found.phase.axis} over q{found.phase.over} by {shift} degrees"
        " where that sinusoid is largest."
    )


def _needless(found: DiagnosisFile) -> str:
    names = ", ".join(f"{each.name} ({each.expression})" for each in found.needless)
    return f"Not needed by the data: {names}." if names else ""
