"""Base of both buses: drives in front of a machine, and the passage of time.

The machine stops at every due timer, all axes are latched at the same instant, and each drive is
informed of the events of its axis.
"""

from __future__ import annotations

from bisect import bisect_left
from itertools import accumulate, repeat
from operator import sub
from typing import TYPE_CHECKING

from sim_plant.canopen.timers import Timers
from sim_plant.drive.process_image import ProcessImage

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from sim_plant.drive.cia402_drive import Cia402Drive
    from sim_plant.machine_protocol import Machine

    Integers = NDArray[np.int64]


class TimedNetwork:
    """Drives of a machine with their timers, on any bus.

    Parameters
    ----------
    machine : Machine

    Attributes
    ----------
    nodes : sequence of Cia402Drive
        Drives in joint order, set by the bus.
    """

    nodes: Sequence[Cia402Drive] = ()

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._timers = Timers()
        self._image = ProcessImage(len(machine.axes))
        machine.handle_event = self._handle_event

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self._timers.now

    def _advance(self, duration: float) -> None:
        timers, machine = self._timers, self._machine
        end = timers.now + duration
        while timers.next <= end:
            machine.advance(max(0.0, timers.next - timers.now))
            timers.now = max(timers.now, timers.next)
            timers.run()
            self._settle()
        machine.advance(end - timers.now)
        timers.now = end

    def _advance_quietly(self, times: int, duration: float) -> tuple[list[float], Integers]:
        """Let a duration pass several times, up to the next timer or news of a drive.

        Returns
        -------
        instants : list of float
            Ends of the durations that have passed [s].
        readings : ndarray, shape (k, 7 n_axes)
            Readings latched at these instants.
        """
        timers = self._timers
        instants = list(accumulate(repeat(duration, times), initial=timers.now))
        instants = instants[: bisect_left(instants, timers.next)]
        durations = list(map(sub, instants[1:], instants))
        readings = self._machine.advance_quietly(durations, self._image.watch)
        passed = instants[1 : len(readings) + 1]
        if passed:
            timers.now = passed[-1]
        return passed, readings

    def _settle(self) -> None:
        """Complete an instant, after the actions of all timers due at it."""

    def _latch(self) -> None:
        self._attend(self._image.latch(self._machine.read()))

    def _attend(self, news: int) -> None:
        """Let the drives of the given axes (a bit mask) process their readings."""
        for axis, node in enumerate(self.nodes):
            if news >> axis & 1:
                node.attend()

    def _handle_event(self, axis: int, events: int) -> None:
        self.nodes[axis].handle_events(events)
