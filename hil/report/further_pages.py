"""Pages beside reports, one HTML file each: of an acceptance, a history, a load, a validation.

All are one template: a word and its sentence, facts, charts, tables.

A history draws quantities of a machine over its runs, with intervals; what is marked stands out.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.intervals import SIGNIFICANT
from hil.model.load import load_columns
from hil.report.carried import first_pose, packed_recordings
from hil.report.charts.arm import arm
from hil.report.charts.chart import MEASURED, MODEL, MUTED, Chart, Panel, Points, chart
from hil.report.page import when, write_html
from hil.report.pictures import replay as replay_chart
from hil.report.pictures import tracking as tracking_chart
from hil.report.pictures import watch as watch_chart
from hil.report.section import Plot
from hil.report.sections.torques import over_time as torques_over_time
from hil.results import history_file as tables
from hil.results import load_tables
from hil.results.acceptance import checked
from hil.results.rounding import unit
from hil.results.tables.load import quantities as load_quantities
from hil.results.tables.parameters import band_residual
from hil.results.tables.table import Column, Table, table
from hil.results.tracking import PASSES
from hil.results.validation_tables import scores
from hil.results.watch import alarms, watched
from hil.runs.pooling import recorded
from hil.view.along_motion import beside
from hil.view.stretches import most_demanding, stretches

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.estimation.loads.figures import Load
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.acceptance import Acceptance
    from hil.results.history import History
    from hil.results.load_file import LoadFile
    from hil.results.model import Model
    from hil.results.quantities import Kind
    from hil.results.recorded_torque import PredictedTorque
    from hil.results.validation import Validation
    from hil.results.watch import Alarm, Watched
    from hil.runs.recording import Recording
    from hil.runs.run import Run
    from hil.simulation.replay import Replay
    from hil.view.along_motion import Shown
    from hil.watching.trace import Trace

NOT_KNOWN = "not stated"
VALIDATION, TRACKING, WATCH = "validation.html", "tracking.html", "watch.html"
REPLAY = "replay.html"
PAYLOAD = "payload.html"
"""Names of pages in the folders of what they are about."""
FIRST = 3
"""Changes that stand above a history's charts in full, the clearest ones."""


class Torques(NamedTuple):
    """Measured and predicted torque as a plot, and its recordings, which the page plays."""

    plots: tuple[Plot, ...] = ()
    shown: tuple[Shown, ...] = ()

    def values(self, robot: Robot) -> dict[str, object]:
        """What the page shows of them beside the plot."""
        first = first_pose(robot, self.shown[0].recording) if self.shown else None
        return {
            "carried": packed_recordings(robot, self.shown),
            "picture": "" if first is None else arm(robot, first),
        }

    @classmethod
    def of(cls, model: Model, runs: Sequence[Run], words: str = "") -> Torques:
        """Predict runs; empty where nothing of them can be predicted."""
        found: dict[tuple[str, int], PredictedTorque] = {}
        pairs: dict[str, tuple[RecordedMotion, Recording]] = {}
        for run in runs:
            own = {motion.id: (motion, recording) for motion, recording in recorded(run)}
            found = {key: each for key, each in found.items() if key[0] not in own}
            found |= stretches(model, own.values())
            pairs |= own
        if not found:
            return cls()
        chosen = most_demanding(found)
        played = dict.fromkeys(each.measurement for each in chosen)
        plot = Plot(
            "torque",
            lambda: torques_over_time(chosen, model.robot),
            "Measured and predicted torque of every axis over time with its interval of 95 %, and"
            " their difference below.",
            f"Measured and predicted torque, after the low-pass; below it the residual. {words}Of"
            " each axis the recording that asks most of it.",
        )
        return cls((plot,), tuple(beside((pairs[name] for name in played), found)))


def _write(
    path: Path,
    robot: Robot,
    title: str,
    verdicts: Sequence[tuple[str, str, str]] = (),
    plots: Sequence[Plot] = (),
    tables: Sequence[Table] = (),
    torques: Torques | None = None,
    *,
    facts: Mapping[str, str] | None = None,
    simulated: bool = False,
    note: str = "",
) -> Path:
    """Write the page, whole or not at all, and return its path.

    `verdicts` are each a word that colours it, a word, and the reason; plots of torques come last.
    """
    played = {"carried": ""} if torques is None else torques.values(robot)
    write_html(
        path, "result.html", title=f"{robot.name}: {title}", verdicts=verdicts,
        plots=(*plots, *(torques.plots if torques else ())), facts=facts or {}, note=note,
        tables=[each for each in tables if each], simulated=simulated, **played,
    )  # fmt: skip
    return path


