"""What sessions on a bus leave for the next one, in the user's state directory, by bus.

Commands without a folder keep there what they found (`.yaml`). A run has its folder; as long as its
drives hold values of ours, `.run` names the file in it, so that no later session on that bus takes
them for found ones. Where that file is gone or the name is damaged, what the drives held is not at
hand, and the bus is refused until the operator has decided. `.lock` is held by whoever commands the
drives: settings put back beside a session would disarm the watchdogs of axes with power.
"""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError, read_text
from drivers.found_settings.settings_file import load_found_settings
from hil.runs.atomic_file import file_errors, locked_bus, write_file

if TYPE_CHECKING:
    from collections.abc import Iterator

STATE = "XDG_STATE_HOME"


class BusState:
    """What stands about a bus in the user's state directory.

    Parameters
    ----------
    interface, channel : str
        As python-can has them.

    Attributes
    ----------
    settings : Path
        Where commands without a folder of their own keep the settings found on it.
    word : Path
        Where a run on it states in which file its drives' settings are.
    """

    def __init__(self, interface: str, channel: str) -> None:
        stated = os.environ.get(STATE, "")
        home = Path(stated) if Path(stated).is_absolute() else Path.home() / ".local" / "state"
        name = re.sub(r"[^\w.-]+", "_", f"{interface}-{channel}")
        self._bus = f"{interface} {channel}"
        self._options = f"--interface {interface} --channel {channel}"
        self._folder = home / "hil" / "found-settings"
        self.settings = self._folder / f"{name}.yaml"
        self.word = self._folder / f"{name}.run"
        self._lock = self._folder / f"{name}.lock"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Command the drives of the bus alone, among all processes of this user.

        Raises
        ------
        FileError
            Another process does.
        """
        self._make_folder()
        with locked_bus(self._lock, self._bus):
            yield

    def write(self, path: Path, content: bytes) -> None:
        """Write a file of the state directory, whole or not at all.

        Raises
        ------
        FileError
            It cannot be written.
        """
        self._make_folder()
        write_file(path, content)

    def name_run(self, kept: Path) -> None:
        """State that drives may hold values of the run that keeps the found ones in `kept`."""
        content = f"{kept.resolve()}\n".encode()
        if not self.word.exists() or self.word.read_bytes() != content:
            self.write(self.word, content)

    def forget_run(self, kept: Path) -> None:
        """Withdraw what `name_run` stated, once everything in `kept` has been put back."""
        word = self.word
        if word.exists() and word.read_bytes() == f"{kept.resolve()}\n".encode():
            with file_errors(word, "removed"):
                word.unlink(missing_ok=True)

    def refuse_left_behind(self, ours: Path | None) -> None:
        """Refuse a bus whose drives still hold what a session wrote that was killed.

        A session that was kept in `ours` itself may go on: there the values found first stand.

        Raises
        ------
        FileError
            With the remedy.
        """
        for path in filter(None, (self._named(), None if ours is None else self.settings)):
            same = ours is not None and path == ours.resolve()
            if not same and left_behind(path):
                raise FileError(
                    f"{path}: drives on {self._bus} hold what an earlier session wrote, which was"
                    " ended before it could put back what it had found; with the drives off, put"
                    f" it back: {self._remedy(path)} (or remove the file if the drives have been"
                    " set up anew)"
                )

    def _named(self) -> Path | None:
        """Return the file that a run stated; None where there is none."""
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
                f"{path}: is missing, and {self.word} names it as the file of what drives on"
                f" {self._bus} held before a session that was ended before it could put that back;"
                f" put its folder back and, with the drives off, do {self._remedy(path)}; or"
                f" remove {self.word} if the drives hold again what they held, or have been set up"
                " anew"
            )
        return path

    def _damaged(self, why: str) -> FileError:
        return FileError(
            f"{why}; it names the file of what drives on {self._bus} held before a session that"
            " was ended before it could put that back: find found-settings.yaml in the folder of"
            " the latest run on this bus and, with the drives off, do"
            f" {self._remedy('FOLDER/found-settings.yaml')}; then remove {self.word}"
        )

    def _remedy(self, path: Path | str) -> str:
        return f"hil drives restore {path} {self._options}"

    def _make_folder(self) -> None:
        with file_errors(self._folder, "made"):
            self._folder.mkdir(parents=True, exist_ok=True)


def left_behind(path: Path) -> bool:
    """Whether drives may hold values of the session that was kept in a file."""
    return path.exists() and bool(load_found_settings(path).unrestored)
