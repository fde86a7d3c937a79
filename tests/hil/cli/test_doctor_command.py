"""`hil doctor`: verdict and remedy for each property of a computer; the readings are simulated."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from hil.cli import doctor
from hil.cli.doctor import CanInterface, Readings, judge

if TYPE_CHECKING:
    from command_line import Hil

GOOD = Readings(
    python=(3, 12, 1),
    system="Linux",
    socketcan=True,
    vcan=True,
    interfaces=(CanInterface("can0", up=True, bitrate=1_000_000),),
    administrator=False,
    priority=99,
    resolution=1e-9,
    folder="runs",
    disk=50e9,
    writable=True,
    memory=8e9,
    extras={"pandas": False},
)


def test_a_computer_that_is_fit_has_nothing_to_do() -> None:
    points = judge(GOOD)
    assert {each.word for each in points} == {"OK"}
    assert not any(each.remedy for each in points)
    assert "up at 1000 kbit/s" in [each.found for each in points]


DOWN = (CanInterface("can0", up=False, bitrate=None),)
VIRTUAL = (CanInterface("vcan0", up=False, bitrate=None, virtual=True),)


@pytest.mark.parametrize(
    ("change", "point", "word", "remedy"),
    [
        ({"python": (3, 10, 2)}, "Python", "FAIL", "Python 3.11 or later"),
        ({"socketcan": False}, "kernel", "WARN", "modprobe can_raw"),
        ({"socketcan": False, "system": "Darwin"}, "kernel", "WARN", "python-can interface"),
        ({"interfaces": ()}, "CAN interfaces", "WARN", "ip link"),
        ({"interfaces": DOWN}, "can0", "WARN", "ip link set can0 up type can bitrate 1000000"),
        ({"interfaces": VIRTUAL}, "vcan0", "WARN", "ip link set vcan0 up"),
        ({"interfaces": DOWN}, "rights", "WARN", "administrator"),
        ({"priority": 0}, "real-time priority", "WARN", "rtprio 40"),
        ({"resolution": 0.01}, "clock", "FAIL", "high-resolution timers"),
        ({"disk": 1e9}, "disk", "WARN", "free up space"),
        ({"disk": 1e6}, "disk", "FAIL", "free up space"),
        ({"writable": False}, "disk", "FAIL", "another folder"),
        ({"memory": 1e8}, "memory", "FAIL", "end other programs"),
    ],
)
def test_what_hinders_measuring_is_stated_with_what_to_do(
    change: dict[str, object], point: str, word: str, remedy: str
) -> None:
    found = {each.point: each for each in judge(replace(GOOD, **change))}[point]  # type: ignore[arg-type]
    assert found.word == word
    assert remedy in found.remedy


@pytest.mark.parametrize(("disk", "status"), [(50e9, 0), (1e9, 0), (0.0, 1)])
def test_the_exit_status_is_1_only_where_a_point_fails(
    hil: Hil, monkeypatch: pytest.MonkeyPatch, disk: float, status: int
) -> None:
    monkeypatch.setattr(doctor, "read_computer", lambda *_: replace(GOOD, disk=disk))
    left, out, _ = hil("doctor")
    assert left == status
    assert ("FAIL  disk" in out) == bool(status)


def test_the_points_of_this_computer_are_written_as_json(hil: Hil) -> None:
    _, out, _ = hil("doctor", "--json")
    points = json.loads(out)["points"]
    assert {"Python", "disk", "memory", "clock"} <= {each["point"] for each in points}
