"""Node guarding and life guarding of a node (CiA 301), the predecessors of heartbeats.

A remote frame under the identifier of the heartbeat is answered by the NMT state and a toggle bit,
unless the node produces a heartbeat (1017h). The first request starts the life time, guard time
(100Ch) times life time factor (100Dh). If no request comes within the life time, an error is
present until the next request.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.canopen.timers import Timers

TOGGLE = 0x80


class NodeGuarding:
    """Answers to guarding requests, and supervision of the requests.

    Parameters
    ----------
    dictionary : ObjectDictionary
    timers : Timers
    answer : callable
        Sends the NMT state with the given toggle bit.
    lost, returned : callable
        Called when no request has come within the life time, and at the next request.

    Attributes
    ----------
    present : bool
        True unless no request has come within the life time.
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
        """True if the node has the objects for guarding and produces no heartbeat."""
        objects = self._dictionary
        return objects.declares(0x100C) and objects.declares(0x100D) and not objects.get(0x1017)

    def restart(self) -> None:
        """Start anew, as after a reset of communication."""
        self._timers.stop(self._name)
        self._toggle, self._begun, self.present = 0, False, True

    def request(self) -> None:
        """Answer a guarding request and restart the life time."""
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
