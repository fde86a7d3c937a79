"""What a page carries with it: recordings behind the points of plots, parameters as files.

Recordings are torque and position over time, thinned to what a screen shows: of each stretch of
time the least and the greatest torque, so that no peak is lost, and one position; and what the
model says of them. Base parameters are CSV for tables and JSON for programs.
"""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

import numpy as np

from hil.model.base_parameters import base_parameters
from hil.report.section import data_uri
from hil.report.stretches import carriers
from hil.view.packed import INSTANT, deflated, packed
from hil.view.visuals import robot_data

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.report.reported_run import ReportedRun
    from hil.report.stretches import Stretch
    from hil.results.model import Model
    from hil.runs.recording import Recording

MOST = 500
"""Stretches of time of one recording: more than a dialog has pixels for."""


def carried(run: ReportedRun, ids: Collection[str], played: Collection[str]) -> str:
    """What a page's script reads, compressed; empty where there is nothing.

    Parameters
    ----------
    run : ReportedRun
    ids : collection of str
        Measurements behind points.
    played : collection of str
        Recordings whose time has a cursor.
    """
    found = run.own_torques.stretches if run.is_identified else {}
    base = base_parameters(run.robot) if run.is_identified else None
    of = carriers(found, base.names) if base else {}
    wanted = {*ids, *(name for each in of.values() for name, _ in each)}
    data: dict[str, object] = {
        "recordings": {
            each.measurement.id: _recording(each.measurement, each.recording, run.robot, found)
            for each in run.campaign
            if each.measurement.id in wanted
        },
        "parameters": {
            name: {
                "title": title,
                "by": [[each, round(100 * share, 1)] for each, share in of[name]],
            }
            for name, title in (zip(base.names, base.titles, strict=True) if of and base else ())
        },
    }
    limits = run.robot.q_min, run.robot.q_max
    if played and np.isfinite(limits).all():
        recordings = run.shown_torques.recordings
        data["robot"] = robot_data(run.robot)
        data["poses"] = {name: _poses(recordings[name]) for name in played}
    return deflated(data) if data["recordings"] or "poses" in data else ""


def _poses(recording: Recording) -> dict[str, object]:
    every = max(1, -(-recording.n_samples // (2 * MOST)))
    return {
        "duration": round(float(recording.time[-1] - recording.time[0]), 4),
        "q": [packed(_filled(q), 1e-4) for q in recording.q[::every].T],
    }


def _recording(
    motion: RecordedMotion,
    recording: Recording,
    robot: Robot,
    found: Mapping[tuple[str, int], Stretch],
) -> dict[str, object]:
    every = max(1, -(-recording.n_samples // MOST))
    return {
        "words": f"{motion.kind}, {motion.axes_in_words}",
        "duration": round(float(recording.time[-1] - recording.time[0]), 4),
        "axes": [
            _axis(recording, robot, axis, every) | _predicted(found.get((motion.id, axis)))
            for axis in _shown(motion)
        ],
    }


def _predicted(found: Stretch | None) -> dict[str, object]:
    """What the model says of it, where it says something."""
    if found is None or not np.isfinite(found.predicted).any():
        return {}
    part = found.part(0.0, np.inf, MOST)
    there = np.isfinite(part.predicted)
    values = {
        "predicted": part.predicted[there],
        "residual": part.residual[there],
        "half": part.half[there],
    }
    step = float(np.abs(part.measured).max()) / 2000.0 or 1.0
    return {
        "instants": packed(part.time[there], 10 * INSTANT),
        **{name: packed(each, step) for name, each in values.items()},
    }


def _shown(motion: RecordedMotion) -> list[int]:
    """Axes that moved, and that whose torque was read."""
    return sorted({*motion.moved, *motion.read})


def _axis(recording: Recording, robot: Robot, axis: int, every: int) -> dict[str, object]:
    torque, position = recording.tau[:, axis], recording.q[:, axis]
    turns = bool(robot.revolute[axis])
    shown = np.degrees(position) if turns else 1e3 * position
    return {
        "name": f"axis {axis + 1}",
        "units": [robot.torque_unit(axis), "deg" if turns else "mm"],
        "torque": _packed(_extremes(torque, every)),
        "position": _packed(shown[::every]),
    }


def _extremes(values: Array, every: int) -> Array:
    """Least and greatest of each `every` successive values, in turn."""
    starts = np.arange(0, len(values), every)
    both = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    return np.ravel(np.column_stack(both))


def _packed(values: Array) -> dict[str, object]:
    """Whole multiples of 1e-4 of the greatest; what is missing is as before."""
    filled = _filled(values)
    reach = float(np.abs(filled).max(initial=0.0))
    return packed(filled, 1e-4 * reach if reach > 0 else 1.0)


def _filled(values: Array) -> Array:
    """What is missing is as before."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return np.nan_to_num(values[last])


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
