"""Permitted and refused differences between a written value and its readback."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from local_bench import build, drives_file, never_energised

from drivers.canopen import objects as cia301
from drivers.canopen.rules import REQUIREMENTS
from drivers.cia402 import objects
from drivers.commissioning.configure import make_judge
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from drivers.remote_dictionary import Judge

TIMEOUT = 127 << 16 | 500
"""Consumer heartbeat (1016) of 0.5 s for our heartbeat, as in the drives file."""


@pytest.fixture
def judge() -> Judge:
    """Judge of readbacks of joint 1, with heartbeat period 0.1 s and time-out 0.5 s."""
    drives = drives_file()
    return make_judge(drives.axes[0], drives, REQUIREMENTS)


@pytest.mark.parametrize(
    ("entry", "written", "kept"),
    [
        (objects.MAX_PROFILE_VELOCITY, 32594, 32592),
        (objects.MAX_PROFILE_VELOCITY, 32594, 20000),
        (objects.MAX_PROFILE_VELOCITY, 32594, 32900),
        (objects.MAX_ACCELERATION, 100000, 1000),
        (objects.FOLLOWING_ERROR_WINDOW, 3000, 2000),
        (objects.QUICK_STOP_DECELERATION, 100000, 99100),
        (objects.MAX_TORQUE, 3000, 2980),
        (objects.SOFTWARE_LIMIT_MIN, -5000, -4000),
        (objects.SOFTWARE_LIMIT_MIN, -5000, -5001),
        (objects.SOFTWARE_LIMIT_MAX, 5000, 4992),
        (cia301.PRODUCER_HEARTBEAT, 100, 128),
        (cia301.PRODUCER_HEARTBEAT, 100, 250),
        (cia301.PRODUCER_HEARTBEAT, 100, 64),
        (cia301.CONSUMER_HEARTBEAT, TIMEOUT, 127 << 16 | 512),
        (cia301.CONSUMER_HEARTBEAT, TIMEOUT, 127 << 16 | 750),
        (cia301.CONSUMER_HEARTBEAT, TIMEOUT, 127 << 16 | 200),
    ],
)
def test_what_is_rounded_or_lies_on_the_safe_side_is_accepted(
    entry: Any, written: int, kept: int, judge: Judge
) -> None:
    assert judge(entry, written, kept)[0]


@pytest.mark.parametrize(
    ("entry", "written", "kept"),
    [
        (objects.MAX_PROFILE_VELOCITY, 32594, 33000),
        (objects.MAX_PROFILE_VELOCITY, 32594, 0xFFFFFFFF),
        (objects.MAX_PROFILE_VELOCITY, 32594, 0),
        (objects.MAX_ACCELERATION, 100000, 110000),
        (objects.FOLLOWING_ERROR_WINDOW, 3000, 4000),
        (objects.FOLLOWING_ERROR_WINDOW, 3000, 0),
        (objects.QUICK_STOP_DECELERATION, 100000, 50000),
        (objects.MAX_DECELERATION, 100000, 50000),
        (objects.MAX_TORQUE, 3000, 1000),
        (objects.MAX_TORQUE, 3000, 3100),
        (objects.SOFTWARE_LIMIT_MIN, -5000, -5002),
        (objects.SOFTWARE_LIMIT_MAX, 5000, 5008),
        (cia301.PRODUCER_HEARTBEAT, 100, 251),
        (cia301.PRODUCER_HEARTBEAT, 100, 0),
        (cia301.CONSUMER_HEARTBEAT, TIMEOUT, 127 << 16),
        (cia301.CONSUMER_HEARTBEAT, TIMEOUT, 127 << 16 | 751),
        (cia301.CONSUMER_HEARTBEAT, TIMEOUT, 127 << 16 | 199),
        (cia301.CONSUMER_HEARTBEAT, TIMEOUT, 1 << 16 | 500),
        (objects.QUICK_STOP_OPTION, 2, 1),
    ],
)
def test_what_lies_on_the_unsafe_side_is_not_accepted(
    entry: Any, written: int, kept: int, judge: Judge
) -> None:
    assert not judge(entry, written, kept)[0]


@pytest.mark.parametrize(
    ("place", "kept", "words"),
    [
        ((0x607F, 0), 200000, "607F:00 .* reads back 200000 after 130379 was written .*rad/s"),
        ((0x6065, 0), 100000, "6065:00 .* reads back 100000 after 3259 was written .*rad instead"),
        ((0x1017, 0), 500, "1017:00 .* reads back 500 after 100 was written; "),
        ((0x1016, 1), 127 << 16, "1016:01 .*reads back .* keeps moving after a crash"),
        ((0x607D, 2), 200000, "607D:02 .* reads back 200000 after 130380 was written .*rad inst"),
    ],
)
def test_a_drive_that_keeps_an_unsafe_value_is_refused(
    place: tuple[int, int], kept: int, words: str
) -> None:
    can_bus, drive_bus = build()
    can_bus.drives[1].insists[place] = kept
    with can_bus:
        with pytest.raises(DriveRefused, match=f"^joint 1 .*{words}"):
            drive_bus.__enter__()
        assert never_energised(can_bus)


def test_what_the_drive_keeps_is_at_hand_for_the_checks_of_motions() -> None:
    can_bus, drive_bus = build()
    can_bus.drives[1].insists[0x607F, 0] = 100000
    with can_bus, drive_bus:
        kept = [server.kept[objects.MAX_PROFILE_VELOCITY] for server in drive_bus.servers]
    assert kept == [100000, 130379, 130379]
    note = "joint 1 (node 1): the drive's own max profile velocity (607F) is 1.534 rad/s, tighter"
    assert [n for n in drive_bus.notes if n.startswith(note)]


def test_a_reaction_that_is_silently_another_but_stops_the_axis_is_noted() -> None:
    can_bus, drive_bus = build()
    can_bus.drives[1].insists[0x605A, 0] = 6
    with can_bus, drive_bus:
        pass
    assert any("6 instead of 2 in object 605A:00" in note for note in drive_bus.notes)
