"""Restoring of drive settings after power-off.

Process data come first, in the order of their bus. The supervision of the master comes last, since
until then it stops the axis if this process dies. A value refused by a drive hinders no other. Each
value is read first and written only if different, so a repetition is harmless. The mode is restored
if the drive accepts it: many show a mode at power-on that cannot be written, and every master
selects its own.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.states import decode_state
from drivers.cia402.stop import NOT_ENERGISED
from drivers.commissioning.held_values import read_if_held
from drivers.drive_bus import DriveRefused
from drivers.remote_dictionary import Aborted

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from drivers.fieldbus import Entry
    from drivers.found_settings.settings_file import FoundDrive
    from drivers.remote_dictionary import RemoteDictionary

_MODE = frozenset({objects.MODE.index})
_ROUNDS = 2
"""Number of attempts: limits may depend on each other."""


@dataclass(frozen=True, kw_only=True)
class RestoringOrder:
    """Order of restoring the objects of a bus.

    Attributes
    ----------
    restore_process_data : callable
        Restores the process data of `server` in `values`; returns the remaining values, and
        failures by object.
    late : frozenset of int
        Index of objects to be restored after the others of the bus.
    watchdogs : frozenset of int
        Index of objects that supervise the master, restored last.
    """

    restore_process_data: Callable[
        [RemoteDictionary, Mapping[Entry, int]], tuple[dict[Entry, int], dict[Entry, str]]
    ]
    late: frozenset[int] = frozenset()
    watchdogs: frozenset[int] = frozenset()


class NotTakenBack(DriveRefused):
    """A drive is restored except for values that it refuses.

    Attributes
    ----------
    places : frozenset of (int, int)
        Index and sub-index of the refused objects.
    """

    def __init__(self, problems: Mapping[Entry, str]) -> None:
        super().__init__("\n".join(problems.values()))
        self.places = frozenset(each.key for each in problems)


def restore_drive(server: RemoteDictionary, found: FoundDrive, order: RestoringOrder) -> None:
    """Restore the settings of a drive confirmed to be off, and read them back.

    Raises
    ------
    NotTakenBack
        The drive refuses values, a line each; the others are restored.
    DriveRefused
        The drive is energised, so nothing was written.
    NodeSilent, BusUnavailable
        No answer: the remaining objects are unchanged, the watchdog included.
    """
    refuse_energised(server)
    server.access.leave_operational()
    held = {each.entry: each.value for each in found.objects}
    values, problems = order.restore_process_data(server, held)
    waiting = (order.late, _MODE, order.watchdogs)
    for group in (frozenset(e.index for e in values).difference(*waiting), *waiting):
        refused = restore(server, {e: v for e, v in values.items() if e.index in group})
        if group != _MODE:
            problems |= refused
    if problems:
        raise NotTakenBack(problems)


def refuse_energised(server: RemoteDictionary) -> None:
    """Refuse a drive that is not confirmed to be off.

    Raises
    ------
    DriveRefused
        The drive may be energised; with its state.
    """
    word = server.get(objects.STATUSWORD)
    state = decode_state(word)
    if state not in NOT_ENERGISED:
        shown = f"an undefined state ({word:04X}h)" if state is None else state.value
        raise DriveRefused(
            f"{server.label}: shows {shown}, settings are restored only to a drive that is off;"
            " switch it off first, by the emergency stop if need be"
        )


def restore(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Write values that differ from the drive's; return failures by object."""
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
    if holds(server, {entry: value}):
        return
    server.put(entry, value)
    kept = server.get(entry)
    if kept != value:
        raise DriveRefused(
            f"{server.label}: object {entry} held {value}, but reads {kept} after this value was "
            "written; set it with the maker's commissioning tool"
        )


def restore_mapping(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Restore a mapping or assignment: count 0, entries, count; return failures by object."""
    count = {e: v for e, v in values.items() if e.subindex == 0}
    for entry in count:
        put_if_taken(server, entry, 0)
    active = max(count.values(), default=0)
    entries = {e: v for e, v in values.items() if e.subindex}
    # entries beyond the count are meaningless, and some drives refuse them
    restore(server, {e: v for e, v in entries.items() if e.subindex > active})
    problems = restore(server, {e: v for e, v in entries.items() if e.subindex <= active})
    return problems | restore(server, count)


def put_if_taken(server: RemoteDictionary, entry: Entry, value: int) -> None:
    """Write a number; a refusal is ignored."""
    with suppress(Aborted):
        server.put(entry, value)


def holds(server: RemoteDictionary, values: Mapping[Entry, int]) -> bool:
    """Return True if a drive holds the values; unreadable ones count as different."""
    return all(read_if_held(server, entry) == value for entry, value in values.items())
