"""Base parameters as files that a report carries with it: CSV for tables, JSON for programs."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

from hil.report.section import data_uri

if TYPE_CHECKING:
    from hil.results.model import Model

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
