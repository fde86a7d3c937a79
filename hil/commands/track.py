"""`hil track`: following errors of a trajectory with and without feed-forward.

The following error is planned less measured position at the same instant. Every drive follows its
set-points with the delay of its interpolation, with any feed-forward (`hil.measuring.feeding`).
This delay is no following error, so planned positions are shifted by the stated delay, equally for
all axes and passes. The delay estimated from the pass with velocity and torque is reported for
comparison: a difference means a wrong stated delay.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.commands.torques import model_and_run, played
from hil.errors import NotEnoughData
from hil.planning.trajectory import Trajectory
from hil.results.model import Model
from hil.results.provenance import KeptResult
from hil.runs.run import Run
from hil.runs.set_points import path_time
from hil.show.charts.chart import GREEN, MUTED, PURPLE, Line, Panel
from hil.show.outcome import Outcome, Plot, Verdict
from hil.show.rounding import significant
from hil.show.table import Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from hil.arrays import Array
    from hil.runs.recording import Recording
    from hil.show.table import Row


NAME, PAGE = "tracking.yaml", "tracking.html"
PASSES = ("neither", "velocity", "both")
"""Feed-forward of the passes, in the order of the table."""
PASS_LINES = {
    "neither": ("neither", MUTED),
    "velocity": ("velocity", PURPLE),
    "both": ("velocity and torque", GREEN),
}
"""Label and colour of each pass of a tracking."""


class AxisErrors(FileModel):
    """Following errors of an axis, by pass.

    Attributes
    ----------
    axis : int
        Axis, from 1.
    unit : {"rad", "m"}
    rms, peak : dict
        Errors by name of the pass [rad or m].
    """

    axis: int
    unit: str
    rms: dict[str, float]
    peak: dict[str, float]


class Tracking(KeptResult):
    """Following errors of the axes.

    Attributes
    ----------
    robot_digest, plan_digest, model : str
        Digests of robot and plan, and the path of the model file.
    delay : float
        Stated delay of the drives [SYNC periods].
    shown_delay : float
        Delay estimated from the pass with velocity and torque [SYNC periods].
    """

    names = (NAME,)
    robot_digest: str
    plan_digest: str
    model: str
    delay: float
    shown_delay: float
    axes: tuple[AxisErrors, ...]

    def gain(self, before: str, after: str) -> float:
        """Return the ratio of rms errors of two passes, median over axes."""
        return float(np.median([axis.rms[before] / axis.rms[after] for axis in self.axes]))


def tracked(runs: dict[str, Run], model: str, delay: float) -> Tracking:
    """Compute the following errors of the passes.

    Parameters
    ----------
    runs : dict
        Runs of one plan of trajectories, by name of the pass.
    model : str
        Path of the model file.
    delay : float
        Delay of the drives [SYNC periods].

    Raises
    ------
    NotEnoughData
        A pass has no sample of a motion.
    """
    run, left = runs[PASSES[0]], 0.0
    found: dict[str, Array] = {}
    for name, each in runs.items():
        own = trajectories(each)
        parts = [following_error(recording, path, delay)[1:] for path, recording in own]
        if not any(len(error) for error, _ in parts):
            raise NotEnoughData(
                f"{each.path}: no sample of a motion was recorded; measure it again"
            )
        error, qd = (np.vstack(both) for both in zip(*parts, strict=True))
        found[name] = error
        if name == "both":
            # remaining delay in the errors of all axes, by least squares [SYNC periods]
            e, v = ((x / run.robot.velocity_limit).ravel() for x in (error, qd))
            left = float(e @ v / (v @ v)) / own[-1][1].period
    return Tracking(
        robot_digest=run.robot.digest,
        plan_digest=run.plan.digest,
        model=model,
        delay=delay,
        shown_delay=delay + left,
        axes=tuple(
            AxisErrors(
                axis=axis + 1,
                unit=run.robot.position_unit(axis),
                rms={name: float(np.sqrt(np.mean(e[:, axis] ** 2))) for name, e in found.items()},
                peak={name: float(np.abs(e[:, axis]).max()) for name, e in found.items()},
            )
            for axis in range(run.robot.n_joints)
        ),
    )


def following_error(
    recording: Recording, trajectory: Trajectory, delay: float
) -> tuple[Array, Array, Array]:
    """Compute following errors during motion, without periods of reduced speed.

    Returns
    -------
    time : ndarray, shape (n,)
        Planned time since the beginning of the motion [s].
    error, qd : ndarray, shape (n, n_joints)
        Planned less measured position [rad or m], and planned velocity.
    """
    t = path_time(recording, delay)
    q, qd, _ = trajectory.motion(trajectory.within(t))
    error = q - recording.q
    shown = recording.active & np.isfinite(error).all(axis=1) & ~recording.slowed_groups
    return t[shown], error[shown], qd[shown]


def trajectories(run: Run) -> list[tuple[Trajectory, Recording]]:
    """Return the trajectories of a run with recordings."""
    return [
        (each.measurement, each.recording)
        for each in run
        if isinstance(each.measurement, Trajectory)
    ]


def errors(found: Tracking) -> Table:
    """Return the table of following errors."""
    return table(
        "Following errors by kind of feed-forward",
        ("axis", *figures(*PASSES, "factor"), "unit"),
        (
            Part(tuple(_row(axis, getattr(axis, size)) for axis in found.axes), size)
            for size in ("rms", "peak")
        ),
        "Planned less measured position during motion: without feed-forward (neither), with "
        "velocity, and with velocity and torque (both). Factor: error with velocity over error "
        "with both.",
        notes(found),
    )


def notes(found: Tracking, wrong: float = 0.25) -> tuple[str, ...]:
    """Return remarks on the following errors.

    The stated delay may differ from the estimated delay by `wrong` SYNC periods.
    """
    lines = []
    if abs(found.shown_delay - found.delay) > wrong:
        lines.append(
            f"the recordings show a delay of {found.shown_delay:.2f} SYNC periods instead of"
            f" the stated {found.delay:g}: repeat with --delay {found.shown_delay:.2f}"
        )
    if worse := _worse(found):
        lines.append(
            f"axis {', '.join(map(str, worse))}: velocity feed-forward makes the errors larger: "
            "the drive may add a velocity feed-forward of its own; set this to zero with the "
            "maker's tool"
        )
    return tuple(lines)


def judge(found: Tracking) -> Verdict:
    """Return the verdict on feed-forward, doubtful if it increases the errors of an axis."""
    better = found.gain("neither", "both") > 1.0
    return Verdict(
        "good" if better and not _worse(found) else "doubtful",
        "improved" if better else "not improved",
        f"median over the axes: errors {found.gain('neither', 'velocity'):.3g} times smaller "
        f"with velocity feed-forward, a further {found.gain('velocity', 'both'):.3g} times with "
        "torque feed-forward",
    )


def _worse(found: Tracking) -> list[int]:
    """Return the axes with larger errors by velocity feed-forward."""
    return [axis.axis for axis in found.axes if axis.rms["velocity"] > axis.rms["neither"]]


def _row(axis: AxisErrors, errors: dict[str, float]) -> Row:
    cells = (significant(1e3 * errors[name], 3) for name in PASSES)
    factor = errors["velocity"] / errors["both"]
    return (str(axis.axis), *cells, f"{factor:.1f}", f"m{axis.unit}")


def track(folder: Path, model: str, delay: float) -> Outcome:
    """Compare the passes in a folder, and write the following errors there.

    Parameters
    ----------
    model : str
        Path of the model file.
    delay : float
        Delay of the drives behind set-points [SYNC periods].
    """
    runs = {name: Run.open(folder / name) for name in PASSES}
    found = tracked(runs, model, delay)
    found.write(folder)
    plot = Plot(
        "errors",
        partial(_error_chart, runs, delay),
        "Following error of every axis over time: without feed-forward, with velocity, and with "
        "velocity and torque.",
        "Following errors over the first period of the first trajectory, by kind of "
        "feed-forward; below, the smaller errors enlarged.",
    )
    run, words = runs[PASSES[0]], "Velocity and torque were fed forward. "
    known = Model.load(model)
    return Outcome(
        (errors(found),),
        verdicts=(judge(found),),
        plots=(plot,),
        title=f"{run.robot.name}: following errors",
        facts=model_and_run(Path(model), known, folder),
        simulated=any(each.journal.simulated for each in runs.values()),
        played=lambda: played(known, [runs[PASSES[-1]]], words),
    )


def _error_chart(runs: Mapping[str, Run], delay: float) -> Iterator[Panel]:
    robot = runs[PASSES[0]].robot
    lines: list[dict[str, Line]] = [{} for _ in range(robot.n_joints)]
    for name in PASSES:
        trajectory, recording = trajectories(runs[name])[0]
        time, error, _ = following_error(recording, trajectory, delay)
        shown = np.flatnonzero(time <= trajectory.period)
        shown = shown[:: max(1, len(shown) // 700)]
        label, colour = PASS_LINES[name]
        for axis, own in enumerate(lines):
            own[name] = Line(time[shown], 1e3 * error[shown, axis], colour, label)
    for axis, own in enumerate(lines, start=1):
        yield Panel(
            tuple(own.values()),
            title=f"axis {axis}",
            x_label="time [s]",
            y_label=f"error [m{robot.position_unit(axis - 1)}]",
            below=Panel([own[name] for name in PASSES if name != "neither"], height=90.0),
            width=357.0,
            height=110.0,
        )
