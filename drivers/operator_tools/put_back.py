"""`hil drives restore`: what drives held before a session that never put it back.

A process that was killed leaves its values in the drives, and the file that it kept. Before
anything is written, every drive of the file must be there, be the one that it was, and be off. A
value that a drive does not take back is reported and marked, and the drive is done with: it must
not keep every later session from its bus.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from drivers.drive_bus import DriveError, DriveRefused, NodeSilent, join_errors
from drivers.found_settings.restoring import NotTakenBack, refuse_energised, restore_drive
from drivers.found_settings.settings_file import difference, read_identity
from drivers.session.connection import places_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.fieldbus import Entry
    from drivers.found_settings.restoring import RestoringOrder
    from drivers.found_settings.settings_file import FoundDrive, FoundSettings
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Fieldbus


class Returned(NamedTuple):
    """One drive after it was dealt with.

    Attributes
    ----------
    label : str
        How messages name it.
    drive : FoundDrive
        With `restored` as it is by now.
    written : tuple of (Entry, int or None, int)
        What differed: object, value on the drive (None: missing), value that it held before.
    left : tuple of str
        What has been set up anew since and is not put back, in words.
    problem : str
        Why some of it could not be put back; empty if all was. Where `drive.restored` is true, it
        is about values that the drive does not take.
    """

    label: str
    drive: FoundDrive
    written: tuple[tuple[Entry, int | None, int], ...]
    left: tuple[str, ...]
    problem: str


def put_back(bus: Fieldbus, settings: FoundSettings) -> Iterator[Returned]:
    """Put back what drives held; those that hold it again already are left alone.

    Parameters
    ----------
    bus : Fieldbus
        An open bus on which nobody commands the drives.
    settings : FoundSettings
        What they held.

    Yields
    ------
    Returned
        Each drive once it has been dealt with.

    Raises
    ------
    NodeSilent, DriveRefused
        A drive is missing, another one, or energised, a line each; nothing was written.
    """
    left = settings.unrestored
    servers = bus.servers(places_of(left), settings.sdo_timeout)
    pairs = list(zip(servers, left, strict=True))
    _refuse(pairs)
    for server, drive in pairs:
        yield _returned(server, drive, bus.rules)


def _refuse(pairs: Sequence[tuple[RemoteDictionary, FoundDrive]]) -> None:
    problems: list[DriveError] = []
    for server, drive in pairs:
        try:
            _refuse_other(server, drive)
            refuse_energised(server)
        except (DriveRefused, NodeSilent) as error:
            problems.append(error)
    if problems:
        raise join_errors(problems, "nothing was written")


def _refuse_other(server: RemoteDictionary, drive: FoundDrive) -> None:
    differs = difference(drive.identity, read_identity(server))
    if differs:
        raise DriveRefused(
            f"{server.label}: another drive than the file is about: {differs}; check node numbers"
            " and wiring, or take the file of this drive"
        )


def _returned(server: RemoteDictionary, drive: FoundDrive, order: RestoringOrder) -> Returned:
    written: tuple[tuple[Entry, int | None, int], ...] = ()
    left: tuple[str, ...] = ()
    try:
        present = {each: server.find(each.entry) for each in drive.objects}
        anew = {each: value for each, value in present.items() if each.was_changed(value)}
        left = tuple(
            f"{server.label}: {each.comparison(value)} and is left as it is"
            for each, value in anew.items()
            if value is not None
        )
        ours = tuple(each for each in drive.objects if each not in anew)
        rows = ((each.entry, present[each], each.value) for each in ours)
        written = tuple(row for row in rows if row[1] != row[2])
        restore_drive(server, drive.model_copy(update={"objects": ours}), order)
    except NotTakenBack as error:
        return Returned(server.label, drive.finish(error.places), written, left, str(error))
    except DriveError as error:
        return Returned(server.label, drive, written, left, str(error))
    return Returned(server.label, drive.finish(), written, left, "")
