"""What was found of a load, in the operator's words: figures, whether it is rigid, what is open."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.planning.design.load_pose import helpful_poses
from hil.results.rounding import rounded, unit

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from hil.estimation.loads.figures import Load, Quantity
    from hil.model.robot import Robot
    from hil.planning.design.load import WithoutLoad
    from hil.planning.design.load_pose import Pose
    from hil.planning.plan import Plan

WHOLE_RUNS = "take two whole runs"
"""What helps where no pose does."""


def verdict(found: Load, advice: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """What was found, in sentences.

    Parameters
    ----------
    advice : mapping of str to str, optional
        What would help, by the parameter of the load that is rough or open (`advised`).
    """
    figures = [q for q in found.quantities() if q.name == "mass" or "centre" in q.name]
    lines = ["; ".join(_in_words(q) for q in figures), *_of_rigidity(found)]
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
    for help_, figures in by_help.items():
        yield f"rough: {', '.join(figures)}; {help_}{else_}"
    for name in found.unidentifiable:
        yield f"not identifiable: {name}; {advice.get(name, WHOLE_RUNS)}"


def _rough(found: Load, most: float = 0.1) -> list[Quantity]:
    """Mass and moments of inertia about the centre with half-widths beyond that share of them."""
    return [
        q for q in found.quantities()
        if q.name in {"mass", *(f"I{k}{k} about the centre" for k in "xyz")}
        and q.standard_error and q.half_width > most * abs(q.value)
    ]  # fmt: skip


def _parameter_of(figure: Quantity) -> str:
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
        return [f"rigid and fixed, as far as axes {axes} show (p = {chance:.2g})"]
    worst = min(found.misfit, key=lambda each: each.p_value)
    return [
        f"{doubt}measurements of axis {worst.axis} contradict one another"
        f" {math.sqrt(worst.ratio):.2g} times as much as without the load (p = {chance:.2g})"
        f"{remedy}"
    ]


def _in_words(q: Quantity) -> str:
    if not q.standard_error:
        return f"{q.name} {q.value:g} {unit(q.unit)} as stated"
    value, half = (rounded(each, q.half_width) for each in (q.value, q.half_width))
    return f"{q.name} {value} ± {half} {unit(q.unit)}"
