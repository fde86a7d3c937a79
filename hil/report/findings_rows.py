"""What reports say about loads, left-out parameters and lags, as plain rows and sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.results.rounding import rounded, signed

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.results.diagnosis_file import DiagnosisFile
    from hil.results.payload_file import PayloadFile

    Row = tuple[str, ...]

SHOWN = 8
"""Candidates in the ranking."""
MISFIT = 0.001
"""p-value below which something else than a rigid load changed."""


def table_3(load: PayloadFile) -> tuple[tuple[Row, ...], tuple[tuple[str, tuple[Row, ...]], ...]]:
    """The paper's Table 3: halves of it, each with its head and its rows of figures.

    Returns
    -------
    heads : tuple of tuple of str
        Names of the base parameters of each half.
    halves : tuple of (name of a row, its cells in each half)
    """
    half = math.ceil(len(load.changes) / 2)
    parts = load.changes[:half], load.changes[half:]
    heads = tuple(tuple(each.name for each in part) for part in parts)
    rows = {
        "without load, A": "without",
        "with load, B": "loaded",
        "difference": "change",
        "standard error": "standard_error",
        "expected": "expected",
    }
    cells = tuple(
        (
            told,
            tuple(
                tuple(rounded(getattr(each, key), each.standard_error) for each in part)
                for part in parts
            ),
        )
        for told, key in rows.items()
    )
    return heads, cells


def shares(load: PayloadFile) -> str:
    """What of the load stands in each base parameter that it changes."""
    return ", ".join(f"{each.name}: {each.share}" for each in load.changes if each.share != "0")


def load_rows(load: PayloadFile) -> list[Row]:
    """Figures of the load."""
    return [
        (
            q.name,
            rounded(q.value, q.standard_error),
            rounded(q.standard_error, q.standard_error) if q.standard_error else "stated",
            q.unit.replace("m2", "m²"),
        )
        for q in load.load
    ]


def goodness_of_fit(load: PayloadFile) -> str:
    """Tell how well a rigid load explains the changes, and what of it is not seen."""
    p = load.p_value
    verdict = "" if p > MISFIT else ": something else changed between the runs"
    unseen = ""
    if load.unseen:
        unseen = (
            f" Not observed are {', '.join(load.unseen)} of the load, which the robot file leaves"
            " out of the last link; they are taken as zero."
        )
    return (
        f"A rigid load leaves χ² = {load.chi_squared:.1f} of the differences with"
        f" {load.degrees_of_freedom} degrees of freedom (p = {p:.2g}){verdict}.{unseen}"
    )


def gain_rows(load: PayloadFile) -> list[Row]:
    """Torque constants by the known mass."""
    rows: list[Row] = []
    for gain in load.gains:
        assumed = f"{gain.assumed:.4f}"
        if not gain.told:
            rows.append((str(gain.axis), assumed, "the load does not tell", "", "", ""))
            continue
        off, error = 100 * gain.error, 100 * gain.error_standard_error
        s = gain.standard_error
        corrected = rounded(gain.corrected, s), rounded(s, s)
        rows.append((
            str(gain.axis), assumed, *corrected, rounded(off, error), rounded(error, error),
        ))  # fmt: skip
    return rows


def candidate_rows(found: DiagnosisFile) -> list[Row]:
    """Left-out parameters, strongest evidence first."""
    return [
        (
            c.label,
            rounded(c.value, c.standard_error),
            rounded(c.standard_error, c.standard_error),
            signed(f"{c.t:.1f}"),
            f"{c.p_value:.1g}",
            "found" if c.label in found.found else _beside(c.beside),
        )
        for c in found.candidates[:SHOWN]
    ]


def _beside(t: float | None) -> str:
    return "" if t is None else signed(f"{t:.1f}")


def verdict(found: DiagnosisFile) -> str:
    """Tell what is significant, and what the data do not need."""
    if found.found:
        told = (
            f"Significant (p below {found.threshold:.1g}) is {', '.join(found.found)}: add it to"
            " the robot file."
        )
    else:
        told = (
            f"None is significant (p below {found.threshold:.1g}): the robot file leaves out"
            " nothing that these measurements show."
        )
    names = ", ".join(f"{each.name} ({each.expression})" for each in found.needless)
    return told + (f" Not needed by the data: {names}." if names else "")


def lag_rows(estimate: Estimate) -> list[Row]:
    """By how much each axis's current was read late [ms]; empty where none was estimated."""
    if estimate.lags is None:
        return []
    rows: list[Row] = []
    for axis, (lag, error) in enumerate(
        zip(estimate.lags.lag, estimate.lags.standard_error, strict=True)
    ):
        ms, s = 1e3 * float(lag), 1e3 * float(error)
        known = not math.isnan(s)
        told = (rounded(ms, s), rounded(s, s)) if known else ("not told", "")
        rows.append((str(axis + 1), *told))
    return rows
