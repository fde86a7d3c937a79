"""Heartbeats: sending the node's state (1017h) and watching other nodes (1016h).

A consumer starts to watch a node with its first heartbeat. A heartbeat missing for longer than the
consumer time is an error until the next heartbeat.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.canopen.timers import Timers

HEARTBEAT = 0x700
_ROUNDING = 1e-9
"""Rounding error of sums of instants [s]."""


class HeartbeatProducer:
    """Producer of heartbeats every 1017h milliseconds; 0 switches the service off."""

    def __init__(
        self, dictionary: ObjectDictionary, timers: Timers, send: Callable[[], None]
    ) -> None:
        self._dictionary = dictionary
        self._timers = timers
        self._send = send
        self._name = (dictionary.owner, "heartbeat producer")
        self._period = 0.0
        dictionary.react(0x1017, lambda _subindex, _value: self.restart())

    def restart(self) -> None:
        """Start with the period in 1017h."""
        self._timers.stop(self._name)
        self._period = self._dictionary.get(0x1017) / 1000
        if self._period:
            self._timers.start(self._name, self._period, self._beat)

    def _beat(self) -> None:
        self._timers.start(self._name, self._period, self._beat)
        self._send()


class HeartbeatConsumer:
    """Consumer of the heartbeats of the nodes in 1016h.

    Parameters
    ----------
    dictionary : ObjectDictionary
    timers : Timers
    lost, returned : callable
        Called when a watched heartbeat has stayed away, and when all are back.
    rewired : callable
        Called when `watched` has changed.
    """

    ENTRIES = 4

    def __init__(
        self,
        dictionary: ObjectDictionary,
        timers: Timers,
        lost: Callable[[], None],
        returned: Callable[[], None],
        rewired: Callable[[], None],
    ) -> None:
        self._dictionary = dictionary
        self._timers = timers
        self._lost = lost
        self._returned = returned
        self._rewired = rewired
        self._missing: set[int] = set()
        self._heard: dict[int, float] = {}
        self.watched: dict[int, float] = {}
        dictionary.guard(0x1016, self._check)
        dictionary.react(0x1016, lambda _subindex, _value: self.restart())

    def restart(self) -> None:
        """Forget all received heartbeats and watch the nodes now in 1016h."""
        for node in self._heard:
            self._timers.stop(self._name(node))
        self._heard.clear()
        if self._missing:
            self._missing.clear()
            self._returned()
        entries = [self._dictionary.get(0x1016, n) for n in range(1, self.ENTRIES + 1)]
        self.watched = {
            entry >> 16: (entry & 0xFFFF) / 1000 for entry in entries if _is_used(entry)
        }
        self._rewired()

    @property
    def is_supervising(self) -> bool:
        """True if the loss of a heartbeat would be noticed, or has been."""
        return bool(self._heard or self._missing)

    @property
    def all_present(self) -> bool:
        """True if no watched heartbeat is missing."""
        return not self._missing

    def hear(self, node: int) -> None:
        """Receive a heartbeat of a watched node."""
        if node not in self._heard:
            self._wait(node, self.watched[node])
        self._heard[node] = self._timers.now
        if node in self._missing:
            self._missing.remove(node)
            if not self._missing:
                self._returned()

    def _wait(self, node: int, delay: float) -> None:
        self._timers.start(self._name(node), delay, lambda: self._expire(node))

    def _expire(self, node: int) -> None:
        left = self._heard[node] + self.watched[node] - self._timers.now
        if left > _ROUNDING:
            self._wait(node, left)
        else:
            del self._heard[node]
            self._missing.add(node)
            self._lost()

    def _name(self, node: int) -> tuple[tuple[int, int], str, int]:
        return self._dictionary.owner, "heartbeat consumer", node

    def _check(self, subindex: int, value: int) -> None:
        if value >> 24:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        others = set(range(1, self.ENTRIES + 1)) - {subindex}
        taken = {self._dictionary.get(0x1016, n) >> 16 for n in others if self._uses(n)}
        if _is_used(value) and value >> 16 in taken:
            raise SdoAbort(AbortCode.INCOMPATIBLE)

    def _uses(self, subindex: int) -> bool:
        return _is_used(self._dictionary.get(0x1016, subindex))


def _is_used(entry: int) -> bool:
    return 1 <= entry >> 16 <= 127 and entry & 0xFFFF != 0
