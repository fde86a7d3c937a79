"""`hil payload`: a load, identified from runs without and with the load, written to `load.yaml`.

The file is written beside the runs with the load, or into the folder of the loaded run. The file
names its recordings, so that reports show a load without a new computation: Table 3, parameters of
the load, gains of the drives, and Figs. 5 and 6. `payload.yaml` of earlier versions is read as
well.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import yaml
from pydantic import AfterValidator, BeforeValidator
from scipy import special

from checked_files.yaml_file import FileModel, load_yaml
from hil.commands.torques import played
from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.loads.figures import LOOSE, AxisMisfit, Figure
from hil.model.base_parameters import base_parameters, link_share
from hil.model.drive_train_file import USUAL_BOUND
from hil.model.load import FIRST_MOMENTS, load_columns
from hil.planning.measurement import ELEMENT_KINDS
from hil.results.findings import found_in
from hil.results.provenance import RunStamp, same_parameters
from hil.results.tables.parameters import NAMED
from hil.runs.atomic_file import write_file
from hil.runs.journal import now
from hil.show.charts.chart import MEASURED, MODEL, MUTED, Chart, Line, Panel, Points, chart
from hil.show.outcome import Outcome, Played, Verdict
from hil.show.rounding import rounded, signed, uncertain, unit
from hil.show.section import Plot
from hil.show.table import Column, Table, figures, table
from hil.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.estimation.estimate import Estimate
    from hil.estimation.loads.figures import Load
    from hil.model.robot import Robot
    from hil.planning.design.load import WithoutLoad
    from hil.planning.design.load_pose import Pose
    from hil.planning.measurement import ElementKind
    from hil.planning.plan import Plan
    from hil.results.load import LoadFit
    from hil.runs.run import Run
    from hil.show.charts.chart import Item
    from hil.show.table import Row

NAME, EARLIER, PAGE = "load.yaml", "payload.yaml", "payload.html"
DRAWN = tuple(name for name, kind in ELEMENT_KINDS.items() if kind.figure)
"""Kinds of measurement in figures of the paper."""


def _drawn(kind: str) -> str:
    if kind not in DRAWN:
        raise ValueError(f"{kind!r} must be one of {', '.join(DRAWN)}")
    return kind


class ParameterChange(FileModel):
    """Column of Table 3: a base parameter without and with the load."""

    name: str
    meaning: str = ""
    unit: str
    without: float
    loaded: float
    change: float
    standard_error: float
    expected: float
    share: str
    """Expression in the parameters of the load."""


class GainRecord(FileModel):
    """Gain of one axis by the known mass; `error` is relative.

    Torque constant [N m/A]. For imported runs: factor of the gain in the map, or, if the map states
    an unknown gain, N m or N per unit of the signal without an assumed value.
    """

    axis: int
    assumed: float | None
    told: bool
    corrected: float | None
    standard_error: float | None
    error: float | None
    error_standard_error: float | None


class ElementRecord(FileModel):
    """Measured and modelled element of g(q) or M(q) of one measurement."""

    id: str
    kind: Annotated[str, AfterValidator(_drawn)]
    axis: int
    value: float
    standard_error: float | None
    model: float


class LoadFile(FileModel):
    """Content of `load.yaml`.

    Attributes
    ----------
    without : RunStamp
    loaded : tuple of RunStamp
        Runs with the load.
    mass : float or None
        Stated mass [kg].
    verdict : tuple of str
        Sentences for the operator.
    rigidity : tuple of AxisMisfit
    unseen : tuple of str
        Parameters of the load that the robot file states as zero.
    unidentifiable : tuple of str
        Parameters of the load without information in the recordings.
    changes : tuple of ParameterChange
        Changes between two runs that each identify the robot; empty otherwise, as are all further
        attributes.
    chi_squared, degrees_of_freedom, p_value
        Test of the changes against a rigid load.
    imported : bool
        True for an imported loaded run.
    own : tuple of float
        Base parameters of the loaded run alone with the gains of its map; empty if equal to those
        in `changes`, or unknown.
    elements_without, elements_loaded : tuple of ElementRecord
        Elements of Figs. 5 and 6 in the order of the plans; axes count from 1.
    """

    format: Literal[1] = 1
    made: str
    version: str
    without: RunStamp
    loaded: Annotated[
        tuple[RunStamp, ...], BeforeValidator(lambda x: [x] if isinstance(x, dict) else x)
    ]
    mass: float | None
    verdict: tuple[str, ...] = ()
    rigidity: tuple[AxisMisfit, ...] = ()
    load: tuple[Figure, ...]
    unseen: tuple[str, ...]
    unidentifiable: tuple[str, ...] = ()
    changes: tuple[ParameterChange, ...] = ()
    chi_squared: float = 0.0
    degrees_of_freedom: int = 0
    p_value: float = 1.0
    imported: bool = False
    own: tuple[float, ...] = ()
    gains: tuple[GainRecord, ...] = ()
    elements_without: tuple[ElementRecord, ...] = ()
    elements_loaded: tuple[ElementRecord, ...] = ()

    def stale(self, folder: Run, p: Array) -> str:
        """Return the reason if the file does not match the present runs; empty if it does.

        Parameters
        ----------
        p : ndarray, shape (n_base,)
            Present base parameters of the loaded run.
        """
        return (
            self.loaded[-1].change(folder)
            or self.without.change_beside(folder)
            or same_parameters(self.own or [each.loaded for each in self.changes], p)
        )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def write_load(
    path: Path,
    without: Run,
    loaded: Sequence[Run],
    found: LoadFit,
    verdict: Sequence[str],
) -> LoadFile:
    """Write `load.yaml` into the folder `path`, atomically; return its content."""
    load, before, after, own = found.load, found.before, found.after, found.own
    kept = LoadFile(
        made=now(),
        version=__version__,
        without=RunStamp.create(without, path),
        loaded=tuple(RunStamp.create(run, path) for run in loaded),
        mass=load.stated_mass,
        verdict=tuple(verdict),
        rigidity=load.misfit,
        load=tuple(load.quantities()),
        unseen=load.unseen,
        unidentifiable=load.unidentifiable,
        chi_squared=load.rigid.square,
        degrees_of_freedom=load.rigid.directions,
        p_value=load.rigid.p_value,
        imported=loaded[-1].imported,
        changes=_changes(without.robot, load, before, after) if before and after else (),
        own=() if own is None or own is after else tuple(own.p.tolist()),
        gains=_gains(found.by_mass, found.assumed) if found.by_mass else (),
        elements_without=_elements(before),
        elements_loaded=_elements(after),
    )
    text = yaml.safe_dump(
        kept.model_dump(mode="json"), sort_keys=False, width=100, allow_unicode=True
    )
    write_file(path / NAME, text.encode())
    return kept


def read_load(folder: Run) -> LoadFile | None:
    """Read the load file of a run; None without a file.

    Raises
    ------
    FileError
        A damaged file.
    """
    paths = (folder.path / name for name in (NAME, EARLIER))
    return next((load_yaml(path, LoadFile) for path in paths if path.exists()), None)


def _changes(
    robot: Robot, load: Load, before: Estimate, after: Estimate
) -> tuple[ParameterChange, ...]:
    """Return the changes between two estimates; common errors of the drives cancel."""
    base, shares = base_parameters(robot), link_share(robot, robot.n_joints - 1)
    expected = load_columns(robot).K @ load.phi
    drives = after.drive_effect - before.drive_effect
    variance = np.diag(before.covariance + after.covariance) + (drives**2).sum(axis=1)
    return tuple(
        ParameterChange(
            name=name,
            meaning=base.meanings[k],
            unit=base.units[k],
            without=float(before.p[k]),
            loaded=float(after.p[k]),
            change=float(after.p[k] - before.p[k]),
            standard_error=float(np.sqrt(variance[k])),
            expected=float(expected[k]),
            share=shares[k],
        )
        for k, name in enumerate(base.names)
    )


def _gains(found: Load, assumed: Array) -> tuple[GainRecord, ...]:
    """Return the gains; gains less certain than usual torque constants are not identifiable."""
    gain, relative, unknown = found.gains, found.gain_errors, np.isnan(assumed)
    constant = gain * np.where(unknown, 1.0, assumed)
    error = np.where(unknown, np.nan, 1.0 / gain - 1.0)
    of_error = np.where(unknown, relative, relative / gain)
    return tuple(
        GainRecord(
            axis=k + 1,
            assumed=_finite(each),
            told=bool(relative[k] < USUAL_BOUND),
            corrected=_finite(constant[k]),
            standard_error=_finite(constant[k] * relative[k]),
            error=_finite(error[k]),
            error_standard_error=_finite(of_error[k]),
        )
        for k, each in enumerate(assumed)
    )


def _elements(estimate: Estimate | None) -> tuple[ElementRecord, ...]:
    return tuple(
        ElementRecord(
            id=value.id,
            kind=value.kind,
            axis=value.axis + 1,
            value=value.shown[0],
            standard_error=_finite(value.shown[1]),
            model=value.model,
        )
        for value in (estimate.local if estimate else ())
        if value.kind in DRAWN
    )


SHOWN = float((special.ndtri(1.0 - LOOSE / 2.0) + special.ndtri(0.8)) / special.ndtri(0.975))
"""Change, in half-widths of the interval of 95 %, that is found with a probability of 80 %."""
WHOLE_RUNS = "take two whole runs"
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
            f"taken as zero: {', '.join(found.unseen)}, absent from the last link in the robot"
            " file; add what the load has of them there, or test them with hil diagnose"
        )
    return tuple(lines)


def unsure(found: Load) -> tuple[str, ...]:
    """Return uncertain and unidentifiable parameters of the load, each once."""
    return tuple(dict.fromkeys([*map(_parameter_of, _rough(found)), *found.unidentifiable]))


def advised(bare: WithoutLoad, plans: Sequence[Plan], found: Load) -> dict[str, str]:
    """Return a further pose for each uncertain or unidentifiable parameter, in words."""
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


def _unsure_lines(found: Load, advice: Mapping[str, str]) -> Iterator[str]:
    """Yield uncertain and unidentifiable parameters with remedies, a line per remedy."""
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
        "not rigid, not fixed, or friction changed with it: ",
        ("; fasten the load and its cables, empty what can flow, and measure again"),
    )
    if least is not None and found.is_no_body:
        return [
            f"{doubt}no body has the inertia that was found, with {_worded(least[0])} about an"
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


OF_MAPS = (
    "Gains are over those that the map states, 1 where these are right; one that the map leaves"
    " unknown is N m or N for one unit of the signal."
)


def changes(load: LoadFile) -> Table:
    """Return Table 3: base parameters without and with the load, and the expected change.

    No rows unless both runs identify the robot.
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
    """Return the table of torque constants by the mass of the load; no rows without a mass."""
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
    """State how well a rigid load explains the changes; empty without a test."""
    p = load.p_value
    if not load.degrees_of_freedom:
        return ""
    return (
        f"A rigid load leaves χ² = {load.chi_squared:.1f} of the differences with"
        f" {load.degrees_of_freedom} degrees of freedom (p = {p:.2g})"
        + ("." if p > LOOSE else f": something else changed between the runs{_or_gains(load)}.")
    )


