"""Saving of drive settings before each object is first written.

A `SettingsKeeper` is called before every write of a session: the first write to an object is
preceded by a read of its value. Values that start-up will overwrite are known beforehand
(`announcement`), so that they are on the disk before the first write; an object first written later
in a session is added then. If an earlier session has left a file without restoring its values,
those values are kept: the values in the drives are those of that session. But if a drive holds
neither value, another tool has configured the drive meanwhile, and the drive's value is saved.
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
    """Reader and store of drive settings before they are overwritten.

    Parameters
    ----------
    path : Path, optional
        The file; None to keep the settings in memory only.
    write : callable, optional
        ``write(path, content)`` writes a file atomically. Needed with `path`.
    bus : tuple of str, optional
        Interface and channel of the drives, for `hil drives restore`.

    Attributes
    ----------
    path : Path or None
    later : tuple of Entry
        Objects written by the session after power-on, saved with the others.
    unannounced : list of str
        Objects first written after the announcement, in words.
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
        """Settings saved so far.

        Raises
        ------
        LookupError
            Nothing has been saved yet.
        """
        if self._settings is None:
            raise LookupError("settings are kept once `open` was called")
        return self._settings

    @property
    def unrestored(self) -> bool:
        """True if a drive may still hold values of a session."""
        return self._announced and self._settings is not None and not self._settings.restored

    def open(self, drives: DrivesFile) -> None:
        """Begin a session; read the file of an earlier one.

        Raises
        ------
        FileError
            There is an unusable file.
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
            self._settings = self._settings.update_drives(earlier.unrestored)
        self._earlier = frozenset(drive.place for drive in self._settings.drives)

    def found(self, server: RemoteDictionary, entry: Entry) -> int | None:
        """Return the value of an object before any of our writes; None if missing."""
        kept = self._drive(server.place)
        for each in kept.objects if kept else ():
            if each.key == entry.key:
                present = None if each.written is None else server.find(entry)
                return present if each.was_changed(present) else each.value
        return server.find(entry)

    def take(
        self,
        server: RemoteDictionary,
        axis: AxisDrive,
        found: Mapping[Entry, int],
        planned: Mapping[Entry, int],
    ) -> None:
        """Save the values of a drive and the planned ones; an earlier session's values stay.

        Raises
        ------
        DriveRefused
            The earlier session's values belong to another drive.
        NodeSilent
            No answer.
        """
        earlier, identity = self._drive(server.place), read_identity(server)
        if earlier is not None and (differs := difference(earlier.identity, identity)):
            raise DriveRefused(
                f"{server.label}: {self.path} holds settings of another drive, not yet restored: "
                f"{differs}; connect that drive and restore its settings: hil drives restore "
                f"{self.path}, or remove the file if the drive is gone"
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
            kept = _reconcile(server, earlier)
        # planned values too, for a session killed during start-up
        values = {entry.key: value for entry, value in {**found, **planned}.items()}
        kept = _extend(kept, found).hold(lambda each: values.get(each.key, each.written))
        self._settings = self.settings.update_drives([kept])
        server.saved = {each.key for each in kept.objects}

    def announce(self, servers: Iterable[RemoteDictionary]) -> None:
        """Write the file; from now on further objects are saved at their first write.

        Raises
        ------
        FileError
            The file cannot be written.
        """
        self.save()
        self._announced = True
        for server in servers:
            self.guard(server)

    def confirm(self, servers: Iterable[RemoteDictionary]) -> None:
        """Record the values in the drives after start-up, and write the file.

        Raises
        ------
        NodeSilent
            No answer.
        FileError
            The file cannot be written.
        """
        for server in servers:
            held = self.drive(server).hold(partial(_read, server))
            self._settings = self.settings.update_drives([held])
        self.save()

    def guard(self, server: RemoteDictionary) -> None:
        """Save the value in `server` before each first write to an object."""
        server.first_write = lambda entry: self._keep(server, entry)

    def drive(self, server: RemoteDictionary) -> FoundDrive:
        """Return the saved settings of a drive.

        Raises
        ------
        LookupError
            There are none.
        """
        kept = self._drive(server.place)
        if kept is None:
            raise LookupError(f"{server.label}: nothing was kept")
        return kept

    def restore(self, server: RemoteDictionary, order: RestoringOrder) -> None:
        """Restore a drive confirmed to be off, and record that; `close` writes the file.

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
        """End a session; return messages about drives that were not restored.

        Parameters
        ----------
        servers : iterable of RemoteDictionary
            Drives of the session.
        written : collection of RemoteDictionary
            Drives that may have been written to.

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
        remedy = f": restore with hil drives restore {self.path}" if self.path else ""
        left = [server.label for server in servers if not self.drive(server).restored]
        return [
            *(f"{each} was written without having been announced" for each in self.unannounced),
            *([f"{', '.join(left)}: earlier values not restored{remedy}"] * bool(left)),
        ]

    def save(self) -> None:
        """Write the file, if there is a path.

        Raises
        ------
        FileError
            The file cannot be written.
        """
        if self.path is not None and self._write is not None:
            self._write(self.path, dump_found_settings(self.settings).encode())

    def _note_restored(self, server: RemoteDictionary) -> None:
        self._settings = self.settings.update_drives([self.drive(server).finish()])

    def _drive(self, place: tuple[int, int]) -> FoundDrive | None:
        return next((drive for drive in self.settings.drives if drive.place == place), None)

    def _keep(self, server: RemoteDictionary, entry: Entry) -> None:
        found = read_before_write(server, entry)
        if found:
            self._settings = self.settings.update_drives([_extend(self.drive(server), found)])
            self.save()
            self.unannounced.append(f"{server.label}: {entry}")
        server.saved.update(each.key for each in (*found, entry))


def _reconcile(server: RemoteDictionary, earlier: FoundDrive) -> FoundDrive:
    """Return the settings of an earlier session, with values that were changed afterwards."""
    objects = []
    for each in earlier.objects:
        present = None if each.written is None else read_if_held(server, each.entry)
        update = {"written": present}
        if present is not None and each.was_changed(present):
            server.note(f"{each.comparison(present)} and is kept")
            update["value"] = present
        objects.append(each.model_copy(update=update))
    return earlier.model_copy(update={"objects": tuple(objects)})


def _read(server: RemoteDictionary, each: FoundObject) -> int | None:
    return read_if_held(server, each.entry)


def _extend(drive: FoundDrive, found: Mapping[Entry, int]) -> FoundDrive:
    """Add values to the settings of a drive; values saved already are kept."""
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
