"""Emergencies (EMCY): which frames are a drive's, and to whom they go."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.canopen.network import PumpedNetwork

PREDEFINED = 0x80
"""Identifier of a node's emergencies, less its number, unless 1014 says otherwise."""


class Emergencies:
    """Listens for the emergencies of all drives.

    Parameters
    ----------
    network : PumpedNetwork
        Where they are heard.
    nodes : sequence of int
        Of the drives, in joint order.
    deliver : callable
        ``deliver(node, data)`` takes each emergency.
    """

    def __init__(
        self,
        network: PumpedNetwork,
        nodes: Sequence[int],
        deliver: Callable[[int, bytes], None],
    ) -> None:
        self._network = network
        self._nodes = nodes
        self._deliver = deliver
        self._senders: dict[int, int] = {}
        self.listen([PREDEFINED + node for node in nodes])

    def listen(self, identifiers: Sequence[int | None]) -> None:
        """Listen for each drive's under its identifier (1014) from now on, None where off."""
        for identifier in self._senders:
            self._network.unsubscribe(identifier, self._on_emergency)
        self._senders = {
            identifier: node
            for identifier, node in zip(identifiers, self._nodes, strict=True)
            if identifier is not None
        }
        for identifier in self._senders:
            self._network.subscribe(identifier, self._on_emergency)

    def _on_emergency(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        self._deliver(self._senders[can_id], bytes(data))
