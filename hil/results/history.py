"""The condition of one machine over time: many runs, and what changed significantly between them.

Every run is compared with a reference, the first one by default, and with the one before; what is
tested of a run counts together (`hil.results.changes`). Nothing but the models is read, so that
hundreds of runs take seconds. What the recordings of two runs show of a change, cause by cause, is
asked for by itself (`by_cause`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.errors import InvalidValue, Mismatch
from hil.estimation.excluded.proof import changed
from hil.results.changes import adjusted, change, common_friction, rescaled
from hil.results.model import Model
from hil.results.provenance import same_recordings
from hil.results.quantities import quantities, reading
from hil.results.tables import excluded
from hil.runs.pooling import Pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.results.changes import Change, Rescaled
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.quantities import Quantity, Reading
    from hil.show.table import Table


@dataclass(frozen=True, eq=False)
class KnownRun:
    """A run and what its model says of each quantity, in their order; None of what it does not."""

    label: str
    model: IdentifiedRobot
    readings: tuple[Reading | None, ...]

    @property
    def measured(self) -> str:
        """When its last session began; of an imported run when it was imported."""
        return self.model.provenance.measured


@dataclass(frozen=True, eq=False)
class History:
    """Runs of one machine and the changes between them.

    Attributes
    ----------
    quantities : tuple of Quantity
    runs : tuple of KnownRun
        In the order in which they were measured.
    reference : str
        Label of the run that all others are compared with.
    changes : tuple of Change
        All that was tested, run by run, of each run the least probable first.
    notes : tuple of str
        What restricts the comparison, and which drives are others than before.
    common : dict of (str, str) to float
        Share by which friction of all axes differs together, by the labels of a run and of the one
        that it was compared with.
    rescaled : tuple of Rescaled
        Axes whose torques all changed by one factor, which explains what is marked.
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
        """Robot of all runs."""
        return self.runs[0].model.robot

    @property
    def marked(self) -> tuple[Change, ...]:
        """Changes that are no chance."""
        return tuple(each for each in self.changes if each.marked)

    def of(self, run: KnownRun) -> tuple[Change, ...]:
        """What was tested of a run."""
        return tuple(each for each in self.changes if each.run == run.label)

    def sentences(self, run: KnownRun) -> tuple[str, ...]:
        """What is marked of a run, in words: exchanged drives in place of what they explain."""
        exchanged = [each for each in self.rescaled if each.run == run.label]
        explained = {each.against for each in exchanged}
        others = (e.sentence for e in self.of(run) if e.marked and e.against not in explained)
        return (*(each.sentence for each in exchanged), *others)


_OF_DRIVE = ("rotor_inertia_uncertainty", "torque_constant_uncertainty", "encoder_resolution")
_OF_JOINT = (
    "name", "q_min", "q_max", "velocity_limit", "acceleration_limit", "torque_limit", "capsule",
    "torque_noise", "friction_wander",
)  # fmt: skip
_FREE_TO_DIFFER: dict[str, bool | dict[str, bool]] = {
    **dict.fromkeys(_OF_JOINT, True),
    "drive": dict.fromkeys(_OF_DRIVE, True),
}
"""Keys of a joint that no parameter depends on."""


def read_history(
    paths: Sequence[Path], reference: Path | None = None, least_wander: float = 0.0
) -> History:
    """Read the models of runs of one machine and compare them.

    Parameters
    ----------
    paths : sequence of Path
        Folders of identified runs, or models' files.
    reference : Path, optional
        Run that all others are compared with; it need not be among `paths`. By default the first.
    least_wander : float
        Share of friction's level that temperature may move it by, whatever a campaign showed.

    Raises
    ------
    FileError
        A run without a model, or a damaged one.
    Mismatch
        Runs of different robots, or the same one twice.
    InvalidValue
        A share that is not from 0 up to less than 1.
    """
    if not 0 <= least_wander < 1:
        raise InvalidValue(
            f"least wander {least_wander:g} must be from 0 up to less than 1: 0.05 stands for 5 %"
        )
    every = list(paths)
    if reference is not None and reference.resolve() not in {path.resolve() for path in paths}:
        every.append(reference)
    loaded = [(str(path), Model.load(path)) for path in every]
    _refuse_others(loaded)
    chosen = next(
        (str(path) for path in every if reference and path.resolve() == reference.resolve()), None
    )
    return history_of(loaded, chosen, least_wander)


def history_of(
    loaded: Sequence[tuple[str, Model]],
    reference: str | None = None,
    least_wander: float = 0.0,
) -> History:
    """Compare models of one robot, each with its label; parameters as of `read_history`."""
    dated = all(model.provenance.measured for _, model in loaded)
    in_time = sorted(loaded, key=lambda each: each[1].provenance.measured) if dated else loaded
    found = quantities([model for _, model in in_time])
    runs = tuple(
        KnownRun(label, model, tuple(reading(model, each, least_wander) for each in found))
        for label, model in in_time
    )
    first = next((run for run in runs if run.label == reference), runs[0])
    pairs = [(run, others) for k, run in enumerate(runs) if (others := _others(runs, k, first))]
    common = {
        (run.label, other.label): common_friction(found, run.readings, other.readings)
        for run, others in pairs
        for other in others
    }
    tests = tuple(each for pair in pairs for each in _tested(found, *pair, common))
    notes = (*_notes(runs, dated=dated), *_other_drives(pairs))
    return History(
        found, runs, first.label, tests, notes, common, tuple(_rescaled(pairs, tests))
    )  # fmt: skip


