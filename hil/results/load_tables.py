"""A load that was found: in the operator's words, and as tables, among them the paper's Table 3."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.loads.figures import LOOSE
from hil.model.load import FIRST_MOMENTS
from hil.results.rounding import rounded, signed, uncertain, unit
from hil.results.tables.parameters import NAMED
from hil.results.tables.table import Column, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from hil.estimation.loads.figures import Figure, Load
    from hil.model.robot import Robot
    from hil.planning.design.load import WithoutLoad
    from hil.planning.design.load_pose import Pose
    from hil.planning.plan import Plan
    from hil.results.load_file import GainRecord, LoadFile, ParameterChange
    from hil.results.tables.table import Row

SHOWN = float((special.ndtri(1.0 - LOOSE / 2.0) + special.ndtri(0.8)) / special.ndtri(0.975))
"""Change, in half-widths of the interval of 95 %, that is found with a probability of 80 %."""
WHOLE_RUNS = "take two whole runs"
"""What helps where no pose does."""


def verdict(found: Load, advice: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """What was found, in sentences.

    Parameters
    ----------
    advice : mapping of str to str, optional
        What would help, by the parameter of the load that is rough or open (`advised`).
    """
    named = [q for q in found.quantities() if q.name == "mass" or "centre" in q.name]
    lines = ["; ".join(_in_words(q) for q in named), *_of_rigidity(found)]
    if not found.is_loose:
        lines += _of_unsure(found, advice or {})
    if found.unseen:
        lines.append(
            f"taken as zero: {', '.join(found.unseen)}, absent from the last link in the robot file"
        )
    return tuple(lines)


def unsure(found: Load) -> tuple[str, ...]:
    """Parameters of the load that are rough or open, each once."""
    return tuple(dict.fromkeys([*map(_parameter_of, _rough(found)), *found.unidentifiable]))


def advised(bare: WithoutLoad, plans: Sequence[Plan], found: Load) -> dict[str, str]:
    """What would help beside plans that were measured, by what is rough or open."""
    # reports show what was found and design nothing
    from hil.planning.design.load_pose import helpful_poses  # noqa: PLC0415

    poses = helpful_poses(bare, plans, found, unsure(found))
    return {name: _advice(bare.robot, pose) for name, pose in poses.items()}


def _advice(robot: Robot, pose: Pose) -> str:
    to = f"to {100 * pose.share:.0f} % of its error by one more measurement, as predicted"
    if pose.position is None:
        return f"measure again with more strokes of axis {pose.axis} ({to})"
    turns = bool(robot.revolute[pose.axis - 1])
    at = f"{math.degrees(pose.position):.0f}" if turns else f"{pose.position:.2g}"
    unit_of = "degrees" if turns else "m"
    return (
        f"measure again with axis {pose.axis} at {at} {unit_of}: --pose axis{pose.axis}={at} ({to})"
    )


def _of_unsure(found: Load, advice: Mapping[str, str]) -> Iterator[str]:
    """What is rough or open, and what would help; what the same would help in one line."""
    else_ = "" if found.stated_mass else ", or state the mass"
    by_help: dict[str, list[str]] = {}
    for q in _rough(found):
        figure = f"{q.name} (± {100 * q.half_width / abs(q.value):.0f} %)"
        by_help.setdefault(advice.get(_parameter_of(q), WHOLE_RUNS), []).append(figure)
    for help_, rough in by_help.items():
        yield f"rough: {', '.join(rough)}; {help_}{else_}"
    for name in found.unidentifiable:
        yield f"not identifiable: {name}; {advice.get(name, WHOLE_RUNS)}"


def _rough(found: Load, most: float = 0.1) -> list[Figure]:
    """Mass and moments of inertia about the centre with half-widths beyond that share of them."""
    return [
        q for q in found.quantities()
        if q.name in {"mass", *(f"I{k}{k} about the centre" for k in "xyz")}
        and q.standard_error and q.half_width > most * abs(q.value)
    ]  # fmt: skip


def _parameter_of(figure: Figure) -> str:
    """Parameter that a figure of the load needs most: `Ixx` of `Ixx about the centre`."""
    return "m" if figure.name == "mass" else figure.name.split(maxsplit=1)[0]


def _of_rigidity(found: Load) -> list[str]:
    if not found.misfit:
        return []
    chance, least = found.rigid_chance, found.least_inertia()
    doubt, remedy = (
        "not rigid, not fixed, or friction changed with it: ",
        ("; fasten the load and its cables, empty what can flow, and measure again"),
    )
    if least is not None and found.is_no_body:
        return [
            f"{doubt}no body has the inertia that was found, with {_in_words(least[0])} about an"
            f" axis through the centre{remedy}"
        ]
    if not found.is_loose:
        axes = ", ".join(str(each.axis) for each in found.misfit)
        seen = f"rigid and fixed, as far as axes {axes} show (p = {chance:.2g})"
        if (sag := _hidden_sag(found)) is not None:
            seen += f"; a centre that sags by up to {1e3 * sag:.2g} mm is not excluded"
        return [seen]
    worst = min(found.misfit, key=lambda each: each.p_value)
    return [
        f"{doubt}measurements of axis {worst.axis} contradict one another"
        f" {math.sqrt(worst.ratio):.2g} times as much as without the load (p = {chance:.2g})"
        f"{remedy}"
    ]


def _hidden_sag(found: Load) -> float | None:
    """Return the largest sag of the centre along gravity that the recordings hide [m].

    A centre that moves along the line of gravity's force leaves the moment of gravity unchanged.
    The sag d shows in the moments of inertia alone, of which it changes Ixx by up to
    2 d sqrt(sy^2 + sz^2) from one pose to another. A load counts as loose at the chance `LOOSE`; of
    four in five the least change is `SHOWN` half-widths. None where no such moment was identified.
    """
    s, halves = found.phi[list(FIRST_MOMENTS)], {q.name: q.half_width for q in found.quantities()}
    across = np.sqrt(np.maximum(s @ s - s**2, 0.0))
    each = [
        SHOWN * halves[name] / (2.0 * float(arm))
        for name, arm in zip(("Ixx", "Iyy", "Izz"), across, strict=True)
        if name in halves and arm > 0.0
    ]
    return min(each, default=None)


def _in_words(q: Figure) -> str:
    if not q.standard_error:
        return f"{q.name} {q.value:g} {unit(q.unit)} as stated"
    value, half = (rounded(each, q.half_width) for each in (q.value, q.half_width))
    return f"{q.name} {value} ± {half} {unit(q.unit)}"


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
            *NAMED,
            *figures("without", "with load", "change", "std. error", "expected", "z"),
            Column("of the load", folds=True, symbols=True),
        ),
        map(_change, load.changes),
        "Base parameters without (A) and with the load (B), in"
        f" {' and '.join(filter(None, (', '.join(units[:-1]), *units[-1:])))}."
        " Expected is what the load below changes by the expressions of the base parameters; z"
        " is how far the change found is off it, in standard errors.",
    )


def _change(each: ParameterChange) -> Row:
    s = each.standard_error
    values = (each.without, each.loaded, each.change, s, each.expected)
    z = signed(f"{(each.change - each.expected) / s:.1f}")
    return (each.name, each.meaning, *(rounded(value, s) for value in values), z, each.share)


def torque_constants(load: LoadFile) -> Table:
    """Torque constants by the load's mass; no rows where the mass was not stated."""
    unit_of = "" if load.imported else ", N m/A"
    stated = "" if load.mass is None else f"The mass was stated as {load.mass:g} kg."
    return table(
        f"{'Gains' if load.imported else 'Torque constants'} by the mass of the load",
        (
            "axis",
            *figures(*(f"{head}{unit_of}" for head in ("assumed", "corrected", "std. error"))),
            *figures("off by, %", "std. error, %"),
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


def not_shown(load: LoadFile) -> str:
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
