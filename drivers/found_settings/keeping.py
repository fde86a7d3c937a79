"""Keeping what drives held, before each object is first written.

A `SettingsKeeper` stands in front of every write of a session: the first one to an object reads
what it held. What start-up will overwrite is known beforehand (`announcement`), so that all of it
is on the disk before the first write; an object that is first written later, in the middle of a
session, is added by itself. Where the file of an earlier session is there that never put back what
it had found, its values stand: what the drives hold by now is ours. But where a drive holds neither
what was found nor what that session wrote, it has been set up anew: then it is the drive's that
stands.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from drivers.commissioning.held_values import read_before_write, read_if_held
from drivers.drive_bus import DriveRefused
from drivers.found_settings.restoring import restore_drive
from drivers.found_settings.settings_file import (
    FoundDrive,
    FoundObject,
    FoundSettings,
    difference,
    dump_found_settings,
    load_found_settings,
    read_identity,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping
    from pathlib import Path

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.found_settings.restoring import RestoringOrder
    from drivers.remote_dictionary import RemoteDictionary


class SettingsKeeper:
    """Reads and keeps what drives hold, before it is overwritten.

    Parameters
    ----------
    path : Path, optional
        The file; None to keep everything in memory only.
    write : callable, optional
        ``write(path, content)`` puts a file on the disk, whole or not at all. Needed with `path`.
    bus : tuple of str, optional
        Interface and channel that the drives are on, for who puts them back.

    Attributes
    ----------
    path : Path or None
    later : tuple of Entry
        Objects that the session will write once the drives are on: they are kept with the others.
    unannounced : list of str
        Objects that were first written after the announcement, in words.
    """

    def __init__(
        self,
        path: Path | None = None,
        write: Callable[[Path, bytes], None] | None = None,
        bus: tuple[str | None, str | None] = (None, None),
    ) -> None:
        self.path = path
        self.later: tuple[Entry, ...] = ()
        self.unannounced: list[str] = []
        self._write = write
        self._interface, self._channel = bus
        self._settings: FoundSettings | None = None
        self._announced = False
        self._earlier: frozenset[tuple[int, int]] = frozenset()

    @property
    def settings(self) -> FoundSettings:
        """What is kept by now.

        Raises
        ------
        LookupError
            Nothing has been kept yet.
        """
        if self._settings is None:
            raise LookupError("settings are kept once `open` was called")
        return self._settings

    @property
    def unrestored(self) -> bool:
        """Whether a drive may hold values of ours."""
        return self._announced and self._settings is not None and not self._settings.restored

    def open(self, drives: DrivesFile) -> None:
        """Begin a session; read what an earlier one left behind.

        Raises
        ------
        FileError
            There is a file that cannot be used.
        """
        self._settings = FoundSettings(
            bitrate=drives.bitrate,
            sdo_timeout=drives.sdo_timeout,
            interface=self._interface or None,
            channel=self._channel or None,
        )
        self._announced = False
        self.unannounced.clear()
        if self.path is not None and self.path.exists():
            earlier = load_found_settings(self.path)
            self._settings = self._settings.with_drives(earlier.unrestored)
        self._earlier = frozenset(drive.place for drive in self._settings.drives)

    def found(self, server: RemoteDictionary, entry: Entry) -> int | None:
        """Return what an object held before any of our writes; None where it is missing."""
        kept = self._drive(server.place)
        for each in kept.objects if kept else ():
            if each.key == entry.key:
                present = None if each.written is None else server.find(entry)
                return present if each.set_anew(present) else each.value
        return server.find(entry)

    def take(
        self,
        server: RemoteDictionary,
        axis: AxisDrive,
        found: Mapping[Entry, int],
        planned: Mapping[Entry, int],
    ) -> None:
        """Add what one drive holds, and what will be written; values of an earlier session stay.

        Raises
        ------
        DriveRefused
            The earlier session's values are those of another drive.
        NodeSilent
            No answer.
        """
        earlier, identity = self._drive(server.place), read_identity(server)
        if earlier is not None and (differs := difference(earlier.identity, identity)):
            raise DriveRefused(
                f"{server.label}: {self.path} holds what another drive was set to, which was never"
                f" put back: {differs}; connect that drive and put it back with hil drives restore"
                f" {self.path}, or remove the file if the drive is gone"
            )
        axes, pdos = axis.within
        kept = FoundDrive(
            name=axis.name,
            node=axis.node,
            alias=axis.alias,
            axis=axes,
            pdos=pdos,
            identity=identity,
        )
        if earlier is not None:
            if earlier.doubt:
                server.note(earlier.doubt)
            kept = _standing(server, earlier)
        # written already, for a session that is killed during start-up
        values = {entry.key: value for entry, value in {**found, **planned}.items()}
        kept = _extended(kept, found).holding(lambda each: values.get(each.key, each.written))
        self._settings = self.settings.with_drives([kept])
        server.saved = {each.key for each in kept.objects}

    def announced(self, servers: Iterable[RemoteDictionary]) -> None:
        """Put on the disk what was taken; from here on a further object is kept when it comes.

        Raises
        ------
        FileError
            The file cannot be written.
        """
        self.save()
        self._announced = True
        for server in servers:
            self.guard(server)

    def configured(self, servers: Iterable[RemoteDictionary]) -> None:
        """Note what drives hold once start-up has written to them, and put that on the disk.

        Raises
        ------
        NodeSilent
            No answer.
        FileError
            The file cannot be written.
        """
        for server in servers:
            held = self.drive(server).holding(partial(_present, server))
            self._settings = self.settings.with_drives([held])
        self.save()

    def guard(self, server: RemoteDictionary) -> None:
        """Keep what `server` holds before each first write to it."""
        server.first_write = lambda entry: self._keep(server, entry)

    def drive(self, server: RemoteDictionary) -> FoundDrive:
        """Return what is kept of a drive.

        Raises
        ------
        LookupError
            Nothing is.
        """
        kept = self._drive(server.place)
        if kept is None:
            raise LookupError(f"{server.label}: nothing was kept")
        return kept

    def restore(self, server: RemoteDictionary, order: RestoringOrder) -> None:
        """Put back what a drive held that is shown off, and note it; `close` brings that to disk.

        Raises
        ------
        DriveRefused, NodeSilent, BusUnavailable
            See `drivers.found_settings.restoring.restore_drive`.
        """
        restore_drive(server, self.drive(server), order)
        self._note_restored(server)

    def close(
        self, servers: Iterable[RemoteDictionary], written: Collection[RemoteDictionary]
    ) -> list[str]:
        """End a session; return for the operator which drives could not be put back.

        Parameters
        ----------
        servers : iterable of RemoteDictionary
            The drives of the session.
        written : collection of RemoteDictionary
            Those that something may have been written to.

        Raises
        ------
        FileError
            The file cannot be written.
        """
        if not self._announced:
            return []
        for server in servers:
            if server not in written and server.place not in self._earlier:
                self._note_restored(server)
        self.save()
        remedy = f": put it back with hil drives restore {self.path}" if self.path else ""
        left = [server.label for server in servers if not self.drive(server).restored]
        return [
            *(f"{each} was written without having been announced" for each in self.unannounced),
            *([f"{', '.join(left)}: does not hold again what it held before{remedy}"] * bool(left)),
        ]

    def save(self) -> None:
        """Write the file, if there is to be one.

        Raises
        ------
        FileError
            It cannot be written.
        """
        if self.path is not None and self._write is not None:
            self._write(self.path, dump_found_settings(self.settings).encode())

    def _note_restored(self, server: RemoteDictionary) -> None:
        self._settings = self.settings.with_drives([self.drive(server).done()])

    def _drive(self, place: tuple[int, int]) -> FoundDrive | None:
        return next((drive for drive in self.settings.drives if drive.place == place), None)

    def _keep(self, server: RemoteDictionary, entry: Entry) -> None:
        found = read_before_write(server, entry)
        if found:
            self._settings = self.settings.with_drives([_extended(self.drive(server), found)])
            self.save()
            self.unannounced.append(f"{server.label}: {entry}")
        server.saved.update(each.key for each in (*found, entry))


def _standing(server: RemoteDictionary, earlier: FoundDrive) -> FoundDrive:
    """Take what an earlier session found, but the drive's value where it has been set up anew."""
    objects = []
    for each in earlier.objects:
        present = None if each.written is None else read_if_held(server, each.entry)
        update = {"written": present}
        if present is not None and each.set_anew(present):
            server.note(f"{each.comparison(present)} and stands")
            update["value"] = present
        objects.append(each.model_copy(update=update))
    return earlier.model_copy(update={"objects": tuple(objects)})


def _present(server: RemoteDictionary, each: FoundObject) -> int | None:
    return read_if_held(server, each.entry)


def _extended(drive: FoundDrive, found: Mapping[Entry, int]) -> FoundDrive:
    """Add values to those that are kept of a drive; what is kept already stays."""
    places = {each.key for each in drive.objects}
    objects = tuple(
        FoundObject.model_validate(
            {
                "index": entry.index,
                "subindex": entry.subindex,
                "type": entry.type,
                "value": value,
                "name": entry.name,
            }
        )
        for entry, value in found.items()
        if entry.key not in places
    )
    return drive.model_copy(update={"objects": (*drive.objects, *objects), "restored": False})
