"""Drives whose positions wrap around within the limits of their axes (607B)."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any
from unittest.mock import Mock, call

import numpy as np
import pytest
import yaml
from personalities import drives_for, plant_file

from drivers.axis import Wrap, unwrap_positions
from drivers.drive_bus import DriveRefused, Move, Tripped
from drivers.opening import open_drive_bus
from sim_plant.personality import load_personality

if TYPE_CHECKING:
    from canopen_drive_bus import CanopenDriveBus


OFF = [{"index": 0x607D, "subindex": subindex, "default": 0} for subindex in (1, 2)]
"""No software limits."""


def turning(folder: Path, name: str = "turning", **changes: Any) -> CanopenDriveBus:
    """Return the bus of six drives with wrapping positions, possibly with further deviations."""
    channel = Path(plant_file(folder, name))
    if changes:
        data = load_personality("turning").model_dump(mode="json") | changes
        own = folder / "own.yaml"
        own.write_text(yaml.safe_dump(data))
        content = yaml.safe_load(channel.read_text())
        for axis in content["axes"]:
            axis["drive"]["personality"] = str(own)
        channel.write_text(yaml.safe_dump(content))
    return open_drive_bus(drives_for(name), "sim_plant", str(channel))


def gone(bus: CanopenDriveBus, *targets: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and torques of all axes on their way to targets."""
    bus.move({axis: Move(q, 1.0, 5.0) for axis, q in enumerate(targets)})
    samples = [bus.sample()]
    while not samples[-1].reached:
        samples.append(bus.sample())
        assert len(samples) < 2500
    return np.array([s.q for s in samples]), np.array([s.tau for s in samples])


@pytest.mark.parametrize("place", [-7, 0, 5, 99, 100, 123])
def test_each_position_is_one_place_of_the_axis(place: int) -> None:
    wrap = Wrap(low=20, size=150, first=-20)
    assert 20 <= wrap.wrap(place) < 170
    assert wrap.unwrap(wrap.wrap(place)) == place


def test_every_target_goes_out_within_the_range_of_its_drive() -> None:
    inner, wrap = Mock(), Wrap(low=20, size=150, first=-20)
    there = unwrap_positions(inner, [SimpleNamespace(wrap=wrap), SimpleNamespace(wrap=None)])
    there.lead(0, -7)
    there.command(0, -7, 0x1F)
    there.lead(1, -7)
    assert inner.lead.call_args_list == [call(0, 143), call(1, -7)]
    assert inner.command.call_args_list == [call(0, 143, 0x1F)]


def test_axes_pass_the_end_of_the_range_as_if_there_were_none(tmp_path: Path) -> None:
    ways = []
    for name in ("turning", "cyclic-only"):
        with turning(tmp_path, name) as bus:
            q, _ = gone(bus, *[0.3, -0.4, 0.5, -0.6, 0.7, -0.8])
            back, _ = gone(bus, *[-0.2] * 6)
            ways.append(np.vstack([q, back]))
            if name == "turning":
                assert min(bus._session.connection.process_data._inner.positions) > 0
                assert min(bus._session.connection.process_data.positions) < 0
                assert (
                    sum("the driver plans all motion, and only the driver" in n for n in bus.notes)
                    == 6
                )
    assert ways[0] == pytest.approx(ways[1], abs=1e-9)
    assert np.abs(np.diff(ways[0], axis=0)).max() < 0.01


def test_an_axis_that_leaves_its_way_beyond_the_end_of_the_range_is_stopped(
    tmp_path: Path,
) -> None:
    with turning(tmp_path) as bus:
        gone(bus, *[-0.1] * 6)
        bus.move({axis: Move(0.3, 1.0, 5.0) for axis in range(6)})
        bus._session._cyclic_position._highs = [[-6000] * 6] * 5000
        with pytest.raises(Tripped, match=r"at -0\.0\d+ rad, outside"):
            list(iter(bus.sample, None))
        bus.reset()
        q, _ = gone(bus, *[0.1] * 6)
        assert q[-1] == pytest.approx([0.1] * 6, abs=2e-3)


def test_a_range_that_leaves_an_axis_no_room_beyond_its_limits_is_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(
            DriveRefused, match=r"take \d+ of 600001 positions, so the place of the axis"
        ),
        turning(tmp_path, position_range=[0, 600_000]),
    ):
        pass


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (
            {"objects": [*OFF, {"index": 0x6502, "default": 1}]},
            r"no cyclic synchronous position mode \(6502 = 00000001h",
        ),
        (
            {
                "objects": [
                    {"index": 0x607D, "subindex": 1, "default": 0},
                    {"index": 0x607D, "subindex": 2, "default": 400_000},
                ]
            },
            r"software limits \(607D\) \[0, 400000\] cut positions that wrap around",
        ),
    ],
)
def test_drives_that_could_not_be_led_around_are_refused(
    tmp_path: Path, changes: dict[str, Any], reason: str
) -> None:
    with pytest.raises(DriveRefused, match=reason), turning(tmp_path, **changes):
        pass
