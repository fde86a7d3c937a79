"""Node and life guarding of one node (CiA 301), from the days before heartbeats.

A remote frame under the identifier of the heartbeat is answered by the NMT state and a toggle bit,
unless the node produces a heartbeat (1017h). The first request begins the life time, guard time
(100Ch) times life time factor (100Dh): when none comes for so long, that is an error until the next
one does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.canopen.timers import Timers

TOGGLE = 0x80


class NodeGuarding:
    """Answers guarding requests and watches that they come.

    Parameters
    ----------
    dictionary : ObjectDictionary
    timers : Timers
    answer : callable
        Sends the NMT state with the given toggle bit.
    lost, returned : callable
        Called when requests have stayed away, and when they are back.

    Attributes
    ----------
    present : bool
        Requests have not stayed away.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        timers: Timers,
        answer: Callable[[int], None],
        lost: Callable[[], None],
        returned: Callable[[], None],
    ) -> None:
        self.present = True
        self._dictionary = dictionary
        self._timers = timers
        self._answer = answer
        self._lost = lost
        self._returned = returned
        self._toggle = 0
        self._begun = False
        self._name = (dictionary.owner, "life guarding")
        for index in (0x100C, 0x100D):
            dictionary.react(index, lambda _subindex, _value: self._wait())

    @property
    def available(self) -> bool:
        """Whether the node is guarded at all: it has the objects and produces no heartbeat."""
        objects = self._dictionary
        return objects.declares(0x100C) and objects.declares(0x100D) and not objects.get(0x1017)

    def restart(self) -> None:
        """Begin anew, as after a reset of communication."""
        self._timers.stop(self._name)
        self._toggle, self._begun, self.present = 0, False, True

    def request(self) -> None:
        """Take a request: answer it, and live on."""
        self._answer(self._toggle)
        self._toggle ^= TOGGLE
        self._begun = True
        self._wait()

    def _wait(self) -> None:
        self._timers.stop(self._name)
        time = self._dictionary.get(0x100C) * self._dictionary.get(0x100D) / 1000
        if self._begun and time:
            self._timers.start(self._name, time, self._expire)
        if not self.present:
            self.present = True
            self._returned()

    def _expire(self) -> None:
        self.present = False
        self._lost()
