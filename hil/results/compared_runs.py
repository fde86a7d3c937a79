"""Runs of one machine and what changed between them, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.results.changes import Change
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.quantities import Quantity, Reading
    from hil.results.rescaled_torque import Rescaled


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
