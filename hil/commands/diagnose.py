"""`hil diagnose`: test of a robot file by a run: absent and needless parameters, Fig. 7.

The diagnosis is written to `diagnosis.yaml` in the folder of the run. The file names the
recordings, the robot file and the base parameters of the diagnosis, so that reports show the
diagnosis without a new computation as long as all three are unchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from checked_files.yaml_file import FileModel
from hil.errors import Mismatch
from hil.estimation.absent_parameters import Candidate, Phase, examine, shifted_most
from hil.estimation.identify import estimate
from hil.estimation.two_step_methods import prepared_for
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS
from hil.results.provenance import KeptResult, RunStamp, named, same_parameters
from hil.results.tables.parameters import drive_train
from hil.runs.atomic_file import own_folder, write_file
from hil.runs.journal import now
from hil.runs.pooling import recorded
from hil.show.charts.chart import MODEL, Chart, Line, Panel, Points, Rule
from hil.show.charts.svg import file
from hil.show.outcome import Outcome, Plot
from hil.show.rounding import signed, uncertain
from hil.show.table import Table, figures, table
from hil.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.absent_parameters import ModelErrors
    from hil.estimation.estimate import Estimate
    from hil.estimation.local_fits import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind
    from hil.runs.run import Run


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Diagnosis of a run; `phase` is None if no absent parameter shows in gravity torques."""

    robot: Robot
    estimate: Estimate
    errors: ModelErrors
    phase: Phase | None


def diagnose(run: Run) -> Diagnosis:
    """Estimate a run and test the robot file.

    Raises
    ------
    NotIdentifiable
        Too few measurements.
    Mismatch
        An imported run.
    """
    if run.imported:
        raise Mismatch(
            f"{run.path}: is an imported run; hil diagnose needs measurements of single "
            "elements, made by hil run; to test a link parameter by imported recordings, add it "
            "to the robot file, import and identify again, and check whether its interval "
            "contains zero"
        )
    recordings = list(recorded(run))
    robot = run.robot
    with named(run):
        best = estimate(robot, recordings)
    errors = examine(robot, prepared_for(robot, best, recordings))
    shifted = shifted_most(best, errors, robot.torque_limit) if errors.found else None
    return Diagnosis(robot, best, errors, shifted)


NAME, PLOTS = "diagnosis.yaml", "diagnosis"
SHOWN = 8
"""Number of candidates in the ranking."""


class Needless(FileModel):
    """Stated base parameter that does not differ significantly from zero."""

    name: str
    expression: str
    p_value: float


class DiagnosisFile(KeptResult):
    """Content of `diagnosis.yaml`.

    Attributes
    ----------
    p : tuple of float
        Base parameters of the estimate.
    candidates : tuple of Candidate
        Candidates, each tested alone, strongest evidence first.
    found : tuple of str
        Labels of the significant candidates.
    threshold : float
        p-value below which a candidate is significant.
    absorbed, unmeasured : tuple of str
        Absent parameters invisible in any measurement, and those invisible in these measurements.
    """

    names = (NAME,)
    format: Literal[1] = 1
    made: str
    version: str
    of: RunStamp
    p: tuple[float, ...]
    threshold: float
    candidates: tuple[Candidate, ...]
    found: tuple[str, ...]
    needless: tuple[Needless, ...]
    absorbed: tuple[str, ...]
    unmeasured: tuple[str, ...]
    phase: Phase | None

    def stale(self, folder: Run, p: Array) -> str:
        """Return the reason if the file does not match the present run; empty if it does."""
        return self.of.change(folder) or same_parameters(self.p, p)


def write_diagnosis(run: Run, found: Diagnosis) -> DiagnosisFile:
    """Write `diagnosis.yaml` into the folder of the run, atomically; return its content."""
    errors, base = found.errors, base_parameters(found.robot)
    kept = DiagnosisFile(
        made=now(),
        version=__version__,
        of=RunStamp.create(run),
        p=tuple(found.estimate.values.tolist()),
        threshold=errors.threshold,
        candidates=errors.alone,
        found=tuple(c.label for c in errors.found),
        needless=tuple(
            Needless(name=base.titles[k], expression=base.expressions[k], p_value=float(p_value))
            for k, p_value in enumerate(errors.p_values)
            # p-value above which a stated parameter does not differ significantly from zero
            if p_value > 0.05
        ),
        absorbed=errors.absorbed,
        unmeasured=errors.unmeasured,
        phase=found.phase,
    )
    kept.write(run.path)
    return kept


def candidates(found: DiagnosisFile) -> Table:
    """Return the table of absent parameters, strongest evidence first."""
    rows = []
    for each in found.candidates[:SHOWN]:
        beside = "" if each.beside is None else signed(f"{each.beside:.1f}")
        rows.append(
            (
                each.label,
                *uncertain(each.value, each.standard_error),
                signed(f"{each.t:.1f}"),
                f"{each.p_value:.1g}",
                "found" if each.label in found.found else beside,
            )
        )
    return table(
        "Effects missing in the robot file, ranked by evidence",
        ("parameter", *figures("value", "std. error", "t", "p", "t, combined")),
        rows,
        "t: value over standard error; p: probability of such a t by chance. Last column: t with "
        "the effects found added to the model; small for one that only resembles a found effect.",
    )


