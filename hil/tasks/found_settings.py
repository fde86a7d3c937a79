"""Storage of the drives' found settings while the drives are commanded.

A run keeps the settings in its folder. Commands that power drives without a folder keep them in the
user's state directory (`bus_state`), in a file per bus, removed after the restoration. The process
that commands the drives of a bus holds its lock. For the virtual plant, which is new each time,
nothing is kept and nothing is locked.
"""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from drivers.found_settings.keeping import SettingsKeeper
from drivers.found_settings.settings_file import NAME, load_found_settings
from hil.runs import SIMULATED
from hil.runs.atomic_file import file_errors, write_file
from hil.tasks.bus_state import BusState, left_behind

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

REPLAY = "replay"


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

    with state.locked():
        state.refuse_left_behind(kept)
        with _reported(SettingsKeeper(kept, write, (interface, channel))) as keeper:
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
    with state.locked():
        state.refuse_left_behind(None)
        with _reported(SettingsKeeper(path, state.write, (interface, channel))) as keeper:
            try:
                yield keeper
            finally:
                if path.exists() and not keeper.unrestored and load_found_settings(path).restored:
                    with file_errors(path, "removed"):
                        path.unlink(missing_ok=True)


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
