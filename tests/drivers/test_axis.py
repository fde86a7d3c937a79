"""Drives file and its conversion factors."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stated_axis import axis, drives

from checked_files.yaml_file import FileError, parse_yaml
from drivers.axis import AxisScale
from drivers.drives_file import DrivesFile, load_drives

MANUTEC = Path(__file__).parents[2] / "hil" / "robots" / "manutec-r15.drives.yaml"


def scale(**changes: Any) -> AxisScale:
    return AxisScale.derive(drives(axis(**changes)).axes[0])


def current(basis: str, amplitude: str | None = "peak") -> dict[str, Any]:
    return {"index": 0x6078, "type": "i16", "basis": basis, "amplitude": amplitude}


AXES = st.builds(
    axis,
    gear_ratio=st.floats(1, 300),
    sign=st.sampled_from([-1, 1]),
    zero=st.integers(-100_000, 100_000),
    increments_per_revolution=st.integers(256, 65_536),
    velocity_unit=st.sampled_from(["inc/s", "rpm", "0.1 rpm"]),
    acceleration_unit=st.sampled_from(["inc/s^2", "rpm/s", "0.1 rpm/s"]),
)


@given(AXES, st.floats(-10, 10))
def test_a_position_comes_back_within_half_an_increment(stated: dict[str, Any], q: float) -> None:
    s = AxisScale.derive(drives(stated).axes[0])
    back = s.position_from_counts(float(s.position_to_counts(q)))
    assert abs(back - q) <= 0.5 * abs(s.position) * (1 + 1e-6)


@given(AXES, st.integers(-(2**30), 2**30))
def test_every_count_comes_back_exactly(stated: dict[str, Any], counts: int) -> None:
    s = AxisScale.derive(drives(stated).axes[0])
    assert s.position_to_counts(s.position_from_counts(float(counts))) == counts


@given(AXES, st.floats(0.001, 10))
def test_velocities_and_accelerations_are_never_rounded_up_and_lose_less_than_a_count(
    stated: dict[str, Any], value: float
) -> None:
    s = AxisScale.derive(drives(stated).axes[0])
    for counts, unit in (
        (s.velocity_to_counts(value), s.velocity),
        (s.acceleration_to_counts(value), s.acceleration),
    ):
        assert value - unit * (1 + 1e-6) <= counts * unit <= value * (1 + 1e-8)


@given(st.lists(st.integers(-30_000, 30_000), min_size=1, max_size=20))
def test_arrays_scale_as_their_elements_do(counts: list[int]) -> None:
    s = scale(sign=-1, zero=77)
    array = np.array(counts, dtype=float)
    assert s.position_from_counts(array).tolist() == [
        s.position_from_counts(float(c)) for c in counts
    ]
    assert s.torque_from_counts(array).tolist() == [s.torque_from_counts(float(c)) for c in counts]


def test_a_motor_turn_is_two_pi_over_the_gear_ratio() -> None:
    s = scale(gear_ratio=50, zero=1000)
    assert s.position_from_counts(1000.0 + 4096) == pytest.approx(2 * math.pi / 50)


def test_the_sign_turns_position_and_torque_alike() -> None:
    forth, back = scale(sign=1), scale(sign=-1)
    assert forth.position_from_counts(100.0) == -back.position_from_counts(100.0)
    assert forth.torque_from_counts(100.0) == -back.torque_from_counts(100.0)


def test_the_sign_of_the_current_turns_torque_alone() -> None:
    basis = "per mille of rated current"
    with_it, against = scale(), scale(current={**current(basis), "sign": -1})
    assert against.position_from_counts(100.0) == with_it.position_from_counts(100.0)
    assert against.torque_from_counts(100.0) == -with_it.torque_from_counts(100.0)
    assert against.torque_limit == with_it.torque_limit


def test_per_mille_of_rated_current_is_torque_through_torque_constant_and_gear() -> None:
    assert scale().torque_from_counts(1000.0) == pytest.approx(2.0 * 0.5 * 100)


def test_milliamperes_need_no_rated_current() -> None:
    assert scale(current=current("mA")).torque_from_counts(2000.0) == pytest.approx(2.0 * 0.5 * 100)


def test_per_mille_of_rated_torque_needs_no_torque_constant() -> None:
    s = scale(
        current=current("per mille of rated torque", None),
        torque_constant=None,
        torque_constant_amplitude=None,
    )
    assert s.torque_from_counts(500.0) == pytest.approx(0.5 * 3.0 * 100)


@pytest.mark.parametrize(
    ("readback", "constant", "factor"),
    [("rms", "peak", math.sqrt(2)), ("peak", "rms", math.sqrt(0.5)), ("rms", "rms", 1.0)],
)
def test_rms_and_peak_are_a_factor_of_root_two_apart(
    readback: str, constant: str, factor: float
) -> None:
    s = scale(
        current=current("per mille of rated current", readback), torque_constant_amplitude=constant
    )
    assert s.torque_from_counts(1000.0) == pytest.approx(factor * 100)


def test_revolutions_per_minute_are_those_of_the_motor() -> None:
    s = scale(velocity_unit="rpm", acceleration_unit="0.1 rpm/s")
    turns_per_minute = 1.5 * 100 / (2 * math.pi) * 60
    assert s.velocity_to_counts(1.5) == math.floor(turns_per_minute)
    assert s.acceleration_to_counts(1.5) == math.floor(10 * turns_per_minute)


def test_the_torque_limit_is_in_per_mille_of_rated_torque() -> None:
    assert scale().torque_limit_to_counts(450.0) == 1500


def test_a_prismatic_axis_is_scaled_by_its_radians_per_metre() -> None:
    s = scale(joint="prismatic", gear_ratio=2 * math.pi / 0.01)
    assert s.position_from_counts(4096.0) == pytest.approx(0.01)


def test_the_packaged_drives_give_peak_torque_at_three_times_rated() -> None:
    packaged = load_drives(MANUTEC)
    assert [a.node for a in packaged.axes] == [1, 2, 3, 4, 5, 6]
    peaks = [abs(AxisScale.derive(a).torque_from_counts(3000.0)) for a in packaged.axes]
    assert peaks == pytest.approx([945, 1890, 540, 210, 186, 75], rel=2e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"limits": {**axis()["limits"], "q_min": 3}}, "q_min = 3 must be below q_max = 2"),
        ({"gear_ratio": -100}, "greater than 0"),
        ({"sign": 0}, "1"),
        ({"node": 0}, "greater than or equal to 1"),
        ({"torque_constant": None}, "torque_constant is missing"),
        ({"current": current("mA", None)}, "current.amplitude is missing"),
        ({"current": current("per cent")}, "per mille of rated current"),
        ({"zero": 2_000_000_000, "gear_ratio": 1e6}, "beyond 32 bits of increments"),
        ({"velocity_unit": "furlong/s"}, "'furlong/s' is not a unit of velocities; .* 0.1 rpm"),
        ({"velocity_unit": "0 rpm"}, "'0' must be a positive number or ratio"),
        ({"acceleration_unit": "rpm"}, "'rpm' is not a unit of accelerations"),
        ({"acceleration_unit": "mm/s^2"}, "mm/s.2 is a unit of lengths and the joint is revolute"),
        ({"increments_per_revolution": "360000/0"}, "such as 360000/101"),
        ({"increments_per_revolution": -4096}, "'-4096' must be a positive number or ratio"),
        ({"increments_per_revolution": True}, "'True' must be a positive number"),
        ({"increments_per_revolution": 2**31}, "must be at most 2147483647"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_an_axis_that_makes_no_sense_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        drives(axis(**changes))


def test_two_axes_on_one_node_are_refused() -> None:
    with pytest.raises(ValueError, match="node 2 of 'elbow' is also that of 'shoulder'"):
        drives(axis(), axis(name="elbow"))


def test_an_axis_on_the_masters_node_is_refused() -> None:
    with pytest.raises(ValueError, match="also that of the master"):
        drives(axis(), master_node=2)


def test_a_heartbeat_timeout_that_one_lost_frame_would_exceed_is_refused() -> None:
    with pytest.raises(ValueError, match="must be at least twice heartbeat_period"):
        drives(axis(), heartbeat_period=0.1, heartbeat_timeout=0.15)


def test_a_mistake_in_the_file_is_told_with_its_line() -> None:
    text = MANUTEC.read_text(encoding="utf-8").replace("sign: -1", "sign: 2", 1)
    line = text.splitlines().index("    sign: 2") + 1
    with pytest.raises(FileError, match=rf"^drives.yaml:{line}: axes.2.sign: "):
        parse_yaml(text, DrivesFile, "drives.yaml")
