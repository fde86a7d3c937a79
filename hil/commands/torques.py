"""Plots of measured and predicted torques, and the recordings for playback on a page.

The picture of the arm, capsules in an oblique parallel projection from above, needs no scripts and
can be printed; `hil.view` draws the same capsules in three dimensions. Links are drawn from the
farthest to the nearest.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from hil.model.capsules import capsules, segments
from hil.planning.workspace import Workspace, narrow_ranges
from hil.runs.pooling import recorded
from hil.show.charts.chart import MEASURED, MODEL, Band, Line, Panel, Rule
from hil.show.charts.svg import number, text
from hil.show.html import deflate
from hil.show.outcome import Played, Plot
from hil.show.rounding import when
from hil.view.along_motion import (
    concatenate_recordings,
    join_predictions,
    most_demanding,
    stretches,
)
from hil.view.page import view_script
from hil.view.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.results.recorded_torque import PredictedTorque
    from hil.runs.recording import Recording
    from hil.runs.run import Run
    from hil.view.along_motion import Shown


SEEN_FROM = (1.0, -1.1, 0.7)
"""Initial viewpoint of the page of `hil view`: forward, right, up."""
WIDTH, HEIGHT, MARGIN = 330.0, 270.0, 12.0


def arm(robot: Robot, recording: Recording) -> Markup:
    """Draw a robot at the first known configuration of a recording, with axis numbers."""
    known = recording.q[np.isfinite(recording.q).all(axis=1)]
    ends = segments(robot, known[:1] if len(known) else np.zeros((1, robot.n_joints)))[0]
    radii = capsules(robot).radii
    # unit vectors right, up and toward the viewer in the base frame, as rows (3, 3)
    strength = float(np.linalg.norm(robot.gravity))
    up = -robot.gravity / strength if strength else np.array([0.0, 0.0, 1.0])
    # smallest rotation from z to up
    first = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = first - up * (first @ up)
    frame = np.array([x / np.linalg.norm(x), np.cross(up, x / np.linalg.norm(x)), up])
    toward = np.array(SEEN_FROM) @ frame
    toward /= np.linalg.norm(toward)
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    view = np.array([right, np.cross(toward, right), toward])
    seen = ends @ view.T
    low = (seen[..., :2] - radii[:, np.newaxis, np.newaxis]).min(axis=(0, 1))
    high = (seen[..., :2] + radii[:, np.newaxis, np.newaxis]).max(axis=(0, 1))
    room = np.array([WIDTH, HEIGHT]) - 2 * MARGIN
    scale = float((room / np.maximum(high - low, 1e-9)).min())
    at = MARGIN + (room - scale * (high - low)) / 2 + scale * (seen[..., :2] - low)
    at[..., 1] = HEIGHT - at[..., 1]
    links = []
    for link in np.argsort(seen[..., 2].mean(axis=1), kind="stable"):  # the farthest first
        path = "M{} {}L{} {}".format(*map(number, at[link].ravel().tolist()))
        radius = scale * radii[link]
        # a capsule with rim and highlight
        for kind, width in (("rim", radius + 1.0), ("link", radius), ("lit", 0.55 * radius)):
            links.append(f'<path class="{kind}" stroke-width="{number(2 * width)}" d="{path}"/>')
    numbers = "".join(
        text(float(x), float(y), str(axis), "middle joint")
        for axis, (x, y) in enumerate(at[:, 0], start=1)
    )
    box = f"0 0 {number(WIDTH)} {number(HEIGHT)}"
    drawn = "".join(links)
    return Markup(f'<svg viewBox="{box}">{drawn}{numbers}</svg>')  # noqa: S704 - numbers alone


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
    picture = arm(robot, shown[0].recording)
    return Played((plot,), packed_recordings(robot, shown), view_script(), picture)


def model_and_run(path: Path, model: Model, folder: Path) -> dict[str, str]:
    """Return the facts of a page on a model and recordings: folder, model file, identification."""
    return {
        "Recordings": folder.name,
        "Model": os.path.relpath(path, folder),
        "Identified": when(model.provenance.identified),
    }


def torque_chart(shown: Sequence[PredictedTorque], robot: Robot) -> Iterator[Panel]:
    """Draw measured and predicted torque with interval by axis, residuals below."""
    for each in shown:
        unit, t, half = robot.torque_unit(each.axis), each.time, each.half
        low, high = each.predicted - half, each.predicted + half
        around = np.where(np.isfinite(low), half, np.nan)
        yield Panel(
            (
                Band(t, low, high, label="95 % interval"),
                Line(t, each.measured, MEASURED, "measured"),
                Line(t, each.predicted, MODEL, "predicted", "5 3"),
            ),
            title=f"axis {each.axis + 1}, {each.measurement}",
            x_label="time [s]",
            y_label=f"{'torque' if robot.revolute[each.axis] else 'force'} [{unit}]",
            below=Panel(
                (Band(t, -around, around), Rule(0.0), Line(t, each.residual, MEASURED, width=0.9)),
                y_label=f"Δ [{unit}]",
                height=42.0,
            ),
            width=357.0,
            height=112.0,
            recording=each.measurement,
            axis=each.axis,
        )


def packed_recordings(
    robot: Robot, recordings: Sequence[Shown], parameters: Mapping[str, object] | None = None
) -> str:
    """Return recordings in the compressed form of `hil.view.page`; empty without recordings."""
    if not recordings:
        return ""
    tracks = concatenate_recordings(robot, recordings, EACH * len(recordings))
    # the recorded range in place of unknown joint limits
    unknown = np.flatnonzero(~np.isfinite(robot.q_max - robot.q_min))
    q = np.concatenate([each.recording.q[:, unknown] for each in recordings])
    # more than a point
    ends = np.nanmin(q, axis=0).tolist(), (np.nanmax(q, axis=0) + 1e-6).tolist()
    passed = dict(zip((unknown + 1).tolist(), zip(*ends, strict=True), strict=True))
    scene = Scene(
        title=robot.name,
        robot=narrow_ranges(robot, Workspace(ranges=passed)),
        segments=tracks.segments,
        planned=tracks.set_point,
        measured=tracks,
        predicted=tracks.predicted,
    )
    return deflate(scene.data() | {"parameters": dict(parameters or {})})
