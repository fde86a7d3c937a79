"""What a page carries with it: recordings behind the points of plots, parameters as files.

Recordings are as on the page of `hil view`, with what the model predicts of them, thinned to what a
screen shows. Base parameters are CSV for tables and JSON for programs.
"""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.planning.workspace import Workspace, narrowed
from hil.report.section import data_uri
from hil.view.along_motion import beside, measured
from hil.view.packed import deflated
from hil.view.scene import Scene
from hil.view.stretches import carriers

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun
    from hil.results.model import Model
    from hil.runs.recording import Recording
    from hil.view.along_motion import Shown

EACH = 400
"""Instants of a recording, on average: as many as a dialog has pixels for."""


def carried(run: ReportedRun, ids: Collection[str], played: Collection[str]) -> str:
    """What a page's script reads (`hil.view.packed`), compressed; empty where there is nothing.

    Parameters
    ----------
    run : ReportedRun
    ids : collection of str
        Measurements behind points.
    played : collection of str
        Recordings whose time has a cursor.
    """
    own = run.own_torques if run.is_identified else None
    found = own.stretches if own else {}
    of = carriers(found, base_parameters(run.robot).names) if own else {}
    wanted = {*ids, *(name for each in of.values() for name, _ in each)}
    shown = run.shown_torques if run.is_identified else None
    wanted |= set(played) if shown is own else set()
    pairs = (pair for pair in run.recordings if pair[0].id in wanted)
    recordings = [*beside(pairs, found)]
    if shown is not None and shown is not own:  # behind the run's own, whose ids they may have
        others = (pair for pair in shown.recordings if pair[0].id in played)
        recordings += beside(others, shown.stretches)
    titles = base_parameters(run.robot).titles if of else ()
    parameters = {
        name: {"title": title, "by": [[each, round(100 * share, 1)] for each, share in by]}
        for (name, by), title in zip(of.items(), titles, strict=True)
    }
    return packed_recordings(run.robot, recordings, parameters)


def packed_recordings(
    robot: Robot,
    recordings: Sequence[Shown],
    parameters: Mapping[str, object] | None = None,
) -> str:
    """Return recordings as `hil.view.packed` has them, compressed; empty where there are none."""
    if not recordings:
        return ""
    tracks = measured(robot, recordings, EACH * len(recordings))
    scene = Scene(
        title=robot.name,
        robot=_with_limits(robot, recordings),
        segments=tracks.segments,
        planned=tracks.set_point,
        measured=tracks,
        predicted=tracks.predicted,
    )
    return deflated(scene.data() | {"parameters": dict(parameters or {})})


def first_pose(robot: Robot, recording: Recording) -> Array:
    """Configuration where a recording begins; all joints at 0 where that is not known."""
    there = recording.q[np.isfinite(recording.q).all(axis=1)]
    return there[0] if len(there) else np.zeros(robot.n_joints)


def _with_limits(robot: Robot, shown: Sequence[Shown]) -> Robot:
    """The robot, with what it passed in place of limits that nobody stated."""
    q = np.concatenate([each.recording.q for each in shown])
    low, high = np.nanmin(q, axis=0), np.nanmax(q, axis=0) + 1e-6  # more than a point
    unknown = np.flatnonzero(~np.isfinite(robot.q_max - robot.q_min)).tolist()
    passed = {j + 1: (float(low[j]), float(high[j])) for j in unknown}
    return narrowed(robot, Workspace(ranges=passed))


Downloads = tuple[tuple[str, str, str], ...]
"""Name of each file, what it holds, and an address with its content."""


def downloads(model: Model) -> Downloads:
    """Return the base parameters of a model as files."""
    rows = _rows(model)
    name = f"{model.robot.name}-parameters"
    return (
        (f"{name}.csv", "CSV", data_uri(_csv(rows).encode(), "text/csv;charset=utf-8")),
        (f"{name}.json", "JSON", data_uri(_json(model, rows).encode(), "application/json")),
    )


def _rows(model: Model) -> list[dict[str, str | float]]:
    interval = model.interval(0.95)
    columns = zip(
        model.names, base_parameters(model.robot).meanings, model.values, model.standard_errors,
        interval, model.units, model.expressions, strict=True,
    )  # fmt: skip
    return [
        {
            "name": name,
            "meaning": meaning,
            "value": float(value),
            "standard_error": float(error),
            "low_95": float(low),
            "high_95": float(high),
            "unit": unit,
            "expression": expression,
        }
        for name, meaning, value, error, (low, high), unit, expression in columns
    ]


def _csv(rows: list[dict[str, str | float]]) -> str:
    written = io.StringIO()
    table = csv.DictWriter(written, rows[0].keys(), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return written.getvalue()


def _json(model: Model, rows: list[dict[str, str | float]]) -> str:
    content = {
        "robot": model.robot.name,
        "method": model.method,
        "parameters": rows,
        "covariance": model.covariance.tolist(),
    }
    return json.dumps(content, indent=1) + "\n"
