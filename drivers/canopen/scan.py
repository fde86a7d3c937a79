"""Scan of the bus: all 127 node numbers, by listening and by SDO requests.

First the scan only listens: heartbeats, boot-ups and emergencies reveal nodes without SDO answers,
and a SYNC reveals another master. Then every number is asked for its device type (1000), all in a
row, within one time-out; and the objects for a review are read from each node that answers.
Nothing is written, no state of a node changes and nothing is energised: only SDO read requests are
sent.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from drivers.can_bus.capabilities import find_capabilities
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.objects import NMT_STATES, SYNC
from drivers.canopen.rules import RULES
from drivers.canopen.sdo import SdoAccess
from drivers.dictionary.live import read_dictionary
from drivers.dictionary.review import Scan, review
from drivers.in_node import find_axes, show_axis
from drivers.remote_dictionary import ABSENT, AccessRefused, NoAnswer

if TYPE_CHECKING:
    from collections.abc import Sequence

    import can

NODES = range(1, 128)
LISTENING = 1.2
"""Duration of listening [s]: heartbeats rarely come less often than once a second."""
ANSWERING = 0.5
"""Longest time to the first answer of a node [s]."""
SDO_TIMEOUT = 0.25
BATCH = 8
"""Largest number of requests in a row; socketcan queues ten."""
REQUEST = bytes([0x40, 0x00, 0x10, 0, 0, 0, 0, 0])


def scan_bus(
    bus: can.BusABC,
    *,
    listening: float = LISTENING,
    answering: float = ANSWERING,
    timeout: float = SDO_TIMEOUT,
    only: Sequence[int] = NODES,
) -> Scan:
    """Find the nodes on an open bus and their offers.

    Parameters
    ----------
    bus : can.BusABC
        An open bus; in lock-step listening is useless, since time does not advance.
    listening, answering, timeout : float
        Time to listen, to wait for first answers, and for each further answer [s].
    only : sequence of int
        Node numbers to ask.

    Raises
    ------
    BusUnavailable
            The bus accepts no frames or has gone.
    """
    network = PumpedNetwork(bus, synchronous=find_capabilities(bus).lock_step)
    scan = Scan()
    for identifier in (SYNC, *(base + node for base in (0x700, 0x580, 0x080) for node in NODES)):
        network.subscribe(identifier, partial(_take_frame, scan))
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
                dictionary = read_dictionary(show_axis(access, within), node, RULES, within.axis)
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
        return error.code not in ABSENT  # it exists, and can perhaps only be written
    except NoAnswer:
        return False
    return True


def _take_frame(scan: Scan, can_id: int, data: bytearray, _: float) -> None:
    """Record a heartbeat, an answer to our request, an emergency or a SYNC."""
    service, node = can_id & ~0x7F, can_id & 0x7F
    if can_id == SYNC:
        scan.syncs += 1
    elif service == 0x700:
        found = scan.heard(node)
        found.state = NMT_STATES.get(data[0] & 0x7F, "unknown state") if data else "unknown state"
        found.boots += found.state == "boot-up"
    elif service == 0x580 and len(data) == 8 and data[1:4] == REQUEST[1:4]:
        scan.heard(node).answers += 1
    elif service == 0x080 and len(data) == 8:
        scan.heard(node).emergencies += 1
