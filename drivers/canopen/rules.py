"""Rules of CANopen for object dictionaries (`drivers.dictionary.review.BusRules`).

The requirements on communication objects (CiA 301) complete the table of the profile. Time-outs of
heartbeats follow from the drives file: a drive may send its heartbeat less often if two fit into
`heartbeat_timeout`, and may wait for ours somewhat longer, but neither for ever nor for less than
two beats.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.mapping_review import review_mapping
from drivers.canopen.objects import OFF, SYNC
from drivers.canopen.pdo_mapping import AT_SYNC, ON_SYNC
from drivers.commissioning.held_values import MAPPINGS, mapping_count
from drivers.commissioning.requirements import (
    EXACT,
    ROUNDED,
    Kept,
    Lack,
    Requirement,
    Use,
    add_rows,
    noted,
    refused,
    silent,
)
from drivers.dictionary.review import BusRules, Finding
from drivers.fieldbus import Entry
from drivers.found_settings.restoring import holds, put_if_taken, restore, restore_mapping
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from drivers.dictionary.dictionary import Dictionary
    from drivers.drives_file import DrivesFile
    from drivers.remote_dictionary import RemoteDictionary

LONGER_WATCH = 1.5
"""Longest accepted time of a drive's heartbeat supervision, as a multiple of
`heartbeat_timeout`."""

NODE_SHIFT, TIME_MASK = 16, 0xFFFF
"""Consumer heartbeat (1016): node and time [ms]; time 0 marks an unused entry."""


ON_ARRIVAL = (
    "streamed set-points act on arrival, so jitter of this computer disturbs the control loops"
)
GUARDING = (cia301.GUARD_TIME, cia301.LIFE_TIME_FACTOR)
WATCHDOGS = frozenset(entry.index for entry in (cia301.CONSUMER_HEARTBEAT, *GUARDING))
"""Index of the objects that supervise us: consumer heartbeat and life guarding."""
_GUARDED = "node guarding (100C, 100D) is used instead"
_HEARTBEATS = "only heartbeats (1016, 1017) are used"


def watching_time(drives: DrivesFile) -> tuple[float, float]:
    """Return the bounds of a drive's supervision time of our life sign [ms]."""
    return 2000 * drives.heartbeat_period, LONGER_WATCH * 1000 * drives.heartbeat_timeout


def _accept_watch(written: int, kept: int, drives: DrivesFile) -> bool:
    least, most = watching_time(drives)
    ours = kept >> NODE_SHIFT == written >> NODE_SHIFT
    return ours and least <= kept & TIME_MASK <= most


_TIMES = f"from two times `heartbeat_period` up to {LONGER_WATCH:g} times `heartbeat_timeout`"

BEATS = Kept(
    "any time above 0 up to half of `heartbeat_timeout`",
    lambda _, kept, drives: 0 < kept <= 500 * drives.heartbeat_timeout,
)
WATCHES = Kept(f"`master_node`, and a time {_TIMES}", _accept_watch)
LIFE_TIME = Kept(f"100C times 100D, {_TIMES}", EXACT.accepts)
"""Each factor is read back exactly; the bounds apply to the product."""

REQUIREMENTS = add_rows((
    # supervision
    Requirement(
        cia301.CONSUMER_HEARTBEAT, Use.SET, "the axis keeps moving after a crash of this program",
        Lack.REFUSED_UNLESS_STATED, kept=WATCHES, instead=GUARDING, served=_GUARDED,
    ),
    refused(
        cia301.PRODUCER_HEARTBEAT, Use.SET, "loss of the drive would not be detected",
        kept=BEATS, instead=GUARDING, served=_GUARDED,
    ),
    silent(cia301.GUARD_TIME, Use.SET, _HEARTBEATS, kept=LIFE_TIME),
    silent(cia301.LIFE_TIME_FACTOR, Use.SET, _HEARTBEATS, kept=LIFE_TIME),
    # SYNC, emergencies, faults
    silent(
        cia301.SYNC_COB_ID, Use.SET, "SYNC under 80h is assumed",
        value=SYNC, serves=(SYNC | 1 << 31,), fixed="the drive produces SYNC, or ignores 80h",
    ),
    silent(
        cia301.SYNC_COUNTER, Use.SET, "the drive expects no counter in SYNC",
        value=0, fixed="the drive ignores SYNC without a counter",
    ),
    noted(
        cia301.CYCLE_PERIOD, Use.SET, "the SYNC period is unknown to the drive",
        kept=ROUNDED, fixed="the value must equal the SYNC period",
    ),
    noted(
        cia301.SET_POINT_TRANSMISSION, Use.SET, ON_ARRIVAL,
        value=ON_SYNC, serves=range(256), served=f"above {AT_SYNC[-1]}, {ON_ARRIVAL}",
    ),
    silent(
        cia301.INHIBIT_TIME, Use.SET, "TPDOs are not delayed", value=0,
        fixed="TPDOs are delayed: not every SYNC is answered",
    ),
    silent(
        cia301.EVENT_TIMER, Use.SET, "TPDOs only with SYNC", value=0,
        fixed="TPDOs also between SYNCs",
    ),
    silent(cia301.EMERGENCY_COB_ID, Use.READ, "emergencies are expected under 80h plus node"),
))  # fmt: skip
"""Requirements by object, in the order of reading."""