def write_validation_page(
    run: Run, model: Model, found: Validation, notes: tuple[str, ...] = ()
) -> Path:
    """Write the page of a validation into the folder of the run that was predicted.

    Raises
    ------
    FileError
        A damaged recording, or a full disk.
    """
    return _write(
        run.path / VALIDATION,
        run.robot,
        "validation",
        [(each.word, each.word, each.clause) for each in found.reasons],
        (),
        (
            scores(found, notes),
            band_residual(found.residual, model.robot, "of this recording"),
        ),
        Torques.of(model, [run]),
        simulated=run.journal.simulated,
    )


def write_payload_page(
    folder: Path, bare: Model | None, loaded: Sequence[Run], found: Load, kept: LoadFile
) -> Path:
    """Write the page of a load into its folder.

    Parameters
    ----------
    bare : Model or None
        Of the run without the load, whose friction the prediction has; None of one that does not
        identify the robot.
    loaded : sequence of Run
        With the load.
    found : Load
    kept : LoadFile
        The same with what else was found.

    Raises
    ------
    FileError
        A damaged recording, or a full disk.
    """
    robot, torques = loaded[0].robot, Torques()
    if bare is not None:
        K = load_columns(robot).K
        scatter = bare.scatter_covariance + K @ found.covariance @ K.T
        carrying = replace(bare, values=found.p + K @ found.phi, scatter_covariance=scatter)
        words = "Predicted with the load, and with the friction of the run without it. "
        torques = Torques.of(carrying, loaded, words)
    word = "doubtful" if found.is_loose or found.unidentifiable else "good"
    first, *others = kept.verdict
    notes = (*others, load_tables.goodness_of_fit(kept), load_tables.not_shown(kept))
    quantities = replace(load_quantities(kept.load), notes=tuple(filter(None, notes)))
    return _write(
        folder / PAYLOAD,
        robot,
        "load",
        [(word, word, first)],
        (),
        (quantities, load_tables.changes(kept), load_tables.torque_constants(kept)),
        torques,
        simulated=any(run.journal.simulated for run in loaded),
    )


def write_tracking_page(
    folder: Path, runs: Mapping[str, Run], model: Model, delay: float, errors: Table
) -> Path:
    """Write the page of a tracking into its folder; arguments as of `hil.report.pictures`."""
    run = runs[PASSES[0]]
    torques = Torques.of(model, [runs[PASSES[-1]]], "Velocity and torque were fed forward. ")
    plot = Plot(
        "errors",
        lambda: tracking_chart(runs, delay),
        "Following error of every axis over time with neither, velocity and both fed forward.",
        "Following errors over the first period of the first trajectory, by what is fed forward;"
        " below, the smaller ones by themselves.",
    )
    return _write(
        folder / TRACKING, run.robot, "following errors", (), (plot,), (errors,), torques,
        simulated=run.journal.simulated,
    )  # fmt: skip


def write_watch_page(
    folder: Path, run: Run | None, model: Model, found: Watched, trace: Trace
) -> Path:
    """Write the page of a watch into its folder; without a run where nothing was recorded."""
    units = tuple(axis.unit for axis in found.axes)
    torques = Torques() if run is None else Torques.of(model, [_around(run, found.alarms)])
    plot = Plot(
        "watch",
        lambda: watch_chart(trace, units),
        "Measured and predicted torque of every axis around its first alarm, or at the end.",
        "Torques around each axis's first alarm, or at the end of the watch.",
    )
    return _write(
        folder / WATCH,
        model.robot,
        "watch",
        [found.outcome],
        (plot,),
        (watched(found), alarms(found)),
        torques,
        simulated=run is not None and run.journal.simulated,
    )


def write_replay_page(
    run: Run, found: Replay, verdicts: Sequence[tuple[str, str, str]] = ()
) -> Path:
    """Write the page of a replay into the folder of the run that was simulated."""
    plot = Plot(
        "positions",
        lambda: replay_chart(found),
        "Recorded and simulated position of every axis over time, and their difference below.",
        "Recorded and simulated positions of the recording with the largest error of each axis;"
        " below, simulated less recorded position.",
    )
    return _write(
        run.path / REPLAY, run.robot, "replay", verdicts, (plot,), (found.table(),),
        simulated=run.journal.simulated,
    )  # fmt: skip


def _around(run: Run, raised: Sequence[Alarm]) -> Run:
    """The recordings with the first alarm of each axis; without one the last recording."""
    first = {each.axis: each.time for each in reversed(raised)}
    kept: list[str] = []
    for motion, recording in recorded(run) if first else ():
        begin, end = recording.time[[0, -1]]
        within = [axis for axis, time in first.items() if begin <= time <= end]
        if within:
            kept.append(motion.id)
        first = {axis: time for axis, time in first.items() if axis not in within}
        if all(time < begin for time in first.values()):
            break
    return run.only(kept or run.ids[-1:])


