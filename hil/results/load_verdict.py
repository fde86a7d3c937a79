"""Sentences about a load: mass, centre, rigidity, uncertain quantities, and a helpful pose."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.loads.figures import LOOSE, Figure
from hil.model.load import FIRST_MOMENTS
from hil.show.rounding import rounded, unit

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from hil.estimation.loads.figures import Load
    from hil.model.robot import Robot
    from hil.planning.design.load import WithoutLoad
    from hil.planning.design.load_pose import Pose
    from hil.planning.plan import Plan


SHOWN = float((special.ndtri(1.0 - LOOSE / 2.0) + special.ndtri(0.8)) / special.ndtri(0.975))
"""Change detected with a probability of 80 %, in half-widths of the 95 % interval."""
WHOLE_RUNS = "measure whole runs without and with the load, for hil payload WITHOUT LOADED"
"""Remedy if no pose helps."""


def verdict(found: Load, advice: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """State mass, centre and rigidity of the load in sentences.

    Parameters
    ----------
    advice : mapping of str to str, optional
        Remedy for each uncertain or unidentifiable parameter of the load (`advised`).
    """
    named = [q for q in found.quantities() if q.name == "mass" or "centre" in q.name]
    lines = ["; ".join(_worded(q) for q in named), *_rigidity_lines(found)]
    if not found.is_loose:
        lines += _unsure_lines(found, advice or {})
    if found.unseen:
        lines.append(
            f"taken as zero: {', '.join(found.unseen)}, absent from the last link in the robot "
            "file; add these parameters there, or test them with hil diagnose"
        )
    return tuple(lines)


def unsure(found: Load) -> tuple[str, ...]:
    """Return uncertain and unidentifiable parameters of the load, each once."""
    return tuple(dict.fromkeys([*map(_parameter_of, _rough(found)), *found.unidentifiable]))


def advised(bare: WithoutLoad, plans: Sequence[Plan], found: Load) -> dict[str, str]:
    """Return a further pose for each uncertain or unidentifiable parameter, in words."""
    # reports show findings only and design no measurement
    from hil.planning.design.load_pose import helpful_poses  # noqa: PLC0415

    poses = helpful_poses(bare, plans, found, unsure(found))
    return {name: _advice(bare.robot, pose) for name, pose in poses.items()}


def _advice(robot: Robot, pose: Pose) -> str:
    to = f"predicted error after one more measurement: {100 * pose.share:.0f} % of the present one"
    if pose.position is None:
        return f"measure again with more strokes of axis {pose.axis} ({to})"
    turns = bool(robot.revolute[pose.axis - 1])
    at = f"{math.degrees(pose.position):.0f}" if turns else f"{pose.position:.2g}"
    unit_of = "degrees" if turns else "m"
    return (
        f"measure again with axis {pose.axis} at {at} {unit_of}: --pose axis{pose.axis}={at} ({to})"
    )


def _unsure_lines(found: Load, advice: Mapping[str, str]) -> Iterator[str]:
    """Yield uncertain and unidentifiable parameters with remedies, a line per remedy."""
    else_ = "" if found.stated_mass else ", or state the mass"
    by_help: dict[str, list[str]] = {}
    for q in _rough(found):
        figure = f"{q.name} (± {100 * q.half_width / abs(q.value):.0f} %)"
        by_help.setdefault(advice.get(_parameter_of(q), WHOLE_RUNS), []).append(figure)
    for help_, rough in by_help.items():
        yield f"imprecise: {', '.join(rough)}; {help_}{else_}"
    for name in found.unidentifiable:
        yield f"not identifiable: {name}; {advice.get(name, WHOLE_RUNS)}"


def _rough(found: Load, most: float = 0.1) -> list[Figure]:
    """Return mass and central moments of inertia with relative half-widths above `most`."""
    return [
        q for q in found.quantities()
        if q.name in {"mass", *(f"I{k}{k} about the centre" for k in "xyz")}
        and q.standard_error and q.half_width > most * abs(q.value)
    ]  # fmt: skip


def _parameter_of(figure: Figure) -> str:
    """Return the parameter of a figure's name: `Ixx` of `Ixx about the centre`."""
    return "m" if figure.name == "mass" else figure.name.split(maxsplit=1)[0]


def _rigidity_lines(found: Load) -> list[str]:
    if not found.misfit:
        return []
    chance, least = found.rigid_chance, found.least_inertia()
    doubt, remedy = (
        "load not rigid, not fixed, or friction changed: ",
        ("; fasten the load and its cables, drain liquids, and measure again"),
    )
    if least is not None and found.is_no_body:
        return [
            f"{doubt}the inertia found is physically impossible, {_worded(least[0])} about an "
            f"axis through the centre{remedy}"
        ]
    if not found.is_loose:
        axes = ", ".join(str(each.axis) for each in found.misfit)
        seen = f"rigid and fixed, as far as axes {axes} show (p = {chance:.2g})"
        if (sag := _hidden_sag(found)) is not None:
            seen += f"; sag of the centre of mass up to {1e3 * sag:.2g} mm not excluded"
        return [seen]
    worst = min(found.misfit, key=lambda each: each.p_value)
    return [
        f"{doubt}measurements of axis {worst.axis} scatter {math.sqrt(worst.ratio):.2g} times as "
        f"much as without the load (p = {chance:.2g}){remedy}"
    ]


def _hidden_sag(found: Load) -> float | None:
    """Return the largest undetected sag of the centre of mass along gravity [m].

    A displacement along the line of gravity leaves the moment of gravity unchanged. A sag d changes
    moments of inertia alone, Ixx by up to 2 d sqrt(sy^2 + sz^2) from one pose to another. The test
    of rigidity at the level `LOOSE` detects a change of `SHOWN` half-widths with a probability of
    80 %. None if no such moment was identified.
    """
    s, halves = found.phi[list(FIRST_MOMENTS)], {q.name: q.half_width for q in found.quantities()}
    across = np.sqrt(np.maximum(s @ s - s**2, 0.0))
    each = [
        SHOWN * halves[name] / (2.0 * float(arm))
        for name, arm in zip(("Ixx", "Iyy", "Izz"), across, strict=True)
        if name in halves and arm > 0.0
    ]
    return min(each, default=None)


def _worded(q: Figure) -> str:
    if not q.standard_error:
        return f"{q.name} {q.value:g} {unit(q.unit)} as stated"
    value, half = (rounded(each, q.half_width) for each in (q.value, q.half_width))
    return f"{q.name} {value} ± {half} {unit(q.unit)}"
