"""Unit of the current and direction of the joint, from gravity, friction and the ratio of two
objects.
"""

from __future__ import annotations

import math
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import can
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from probing_bench import AlteredBus, Scripted, drives_of, unaltered
from stated_axis import axis, drives

from drivers.canopen.bus import CanopenBus
from drivers.commissioning.verdict import Grade
from drivers.drive_bus import Move
from drivers.operator_tools.check import check
from drivers.operator_tools.check_motion import Moved, judge_direction
from drivers.operator_tools.check_powered import NEAR, SmallMoves, judge_current_unit
from drivers.operator_tools.small_move import Stroke
from hil.ground_truth.true_parameters import true_parameters
from hil.model.dynamics import gravity_torque

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from drivers.commissioning.verdict import Verdict
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.operator_tools.check_motion import Gravity
    from hil.model.robot import Robot

MOVES = SmallMoves(angle=math.radians(2), angular_velocity=math.radians(5))
BASES = ("mA", "per mille of rated current", "per mille of rated torque")
UNIT, DIRECTION = "unit of the current", "direction of the joint"


@contextmanager
def plant(**options: str) -> Iterator[AlteredBus]:
    with (
        can.Bus("manutec-r15", "sim_plant", ignore_config=True, **options) as inner,
        AlteredBus(inner, unaltered) as bus,
    ):
        yield bus


def verdicts(
    drives_file: DrivesFile, check_: str, gravity: Gravity | None = None, **options: str
) -> list[Verdict]:
    """Return one check's verdict for each axis, from a whole `hil drives check`."""
    with plant(**options) as bus:
        found = list(check(CanopenBus(bus), drives_file, MOVES, Scripted(), gravity=gravity))
        assert bus.left_off
    return [verdict for verdict in found if verdict.check == check_]


def stated(*axes: int, basis: str) -> DrivesFile:
    current = drives_of(1).axes[0].current.model_dump() | {"basis": basis}
    return drives_of(*axes, current=current)


@pytest.fixture
def torqueless(tmp_path: Path) -> str:
    """Personality with current in mA and without a torque object."""
    path = tmp_path / "alone.yaml"
    path.write_text("name: alone\ncurrent: {unit: mA}\nmissing: [0x6077]\n")
    return str(path)


def test_the_unit_that_the_file_states_is_confirmed_on_every_axis() -> None:
    for basis, options in ((BASES[1], {}), (BASES[0], {"personality": "milliampere"})):
        found = verdicts(stated(1, 2, 3, basis=basis), UNIT, **options)
        assert [v.grade for v in found] == [Grade.OK] * 3
        assert all("confirmed" in v.found for v in found)


@pytest.mark.parametrize(
    ("stated_as", "options", "remedy"),
    [
        (BASES[1], {"personality": "milliampere"}, "set basis: mA"),
        (BASES[0], {}, "set basis: per mille of rated current or per mille of rated torque"),
    ],
)
def test_a_current_in_another_unit_than_stated_is_refused_with_the_unit_that_fits(
    stated_as: str, options: dict[str, str], remedy: str
) -> None:
    found = verdicts(stated(1, 2, basis=stated_as), UNIT, **options)
    assert [v.grade for v in found] == [Grade.REFUSED] * 2
    assert all("contradicts" in v.found and v.remedy == remedy for v in found)


def test_without_the_torque_beside_it_the_load_that_no_motor_holds_tells(
    torqueless: str,
) -> None:
    # joint 2 holds its arm with 90 % of the rated torque; mA taken for per mille give 233 %
    light, heavy = verdicts(stated(1, 2, basis=BASES[1]), UNIT, personality=torqueless)
    assert "undecided" in light.found
    assert "contradicts" in heavy.found
    assert heavy.grade is Grade.WARNING
    assert "plausible as mA" in heavy.remedy


def one_axis(**changes: Any) -> AxisDrive:
    return drives(axis(**changes)).axes[0]


def stroke(start: float, way: float, tau: float) -> Stroke:
    """Return a stroke at constant torque."""
    q = np.linspace(start, start + way, 200)
    noise = np.tile([1e-3, -1e-3], 100)
    return Stroke(Move(start + way, 0.1, 1.0), np.arange(200) * 0.004, q, tau + noise, 0.0)


def seen(drive: AxisDrive, counts: np.ndarray, held: np.ndarray, drawn: list[Stroke]) -> Moved:
    return Moved("joint", drive, 0, np.array([0.3]), held, counts, drawn)


def strokes(gravity: float, friction: float, start: float = 0.3) -> list[Stroke]:
    return [
        stroke(start, 0.05, gravity + friction),
        stroke(start + 0.05, -0.05, gravity - friction),
    ]


