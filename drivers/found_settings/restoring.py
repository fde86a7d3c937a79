"""Putting back what a drive held, once it is off.

Process data come first, in the order of their bus. What watches us comes last, for until then it is
what stops the axis when this process dies. A value that a drive refuses
keeps no other from being put back. Each is read first, and written only where the drive holds
another, so doing it again is harmless. The mode is put back where the drive takes it: many show one
at power-on that cannot be written, and every master chooses its own.
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
"""Limits may depend on each other: what a drive refuses at first is tried again once."""


@dataclass(frozen=True, kw_only=True)
class RestoringOrder:
    """How a bus's own objects are put back.

    Attributes
    ----------
    restore_process_data : callable
        Puts the process data of `server` back that stand in `values`; returns the values that are
        left, and why not, by object.
    late : frozenset of int
        Index of those that wait for all others of the bus.
    watchdogs : frozenset of int
        Index of what watches us, which waits for everything.
    """

    restore_process_data: Callable[
        [RemoteDictionary, Mapping[Entry, int]], tuple[dict[Entry, int], dict[Entry, str]]
    ]
    late: frozenset[int] = frozenset()
    watchdogs: frozenset[int] = frozenset()


class NotTakenBack(DriveRefused):
    """A drive holds again what it held but for some values that it does not take.

    Attributes
    ----------
    places : frozenset of (int, int)
        Index and sub-index of their objects.
    """

    def __init__(self, problems: Mapping[Entry, str]) -> None:
        super().__init__("\n".join(problems.values()))
        self.places = frozenset(each.key for each in problems)


def restore_drive(server: RemoteDictionary, found: FoundDrive, order: RestoringOrder) -> None:
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


def restore(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Put values back where the drive holds others; return why not, by object."""
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
            f"{server.label}: object {entry} held {value}, it reads {kept} after that was written;"
            " set it with the maker's commissioning tool"
        )


def restore_mapping(server: RemoteDictionary, values: Mapping[Entry, int]) -> dict[Entry, str]:
    """Put back a mapping or an assignment: count 0, entries, count; return why not, by object."""
    count = {e: v for e, v in values.items() if e.subindex == 0}
    for entry in count:
        put_if_taken(server, entry, 0)
    active = max(count.values(), default=0)
    entries = {e: v for e, v in values.items() if e.subindex}
    # Beyond its count a mapping means nothing, and not every drive takes what stood there.
    restore(server, {e: v for e, v in entries.items() if e.subindex > active})
    problems = restore(server, {e: v for e, v in entries.items() if e.subindex <= active})
    return problems | restore(server, count)


def put_if_taken(server: RemoteDictionary, entry: Entry, value: int) -> None:
    """Write a number; a drive may refuse it."""
    with suppress(Aborted):
        server.put(entry, value)


def holds(server: RemoteDictionary, values: Mapping[Entry, int]) -> bool:
    """Whether a drive holds all of these values; what cannot be read it does not."""
    return all(read_if_held(server, entry) == value for entry, value in values.items())
