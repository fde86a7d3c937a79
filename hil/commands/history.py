"""`hil history`: the condition of one machine over many runs, shown, and as data for monitoring.

docs/how-to/history.md has the keys of the data.
"""

from __future__ import annotations

from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.estimation.intervals import SIGNIFICANT
from hil.runs.journal import now
from hil.show.charts.chart import MEASURED, MODEL, MUTED, Chart, Panel, Points, chart
from hil.show.outcome import Outcome, Verdict
from hil.show.rounding import probability, signed, significant, uncertain, unit
from hil.show.section import Plot
from hil.show.table import Column, Marked, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.results.changes import Change
    from hil.results.history import History, KnownRun
    from hil.results.quantities import Kind, Reading
    from hil.show.table import Row

FIRST = 3
"""Changes that a page states above its charts in full, the clearest ones."""


def outcome(found: History) -> Outcome:
    """Return a history as it is shown."""
    newest = found.runs[-1]
    changed = [Verdict("doubtful", "changed", each) for each in found.sentences(newest)]
    unchanged = Verdict("good", "unchanged", f"{newest.label}: nothing changed significantly")
    return Outcome(
        (runs(found), condition(found), changes(found)),
        verdicts=tuple(changed) or (unchanged,),
        plots=tuple(_plots(found)),
        title=f"{found.robot.name}: condition over time",
        simulated=any(run.model.provenance.of_virtual_plant for run in found.runs),
        note="Anything of a run of an unchanged machine is marked with a probability of"
        f" {SIGNIFICANT:.0%} at most.",
    )


def as_data(found: History) -> dict[str, Any]:
    """Return a history as JSON holds it, for monitoring systems."""
    newest = found.of(found.runs[-1])
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
    tests = found.of(run)
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


def runs(found: History) -> Table:
    """Runs in the order of time, and how much of each is marked."""
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
        f"Each run is compared with {found.reference} and with the one before. Of an unchanged"
        f" machine anything is marked in at most {SIGNIFICANT:.0%} of the runs. Friction: what"
        f" that of all axes differs by together from {found.reference}, which is put down to"
        " the temperature of the machine.",
        found.notes,
    )


def _run(found: History, run: KnownRun) -> Row:
    tests = found.of(run)
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
    """Each quantity in the reference and in the newest run."""
    first = next(run for run in found.runs if run.label == found.reference)
    last = found.runs[-1]
    marked = {each.quantity for each in found.of(last) if each.marked}
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
        "Values with intervals of 95 %, of errors that are the run's own; what all runs share"
        " (torque constants, rotor inertias) does not count. Friction is the level at no load.",
    )


def _cells(read: Reading | None) -> tuple[str, str]:
    if read is None:
        return "not identified", ""
    return uncertain(read.value, read.half_width)


def changes(found: History) -> Table:
    """What changed significantly; empty where nothing did."""
    return table(
        "What changed",
        (
            *(Column(head, folds=True) for head in ("run", "since", "quantity")),
            *figures("change", "± 95 %"),
            "unit",
            *figures("change, %", "p"),
            Column("may come from", folds=True),
        ),
        map(_change, found.marked),
        "The interval holds by how much temperature may move friction; p is the probability of"
        " such a change by chance, for all that was tested of the run together (Holm).",
    )


def _change(each: Change) -> Row:
    share = "" if each.relative is None else signed(significant(100 * each.relative, 2))
    size, half = uncertain(each.size, each.half_width)
    return (
        each.run, each.against, each.quantity.title, size, half, unit(each.quantity.unit), share,
        probability(each.adjusted), each.meaning,
    )  # fmt: skip


_CAPTION = "Values with intervals of 95 %, thin lines with what temperature may add to friction."


def _plots(found: History) -> Iterator[Plot]:
    """A plot of each kind of quantity that the runs know."""
    names: dict[Kind, str] = {
        "gravity parameter": "Gravity parameters", "inertia parameter": "Inertia parameters",
        "friction level": "Friction", "offset": "Offsets",
    }  # fmt: skip
    for kind, name in names.items():
        places = [k for k, each in enumerate(found.quantities) if each.kind == kind]
        if places:
            yield Plot(
                kind.replace(" ", "-"),
                partial(over_time, found, places),
                f"{name} over time, a panel each",
                f"{name} over time. {_CAPTION}",
            )


def over_time(found: History, places: Sequence[int]) -> Chart:
    """Draw the quantities at `places`, a panel each."""
    at, label = _instants(found)
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


def _instants(found: History) -> tuple[np.ndarray, str]:
    """Places of the runs along the axis: days or hours; their numbers where one has no instant."""
    stamps = [run.measured for run in found.runs]
    if not all(stamps):
        return np.arange(1.0, len(stamps) + 1), "run"
    seconds = np.array([datetime.fromisoformat(stamp).timestamp() for stamp in stamps])
    hours = (seconds - seconds[0]) / 3600.0
    if np.ptp(hours) < 48.0:
        return hours, "hours since the first run"
    return hours / 24.0, "days since the first run"


def _readings(found: History, place: int, at: np.ndarray) -> Iterator[Points]:
    quantity = found.quantities[place]
    readings = [run.readings[place] for run in found.runs]
    marked = {each.run for each in found.marked if each.quantity == quantity}
    groups = (("as before", MEASURED, False), ("changed", MODEL, True))
    for name, colour, changed in groups:
        shown = [
            (t, read.value, read.half_width, read.allowance)
            for t, run, read in zip(at, found.runs, readings, strict=True)
            if read is not None and (run.label in marked) == changed
        ]
        t, value, half, allowance = np.array(shown).reshape(-1, 4).T
        if shown:
            yield Points(t, value, "o", MUTED, error=half + allowance, size=0.5)
            yield Points(t, value, "o", colour, name, error=half, size=2.4)
