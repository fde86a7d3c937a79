"""Messages to the operator about a slow drive, a full disk and a missing adapter."""

from __future__ import annotations

import can
import pytest
from local_bench import build

from checked_files.yaml_file import FileError
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.sdo import server_of
from drivers.cia402.objects import STATUSWORD
from drivers.drive_bus import BusUnavailable, NodeSilent
from drivers.session.connection import Place


class Failing(can.BusABC):
    """Bus whose receptions all fail."""

    def __init__(self, error: Exception) -> None:
        self.error, self.channel_info = error, "bench"
        super().__init__("bench")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        pass

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        raise self.error


def test_a_drive_that_does_not_answer_in_time_names_the_key_to_lengthen() -> None:
    with can.Bus("nobody", "virtual", ignore_config=True) as bus:
        server = server_of(PumpedNetwork(bus, synchronous=False), Place(5, "wrist"), 0.02)
        with pytest.raises(NodeSilent, match=r"none within sdo_timeout, 0\.02 s\); .* sdo_timeout"):
            server.get(STATUSWORD)


def test_a_full_disk_names_the_file_and_not_the_cable() -> None:
    error = FileError("run/frames.log: cannot be written: No space left on device")
    with Failing(error) as bus, pytest.raises(BusUnavailable) as caught:
        PumpedNetwork(bus, synchronous=False).receive(0.0)
    assert str(caught.value) == str(error)


def test_an_adapter_that_is_gone_is_stated_once_for_all_axes() -> None:
    can_bus, drive_bus = build()

    def gone(*_: object) -> None:
        raise can.CanOperationError("No such device")

    with can_bus:
        with pytest.raises(BusUnavailable) as caught, drive_bus:  # noqa: PT012 - a session
            drive_bus.sample()
            can_bus.send = gone
            can_bus.recv = gone
            drive_bus.sample()
        text = "\n".join([str(caught.value), *caught.value.__notes__])
    assert text.count("No such device") == 1
    assert text.count("does not switch off") == 1
    assert "joint 1 (node 1), joint 2 (node 2), joint 3 (node 3): does not switch off" in text
