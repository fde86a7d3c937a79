"""Frames to slaves and back: lost frames are repeated, a dead line fails quickly."""

from __future__ import annotations

import pytest

from drivers.drive_bus import BusUnavailable
from drivers.ethercat.line import ATTEMPTS, Line


class Cable:
    """Cable that loses frames, or returns them unchanged."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.lost = 0

    def send(self, frame: bytes | bytearray) -> bool:
        self.sent.append(bytes(frame))
        return True

    def receive(self, timeout: float) -> bytes | None:
        self.lost -= 1
        return None if self.lost >= 0 else self.sent[-1]

    def close(self) -> None:
        pass


def asked(line: Line, cable: Cable) -> int:
    """Return the number of frames of a request."""
    before = len(cable.sent)
    try:
        line.read_all(0x130, 2)
    except BusUnavailable:
        assert cable.lost >= 0
    return len(cable.sent) - before


@pytest.mark.parametrize("lost", [0, 1, ATTEMPTS - 1])
def test_what_is_lost_is_asked_again(lost: int) -> None:
    cable = Cable()
    cable.lost = lost
    assert asked(Line(cable), cable) == lost + 1


def test_a_line_that_no_frame_came_back_of_is_asked_once_until_one_does() -> None:
    cable = Cable()
    line, cable.lost = Line(cable), 1000
    assert [asked(line, cable) for _ in range(3)] == [ATTEMPTS, 1, 1]
    cable.lost = 0
    assert asked(line, cable) == 1
    cable.lost = 3
    assert asked(line, cable) == 4
