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


def state_file(interface: str, channel: str) -> Path:
    """Where the settings found on a bus are kept by commands without a folder of their own."""
    stated = os.environ.get(STATE, "")
    home = Path(stated) if Path(stated).is_absolute() else Path.home() / ".local" / "state"
    name = re.sub(r"[^\w.-]+", "_", f"{interface}-{channel}")
    return home / "hil" / "found-settings" / f"{name}.yaml"


def word_file(interface: str, channel: str) -> Path:
    """Where a run on a bus states in which file its drives' settings are."""
    path = state_file(interface, channel)
    return path.with_name(f"{path.stem}.run")


@contextmanager
def bus_locked(interface: str, channel: str) -> Iterator[None]:
    """Command the drives of a bus alone, among all processes of this user.

    Raises
    ------
    FileError
        Another process does.
    """
    path = state_file(interface, channel)
    lock = path.with_name(f"{path.stem}.lock")
    _make_folder(lock)
    with locked_bus(lock, f"{interface} {channel}"):
        yield


def name_run(interface: str, channel: str, kept: Path) -> None:
    """State that drives on a bus may hold values of the run that keeps the found ones in `kept`."""
    word, content = word_file(interface, channel), f"{kept.resolve()}\n".encode()
    if not word.exists() or word.read_bytes() != content:
        write_with_folder(word, content)


def forget_run(interface: str, channel: str, kept: Path) -> None:
    """Withdraw what `name_run` stated, once everything in `kept` has been put back."""
    word = word_file(interface, channel)
    if word.exists() and word.read_bytes() == f"{kept.resolve()}\n".encode():
        with file_errors(word, "removed"):
            word.unlink(missing_ok=True)


def refuse_left_behind(interface: str, channel: str, ours: Path | None) -> None:
    """Refuse a bus whose drives still hold what a session wrote that was killed.

    A session that was kept in `ours` itself may go on: there the values found first stand.

    Raises
    ------
    FileError
        With the remedy.
    """
    named, left = _named(interface, channel), []
    if named is not None:
        left.append(named)
    if ours is not None:
        left.append(state_file(interface, channel))
    for path in left:
        same = ours is not None and path == ours.resolve()
        if not same and left_behind(path):
            raise FileError(
                f"{path}: drives on {interface} {channel} hold what an earlier session wrote, which"
                " was ended before it could put back what it had found; with the drives off, put"
                f" it back: {_remedy(path, interface, channel)}"
                " (or remove the file if the drives have been set up anew)"
            )


def left_behind(path: Path) -> bool:
    """Whether drives may hold values of the session that was kept in a file."""
    return path.exists() and bool(load_found_settings(path).unrestored)


def write_with_folder(path: Path, content: bytes) -> None:
    """Write a file of the state directory, whole or not at all.

    Raises
    ------
    FileError
        It cannot be written.
    """
    _make_folder(path)
    write_file(path, content)


def _named(interface: str, channel: str) -> Path | None:
    """Return the file that a run stated; None where there is none."""
    word = word_file(interface, channel)
    if not word.exists():
        return None
    try:
        path = Path(read_text(word).strip())
    except FileError as error:
        raise _damaged(word, interface, channel, str(error)) from error
    if not path.is_absolute():
        raise _damaged(word, interface, channel, f"{word}: must hold the path of a file")
    if not path.exists():
        raise FileError(
            f"{path}: is missing, and {word} names it as the file of what drives on {interface}"
            f" {channel} held before a session that was ended before it could put that back; put"
            f" its folder back and, with the drives off, do {_remedy(path, interface, channel)}; or"
            f" remove {word} if the drives hold again what they held, or have been set up anew"
        )
    return path


def _damaged(word: Path, interface: str, channel: str, why: str) -> FileError:
    return FileError(
        f"{why}; it names the file of what drives on {interface} {channel} held before a session"
        " that was ended before it could put that back: find found-settings.yaml in the folder of"
        " the latest run on this bus and, with the drives off, do"
        f" {_remedy('FOLDER/found-settings.yaml', interface, channel)}; then remove {word}"
    )


def _remedy(path: Path | str, interface: str, channel: str) -> str:
    return f"hil drives restore {path} --interface {interface} --channel {channel}"


def _make_folder(path: Path) -> None:
    with file_errors(path.parent, "made"):
        path.parent.mkdir(parents=True, exist_ok=True)
