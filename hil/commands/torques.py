"""Plots of measured and predicted torques, and the recordings for playback on a page."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.workspace import Workspace, narrow_ranges
from hil.runs.pooling import recorded
from hil.show.charts.arm import arm
from hil.show.charts.chart import MEASURED, MODEL, Band, Chart, Line, Panel, Rule, chart
from hil.show.html import deflate
from hil.show.outcome import Played
from hil.show.rounding import when
from hil.show.section import Plot
from hil.view.along_motion import concatenate_recordings, join_predictions
from hil.view.page import view_script
from hil.view.scene import Scene
from hil.view.stretches import most_demanding, stretches

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.results.recorded_torque import PredictedTorque
    from hil.runs.recording import Recording
    from hil.runs.run import Run
    from hil.view.along_motion import Shown

EACH = 400
"""Mean number of drawn instants of a recording: one per pixel of a dialog."""


def played(model: Model, runs: Sequence[Run], words: str = "") -> Played:
    """Predict the torques of runs; empty if the model cannot predict any.

    Each axis is drawn in a recording with large torques; `words` describe the prediction.
    """
    found: dict[tuple[str, int], PredictedTorque] = {}
    pairs: dict[str, tuple[RecordedMotion, Recording]] = {}
    for run in runs:
        own = {motion.id: (motion, recording) for motion, recording in recorded(run)}
        # recordings of a later run replace those of an earlier run with the same name
        found = {key: each for key, each in found.items() if key[0] not in own}
        found |= stretches(model, own.values())
        pairs |= own
    if not found:
        return Played()
    chosen = most_demanding(found)
    names = dict.fromkeys(each.measurement for each in chosen)
    shown = tuple(join_predictions((pairs[name] for name in names), found))
    plot = Plot(
        "torque",
        lambda: torque_chart(chosen, model.robot),
        "Measured and predicted torque of every axis over time with its interval of 95 %, and"
        " their difference below.",
        f"Measured and predicted torque, low-passed; below, the residual. {words}Each axis in a "
        "recording with large torques.",
    )
    robot = model.robot
    picture = arm(robot, first_pose(robot, shown[0].recording))
    return Played((plot,), packed_recordings(robot, shown), view_script(), picture)


def model_and_run(path: Path, model: Model, folder: Path) -> dict[str, str]:
    """Return the facts of a page on a model and recordings: folder, model file, identification."""
    return {
        "Recordings": folder.name,
        "Model": os.path.relpath(path, folder),
        "Identified": when(model.provenance.identified),
    }


def torque_chart(shown: Sequence[PredictedTorque], robot: Robot) -> Chart:
    """Draw measured and predicted torque with interval for each axis, residuals below."""
    return chart(_torque(each, robot) for each in shown)


def _torque(each: PredictedTorque, robot: Robot) -> Panel:
    unit, t, half = robot.torque_unit(each.axis), each.time, each.half
    low, high = each.predicted - half, each.predicted + half
    around = np.where(np.isfinite(low), half, np.nan)
    return Panel(
        (
            Band(t, low, high, label="95 % interval"),
            Line(t, each.measured, MEASURED, "measured"),
            Line(t, each.predicted, MODEL, "predicted", "5 3"),
        ),
        title=f"axis {each.axis + 1}, {each.measurement}",
        x_label="time [s]",
        y_label=f"{'torque' if robot.revolute[each.axis] else 'force'} [{unit}]",
        below=Panel(
            (
                Band(t, -around, around),
                Rule(0.0),
                Line(t, each.residual, MEASURED, width=0.9),
            ),
            y_label=f"Δ [{unit}]",
            height=42.0,
        ),
        width=357.0,
        height=112.0,
        recording=each.measurement,
        axis=each.axis,
    )


def packed_recordings(
    robot: Robot,
    recordings: Sequence[Shown],
    parameters: Mapping[str, object] | None = None,
) -> str:
    """Return recordings in the compressed form of `hil.view.packed`; empty without recordings."""
    if not recordings:
        return ""
    tracks = concatenate_recordings(robot, recordings, EACH * len(recordings))
    scene = Scene(
        title=robot.name,
        robot=_limited(robot, recordings),
        segments=tracks.segments,
        planned=tracks.set_point,
        measured=tracks,
        predicted=tracks.predicted,
    )
    return deflate(scene.data() | {"parameters": dict(parameters or {})})


def first_pose(robot: Robot, recording: Recording) -> Array:
    """Return the first configuration of a recording; zeros if unknown."""
    there = recording.q[np.isfinite(recording.q).all(axis=1)]
    return there[0] if len(there) else np.zeros(robot.n_joints)


def _limited(robot: Robot, shown: Sequence[Shown]) -> Robot:
    """Return the robot with the recorded range in place of unknown joint limits."""
    # a function, so that the positions are freed before the recordings are packed
    q = np.concatenate([each.recording.q for each in shown])
    low, high = np.nanmin(q, axis=0), np.nanmax(q, axis=0) + 1e-6  # more than a point
    unknown = np.flatnonzero(~np.isfinite(robot.q_max - robot.q_min)).tolist()
    passed = {j + 1: (float(low[j]), float(high[j])) for j in unknown}
    return narrow_ranges(robot, Workspace(ranges=passed))
