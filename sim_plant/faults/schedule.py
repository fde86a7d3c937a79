"""Schedule of injected faults on any bus: start and end by progress."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

from checked_files.yaml_file import FileError
from sim_plant.drive.cia402_states import Control
from sim_plant.faults.moment import Progress, Watch
from sim_plant.timed_network import TimedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from sim_plant.drive.cia402_drive import Cia402Drive
    from sim_plant.faults.fault_plan import Fault, FaultPlan, What
    from sim_plant.faults.injection import Injection
    from sim_plant.faults.machine_faults import FaultyMachine
    from sim_plant.slave_network import CanFrame

NetworkT = TypeVar("NetworkT", bound=TimedNetwork)


class FaultSchedule(Generic[NetworkT]):
    """Faults of a network of drives, with their schedule.

    Parameters
    ----------
    network : TimedNetwork
    machine : FaultyMachine
        Machine of the network.
    kinds : mapping of What to callable
        Makes the injections that this bus knows.
    plan : FaultPlan
        Planned faults, possibly none; `add` adds further faults.

    Attributes
    ----------
    machine : FaultyMachine
    progress : Progress
        Counts since power-on.

    Raises
    ------
    FileError
        A fault of an axis that the plant does not have, or that this bus does not know.
    """

    def __init__(
        self,
        network: NetworkT,
        machine: FaultyMachine,
        kinds: Mapping[What, Callable[[Fault, NetworkT, FaultyMachine], Injection]],
        plan: FaultPlan,
    ) -> None:
        plan.check_axes(len(network.nodes))
        self.progress = Progress()
        self.machine = machine
        self._network = network
        self._kinds = kinds
        self._waiting: list[tuple[Watch, Injection]] = []
        self._present: list[tuple[Watch, Injection]] = []
        self._controlwords = [0] * len(network.nodes)
        for axis, node in enumerate(network.nodes):
            self._count_set_points(axis, node)
        for fault in plan.faults:
            self.add(fault)

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self._network.time

    @property
    def present(self) -> tuple[Fault, ...]:
        """Faults now present."""
        return tuple(injection.fault for _, injection in self._present)

    def add(self, fault: Fault) -> None:
        """Add a fault."""
        kind = self._kinds.get(fault.what)
        if kind is None:
            raise FileError(
                f"fault plan: {fault.what} does not exist on this bus; faults are"
                f" {', '.join(sorted(self._kinds))}"
            )
        self._waiting.append((Watch(fault), kind(fault, self._network, self.machine)))

    def _update(self) -> list[CanFrame]:
        """Start and end faults; return the frames held back by ended faults."""
        self.progress.time = self._network.time
        held: list[CanFrame] = []
        for watched in tuple(self._present):
            if not watched[0].present(self.progress):
                self._present.remove(watched)
                held += watched[1].end()
        for watched in tuple(self._waiting):
            if watched[0].present(self.progress):
                self._waiting.remove(watched)
                self._present.append(watched)
                watched[1].begin()
        return held

    def _count_set_points(self, axis: int, node: Cia402Drive) -> None:
        def count(_subindex: int, word: int) -> None:
            risen = word & ~self._controlwords[axis]
            self._controlwords[axis] = word
            if risen & Control.NEW_SET_POINT:
                given = self.progress.set_points
                given[axis + 1] = given.get(axis + 1, 0) + 1

        node.dictionary.react(0x6040, count)
