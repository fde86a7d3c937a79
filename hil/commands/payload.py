"""`hil payload`: sentences, tables and figures of a load from runs without and with the load.

Table 3, parameters of the load, gains of the drives, Figs. 5 and 6. Sentences state mass, centre,
rigidity, uncertain quantities, and a helpful pose.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.commands.torques import played
from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.loads.figures import LOOSE, Figure
from hil.model.load import FIRST_MOMENTS, load_columns
from hil.planning.measurement import ELEMENT_KINDS
from hil.results.findings import found_in
from hil.results.load_file import DRAWN
from hil.results.tables.parameters import NAMED
from hil.show.charts.chart import MEASURED, MODEL, MUTED, Line, Panel, Points
from hil.show.outcome import Outcome, Played, Plot, Verdict
from hil.show.rounding import rounded, signed, uncertain, unit
from hil.show.table import Column, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from hil.estimation.loads.figures import Load
    from hil.model.robot import Robot
    from hil.planning.design.load import Pose, WithoutLoad
    from hil.planning.measurement import ElementKind
    from hil.planning.plan import Plan
    from hil.results.load_file import ElementRecord, GainRecord, LoadFile, ParameterChange
    from hil.runs.run import Run
    from hil.show.charts.chart import Item
    from hil.show.table import Row


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
    by_help: dict[str, list[str]] = {}
    if not found.is_loose:
        helps, stated = advice or {}, "" if found.stated_mass else ", or state the mass"
        for q in _rough(found):
            figure = f"{q.name} (± {100 * q.half_width / abs(q.value):.0f} %)"
            by_help.setdefault(helps.get(_parameter_of(q), WHOLE_RUNS), []).append(figure)
        lines += [f"imprecise: {', '.join(q)}; {help_}{stated}" for help_, q in by_help.items()]
        lines += [
            f"not identifiable: {name}; {helps.get(name, WHOLE_RUNS)}"
            for name in found.unidentifiable
        ]
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
    from hil.planning.design.load import helpful_poses  # noqa: PLC0415

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


PAGE = "payload.html"
OF_MAPS = (
    "Gains are relative to those of the map: 1 where the map is right. Gains unknown in the map "
    "are in N m or N per unit of the signal."
)


WRONG_GAINS = ", or the gains are wrong (find them with --mass and --gains)"


def changes(load: LoadFile) -> Table:
    """Return Table 3: base parameters without and with the load, and the expected change.

    No rows unless both runs identify the robot.
    """
    units = list(dict.fromkeys(unit(each.unit) for each in load.changes))
    return table(
        "Change of the base parameters by the load, like the paper's Table 3",
        (
            *NAMED,
            *figures("without", "with load", "change", "std. error", "expected", "z"),
            Column("of the load", folds=True, symbols=True),
        ),
        map(_change, load.changes),
        "Base parameters without (A) and with the load (B), in "
        f"{' and '.join(filter(None, (', '.join(units[:-1]), *units[-1:])))}. Expected: change "
        "by the load below, from the expressions of the base parameters; z: change found less "
        "expected, in standard errors.",
    )


def _change(each: ParameterChange) -> Row:
    s = each.standard_error
    values = (each.without, each.loaded, each.change, s, each.expected)
    z = signed(f"{(each.change - each.expected) / s:.1f}")
    return (each.name, each.meaning, *(rounded(value, s) for value in values), z, each.share)


def torque_constants(load: LoadFile) -> Table:
    """Return the table of torque constants by the mass of the load; no rows without a mass."""
    unit_of = "" if load.imported else ", N m/A"
    stated = "" if load.mass is None else f"The mass was stated as {load.mass:g} kg."
    return table(
        f"{'Gains' if load.imported else 'Torque constants'} by the mass of the load",
        (
            "axis",
            *figures(*(f"{head}{unit_of}" for head in ("assumed", "corrected", "std. error"))),
            *figures("deviation, %", "std. error, %"),
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
    """State how well a rigid load explains the changes; empty without a test."""
    p = load.p_value
    if not load.degrees_of_freedom:
        return ""
    wrong = "" if not load.imported or load.gains else WRONG_GAINS
    return (
        f"Fit of a rigid load to the differences: χ² = {load.chi_squared:.1f} with "
        f"{load.degrees_of_freedom} degrees of freedom (p = {p:.2g})"
        + ("." if p > LOOSE else f": something else changed between the runs{wrong}.")
    )


def not_shown(load: LoadFile) -> str:
    """State the parameters of the load that the runs do not show; empty if none."""
    said = []
    if load.unseen:
        remedy = "add these parameters to that link" if load.imported else "hil diagnose tests them"
        said.append(
            f"Not observed: {', '.join(load.unseen)} of the load, absent from the last link in "
            f"the robot file and taken as zero; {remedy}."
        )
    if load.unidentifiable:
        said.append(
            f"Not identifiable from these recordings: {', '.join(load.unidentifiable)} of the load."
        )
    return " ".join(said)


def outcome(bare: Run, loaded: Sequence[Run], found: Load, kept: LoadFile) -> Outcome:
    """Return the outcome of a load, with predicted torques of the loaded runs.

    Parameters
    ----------
    bare : Run
        Run without the load.
    loaded : sequence of Run
        Runs with the load.
    kept : LoadFile
        Content of the load file.
    """
    robot = bare.robot
    word = "doubtful" if found.is_loose or found.unidentifiable else "good"
    shown = file_outcome(kept, robot)
    first, *others = shown.sentences
    return replace(
        shown,
        sentences=tuple(others),
        verdicts=(Verdict(word, word, first),),
        title=f"{robot.name}: load",
        facts={
            "Without load": bare.path.name,
            "With load": ", ".join(run.path.name for run in loaded),
        },
        simulated=any(run.journal.simulated for run in (bare, *loaded)),
        played=partial(_predicted, bare, loaded, found),
    )


def file_outcome(kept: LoadFile, robot: Robot) -> Outcome:
    """Return the outcome of a load file."""
    # imported motions have no elements of single measurements
    kinds = () if kept.imported else tuple(ELEMENT_KINDS[name] for name in DRAWN)
    plots = tuple(
        Plot(
            f"load-{kind.name}",
            partial(load_chart, kept.elements_without, kept.elements_loaded, kind, robot),
            f"{elements} without and with load over configuration number, one panel per axis.",
            f"{elements} without and with load, measured and modelled ({kind.figure}).",
        )
        for kind, elements in ((kind, kind.elements.capitalize()) for kind in kinds)
    )
    # files of earlier versions have no verdict
    said = filter(None, (*(kept.verdict or (not_shown(kept),)), goodness_of_fit(kept)))
    from hil.results.load import quantities  # noqa: PLC0415 - reports of other runs need none

    tables = changes(kept), quantities(kept.load), torque_constants(kept)
    return Outcome(tables, sentences=tuple(said), plots=plots if kept.elements_loaded else ())


def _predicted(bare: Run, loaded: Sequence[Run], found: Load) -> Played:
    """Predict torques of the loaded runs by the model without load, extended by the load.

    Friction is that of the run without the load. Empty without a model.
    """
    from hil.results.identification import method_for  # noqa: PLC0415 - as above

    try:
        model = found_in(bare, method_for(bare)[0]).model
    except (NotEnoughData, NotIdentifiable):
        return Played()
    K = load_columns(bare.robot).K
    scatter = model.scatter_covariance + K @ found.covariance @ K.T
    carrying = replace(model, values=found.p + K @ found.phi, scatter_covariance=scatter)
    words = "Predicted with the load, and with the friction of the run without it. "
    return played(carrying, loaded, words)


def load_chart(
    without: Sequence[ElementRecord],
    loaded: Sequence[ElementRecord],
    kind: ElementKind,
    robot: Robot,
) -> Iterator[Panel]:
    """Draw Figs. 5 and 6 of the paper: elements of both runs over configuration number."""
    runs = [[each for each in run if each.kind == kind.name] for run in (without, loaded)]
    axes = sorted({each.axis for run in runs for each in run})
    for axis in axes:
        yield Panel(
            (*_drawn_of(runs[0], axis, loaded=False), *_drawn_of(runs[1], axis, loaded=True)),
            title=f"${kind.element(axis - 1, axis - 1)}$",
            x_label="configuration number",
            y_label=f"{kind.quantity} [{kind.unit_of(robot, axis - 1, axis - 1)}]",
            whole=True,
        )


def _drawn_of(run: Sequence[ElementRecord], axis: int, *, loaded: bool) -> Iterator[Item]:
    state = "with load" if loaded else "without load"
    own = [(k, each) for k, each in enumerate(run, start=1) if each.axis == axis]
    x = [k for k, _ in own]
    dash = "5 3" if loaded else ""
    yield Line(x, [each.model for _, each in own], MODEL, f"model {state}", dash, width=1.0)
    yield Points(
        x,
        [each.value for _, each in own],
        "x" if loaded else "ring",
        MEASURED if loaded else MUTED,
        f"measured {state}",
        ids=[each.id for _, each in own] if loaded else (),
    )