def by_cause(
    before: Path, after: Sequence[Run], known: Sequence[str] = ()
) -> tuple[Table | str, ...]:
    """What changed between recordings, cause by cause, and what would have shown; or why not.

    Parameters
    ----------
    before : Path
        Folder of the earlier run, or a model's file in it.
    after : sequence of Run
        The later ones.
    known : sequence of str
        Causes that are known to have come, such as a load; what changed besides is looked for.

    Raises
    ------
    FileError
        A damaged recording.
    """
    before = before.parent if before.is_file() else before
    if not (before / "run.json").exists():
        return (f"recordings show what changed beside earlier ones, and {before} holds none",)
    earlier = Run.open(before)
    if different := _difference(earlier.robot, after[0].robot):
        return (f"causes of a change stay open: {before} has another robot file, in {different}",)
    if any(same_recordings(earlier, each) for each in after):
        return ()
    proof = changed(earlier.robot, Pooled([earlier]), Pooled(after), known)
    return excluded.of_change(proof, earlier.robot.n_joints, str(before), known)


def _others(runs: Sequence[KnownRun], k: int, first: KnownRun) -> list[KnownRun]:
    """Runs that one is compared with: the reference and the one before."""
    before = [runs[k - 1]] if k and runs[k - 1] is not first else []
    return [each for each in (first, *before) if each is not runs[k]]


def _tested(
    found: Sequence[Quantity],
    run: KnownRun,
    others: Sequence[KnownRun],
    common: dict[tuple[str, str], float],
) -> tuple[Change, ...]:
    """All tests of one run, p-values of all of them together."""
    return adjusted([
        change(quantity, (run.label, new), (other.label, old), common[run.label, other.label])
        for other in others
        for quantity, new, old in zip(found, run.readings, other.readings, strict=True)
        if new is not None and old is not None and new.stands_for == old.stands_for
    ])  # fmt: skip


def _rescaled(
    pairs: Sequence[tuple[KnownRun, Sequence[KnownRun]]], tests: Sequence[Change]
) -> Iterator[Rescaled]:
    for run, other in ((run, other) for run, others in pairs for other in others):
        own = [each for each in tests if (each.run, each.against) == (run.label, other.label)]
        if found := rescaled(other.model, own):
            yield found


def _other_drives(pairs: Sequence[tuple[KnownRun, Sequence[KnownRun]]]) -> Iterator[str]:
    """Drives that state to be others than those of the run before, where runs state it."""
    for run, others in pairs:
        new, old = (each.model.provenance.drives for each in (run, others[-1]))
        for axis, (now, then) in enumerate(zip(new, old, strict=False), start=1):
            if now != then:
                yield (
                    f"{run.label}: the drive of axis {axis} is another one than in"
                    f" {others[-1].label}: {now}, before {then}"
                )


def _refuse_others(loaded: Sequence[tuple[str, Model]]) -> None:
    """Refuse runs of different robots, and one run twice."""
    (label, first), seen = loaded[0], dict[bytes, str]()
    for other, model in loaded:
        if different := _difference(first.robot, model.robot):
            raise Mismatch(
                f"{other}: is no run of the machine of {label}: the robot files differ in"
                f" {different}; give runs of one machine, identified with the same robot file"
            )
        content = model.values.tobytes() + model.scatter_covariance.tobytes()
        if content in seen:
            raise Mismatch(f"{other}: is the same run as {seen[content]}; give each run once")
        seen[content] = other


def _difference(one: Robot, other: Robot) -> str:
    """Keys of robot files that differ and that parameters depend on; empty if none does."""
    if one.digest == other.digest:
        return ""
    first, second = _essence(one), _essence(other)
    return ", ".join(key for key in first if first[key] != second[key])


def _essence(robot: Robot) -> dict[str, object]:
    joints = [joint.model_dump(mode="json", exclude=_FREE_TO_DIFFER) for joint in robot.file.joints]
    return robot.file.model_dump(mode="json", exclude={"joints"}) | {"joints": joints}


def _notes(runs: Sequence[KnownRun], *, dated: bool) -> Iterator[str]:
    if len(runs) == 1:
        yield "one run alone: there is nothing to compare it with; give more runs"
    if not dated:
        yield "not every run states when it was measured, so their order is that of the arguments"
    if len(methods := sorted({run.model.method for run in runs})) > 1:
        yield (
            f"identified by different methods ({', '.join(methods)}), whose own errors may show as"
            " changes; identify all with the same one: hil identify RUN --method"
            f" {runs[0].model.method!r}"
        )
    if any(run.model.friction_law is None for run in runs):
        yield "models of earlier versions know no friction; identify these runs anew to compare it"
