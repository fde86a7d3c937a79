"""A history as JSON, for monitoring systems; docs/how-to/history.md explains the keys."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from scipy import special

from hil.estimation.intervals import SIGNIFICANT
from hil.runs.atomic_file import write_file
from hil.runs.journal import now

if TYPE_CHECKING:
    from pathlib import Path

    from hil.results.changes import Change
    from hil.results.compared_runs import History, KnownRun
    from hil.results.quantities import Reading
    from hil.results.rescaled_torque import Rescaled

FORMAT = 1


def write_history(path: Path, found: History) -> None:
    """Write a history as JSON, whole or not at all."""
    write_file(path, json.dumps(content(found), indent=2, allow_nan=False).encode() + b"\n")


def content(found: History) -> dict[str, Any]:
    """What the file holds."""
    newest = found.of(found.runs[-1])
    return {
        "format": FORMAT,
        "written": now(),
        "robot": found.robot.name,
        "reference": found.reference,
        "false_alarm_rate": SIGNIFICANT,
        "newest_changed": any(each.marked for each in newest),
        "quantities": [each._asdict() for each in found.quantities],
        "runs": [_run(found, run) for run in found.runs],
        "changes": [_change(each) for each in found.marked],
        "rescaled_torques": [_rescaled(each) for each in found.rescaled],
        "notes": list(found.notes),
    }


def _run(found: History, run: KnownRun) -> dict[str, Any]:
    tests = found.of(run)
    pairs = zip(found.quantities, run.readings, strict=True)
    return {
        "run": run.label,
        "measured": run.measured or None,
        "method": run.model.method,
        "changed": any(each.marked for each in tests),
        "tests": len(tests),
        "common_friction": {
            against: share for (label, against), share in found.common.items() if label == run.label
        },
        "values": {quantity.name: read and _reading(read) for quantity, read in pairs},
    }


def _reading(read: Reading) -> dict[str, float]:
    return {
        "value": read.value,
        "half_width_95": half_width(read),
        "temperature_allowance": read.allowance,
    }


def half_width(read: Reading) -> float:
    """Half-width of the interval of 95 % of a reading, without its allowance."""
    return float(special.stdtrit(read.degrees, 0.975)) * read.standard_error


def _rescaled(each: Rescaled) -> dict[str, Any]:
    return {
        "run": each.run,
        "against": each.against,
        "axis": each.axis,
        "share": each.share,
        "interval_95": [each.share - each.half_width, each.share + each.half_width],
        "changes_explained": each.explained,
    }


def _change(each: Change) -> dict[str, Any]:
    return {
        "run": each.run,
        "against": each.against,
        "quantity": each.quantity.name,
        "kind": each.quantity.kind,
        "unit": each.quantity.unit,
        "before": each.before,
        "size": each.size,
        "interval_95": [each.size - each.half_width, each.size + each.half_width],
        "relative": each.relative,
        "p_value": each.adjusted,
        "may_come_from": each.meaning,
    }
