"""Requirements on communication objects (CiA 301), and the complete table for CANopen.

Time-outs of heartbeats follow from the drives file: a drive may send its heartbeat less often if
two fit into `heartbeat_timeout`, and may wait for ours somewhat longer, but neither for ever nor
for less than two beats.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.objects import SYNC
from drivers.canopen.pdo_mapping import AT_SYNC, ON_SYNC
from drivers.commissioning.requirement import (
    EXACT,
    ROUNDED,
    Kept,
    Lack,
    Requirement,
    Use,
    noted,
    refused,
    silent,
)
from drivers.commissioning.requirements import add_rows

if TYPE_CHECKING:
    from drivers.drives_file import DrivesFile

LONGER_WATCH = 1.5
"""Longest accepted time of a drive's heartbeat supervision, as a multiple of
`heartbeat_timeout`."""

NODE_SHIFT, TIME_MASK = 16, 0xFFFF
"""Consumer heartbeat (1016): node and time [ms]; time 0 marks an unused entry."""


ON_ARRIVAL = (
    "set-points of a stream act when they arrive, so the jitter of this computer reaches its loops"
)
GUARDING = (cia301.GUARD_TIME, cia301.LIFE_TIME_FACTOR)
WATCHDOGS = frozenset(entry.index for entry in (cia301.CONSUMER_HEARTBEAT, *GUARDING))
"""Index of the objects that supervise us: consumer heartbeat and life guarding."""
_GUARDED = "it watches our guarding requests (100C, 100D) instead and answers them"
_HEARTBEATS = "heartbeats alone (1016, 1017) watch"


def watching_time(drives: DrivesFile) -> tuple[float, float]:
    """Return the bounds of a drive's supervision time of our life sign [ms]."""
    return 2000 * drives.heartbeat_period, LONGER_WATCH * 1000 * drives.heartbeat_timeout


def _accept_watch(written: int, kept: int, drives: DrivesFile) -> bool:
    least, most = watching_time(drives)
    ours = kept >> NODE_SHIFT == written >> NODE_SHIFT
    return ours and least <= kept & TIME_MASK <= most


_TIMES = f"from two of our heartbeats up to {LONGER_WATCH:g} times `heartbeat_timeout`"

BEATS = Kept(
    "any time above 0 up to half of `heartbeat_timeout`",
    lambda _, kept, drives: 0 < kept <= 500 * drives.heartbeat_timeout,
)
WATCHES = Kept(f"our node, and a time {_TIMES}", _accept_watch)
LIFE_TIME = Kept(f"their product in time, {_TIMES}", EXACT.accepts)
"""Each factor is read back exactly; the bounds apply to the product."""

REQUIREMENTS = add_rows((
    # supervision
    Requirement(
        cia301.CONSUMER_HEARTBEAT, Use.SET, "the axis goes on when our process dies",
        Lack.REFUSED_UNLESS_STATED, kept=WATCHES, instead=GUARDING, served=_GUARDED,
    ),
    refused(
        cia301.PRODUCER_HEARTBEAT, Use.SET, "nobody would notice that the drive is gone",
        kept=BEATS, instead=GUARDING, served=_GUARDED,
    ),
    silent(cia301.GUARD_TIME, Use.SET, _HEARTBEATS, kept=LIFE_TIME),
    silent(cia301.LIFE_TIME_FACTOR, Use.SET, _HEARTBEATS, kept=LIFE_TIME),
    # SYNC, emergencies, faults
    silent(
        cia301.SYNC_COB_ID, Use.SET, "that it listens to SYNC under 80h is taken on trust",
        value=SYNC, serves=(SYNC | 1 << 31,), fixed="it produces SYNC, or does not listen to ours",
    ),
    silent(
        cia301.SYNC_COUNTER, Use.SET, "it expects no counter in SYNC",
        value=0, fixed="it does not act on our SYNC, which has no counter",
    ),
    noted(
        cia301.CYCLE_PERIOD, Use.SET, "it does not know the period of SYNC",
        kept=ROUNDED, fixed="it serves only with the period of SYNC",
    ),
    noted(
        cia301.SET_POINT_TRANSMISSION, Use.SET, ON_ARRIVAL,
        value=ON_SYNC, serves=range(256), served=f"above {AT_SYNC[-1]}, {ON_ARRIVAL}",
    ),
    silent(
        cia301.INHIBIT_TIME, Use.SET, "its TPDOs are not held back", value=0,
        fixed="it holds back TPDOs, so not every SYNC is answered",
    ),
    silent(
        cia301.EVENT_TIMER, Use.SET, "its TPDOs come with SYNC alone", value=0,
        fixed="its TPDOs come between SYNCs too",
    ),
    silent(cia301.EMERGENCY_COB_ID, Use.READ, "emergencies are expected under 80h plus node"),
))  # fmt: skip
"""Requirements by object, in the order of reading."""
