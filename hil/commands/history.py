"""`hil history`: condition of a machine over many runs, with significant changes.

docs/how-to/history.md lists the keys of the data for monitoring.

Every run is compared with a reference, the first run by default, and with the previous run. All
tests of a run are adjusted together (`hil.results.changes`). Only the models are read, so that
hundreds of runs take seconds. Causes of a change are tested separately, on the recordings of two
runs (`compare_causes`).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.errors import InvalidValue, Mismatch
from hil.estimation.excluded.proof import changed
from hil.estimation.intervals import SIGNIFICANT
from hil.results.changes import adjusted, change, changed_table, common_friction, rescaled
from hil.results.model import Model
from hil.results.provenance import same_recordings
from hil.results.quantities import quantities, reading
from hil.results.tables import excluded
from hil.runs.journal import now
from hil.runs.pooling import Pooled
from hil.runs.run import Run
from hil.show.charts.chart import MEASURED, MODEL, MUTED, Panel, Points
from hil.show.outcome import Outcome, Plot, Verdict
from hil.show.rounding import signed, uncertain, unit
from hil.show.table import Column, Marked, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.results.changes import Change, Rescaled
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.quantities import Kind, Quantity, Reading
    from hil.show.table import Row


_OF_DRIVE = ("rotor_inertia_uncertainty", "torque_constant_uncertainty", "encoder_resolution")
_OF_JOINT = (
    "name", "q_min", "q_max", "velocity_limit", "acceleration_limit", "torque_limit", "capsule",
    "torque_noise", "friction_wander",
)  # fmt: skip
_FREE_TO_DIFFER: dict[str, bool | dict[str, bool]] = {
    **dict.fromkeys(_OF_JOINT, True),
    "drive": dict.fromkeys(_OF_DRIVE, True),
}
"""Keys of a joint without influence on the parameters."""


@dataclass(frozen=True, eq=False)
class KnownRun:
    """Run with readings in the order of the quantities; None for an unknown quantity."""

    label: str
    model: IdentifiedRobot
    readings: tuple[Reading | None, ...]

    @property
    def measured(self) -> str:
        """Start of the last session; for imported runs the time of the import."""
        return self.model.provenance.measured


@dataclass(frozen=True, eq=False)
class History:
    """Runs of a machine and the changes between runs.

    Attributes
    ----------
    runs : tuple of KnownRun
        Runs in the order of measurement.
    reference : str
        Label of the run used as reference.
    changes : tuple of Change
        All tests, run by run, the least probable of each run first.
    notes : tuple of str
        Restrictions of the comparison, and exchanged drives.
    common : dict of (str, str) to float
        Common relative change of the friction of all axes, by the labels of a run and of the run
        compared with.
    rescaled : tuple of Rescaled
        Axes with a common factor of all torques that explains the marked changes.
    """

    quantities: tuple[Quantity, ...]
    runs: tuple[KnownRun, ...]
    reference: str
    changes: tuple[Change, ...]
    notes: tuple[str, ...]
    common: dict[tuple[str, str], float]
    rescaled: tuple[Rescaled, ...]

    @property
    def robot(self) -> Robot:
        """Robot of the runs."""
        return self.runs[0].model.robot

    @property
    def marked(self) -> tuple[Change, ...]:
        """Significant changes."""
        return tuple(each for each in self.changes if each.marked)

    def tests(self, run: KnownRun) -> tuple[Change, ...]:
        """Return the tests of a run."""
        return tuple(each for each in self.changes if each.run == run.label)

    def sentences(self, run: KnownRun) -> tuple[str, ...]:
        """Return sentences on significant changes, or on rescalings that explain the changes."""
        exchanged = [each for each in self.rescaled if each.run == run.label]
        explained = {each.against for each in exchanged}
        others = (e.sentence for e in self.tests(run) if e.marked and e.against not in explained)
        return (*(each.sentence for each in exchanged), *others)


def read_history(
    paths: Sequence[Path], reference: Path | None = None, least_wander: float = 0.0
) -> History:
    """Read the models of a machine's runs and compare all runs.

    Parameters
    ----------
    paths : sequence of Path
        Folders of identified runs, or models' files.
    reference : Path, optional
        Reference run, in `paths` or not; by default the first.
    least_wander : float
        Minimum relative change of friction attributed to temperature, even if a campaign showed
        less.

    Raises
    ------
    FileError
        A run without a model, or a damaged one.
    Mismatch
        Runs of different robots, or the same run twice.
    InvalidValue
        A share that is not from 0 up to less than 1.
    """
    if not 0 <= least_wander < 1:
        raise InvalidValue(
            f"least wander {least_wander:g} must be from 0 up to less than 1: 0.05 stands for 5 %"
        )
    every, chosen = list(paths), None
    if reference is not None:
        same = [path for path in paths if path.resolve() == reference.resolve()]
        every += () if same else (reference,)
        chosen = str(same[0] if same else reference)
    loaded = [(str(path), Model.load(path)) for path in every]
    # refuse runs of different robots, and repeated runs
    (label, first), seen = loaded[0], dict[bytes, str]()
    for other, model in loaded:
        if different := _difference(first.robot, model.robot):
            raise Mismatch(
                f"{other}: is not a run of the machine of {label}: the robot files differ in"
                f" {different}; give runs of one machine, identified with the same robot file"
            )
        content = model.values.tobytes() + model.scatter_covariance.tobytes()
        if content in seen:
            raise Mismatch(f"{other}: is the same run as {seen[content]}; give each run once")
        seen[content] = other
    return history_of(loaded, chosen, least_wander)


def history_of(
    loaded: Sequence[tuple[str, Model]], reference: str | None = None, least_wander: float = 0.0
) -> History:
    """Compare labelled models of a robot; parameters as in `read_history`."""
    dated = all(model.provenance.measured for _, model in loaded)
    in_time = sorted(loaded, key=lambda each: each[1].provenance.measured) if dated else loaded
    found = quantities([model for _, model in in_time])
    runs = tuple(
        KnownRun(label, model, tuple(reading(model, each, least_wander) for each in found))
        for label, model in in_time
    )
    first = next((run for run in runs if run.label == reference), runs[0])
    notes: list[str] = []
    changes: list[Change] = []
    factors: list[Rescaled] = []
    common: dict[tuple[str, str], float] = {}
    if len(runs) == 1:
        notes.append("one run alone cannot be compared; give two or more")
    if not dated:
        notes.append("some runs have no time of measurement: the order of the arguments is used")
    if len(methods := sorted({run.model.method for run in runs})) > 1:
        notes.append(
            f"runs identified by different methods ({', '.join(methods)}): differences between "
            "methods may appear as changes; identify all runs by one method: hil identify RUN "
            f"--method {runs[0].model.method!r}"
        )
    if not all(run.model.friction_law.known for run in runs):
        notes.append(
            "some models hold no friction (earlier version, or few measurements); to compare "
            "friction, identify these runs anew, or measure more"
        )
    for k, run in enumerate(runs):
        # the reference and the previous run
        before = [runs[k - 1]] if k and runs[k - 1] is not first else []
        others = [each for each in (first, *before) if each is not run]
        for other in others:
            together = common_friction(found, run.readings, other.readings)
            common[run.label, other.label] = together
        tests = adjusted([
            change(quantity, (run.label, new), (other.label, old), common[run.label, other.label])
            for other in others
            for quantity, new, old in zip(found, run.readings, other.readings, strict=True)
            if new is not None and old is not None and new.stands_for == old.stands_for
        ])  # fmt: skip
        changes += tests
        for other in others:
            own = [each for each in tests if each.against == other.label]
            if factor := rescaled(other.model, own):
                factors.append(factor)
        # exchanged drives, if both runs state the identities of their drives
        last = others[-1] if others else run
        drives = zip(run.model.provenance.drives, last.model.provenance.drives, strict=False)
        notes += [
            f"{run.label}: the drive of axis {axis} differs from that in {last.label}: {its}, "
            f"before {then}"
            for axis, (its, then) in enumerate(drives, start=1)
            if its != then
        ]
    every = tuple(changes), tuple(notes), common, tuple(factors)
    return History(found, runs, first.label, *every)


def compare_causes(
    before: Path, after: Sequence[Run], known: Sequence[str] = ()
) -> tuple[Table | str, ...]:
    """Test causes of a change between recordings; return findings and detectable sizes.

    Parameters
    ----------
    before : Path
        Folder of the earlier run, or a model's file in it.
    after : sequence of Run
        Later runs.
    known : sequence of str
        Known changes, such as a load; the test searches for further causes.

    Raises
    ------
    FileError
        A damaged recording.
    """
    before = before.parent if before.is_file() else before
    if not (before / "run.json").exists():
        return (f"causes of a change need recordings of both runs, and {before} holds none",)
    earlier = Run.open(before)
    if different := _difference(earlier.robot, after[0].robot):
        return (
            f"causes of a change are not tested: the robot file of {before} differs in {different}",
        )
    if any(same_recordings(earlier, each) for each in after):
        return ()
    proof = changed(earlier.robot, Pooled([earlier]), Pooled(after), known)
    return excluded.change_by_cause(proof, earlier.robot.n_joints, str(before), known)


def _difference(one: Robot, other: Robot) -> str:
    """Return the keys of differences between robot files that affect parameters; empty for none."""
    if one.digest == other.digest:
        return ""
    first, second = (
        robot.file.model_dump(mode="json", exclude={"joints": {"__all__": _FREE_TO_DIFFER}})
        for robot in (one, other)
    )
    return ", ".join(key for key in first if first[key] != second[key])


def outcome(found: History) -> Outcome:
    """Return the outcome of a history, for display."""
    newest = found.runs[-1]
    changed = [Verdict("doubtful", "changed", each) for each in found.sentences(newest)]
    unchanged = Verdict("good", "unchanged", f"{newest.label}: nothing changed significantly")
    names: dict[Kind, str] = {
        "gravity parameter": "Gravity parameters", "inertia parameter": "Inertia parameters",
        "friction level": "Friction", "offset": "Offsets",
    }  # fmt: skip
    places = {
        kind: [k for k, each in enumerate(found.quantities) if each.kind == kind] for kind in names
    }
    return Outcome(
        (runs_table(found), condition(found), changed_table(found.marked)),
        verdicts=tuple(changed) or (unchanged,),
        plots=tuple(
            Plot(
                kind.replace(" ", "-"),
                partial(time_chart, found, places[kind]),
                f"{name} over time, one panel each",
                f"{name} over time. {_CAPTION}",
            )
            for kind, name in names.items()
            if places[kind]
        ),
        title=f"{found.robot.name}: condition over time",
        simulated=any(run.model.provenance.any_simulated for run in found.runs),
        note="A run of an unchanged machine is marked with a probability of at most "
        f"{SIGNIFICANT:.0%}.",
    )


def monitoring_data(found: History) -> dict[str, Any]:
    """Return a history as data for JSON, for monitoring systems."""
    newest, runs = found.tests(found.runs[-1]), []
    for run in found.runs:
        tests, common = found.tests(run), found.common.items()
        runs.append({
            "run": run.label,
            "measured": run.measured or None,
            "method": run.model.method,
            "changed": any(each.marked for each in tests),
            "tests": len(tests),
            "common_friction": {
                against: share for (label, against), share in common if label == run.label
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
        })  # fmt: skip
    return {
        "format": 1,
        "written": now(),
        "robot": found.robot.name,
        "reference": found.reference,
        "false_alarm_rate": SIGNIFICANT,
        "newest_changed": any(each.marked for each in newest),
        "quantities": [each._asdict() for each in found.quantities],
        "runs": runs,
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


def time_chart(found: History, places: Sequence[int]) -> Iterator[Panel]:
    """Draw the quantities at `places`, a panel per quantity."""
    # days or hours; run numbers if a run has no date
    stamps = [run.measured for run in found.runs]
    at, label = np.arange(1.0, len(stamps) + 1), "run"
    if all(stamps):
        seconds = np.array([datetime.fromisoformat(stamp).timestamp() for stamp in stamps])
        at, label = (seconds - seconds[0]) / 3600.0, "hours since the first run"
        if np.ptp(at) >= 48.0:
            at, label = at / 24.0, "days since the first run"
    for place in places:
        quantity, items = found.quantities[place], []
        readings = [run.readings[place] for run in found.runs]
        marked = {each.run for each in found.marked if each.quantity == quantity}
        for name, colour, marks in (("as before", MEASURED, False), ("changed", MODEL, True)):
            shown = [
                (t, read.value, read.half_width, read.allowance)
                for t, run, read in zip(at, found.runs, readings, strict=True)
                if read is not None and (run.label in marked) == marks
            ]
            t, value, half, allowance = np.array(shown).reshape(-1, 4).T
            if shown:
                items += [
                    Points(t, value, "o", MUTED, error=half + allowance, size=0.5),
                    Points(t, value, "o", colour, name, error=half, size=2.4),
                ]
        yield Panel(
            tuple(items),
            title=quantity.title,
            x_label=label,
            y_label=unit(quantity.unit),
            height=105.0,
        )