_COMMUNICATION = (range(0x1400, 0x1600), range(0x1800, 0x1A00))
_MAPPING = 0x200
_PDOS = range(0x1400, 0x1C00)


def restore_process_data(
    server: RemoteDictionary, values: Mapping[Entry, int]
) -> tuple[dict[Entry, int], dict[Entry, str]]:
    """Restore PDOs and SYNC counter; return the remaining values, and failures by object."""
    present = {entry.index for entry in values}
    problems: dict[Entry, str] = {}
    for index in (index for indices in _COMMUNICATION for index in indices):
        records = {index, index + _MAPPING}
        if present & records:
            pdo = {e: v for e, v in values.items() if e.index in records}
            problems |= _restore_pdo(server, pdo)
    others = {e: v for e, v in values.items() if e.index not in _PDOS}
    # the counter is found by index, since a file may name its objects otherwise
    counters = [v for e, v in others.items() if e.index == cia301.SYNC_COUNTER.index]
    for counter in counters:
        if not holds(server, {cia301.SYNC_COUNTER: counter}):
            put_if_taken(server, cia301.CYCLE_PERIOD, 0)
            put_if_taken(server, cia301.SYNC_COUNTER, counter)
    return others, problems


def _restore_pdo(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Restore a PDO: off, identifier, mapping, transmission type and the like, COB-ID."""
    if holds(server, values):
        return {}
    mapping = {e: v for e, v in values.items() if any(e.index in mappings for mappings in MAPPINGS)}
    cob = {e: v for e, v in values.items() if e not in mapping and e.subindex == 1}
    rest = {e: v for e, v in values.items() if e not in mapping and e not in cob}
    for entry, value in cob.items():
        with suppress(Aborted):  # a read-only COB-ID need not be off
            for word in (server.get(entry) | OFF, value | OFF):
                if server.get(entry) != word:
                    server.put(entry, word)
    problems = {} if holds(server, mapping) else restore_mapping(server, mapping)
    return problems | restore(server, rest) | restore(server, cob)


def _remarks(dictionary: Dictionary) -> Iterator[Finding]:
    """Yield a finding for a drive that expects a counter in SYNC; a live drive only."""
    declared = dictionary.entry(cia301.SYNC_COUNTER)
    if declared is not None and declared.writable is None and declared.value:
        so = "the drive expects a counter in SYNC, not sent here: start-up sets this to 0"
        yield Finding(str(cia301.SYNC_COUNTER), f"is {declared.value}", so, fatal=False)


def _find_unwatched(dictionary: Dictionary) -> str | None:
    """Return the reason why a drive can neither supervise our heartbeat nor be guarded, or None."""
    watch = cia301.CONSUMER_HEARTBEAT
    known = dictionary.entry(watch) is not None or watch.key in dictionary.unanswered
    return None if known or all(map(dictionary.entry, GUARDING)) else "the drive has no 1016"


RULES = BusRules(
    requirements=REQUIREMENTS,
    asked=tuple(
        entry
        for record in (0x1400, 0x1800, 0x1801)
        for entry in (
            Entry(record, 1, "u32", "COB-ID"),
            Entry(record, 2, "u8", "transmission type"),
            mapping_count(record + 0x200),
        )
    ),
    mappings=(0x1600, 0x1A00, 0x1A01),
    # the value may make the drive produce SYNC, which must not happen with our period
    late=frozenset({cia301.SYNC_COB_ID.index}),
    watchdogs=WATCHDOGS,
    restore_process_data=restore_process_data,
    review_process_data=review_mapping,
    remarks=_remarks,
    unwatched=_find_unwatched,
)