def _or_gains(load: LoadFile) -> str:
    """Name wrong gains of a map as a further cause of changes; empty for other runs."""
    if not load.imported or load.gains:
        return ""
    return ", or the gains are wrong, which --mass and --gains find"


def not_shown(load: LoadFile) -> str:
    """State the parameters of the load that the runs do not show; empty if none."""
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


def outcome(bare: Run, loaded: Sequence[Run], found: Load, kept: LoadFile) -> Outcome:
    """Return the outcome of a load, with predicted torques of the loaded runs.

    Parameters
    ----------
    bare : Run
        Run without the load.
    loaded : sequence of Run
        Runs with the load.
    found : Load
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
            f"{elements} without and with load over configuration number, one panel an axis.",
            f"{elements} without and with load, measured and modelled ({kind.figure}).",
        )
        for kind, elements in ((kind, kind.elements.capitalize()) for kind in kinds)
    )
    # earlier versions kept no verdict
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
) -> Chart:
    """Draw Figs. 5 and 6 of the paper: elements of both runs over configuration number."""
    runs = [[each for each in run if each.kind == kind.name] for run in (without, loaded)]
    axes = sorted({each.axis for run in runs for each in run})
    return chart(
        Panel(
            (*_drawn_of(runs[0], axis, loaded=False), *_drawn_of(runs[1], axis, loaded=True)),
            title=f"${kind.element(axis - 1, axis - 1)}$",
            x_label="configuration number",
            y_label=f"{kind.quantity} [{kind.unit_of(robot, axis - 1, axis - 1)}]",
            whole=True,
        )
        for axis in axes
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
