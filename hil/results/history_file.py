"""A history as tables, and as JSON for monitoring systems; docs/how-to/history.md has its keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.estimation.intervals import SIGNIFICANT
from hil.results.rounding import probability, signed, significant, uncertain, unit
from hil.results.tables.table import Column, Marked, Table, figures, table
from hil.runs.journal import now

if TYPE_CHECKING:
    from hil.results.changes import Change
    from hil.results.history import History, KnownRun
    from hil.results.quantities import Reading
    from hil.results.tables.table import Row


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
