"""First frame with a sign of a fault.

The sign of missing frames is the frame at which the driver's tolerance ends: ten SYNCs without a
TPDO, a heartbeat's time-out, a request without an answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402.states import State, decode_state
from drivers.safety.trips import BLIND
from fault_table.logged_bus import SYNC
from fault_table.trial import AXIS, drives

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from fault_table.logged_bus import Seen

    Sign = Callable[[Sequence[Seen], int], int]

NODE = drives.axes[AXIS - 1].node


def event(log: Sequence[Seen], began: int) -> int:
    """Return the frame number of the event, for events known to us: Ctrl-C."""
    del log
    return began


def trouble(log: Sequence[Seen], began: int) -> int:
    """Return the frame number of the first EMCY, boot-up or statusword of a drive that is not
    enabled.
    """
    nodes = {axis.node for axis in drives.axes}

    def shows(frame: Seen) -> bool:
        node, function = frame.identifier & 0x7F, frame.identifier & 0x780
        if frame.ours or node not in nodes:
            return False
        word = int.from_bytes(frame.data[:2], "little")
        return (
            (function == 0x080 and word != 0)
            or (function == 0x700 and frame.data == b"\0")
            or (function == 0x180 and decode_state(word) is not State.OPERATION_ENABLED)
        )

    return _first(log, began, shows)


def jump(log: Sequence[Seen], began: int) -> int:
    """Return the frame number of the first TPDO of the axis after the fault."""
    return _first(log, began, lambda f: not f.ours and f.identifier == 0x180 + NODE)


def jump_latched(log: Sequence[Seen], began: int) -> int:
    """Return the frame number of the axis's second answer, since the first was latched before the
    fault.
    """
    return jump(log, jump(log, began) + 1)


def blindness(log: Sequence[Seen], began: int) -> int:
    """Return the frame number of the last of `BLIND` SYNCs without an answer of the axis."""
    syncs = [n for n, f in enumerate(log) if n >= began and f.ours and f.identifier == SYNC]
    return syncs[BLIND - 1]


def silence(log: Sequence[Seen], began: int) -> int:
    """Return the frame number of the first SYNC at or after
    the time-out of the axis's heartbeat.
    """
    beats = [n for n, f in enumerate(log[:began]) if not f.ours and f.identifier == 0x700 + NODE]
    due = log[beats[-1]].sync + round(drives.heartbeat_timeout / drives.sync_period)
    return _first(log, began, lambda f: f.ours and f.identifier == SYNC and f.sync >= due)


def request(log: Sequence[Seen], began: int) -> int:
    """Return the frame number of the first request to the axis after the fault."""
    return _first(log, began, lambda f: f.ours and f.identifier == 0x600 + NODE)


def _first(log: Sequence[Seen], began: int, shows: Callable[[Seen], bool]) -> int:
    return next(n for n, frame in enumerate(log) if n >= began and shows(frame))