def sentences(found: DiagnosisFile) -> Iterator[str]:
    """State significant absent parameters with their effect, and needless parameters."""
    below = f"p below {found.threshold:.1g}"
    if found.found:
        names = ", ".join(found.found)
        yield f"Significant effects ({below}), to be added to the robot file: {names}."
    else:
        yield (
            f"No effect is significant ({below}): these measurements show no effect missing in the "
            "robot file."
        )
    if found.phase is not None:
        shift = signed(f"{math.degrees(found.phase.shift):.1f}")
        yield (
            f"The effects found shift the phase of g{found.phase.axis} over q{found.phase.over} by "
            f"{shift} degrees at the measured configuration of largest amplitude."
        )
    if names := "; ".join(f"{each.name}: {each.expression}" for each in found.needless):
        yield f"Not significantly different from zero, may be left out: {names}."
    if found.absorbed:
        names = ", ".join(found.absorbed)
        yield f"Indistinguishable from base parameters in any measurement: {names}."
    if found.unmeasured:
        yield f"Not shown by these measurements: {', '.join(found.unmeasured)}."


def outcome(run: Run, found: Diagnosis) -> Outcome:
    """Write diagnosis and plots into the folder of the run; return the outcome."""
    shown, robot = file_outcome(write_diagnosis(run, found), run.robot), run.robot
    charts = {
        name: Chart(
            tuple(
                residuals_over_angles(
                    [v for v in found.estimate.local if v.kind == name], robot, kind
                )
            )
        )
        for name, kind in ELEMENT_KINDS.items()
        if not kind.pair
    }
    charts |= {plot.name: plot.chart for plot in shown.plots}
    own_folder(run.path / PLOTS)
    for name, drawn in charts.items():
        write_file(run.path / PLOTS / f"{name}.svg", file(drawn))
    tables = *shown.tables, drive_train(found.estimate)
    return replace(shown, tables=tables, simulated=run.journal.simulated)


def file_outcome(kept: DiagnosisFile, robot: Robot) -> Outcome:
    """Return the outcome of a diagnosis file."""
    plots: tuple[Plot, ...] = ()
    if kept.phase is not None:
        plot = Plot(
            "phase",
            partial(shifted_sinusoid, kept.phase, ", ".join(kept.found), robot),
            "A gravity torque over a joint angle: measurements, model of the robot file, and "
            "model with the effects found.",
            "Gravity torque with the largest phase shift by the effects found (the paper's Fig. "
            "7), at the measured configuration of largest amplitude. Measurements at other "
            "configurations are transferred to this one by the extended model; their common "
            "offset is removed.",
        )
        plots = (plot,)
    return Outcome((candidates(kept),), sentences=tuple(sentences(kept)), plots=plots)


def shifted_sinusoid(phase: Phase, found: str, robot: Robot) -> Iterator[Panel]:
    """Draw Fig. 7 of the paper: gravity torque with and without the `found` parameters."""
    angle = np.linspace(-np.pi, np.pi, 181)
    shown = np.degrees(angle)
    name = found if len(found) < 40 else "effects found"  # maximum number of letters in a legend
    error = [2.0 * (each or 0.0) for each in phase.standard_error]
    yield Panel(
        (
            Line(shown, phase.stated.evaluate(angle), MODEL, "robot file", "5 3"),
            Line(shown, phase.extended.evaluate(angle), MODEL, f"with {name}"),
            Points(np.degrees(phase.angle), phase.torque, error=error, label="measured"),
        ),
        title=f"phase offset {signed(f'{np.degrees(phase.shift):.1f}')}°",
        x_label=f"$q_{{{phase.over}}}$ [deg]",
        y_label=f"$g_{{{phase.axis}}}$ [{robot.torque_unit(phase.axis - 1)}]",
        ticks={float(each): signed(f"{each}") for each in range(-180, 181, 60)},
        width=700.0,
        height=220.0,
    )


def residuals_over_angles(
    values: Sequence[LocalValue], robot: Robot, kind: ElementKind
) -> Iterator[Panel]:
    """Draw residuals of the elements of every axis over the position of every varied joint.

    The mean residual of an axis over all configurations is removed: asymmetric friction, which step
    1 attributes to the element, would hide the dependence on angles.

    Parameters
    ----------
    values : sequence of LocalValue
        Local values of one kind.
    kind : ElementKind
        Kind of the values.
    """
    for axis in sorted({value.axis for value in values}):
        own = [value for value in values if value.axis == axis]
        left = np.array([value.shown[0] - value.model for value in own])
        mean = float(left.mean())
        error = 2.0 * np.nan_to_num([value.shown[1] for value in own])
        most = 1.1 * float(np.max(np.abs(left - mean) + error)) or 1.0
        unit, element = kind.unit_of(robot, axis, axis), kind.element(axis, axis)
        for joint, turns in enumerate(robot.revolute):
            shown = np.array([value.q[joint] for value in own]) * (180 / np.pi if turns else 1e3)
            if np.ptp(shown) > 4.0:
                low, high, ticks = float(shown.min()), float(shown.max()), None
                if turns and high - low >= 150:  # marks at right angles
                    step, room = 180 if high - low > 340 else 90, 0.05 * (high - low)
                    every = range(math.floor(low / step), math.ceil(high / step) + 1)
                    marks = (float(step * k) for k in every)
                    ticks = {x: signed(f"{x:g}") for x in marks if low - room <= x <= high + room}
                yield Panel(
                    (
                        Rule(0.0, colour=MODEL),
                        Points(shown, left - mean, error=error, ids=[value.id for value in own],
                               label="measured − modelled, ± 2 standard errors", size=2.5),
                    ),
                    title=f"${element}$ less mean {signed(f'{mean:.2g}')}",
                    x_label=f"$q_{{{joint + 1}}}$ [{'deg' if turns else 'mm'}]",
                    y_label=f"Δ${element}$ [{unit}]",
                    y_range=(-most, most),
                    ticks=ticks,
                    width=260.0,
                    height=95.0,
                )  # fmt: skip
