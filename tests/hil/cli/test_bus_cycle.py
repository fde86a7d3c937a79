"""Bus cycle in a dry run, from the drives file and the streamed data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from personalities import drives_for

from drivers.canopen.sync_rate import frame_bits
from hil.planning.trajectory import Trajectory
from hil.tasks.measuring import bus_cycle

if TYPE_CHECKING:
    from hil.planning.plan import Plan

RATE = 1_000_000


def test_worst_frames_have_135_and_55_bits() -> None:
    assert (frame_bits(8), frame_bits(0)) == (135, 55)


def test_six_tpdos_of_eight_bytes_take_22_percent_of_1_mbit_at_250_hz(small_plan: Plan) -> None:
    found = bus_cycle(small_plan, 6, drives_for("plain"))
    assert found.duration == pytest.approx((55 + 6 * 135) / RATE)
    assert found.duration / 0.004 == pytest.approx(0.216, abs=0.003)
    assert found.frames == "SYNC, 6 TPDOs by the drives file"


def test_currents_of_32_bits_need_a_second_tpdo_an_axis(small_plan: Plan) -> None:
    found = bus_cycle(small_plan, 6, drives_for("int32-current"))
    assert found.frames == "SYNC, 12 TPDOs by the drives file"
    assert found.duration > bus_cycle(small_plan, 6, drives_for("plain")).duration


def test_a_trajectory_adds_a_set_point_of_six_bytes_an_axis(small_plan: Plan) -> None:
    still = Trajectory(id="t", q=(0.0,) * 6, period=5.0, sine=((0.0,) * 2,) * 6,
                       cosine=((0.0,) * 2,) * 6, cycles=1)  # fmt: skip
    streamed = small_plan.model_copy(update={"measurements": (still,)})
    more = bus_cycle(streamed, 6, drives_for("plain"))
    less = bus_cycle(small_plan, 6, drives_for("plain"))
    assert more.duration - less.duration == pytest.approx(6 * frame_bits(6) / RATE)


def test_without_a_drives_file_one_full_tpdo_an_axis_is_assumed_and_stated(
    small_plan: Plan,
) -> None:
    found = bus_cycle(small_plan, 6, None, 250_000)
    assert found.duration == pytest.approx((55 + 6 * 135) / 250_000)
    assert "assumed without a drives file" in found.frames


def test_another_bit_rate_may_be_asked_for(small_plan: Plan) -> None:
    assert bus_cycle(small_plan, 6, drives_for("plain"), 500_000).bitrate == 500_000
