"""A load as it was found from two runs: the paper's Table 3, the load itself, torque constants."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.estimation.loads.figures import LOOSE
from hil.results.rounding import rounded, signed, uncertain, unit
from hil.results.tables.table import Column, Table, figures, table

if TYPE_CHECKING:
    from hil.estimation.loads.figures import Quantity
    from hil.results.load_file import Change, GainRecord, LoadFile
    from hil.results.tables.table import Row

OF_MAPS = (
    "Gains are over those that the map states, 1 where these are right; one that the map leaves"
    " unknown is N m or N for one unit of the signal."
)


def changes(load: LoadFile) -> Table:
    """Base parameters without and with the load, and what a rigid load changes of them.

    No rows where one of the runs does not identify the robot.
    """
    units = list(dict.fromkeys(unit(each.unit) for each in load.changes))
    return table(
        "Change by the load: the paper's Table 3 of this robot",
        (
            Column("", symbols=True),
            *figures("without", "with load", "change", "std. error", "expected", "z"),
            Column("of the load", folds=True, symbols=True),
        ),
        map(_change, load.changes),
        "Base parameters without (A) and with the load (B), in"
        f" {' and '.join(filter(None, (', '.join(units[:-1]), *units[-1:])))}."
        " Expected is what the load below changes by the expressions of the base parameters; z"
        " is how far the change found is off it, in standard errors.",
    )


def _change(each: Change) -> Row:
    s = each.standard_error
    values = (each.without, each.loaded, each.change, s, each.expected)
    z = signed(f"{(each.change - each.expected) / s:.1f}")
    return (each.name, *(rounded(value, s) for value in values), z, each.share)


def quantities(load: LoadFile) -> Table:
    """Mass, first moments, centre of mass and inertia of the load."""
    return table(
        "The load, in the last link's frame",
        ("", *figures("value", "std. error", "95 %, ±"), "unit"),
        map(_quantity, load.load),
    )


def _quantity(q: Quantity) -> Row:
    value, error = uncertain(q.value, q.standard_error)
    half = uncertain(q.half_width, q.standard_error)[0] if q.half_width else ""
    stated = not q.standard_error
    return q.name, value, "stated" if stated else error, "" if stated else half, unit(q.unit)


def torque_constants(load: LoadFile) -> Table:
    """Torque constants by the load's mass; no rows where the mass was not stated."""
    stated = "" if load.mass is None else f"The mass was stated as {load.mass:g} kg."
    return table(
        "Gains by the load's mass"
        if load.imported
        else "Torque constants by the load's mass, N m/A",
        (
            "axis",
            *figures("assumed", "corrected", "std. error", "off by, %", "std. error, %"),
        ),
        map(_gain, load.gains),
        f"{stated} {OF_MAPS}" if load.imported else stated,
    )


def _gain(gain: GainRecord) -> Row:
    axis, assumed = str(gain.axis), "unknown" if gain.assumed is None else f"{gain.assumed:.4f}"
    if not gain.told or gain.corrected is None or gain.standard_error is None:
        return axis, assumed, "not identifiable", "", "", ""
    found = uncertain(gain.corrected, gain.standard_error)
    if gain.error is None or gain.error_standard_error is None:
        return axis, assumed, *found, "", ""
    return axis, assumed, *found, *uncertain(100 * gain.error, 100 * gain.error_standard_error)


def goodness_of_fit(load: LoadFile) -> str:
    """State how well a rigid load explains the changes; empty where that was not tested."""
    p = load.p_value
    if not load.degrees_of_freedom:
        return ""
    return (
        f"A rigid load leaves χ² = {load.chi_squared:.1f} of the differences with"
        f" {load.degrees_of_freedom} degrees of freedom (p = {p:.2g})"
        + ("." if p > LOOSE else f": something else changed between the runs{_or_gains(load)}.")
    )


def _or_gains(load: LoadFile) -> str:
    """What else explains changes that no load makes, of imported runs with gains as stated."""
    if not load.imported or load.gains:
        return ""
    return ", or the gains are wrong, which --mass and --gains find"


def unseen(load: LoadFile) -> str:
    """State what of the load the runs do not show; empty where they show all of it."""
    said = []
    if load.unseen:
        remedy = "add what it has to that link" if load.imported else "hil diagnose tests them"
        said.append(
            f"Not observed are {', '.join(load.unseen)} of the load, absent from the last link in"
            f" the robot file and taken as zero; {remedy}."
        )
    if load.unidentifiable:
        said.append(
            f"Not identifiable are {', '.join(load.unidentifiable)} of the load: no torque of these"
            " recordings shows them."
        )
    return " ".join(said)
