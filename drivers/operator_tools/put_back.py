"""`hil drives restore`: restoring of drives after a session that ended without it.

A killed process leaves its values in the drives, and a file with the original ones. Before anything
is written, every drive of the file must be there, have the same identity, and be off. A value that
a drive refuses is reported and marked, and the drive counts as restored: it must not keep later
sessions from the bus.
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
    """Result of restoring a drive.

    Attributes
    ----------
    label : str
        Name of the drive in messages.
    drive : FoundDrive
        Settings of the drive, with the present `restored`.
    written : tuple of (Entry, int or None, int)
        Differences: object, present value (None: missing), original value.
    left : tuple of str
        Objects not restored, since they were configured after the session, in words.
    problem : str
        Reason of a failure; empty if there is none. If `drive.restored` is true, the drive refused
        some values.
    """

    label: str
    drive: FoundDrive
    written: tuple[tuple[Entry, int | None, int], ...]
    left: tuple[str, ...]
    problem: str


def put_back(bus: Fieldbus, settings: FoundSettings) -> Iterator[Returned]:
    """Restore the settings of drives; drives restored already are left alone.

    Parameters
    ----------
    bus : Fieldbus
        An open bus on which nobody commands the drives.
    settings : FoundSettings
        Original settings.

    Yields
    ------
    Returned
        Result for each drive.

    Raises
    ------
    NodeSilent, DriveRefused
        Drives that are missing, exchanged or energised, a line each; nothing was written.
    """
    left = settings.unrestored
    servers = bus.servers(places_of(left), settings.sdo_timeout)
    pairs = list(zip(servers, left, strict=True))
    _refuse_unfit(pairs)
    for server, drive in pairs:
        yield _put_back(server, drive, bus.rules)


def _refuse_unfit(pairs: Sequence[tuple[RemoteDictionary, FoundDrive]]) -> None:
    problems: list[DriveError] = []
    for server, drive in pairs:
        try:
            if differs := difference(drive.identity, read_identity(server)):
                problems.append(
                    DriveRefused(
                        f"{server.label}: not the drive of the file: {differs}; check node "
                        "numbers and wiring, or use the file of this drive"
                    )
                )
            else:
                refuse_energised(server)
        except (DriveRefused, NodeSilent) as error:
            problems.append(error)
    if problems:
        raise join_errors(problems, "nothing was written")


def _put_back(server: RemoteDictionary, drive: FoundDrive, order: RestoringOrder) -> Returned:
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
