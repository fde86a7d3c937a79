"""Data carried by a page: recordings behind the points of plots, parameters as files.

Recordings and predicted torques are as on the page of `hil view`, thinned to the resolution of a
screen. Base parameters are CSV for tables and JSON for programs.
"""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

from hil.commands.torques import packed_recordings
from hil.model.base_parameters import base_parameters
from hil.show.section import data_uri
from hil.view.along_motion import join_predictions
from hil.view.stretches import carriers

if TYPE_CHECKING:
    from collections.abc import Collection

    from hil.report.reported_run import ReportedRun
    from hil.results.model import Model


def carried(run: ReportedRun, ids: Collection[str], played: Collection[str]) -> str:
    """Pack the data for a page's script (`hil.view.packed`), compressed; empty without data.

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
    recordings = [*join_predictions(pairs, found)]
    # the run's own recordings come first, since recordings of both runs may have equal ids
    if shown is not None and shown is not own:
        others = (pair for pair in shown.recordings if pair[0].id in played)
        recordings += join_predictions(others, shown.stretches)
    titles = base_parameters(run.robot).titles if of else ()
    parameters = {
        name: {"title": title, "by": [[each, round(100 * share, 1)] for each, share in by]}
        for (name, by), title in zip(of.items(), titles, strict=True)
    }
    return packed_recordings(run.robot, recordings, parameters)


Downloads = tuple[tuple[str, str, str], ...]
"""File name, format and data address of downloads."""


def downloads(model: Model) -> Downloads:
    """Convert the base parameters of a model to files."""
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
