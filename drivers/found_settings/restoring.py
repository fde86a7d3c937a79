"""Putting back what a drive held, once it is off.

The order is that of the standard: a mapping and an identifier can be changed only while their PDO
is off, and what makes a drive produce SYNC waits for its period. What watches our heartbeat comes
last, for until then it is what stops the axis when this process dies. A value that a drive refuses
keeps no other from being put back. Each is read first, and written only where the drive holds
another, so doing it again is harmless. The mode is put back where the drive takes it: many show one
at power-on that cannot be written, and every master chooses its own.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.canopen.pdo_set_up import OFF
from drivers.canopen.sdo import Aborted
from drivers.cia402 import objects
from drivers.cia402.states import decode_state
from drivers.cia402.stop import NOT_ENERGISED
from drivers.commissioning.requirements import REQUIREMENTS
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.fieldbus import Entry
    from drivers.found_settings.settings_file import FoundDrive

_WATCH = REQUIREMENTS[cia301.CONSUMER_HEARTBEAT]
WATCHDOGS = frozenset(entry.index for entry in (_WATCH.entry, *_WATCH.instead))
"""Life guarding and consumer heartbeat."""
_SYNC = frozenset({cia301.SYNC_COB_ID.index})
"""May make the drive produce SYNC, which it must not do with our period."""
_MODE = frozenset({objects.MODE.index})
_COMMUNICATION = (range(0x1400, 0x1600), range(0x1800, 0x1A00))
_MAPPING = 0x200
_PDO_SPAN = 0x1C00
_ROUNDS = 2
"""Limits may depend on each other: what a drive refuses at first is tried again once."""


class NotTakenBack(DriveRefused):
    """A drive holds again what it held but for some values that it does not take.

    Attributes
    ----------
    places : frozenset of (int, int)
        Index and sub-index of their objects.
    """

    def __init__(self, problems: Mapping[Entry, str]) -> None:
        super().__init__("\n".join(problems.values()))
        self.places = frozenset((each.index, each.subindex) for each in problems)


def restore_drive(server: RemoteDictionary, found: FoundDrive) -> None:
    """Put back what a drive held that is shown off, and read it back.

    Raises
    ------
    NotTakenBack
        It does not take values, a line each; all others were put back.
    DriveRefused
        It is energised, so nothing was written.
    NodeSilent, BusUnavailable
        No answer: what was not reached is as it was, the watchdog included.
    """
    refuse_energised(server)
    server.enter_pre_operational()
    values = {each.entry: each.value for each in found.objects}
    problems: dict[Entry, str] = {}
    for pdo in _pdos(values):
        problems |= _restore_pdo(server, pdo)
    others = {e: v for e, v in values.items() if not 0x1400 <= e.index < _PDO_SPAN}
    _free_sync_counter(server, others)
    for late in (frozenset[int](), _SYNC, _MODE, WATCHDOGS):
        group = {e: v for e, v in others.items() if _late(e.index) == late}
        refused = _restore(server, group)
        if late != _MODE:
            problems |= refused
    if problems:
        raise NotTakenBack(problems)


def _late(index: int) -> frozenset[int]:
    """Return with which others an object waits until the rest is put back; with none at once."""
    return next((late for late in (_SYNC, _MODE, WATCHDOGS) if index in late), frozenset())


def refuse_energised(server: RemoteDictionary) -> None:
    """Refuse a drive that is not shown off.

    Raises
    ------
    DriveRefused
        With the state that it shows.
    """
    word = server.get(objects.STATUSWORD)
    state = decode_state(word)
    if state not in NOT_ENERGISED:
        shown = f"an undefined state ({word:04X}h)" if state is None else state.value
        raise DriveRefused(
            f"{server.label}: shows {shown}, settings are put back only to a drive that is off;"
            " switch it off first, by the emergency stop if need be"
        )


def _free_sync_counter(server: RemoteDictionary, values: Mapping[Entry, int]) -> None:
    """Put back the counter in SYNC first, which can be changed without a period only (1006)."""
    counters = [v for e, v in values.items() if e.index == cia301.SYNC_COUNTER.index]
    for counter in counters:  # by index: a file may name its objects otherwise
        if not _differs(server, cia301.SYNC_COUNTER, counter):
            return
        _try(server, cia301.CYCLE_PERIOD, 0)
        _try(server, cia301.SYNC_COUNTER, counter)


def _pdos(values: Mapping[Entry, int]) -> Iterable[dict[Entry, int]]:
    """Take apart what belongs to each PDO, in order of its COB-ID's index."""
    present = {entry.index for entry in values}
    for index in (index for indices in _COMMUNICATION for index in indices):
        if present & {index, index + _MAPPING}:
            yield {e: v for e, v in values.items() if e.index in {index, index + _MAPPING}}