@given(
    rated=st.floats(0.3, 30),
    constant=st.floats(0.03, 3),
    shown=st.sampled_from(BASES),
    said=st.sampled_from(BASES),
)
def test_two_units_that_differ_by_more_than_a_factor_are_never_taken_for_one_another(
    rated: float, constant: float, shown: str, said: str
) -> None:
    torque = constant * rated
    drive = one_axis(
        rated_current=rated,
        rated_torque=torque,
        torque_constant=constant,
        current={"index": 0x6078, "type": "i16", "basis": said, "amplitude": "peak"},
    )
    per_mille = np.linspace(-200, 200, 50)
    factor = {BASES[0]: rated, BASES[1]: 1.0, BASES[2]: 1.0}
    counts = np.stack([np.round(per_mille), np.round(factor[shown] * per_mille)], axis=1)
    load = strokes(0.0, 5.0)
    found = judge_current_unit(seen(drive, counts, np.zeros(10), load))
    apart = max(factor[shown] / factor[said], factor[said] / factor[shown])
    if apart < 1.01:
        assert "confirmed" in found.found
    elif apart > 1.02 * NEAR:
        assert found.grade is Grade.REFUSED
        assert shown in found.remedy
    elif 1.1 < apart < 0.98 * NEAR:  # a motor with a rated current of about 1 A
        assert "undecided" in found.found


def test_a_ratio_of_the_root_of_two_is_a_confusion_of_rms_and_peak() -> None:
    drive = one_axis(rated_current=5.0, rated_torque=3.0, torque_constant=0.6)
    per_mille = np.linspace(-200, 200, 50)
    counts = np.stack([per_mille, per_mille * math.sqrt(2)], axis=1)
    found = judge_current_unit(seen(drive, counts, np.zeros(10), strokes(0.0, 5.0)))
    assert found.grade is Grade.WARNING
    assert "rms and peak are confused" in found.remedy


@pytest.mark.parametrize(
    ("counts", "found"),
    [
        (np.zeros((0, 2)), "undecided"),  # the drive has no 6077
        (np.tile([2.0, 2.0], (50, 1)), "undecided"),  # only rounding, since no load
        (np.random.default_rng(1).normal(0, 100, (50, 2)), "undecided"),  # unrelated quantities
    ],
)
def test_a_ratio_that_means_nothing_is_not_used(counts: np.ndarray, found: str) -> None:
    # friction of 5 % of 300 N m: possible as per mille and as mA of a motor for 2 A
    verdict = judge_current_unit(seen(one_axis(), counts, np.zeros(10), strokes(0.0, 15.0)))
    assert found in verdict.found


@pytest.mark.parametrize(
    ("held", "friction", "rated", "found"),
    [
        (0.0, 0.1, 2.0, "contradicts"),  # friction of 0.03 % of the rated torque
        (0.0, 250.0, 2.0, "contradicts"),  # 83 %
        (400.0, 30.0, 2.0, "contradicts"),  # holds 133 % of the rated torque
        (200.0, 30.0, 0.05, "confirmed"),  # as mA it would be 2000 %
        (0.0, 30.0, 2.0, "undecided"),
    ],
)
def test_magnitudes_that_no_motor_has_contradict(
    held: float, friction: float, rated: float, found: str
) -> None:
    drive = one_axis(rated_current=rated, torque_constant=3.0 / rated)
    verdict = judge_current_unit(
        seen(drive, np.zeros((0, 2)), np.full(10, held), strokes(held, friction))
    )
    assert found in verdict.found


class TestDirection:
    """Pendulum of 100 N m: upright, or horizontal, at q = 0."""

    def judged(self, gravity: Gravity | None, measured: float, friction: float = 10.0) -> Verdict:
        drawn = strokes(measured, friction)
        nothing = np.zeros((0, 2)), np.zeros(0)
        return judge_direction(seen(one_axis(), *nothing, drawn), gravity)

    @staticmethod
    def horizontal(q: np.ndarray) -> np.ndarray:
        return 100 * np.cos(q)

    @staticmethod
    def hanging(q: np.ndarray) -> np.ndarray:
        return 100 * np.sin(q)

    def test_gravity_as_predicted_confirms_the_sign(self) -> None:
        assert self.judged(self.horizontal, 94.5).found.startswith("confirmed")

    def test_gravity_turned_round_contradicts_it(self) -> None:
        found = self.judged(self.horizontal, -94.5)
        assert found.grade is Grade.REFUSED
        assert "set sign: -1" in found.remedy

    def test_an_arm_that_is_its_own_mirror_image_tells_nothing(self) -> None:
        assert "undecided" in self.judged(self.hanging, 29.0).found

    def test_a_torque_far_from_both_predictions_tells_nothing(self) -> None:
        assert "neither" in self.judged(self.horizontal, 10.0).remedy

    def test_what_friction_can_hide_is_not_told(self) -> None:
        found = self.judged(lambda q: 0.5 * self.horizontal(q) / 100, 0.5, friction=50.0)
        assert "undecided" in found.found

    def test_without_a_model_nothing_is_told(self) -> None:
        assert "no model of the robot" in self.judged(None, 94.5).found


@pytest.mark.long
def test_on_the_plant_each_joint_that_carries_a_load_shows_which_way_it_turns(
    manutec: Robot,
) -> None:
    gravity = partial(gravity_torque, manutec, true_parameters(manutec, "manutec-r15"))
    right = drives_of(1, 2, 3, 4, 5, 6)
    found = verdicts(right, DIRECTION, gravity)
    assert "confirmed" in found[1].found
    assert not any(v.grade is Grade.REFUSED for v in found)

    turned = right.axes[1].model_copy(update={"sign": -right.axes[1].sign})
    wrong = right.model_copy(update={"axes": (right.axes[0], turned, *right.axes[2:])})
    found = verdicts(wrong, DIRECTION, gravity)
    assert found[1].grade is Grade.REFUSED
    assert "set sign: 1 in the drives file" in found[1].remedy
