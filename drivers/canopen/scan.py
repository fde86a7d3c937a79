"""Who is on the bus: all 127 node numbers, by what is heard and by who answers.

First the scan only listens: heartbeats, boot-ups and emergencies show nodes that answer no SDO,
and a SYNC of another master. Then every number is asked for its device type (1000), all in a row,
which takes no longer than one time-out; and of each node that answers, what a review needs is read.
Nothing is written, no state of a node changes and nothing is energised: the only frames sent are
reading SDO requests.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from drivers.can_bus.capabilities import capabilities_of
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.objects import NMT_STATES, SYNC
from drivers.canopen.rules import RULES
from drivers.canopen.sdo import SdoAccess
from drivers.dictionary.found_nodes import Scan
from drivers.dictionary.live import read_dictionary
from drivers.dictionary.review import review
from drivers.in_node import find_axes, seen_by
from drivers.remote_dictionary import ABSENT, AccessRefused, NoAnswer

if TYPE_CHECKING:
    from collections.abc import Sequence

    import can

NODES = range(1, 128)
LISTENING = 1.2
"""Heartbeats rarely come less often than once a second [s]."""
ANSWERING = 0.5
"""How long the nodes may take for their first answer [s]."""
SDO_TIMEOUT = 0.25
BATCH = 8
"""Requests in a row; socketcan queues ten."""
REQUEST = bytes([0x40, 0x00, 0x10, 0, 0, 0, 0, 0])


def scan_bus(
    bus: can.BusABC,
    *,
    listening: float = LISTENING,
    answering: float = ANSWERING,
    timeout: float = SDO_TIMEOUT,
    only: Sequence[int] = NODES,
) -> Scan:
    """Find the nodes on an open bus and what they offer.

    Parameters
    ----------
    bus : can.BusABC
        An open bus; one in lock-step is not listened to, since its time stands still.
    listening, answering, timeout : float
        How long to listen, to wait for the first answers, and for each further one [s].
    only : sequence of int
        Node numbers to be asked.

    Raises
    ------
    BusUnavailable
        The bus takes no frames or has gone.
    """
    network = PumpedNetwork(bus, synchronous=capabilities_of(bus).lock_step)
    scan = Scan()
    _listen_to_all(network, scan)
    network.pump(listening)
    asked = tuple(only)
    for first in range(0, len(asked), BATCH):
        for node in asked[first : first + BATCH]:
            network.send_message(0x600 + node, REQUEST)
        network.pump(0.01)
    network.pump(answering)
    for node, found in sorted(scan.nodes.items()):
        answers = found.answers
        if answers and node in asked:
            access = SdoAccess(network, node, timeout)
            for within in find_axes(partial(_has, access)):
                dictionary = read_dictionary(seen_by(access, within), node, RULES, within.axis)
                if within.axis == 1:
                    found.within, found.dictionary = within, dictionary
                    found.review = review(dictionary, RULES)
                else:
                    found.further.append((within, dictionary, review(dictionary, RULES)))
        found.answers = answers
    scan.nodes = {node: scan.nodes[node] for node in sorted(scan.nodes) if node in asked}
    return scan


def _has(access: SdoAccess, index: int, subindex: int) -> bool:
    try:
        access.read(index, subindex)
    except AccessRefused as error:
        return error.code not in ABSENT  # as for what is there and can only be written
    except NoAnswer:
        return False
    return True


def _listen_to_all(network: PumpedNetwork, scan: Scan) -> None:
    for base, take in ((0x700, _on_heartbeat), (0x580, _on_answer), (0x080, _on_emergency)):
        for node in NODES:
            network.subscribe(base + node, partial(take, scan))
    network.subscribe(SYNC, lambda *_: _count_sync(scan))


def _on_heartbeat(scan: Scan, can_id: int, data: bytearray, _: float) -> None:
    found = scan.heard(can_id & 0x7F)
    found.state = NMT_STATES.get(data[0] & 0x7F, "unknown state") if data else "unknown state"
    found.boots += found.state == "boot-up"


def _on_answer(scan: Scan, can_id: int, data: bytearray, _: float) -> None:
    if len(data) == 8 and data[1:4] == REQUEST[1:4]:
        scan.heard(can_id & 0x7F).answers += 1


def _on_emergency(scan: Scan, can_id: int, data: bytearray, _: float) -> None:
    if len(data) == 8:
        scan.heard(can_id & 0x7F).emergencies += 1


def _count_sync(scan: Scan) -> None:
    scan.syncs += 1