def write_acceptance_page(
    path: Path, run: Run, model: Model, found: Acceptance, stated: Mapping[str, str]
) -> None:
    """Write the page, whole or not at all; `stated`: facts that the run does not hold."""
    sessions, count = run.journal.sessions, len(found.checks)
    failed = sum(check.word == "failed" for check in found.checks)
    many = "are outside their" if failed > 1 else "is outside its"
    _write(
        path,
        run.robot,
        "acceptance",
        [
            (
                found.word,
                found.word,
                f"{failed} of {count} checks {many} limits"
                if failed
                else f"all {count} checks are within their limits",
            )
        ],
        (),
        (checked(found), _drives(run)),
        Torques.of(model, [run]),
        facts={
            **{name: text or NOT_KNOWN for name, text in stated.items()},
            "Measured": when(sessions[-1].started) if sessions else NOT_KNOWN,
            "Bus": sessions[-1].bus if sessions else NOT_KNOWN,
        },
        simulated=run.journal.simulated,
    )


def _drives(run: Run) -> Table:
    axes = next((session.axes for session in run.journal.sessions if session.axes), ())
    rows = ((axis.name, axis.identity) for axis in axes)
    return table("Drives", ("axis", Column("identity", folds=True)), rows)


_CAPTION = "Values with intervals of 95 %, thin lines with what temperature may add to friction."


def write_history_page(path: Path, found: History) -> None:
    """Write the page, whole or not at all."""
    newest = found.runs[-1]
    changed = [("doubtful", "changed", sentence) for sentence in found.sentences(newest)]
    if (further := len(changed) - FIRST) > 1:
        changed[FIRST:] = [("doubtful", "changed", f"{further} further quantities, listed below")]
    unchanged = [("good", "unchanged", f"{newest.label}: nothing changed significantly")]
    _write(
        path,
        found.robot,
        "condition over time",
        changed or unchanged,
        tuple(_history_plots(found)),
        [each(found) for each in (tables.runs, tables.changes, tables.condition)],
        simulated=any(run.model.provenance.of_virtual_plant for run in found.runs),
        note="Anything of a run of an unchanged machine is marked with a probability of"
        f" {SIGNIFICANT:.0%} at most.",
    )


def _history_plots(found: History) -> Iterator[Plot]:
    """A plot of each kind of quantity that the runs know."""
    names: dict[Kind, str] = {
        "gravity parameter": "Gravity parameters", "inertia parameter": "Inertia parameters",
        "friction level": "Friction", "offset": "Offsets",
    }  # fmt: skip
    for kind, name in names.items():
        places = [k for k, each in enumerate(found.quantities) if each.kind == kind]
        if places:
            yield Plot(
                kind.replace(" ", "-"),
                lambda places=places: over_time(found, places),  # type: ignore[misc]
                f"{name} over time, a panel each",
                f"{name} over time. {_CAPTION}",
            )


def over_time(found: History, places: Sequence[int]) -> Chart:
    """Draw the quantities at `places`, a panel each."""
    at, label = _instants(found)
    return chart(
        Panel(
            tuple(_readings(found, place, at)),
            title=found.quantities[place].title,
            x_label=label,
            y_label=unit(found.quantities[place].unit),
            height=105.0,
        )
        for place in places
    )


def _instants(found: History) -> tuple[np.ndarray, str]:
    """Places of the runs along the axis: days or hours; their numbers where one has no instant."""
    stamps = [run.measured for run in found.runs]
    if not all(stamps):
        return np.arange(1.0, len(stamps) + 1), "run"
    seconds = np.array([datetime.fromisoformat(stamp).timestamp() for stamp in stamps])
    hours = (seconds - seconds[0]) / 3600.0
    if np.ptp(hours) < 48.0:
        return hours, "hours since the first run"
    return hours / 24.0, "days since the first run"


def _readings(found: History, place: int, at: np.ndarray) -> Iterator[Points]:
    quantity = found.quantities[place]
    readings = [run.readings[place] for run in found.runs]
    marked = {each.run for each in found.marked if each.quantity == quantity}
    groups = (("as before", MEASURED, False), ("changed", MODEL, True))
    for name, colour, changed in groups:
        shown = [
            (t, read.value, read.half_width, read.allowance)
            for t, run, read in zip(at, found.runs, readings, strict=True)
            if read is not None and (run.label in marked) == changed
        ]
        t, value, half, allowance = np.array(shown).reshape(-1, 4).T
        if shown:
            yield Points(t, value, "o", MUTED, error=half + allowance, size=0.5)
            yield Points(t, value, "o", colour, name, error=half, size=2.4)
