"""`hil history`: condition of a machine over many runs, with significant changes.

docs/how-to/history.md lists the keys of the data for monitoring.
"""

from __future__ import annotations

from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.estimation.intervals import SIGNIFICANT
from hil.results.changes import changed_table
from hil.runs.journal import now
from hil.show.charts.chart import MEASURED, MODEL, MUTED, Chart, Panel, Points, chart
from hil.show.outcome import Outcome, Verdict
from hil.show.rounding import signed, uncertain, unit
from hil.show.section import Plot
from hil.show.table import Column, Marked, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.results.history import History, KnownRun
    from hil.results.quantities import Kind, Reading
    from hil.show.table import Row


def outcome(found: History) -> Outcome:
    """Return the outcome of a history, for display."""
    newest = found.runs[-1]
    changed = [Verdict("doubtful", "changed", each) for each in found.sentences(newest)]
    unchanged = Verdict("good", "unchanged", f"{newest.label}: nothing changed significantly")
    return Outcome(
        (runs_table(found), condition(found), changed_table(found.marked)),
        verdicts=tuple(changed) or (unchanged,),
        plots=tuple(_plots(found)),
        title=f"{found.robot.name}: condition over time",
        simulated=any(run.model.provenance.any_simulated for run in found.runs),
        note="A run of an unchanged machine is marked with a probability of at most "
        f"{SIGNIFICANT:.0%}.",
    )


def monitoring_data(found: History) -> dict[str, Any]:
    """Return a history as data for JSON, for monitoring systems."""
    newest = found.tests(found.runs[-1])
    return {
        "format": 1,
        "written": now(),
        "robot": found.robot.name,
        "reference": found.reference,
        "false_alarm_rate": SIGNIFICANT,
        "newest_changed": any(each.marked for each in newest),
        "quantities": [each._asdict() for each in found.quantities],
        "runs": [_run_content(found, run) for run in found.runs],
        "changes": [
            {
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
            for each in found.marked
        ],
        "rescaled_torques": [
            {
                "run": each.run,
                "against": each.against,
                "axis": each.axis,
                "share": each.share,
                "interval_95": [each.share - each.half_width, each.share + each.half_width],
                "changes_explained": each.explained,
            }
            for each in found.rescaled
        ],
        "notes": list(found.notes),
    }


def _run_content(found: History, run: KnownRun) -> dict[str, Any]:
    tests = found.tests(run)
    return {
        "run": run.label,
        "measured": run.measured or None,
        "method": run.model.method,
        "changed": any(each.marked for each in tests),
        "tests": len(tests),
        "common_friction": {
            against: share for (label, against), share in found.common.items() if label == run.label
        },
        "values": {
            quantity.name: read
            and {
                "value": read.value,
                "half_width_95": read.half_width,
                "temperature_allowance": read.allowance,
            }
            for quantity, read in zip(found.quantities, run.readings, strict=True)
        },
    }


def runs_table(found: History) -> Table:
    """Return the runs in the order of time, with the number of marked changes."""
    return table(
        f"Runs of {found.robot.name}",
        (
            Column("run", folds=True),
            "measured",
            "method",
            *figures("friction, %", "tests", "marked"),
            Column("named first", folds=True),
        ),
        (_run(found, run) for run in found.runs),
        f"Each run is compared with {found.reference} and with the previous run. A run of "
        f"an unchanged machine is marked with a probability of at most {SIGNIFICANT:.0%}. "
        f"Friction: common change of all axes since {found.reference}, attributed to the "
        "machine's temperature. Named first: the first marked quantity, or the torque constant "
        "that explains all marked changes.",
        found.notes,
    )


def _run(found: History, run: KnownRun) -> Row:
    tests = found.tests(run)
    marked = [each for each in tests if each.marked]
    count = Marked(len(marked)) if marked else "0"
    exchanged = [each.axis for each in found.rescaled if each.run == run.label]
    named = marked[0].quantity.title if marked else ""
    if exchanged:
        named = f"torque constant or drive of axis {exchanged[0]}"
    own = "reference" if run.label == found.reference else named
    measured = run.measured[:16].replace("T", " ")
    common = found.common.get((run.label, found.reference))
    friction = "" if common is None else signed(f"{100 * common:.1f}")
    return run.label, measured, run.model.method, friction, str(len(tests)), count, own


def condition(found: History) -> Table:
    """Return the quantities of the reference and of the newest run."""
    first = next(run for run in found.runs if run.label == found.reference)
    last = found.runs[-1]
    marked = {each.quantity for each in found.tests(last) if each.marked}
    each = zip(found.quantities, first.readings, last.readings, strict=True)
    return table(
        "Condition",
        (
            Column("quantity", folds=True),
            *figures("reference", "± 95 %", "newest", "± 95 %"),
            "unit",
        ),
        (
            (
                Marked(quantity.title) if quantity in marked else quantity.title,
                *_cells(old),
                *_cells(new),
                unit(quantity.unit),
            )
            for quantity, old, new in each
        ),
        "Values with 95 % intervals from the errors of the single run; errors common to all runs "
        "(torque constants, rotor inertias) are not included. Friction: level at no load.",
    )


def _cells(read: Reading | None) -> tuple[str, str]:
    if read is None:
        return "not identified", ""
    return uncertain(read.value, read.half_width)


_CAPTION = (
    "Values with 95 % intervals; thin lines include the possible effect of temperature on friction."
)


def _plots(found: History) -> Iterator[Plot]:
    """Yield a plot for each kind of known quantity."""
    names: dict[Kind, str] = {
        "gravity parameter": "Gravity parameters", "inertia parameter": "Inertia parameters",
        "friction level": "Friction", "offset": "Offsets",
    }  # fmt: skip
    for kind, name in names.items():
        places = [k for k, each in enumerate(found.quantities) if each.kind == kind]
        if places:
            yield Plot(
                kind.replace(" ", "-"),
                partial(time_chart, found, places),
                f"{name} over time, one panel each",
                f"{name} over time. {_CAPTION}",
            )


def time_chart(found: History, places: Sequence[int]) -> Chart:
    """Draw the quantities at `places`, one panel per quantity."""
    # days or hours; run numbers if a run has no date
    stamps = [run.measured for run in found.runs]
    at, label = np.arange(1.0, len(stamps) + 1), "run"
    if all(stamps):
        seconds = np.array([datetime.fromisoformat(stamp).timestamp() for stamp in stamps])
        at, label = (seconds - seconds[0]) / 3600.0, "hours since the first run"
        if np.ptp(at) >= 48.0:
            at, label = at / 24.0, "days since the first run"
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


def _readings(found: History, place: int, at: np.ndarray) -> Iterator[Points]:
    quantity = found.quantities[place]
    readings = [run.readings[place] for run in found.runs]
    marked = {each.run for each in found.marked if each.quantity == quantity}
    groups = (("as before", MEASURED, False), ("changed", MODEL, True))
    for name, colour, marks in groups:
        shown = [
            (t, read.value, read.half_width, read.allowance)
            for t, run, read in zip(at, found.runs, readings, strict=True)
            if read is not None and (run.label in marked) == marks
        ]
        t, value, half, allowance = np.array(shown).reshape(-1, 4).T
        if shown:
            yield Points(t, value, "o", MUTED, error=half + allowance, size=0.5)
            yield Points(t, value, "o", colour, name, error=half, size=2.4)
