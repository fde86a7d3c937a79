"""End of a session with drives that never had power: unconfirmed drives keep their watchdog."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from checked_files.yaml_file import FileError
from drivers.drive_bus import DriveRefused
from drivers.session.servo_axes import leave

if TYPE_CHECKING:
    import pytest


class Server:
    """Drive with nothing but a name and a node number."""

    def __init__(self, label: str) -> None:
        self.label, self.node = label, int(label.rsplit(maxsplit=1)[-1])


class Drives:
    """Two drives, one of which does not switch off; calls are recorded."""

    def __init__(self, stays_on: str) -> None:
        self.log: list[str] = []
        self.stays_on = stays_on
        self.servers = [Server(f"drive {n}") for n in (1, 2)]
        self.written = self.servers
        self.power = self
        self.life_sign = SimpleNamespace(
            name="our heartbeat", cease=lambda: self.log.append("ceased"), trouble=None
        )

    def switch_off(self, server: Server) -> None:
        if server.label == self.stays_on:
            raise DriveRefused("it does not take the command")

    def restore(self, server: Server, order: object) -> None:
        del order
        self.log.append(f"{server.label} put back")

    def close(self, servers: object, written: object) -> list[str]:
        del servers, written
        return ["kept"]


def left(drives: Any) -> Any:
    return leave(drives, None, drives, drives)


def test_only_drives_that_are_shown_to_be_off_get_their_settings_back() -> None:
    drives = Drives(stays_on="drive 1")
    outcome = left(drives)
    assert drives.log == ["ceased", "drive 2 put back"]
    assert [server.label for server in outcome.off] == ["drive 2"]
    assert not outcome.complete
    assert "press the emergency stop" in outcome.message
    assert "drive 1: not shown to be off" in outcome.message
    assert "its watchdog stays armed and our heartbeat has stopped" in outcome.message


def test_where_all_are_off_nothing_ceases_and_nothing_is_wrong() -> None:
    drives = Drives(stays_on="nobody")
    outcome = left(drives)
    assert drives.log == ["drive 1 put back", "drive 2 put back"]
    assert (outcome.complete, outcome.message, outcome.notes) == (True, "", ["kept"])


def test_a_disk_that_takes_nothing_is_noted_and_keeps_nobody_from_leaving(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drives = Drives(stays_on="nobody")

    def full(*_: object) -> list[str]:
        raise FileError("the disk is full")

    monkeypatch.setattr(drives, "close", full)
    assert left(drives).notes == ["the disk is full"]
