"""What a page carries with it: recordings behind the points of plots, parameters as files.

Recordings are torque and position over time, thinned to what a screen shows: of each stretch of
time the least and the greatest torque, so that no peak is lost, and one position. Base parameters
are CSV for tables and JSON for programs.
"""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

import numpy as np

from hil.report.section import data_uri
from hil.view.packed import deflated, packed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured


def carried(campaign: Iterable[Measured], robot: Robot, ids: Collection[str]) -> str:
    """Recordings of the measurements `ids`, compressed; empty where there is none."""
    found = {
        each.measurement.id: _recording(each.measurement, each.recording, robot)
        for each in campaign
        if each.measurement.id in ids
    }
    return deflated(found) if found else ""


def _recording(motion: RecordedMotion, recording: Recording, robot: Robot) -> dict[str, object]:
    every = max(1, -(-recording.n_samples // 500))  # stretches at most
    return {
        "words": f"{motion.kind}, {motion.axes_in_words}",
        "duration": round(float(recording.time[-1] - recording.time[0]), 4),
        "axes": [_axis(recording, robot, axis, every) for axis in _shown(motion)],
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
    there = np.isfinite(values)
    last = np.maximum.accumulate(np.where(there, np.arange(len(values)), 0))
    filled = np.nan_to_num(values[last])
    reach = float(np.abs(filled).max(initial=0.0))
    return packed(filled, 1e-4 * reach if reach > 0 else 1.0)


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
        model.names, model.values, model.standard_errors, interval, model.units, model.expressions,
        strict=True,
    )  # fmt: skip
    return [
        {
            "name": name,
            "value": float(value),
            "standard_error": float(error),
            "low_95": float(low),
            "high_95": float(high),
            "unit": unit,
            "expression": expression,
        }
        for name, value, error, (low, high), unit, expression in columns
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
