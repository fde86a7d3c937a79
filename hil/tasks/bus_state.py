"""Found settings of drives while the drives are commanded, and state of a bus between sessions.

Commands that power drives without a folder keep the found settings in the user's state directory,
in a file `.yaml` for each bus, removed after the restoration. A run keeps them in its own folder.
While its drives hold values written by the run, a file `.run` names the settings file in the
folder, so that no later session on the bus takes the written values for found settings. If the
settings file is gone or its name is damaged, the found settings are unknown, and the bus is refused
until the operator has decided. `.lock` is held by the process that commands the drives: restoring
settings during a session would disarm the watchdogs of powered axes. For the virtual plant, which
is new each time, nothing is kept and nothing is locked.
"""

from __future__ import annotations

import re
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError, read_text
from drivers.found_settings.keeping import SettingsKeeper
from drivers.found_settings.settings_file import NAME, load_found_settings
from hil.runs import SIMULATED
from hil.runs.atomic_file import file_errors, locked_bus, write_file
from hil.runs.user_state import state_folder

if TYPE_CHECKING:
    from collections.abc import Iterator


REPLAY = "replay"


class BusState:
    """Files about a bus in the user's state directory.

    Parameters
    ----------
    interface, channel : str
        Names of python-can.

    Attributes
    ----------
    settings : Path
        File of found settings for commands without a folder.
    word : Path
        File with the path of the settings kept by a run.
    """

    def __init__(self, interface: str, channel: str) -> None:
        name = re.sub(r"[^\w.-]+", "_", f"{interface}-{channel}")
        self._bus = f"{interface} {channel}"
        self._options = f"--interface {interface} --channel {channel}"
        self._folder = state_folder() / "found-settings"
        self.settings = self._folder / f"{name}.yaml"
        self.word = self._folder / f"{name}.run"
        self._lock = self._folder / f"{name}.lock"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold exclusive access to the drives of the bus, among all processes of this user.

        Raises
        ------
        FileError
            Another process has access.
        """
        self._make_folder()
        with locked_bus(self._lock, self._bus):
            yield

    def write(self, path: Path, content: bytes) -> None:
        """Write a file of the state directory, completely or not at all.

        Raises
        ------
        FileError
            The file cannot be written.
        """
        self._make_folder()
        write_file(path, content)

    def name_run(self, kept: Path) -> None:
        """Note that drives may hold values of the run with found settings in `kept`."""
        content = f"{kept.resolve()}\n".encode()
        if not self.word.exists() or self.word.read_bytes() != content:
            self.write(self.word, content)

    def forget_run(self, kept: Path) -> None:
        """Remove the note of `name_run`, after all settings in `kept` are restored."""
        word = self.word
        if word.exists() and word.read_bytes() == f"{kept.resolve()}\n".encode():
            with file_errors(word, "removed"):
                word.unlink(missing_ok=True)

    def refuse_left_behind(self, ours: Path | None) -> None:
        """Refuse a bus with drives that hold values of a killed session.

        A session with settings kept in `ours` may continue, since that file has the original
        settings.

        Raises
        ------
        FileError
            Message with the remedy.
        """
        for path in filter(None, (self._named(), None if ours is None else self.settings)):
            same = ours is not None and path == ours.resolve()
            if not same and left_behind(path):
                raise FileError(
                    f"{path}: drives on {self._bus} hold settings of an interrupted session; "
                    f"with the drives off, restore the earlier ones: {self._remedy(path)} (or "
                    "remove the file if the drives have been set up anew)"
                )

    def _named(self) -> Path | None:
        """Return the settings file named by a run; None if there is none."""
        if not self.word.exists():
            return None
        try:
            path = Path(read_text(self.word).strip())
        except FileError as error:
            raise self._damaged(str(error)) from error
        if not path.is_absolute():
            raise self._damaged(f"{self.word}: must hold the path of a file")
        if not path.exists():
            raise FileError(
                f"{path}: is missing; {self.word} names it as the file of earlier settings of "
                f"drives on {self._bus}, needed after an interrupted session; put its folder "
                f"back and, with the drives off, do {self._remedy(path)}; or remove {self.word} "
                "if the drives have been restored or set up anew"
            )
        return path

    def _damaged(self, why: str) -> FileError:
        return FileError(
            f"{why}; it names the file of earlier settings of drives on {self._bus}, needed "
            "after an interrupted session: find found-settings.yaml in the folder of the latest "
            "run on this bus and, with the drives off, do "
            f"{self._remedy('FOLDER/found-settings.yaml')}; then remove {self.word}"
        )

    def _remedy(self, path: Path | str) -> str:
        return f"hil drives restore {path} {self._options}"

    def _make_folder(self) -> None:
        with file_errors(self._folder, "made"):
            self._folder.mkdir(parents=True, exist_ok=True)


def left_behind(path: Path) -> bool:
    """Return True if drives may hold values of the session kept in a file."""
    return path.exists() and bool(load_found_settings(path).unrestored)


def kept_in(folder: Path, interface: str, channel: str) -> SettingsKeeper:
    """Return the keeper of the drives' settings in the folder of a run."""
    return SettingsKeeper(folder / NAME, write_file, (interface, channel))


@contextmanager
def keeper_of_run(folder: Path, interface: str, channel: str) -> Iterator[SettingsKeeper]:
    """Keep the drives' settings in the folder of a run; a replay has no drives.

    Raises
    ------
    FileError
        The drives hold values of a killed session, or another process commands the drives.
    """
    if interface == REPLAY:
        yield SettingsKeeper()
        return
    kept = folder / NAME
    if interface == SIMULATED:
        with _reported(kept_in(folder, interface, channel)) as keeper:
            yield keeper
        return

    state = BusState(interface, channel)

    def write(path: Path, content: bytes) -> None:
        write_file(path, content)
        state.name_run(kept)  # from here on, drives are written to

    with _session(state, SettingsKeeper(kept, write, (interface, channel)), kept) as keeper:
        try:
            yield keeper
        finally:
            if not keeper.unrestored and not left_behind(kept):
                state.forget_run(kept)


@contextmanager
def keeper_of_bus(interface: str, channel: str | None) -> Iterator[SettingsKeeper]:
    """Keep the drives' settings while a command without a folder powers the drives.

    Raises
    ------
    FileError
        The drives hold values of a killed session, or another process commands the drives.
    """
    if interface == SIMULATED:
        yield SettingsKeeper()
        return
    state = BusState(interface, channel := channel or "")
    path = state.settings
    with _session(state, SettingsKeeper(path, state.write, (interface, channel)), None) as keeper:
        try:
            yield keeper
        finally:
            if path.exists() and not keeper.unrestored and load_found_settings(path).restored:
                with file_errors(path, "removed"):
                    path.unlink(missing_ok=True)


@contextmanager
def _session(
    state: BusState, keeper: SettingsKeeper, ours: Path | None
) -> Iterator[SettingsKeeper]:
    """Command the drives of a bus alone; settings of an earlier session, but `ours`, refuse it."""
    with state.locked():
        state.refuse_left_behind(ours)
        with _reported(keeper):
            yield keeper


@contextmanager
def _reported(keeper: SettingsKeeper) -> Iterator[SettingsKeeper]:
    """State on standard error the file with settings not yet restored."""
    try:
        yield keeper
    finally:
        if keeper.unrestored and keeper.path is not None:
            sys.stderr.write(
                "not all drives have their earlier settings again; the file of these settings is "
                f"{keeper.path}: with the drives off, restore them with hil drives restore "
                f"{keeper.path}\n"
            )