def _restore_pdo(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Off, identifier, count 0, entries, count, transmission type and the like, COB-ID."""
    if not any(_differs(server, entry, value) for entry, value in values.items()):
        return {}
    mapping = {e: v for e, v in values.items() if _is_mapping(e.index)}
    cob = {e: v for e, v in values.items() if e not in mapping and e.subindex == 1}
    count = {e: v for e, v in mapping.items() if e.subindex == 0}
    rest = {e: v for e, v in values.items() if e not in mapping and e not in cob}
    problems: dict[Entry, str] = {}
    for entry, value in cob.items():
        _switch_off(server, entry, value)
    if any(_differs(server, entry, value) for entry, value in mapping.items()):
        problems |= _restore_mapping(server, mapping, count)
    return problems | _restore(server, rest) | _restore(server, cob)


def _switch_off(server: RemoteDictionary, cob: Entry, value: int) -> None:
    """Switch a PDO off, then give it the identifier that it had."""
    with suppress(Aborted):  # a read-only COB-ID need not be off
        for word in (server.get(cob) | OFF, value | OFF):
            if server.get(cob) != word:
                server.put(cob, word)


def _restore_mapping(
    server: RemoteDictionary, mapping: Mapping[Entry, int], count: Mapping[Entry, int]
) -> dict[Entry, str]:
    for entry in count:
        _try(server, entry, 0)
    active = max(count.values(), default=0)
    entries = {e: v for e, v in mapping.items() if e.subindex}
    # Beyond its count a mapping means nothing, and not every drive takes what stood there.
    _restore(server, {e: v for e, v in entries.items() if e.subindex > active})
    problems = _restore(server, {e: v for e, v in entries.items() if e.subindex <= active})
    return problems | _restore(server, count)


def _is_mapping(index: int) -> bool:
    return 0x1600 <= index < 0x1800 or 0x1A00 <= index < _PDO_SPAN


def _restore(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Put values back; return why not, by object."""
    refused: dict[Entry, str] = {}
    pending: Sequence[Entry] = list(values)
    for _ in range(_ROUNDS):
        refused = {}
        for entry in pending:
            try:
                _put_back(server, entry, values[entry])
            except DriveRefused as error:
                refused[entry] = str(error)
        pending = list(refused)
        if not pending:
            break
    return refused


def _put_back(server: RemoteDictionary, entry: Entry, value: int) -> None:
    if not _differs(server, entry, value):
        return
    server.put(entry, value)
    kept = server.get(entry)
    if kept != value:
        raise DriveRefused(
            f"{server.label}: object {entry} held {value}, it reads {kept} after that was written;"
            " set it with the maker's commissioning tool"
        )


def _differs(server: RemoteDictionary, entry: Entry, value: int) -> bool:
    try:
        return server.get(entry) != value
    except Aborted:
        return True


def _try(server: RemoteDictionary, entry: Entry, value: int) -> None:
    with suppress(Aborted):
        server.put(entry, value)
