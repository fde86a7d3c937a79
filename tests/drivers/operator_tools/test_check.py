"""`hil drives check`: findings on the virtual plant, intact or with one defect at a time."""

from __future__ import annotations

import math
import re
import struct
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import can
import numpy as np
import pytest
from kernel_bus import SocketcanLike
from probing_bench import Answering, Scripted, bench, drives_of, spoilt_plant

from drivers.canopen.bus import CanopenBus
from drivers.canopen.stopwatch import StopwatchBus
from drivers.canopen.sync_rate import achievable_rate, cycle_time, frame_bits
from drivers.commissioning.verdict import Grade, Verdict
from drivers.operator_tools.check import check
from drivers.operator_tools.check_motion import refresh_period
from drivers.operator_tools.check_objects import check_limits
from drivers.operator_tools.check_powered import SmallMoves, check_powered
from drivers.operator_tools.operator import StoppedByOperator
from sim_plant import build

if TYPE_CHECKING:
    from pathlib import Path

    from drivers.fieldbus import Entry

MOVES = SmallMoves(angle=math.radians(2), angular_velocity=math.radians(5))


def checked(bus: Any, drives: Any, operator: Any = None) -> list[Verdict]:
    return list(check(CanopenBus(bus), drives, MOVES, operator or Scripted()))


def unpowered(bus: Any, drives: Any) -> list[Verdict]:
    """Return the findings before the operator is asked; the operator declines."""
    found: list[Verdict] = []
    with suppress(StoppedByOperator):
        for verdict in check(CanopenBus(bus), drives, MOVES, Scripted(agreed=False)):
            found.append(verdict)  # noqa: PERF402 - what came before the end counts
    return found


def select_grade(grade: Grade, verdicts: list[Verdict]) -> dict[str, str]:
    return {v.check: str(v) for v in verdicts if v.grade is grade}


def refusals(verdicts: list[Verdict]) -> dict[str, str]:
    return select_grade(Grade.REFUSED, verdicts)


def test_on_a_sound_plant_nothing_is_refused_and_all_axes_end_switched_off() -> None:
    with bench() as bus:
        verdicts = checked(bus, drives_of(1, 2, 3, 4, 5, 6))
        assert refusals(verdicts) == {}
        assert bus.powered
        assert bus.left_off
    signs = [v for v in verdicts if v.check == "sign of the current"]
    assert [v.grade for v in signs] == [Grade.OK] * 6


def test_a_missing_drive_is_named_and_nothing_is_powered_on() -> None:
    drives = drives_of(1, 2)
    lost = drives.axes[1].model_copy(update={"node": 99})
    with bench() as bus:
        found = refusals(checked(bus, drives.model_copy(update={"axes": (drives.axes[0], lost)})))
        assert not bus.powered
    assert "joint 2 (node 99): answers: no answer" in found["answers"]
    assert "nothing was powered on" in found["motion"]


@pytest.mark.parametrize(
    ("stated", "checks", "words"),
    [
        ({"rated_current": 2.0}, "motor rated current (6075)", "2.583 A (file: 2 A); correct"),
        ({"rated_torque": 2.0}, "motor rated torque (6076)", "3 N m (file: 2 N m)"),
        ({"gear_ratio": 100}, "gear (6091)", "105 (file: 100); correct gear_ratio"),
        (
            {"increments_per_revolution": 2000},
            "position unit (6064)",
            "counts per motor revolution (feed 6092 = 430080 over gear 6091 = 105) (file: 2000)",
        ),
    ],
)
def test_what_drive_and_file_state_differently_is_refused_without_power(
    stated: dict[str, Any], checks: str, words: str
) -> None:
    with bench() as bus:
        found = refusals(checked(bus, drives_of(1, **stated)))
        assert not bus.powered
    assert words in found[checks]


def test_limits_of_a_drive_that_are_tighter_than_the_files_hold_and_are_noted(
    tmp_path: Path,
) -> None:
    narrow = spoilt_plant(
        tmp_path,
        ("range_deg: 165", "range_deg: 100"),
        ("peak_torque: 945", "peak_torque: 500"),
        ("velocity_max: 3.0", "velocity_max: 1.0"),
    )
    with bench(narrow) as bus:
        verdicts = checked(bus, drives_of(1))
    assert refusals(verdicts) == {}
    found = select_grade(Grade.WARNING, verdicts)
    assert "[-1.745, 1.745] rad (file: [-2.88, 2.88])" in found["software limits (607D)"]
    assert "the tighter of both applies, [-1.745, 1.745] rad" in found["software limits (607D)"]
    assert "lower limits.torque" in found["max torque (6072)"]
    assert "drive's limit is tighter and applies" in found["max motor speed (6080)"]


def test_all_that_is_checked_of_a_prismatic_axis_is_stated_in_metres_and_newtons() -> None:
    with bench() as bus:
        verdicts = checked(bus, drives_of(1, joint="prismatic"))
    of_the_motor = {"motor rated torque (6076)", "torque constant"}
    stated = "\n".join(str(each) for each in verdicts if each.check not in of_the_motor)
    assert "software limits (607D): [-2.88, 2.88] m" in stated
    assert "max torque (6072): 945 N (" in stated
    assert not re.search(r"\brad\b|N m\b", stated)


def test_ranges_of_drive_and_file_without_anything_in_common_are_refused_without_power() -> None:
    beside = {**drives_of(1).axes[0].limits.model_dump(), "q_min": 3.0, "q_max": 4.0}
    with bench() as bus:
        found = refusals(checked(bus, drives_of(1, limits=beside)))
        assert not bus.powered
    assert "do not overlap" in found["software limits (607D)"]


def test_what_power_on_will_write_is_listed_beforehand_and_only_what_differs() -> None:
    listed = {}
    with bench() as bus:
        with suppress(StoppedByOperator):
            for verdict in check(CanopenBus(bus), drives_of(1), MOVES, Scripted(agreed=False)):
                listed[verdict.check] = str(verdict)
        assert not bus.powered
    watchdog = "set: 1016:01 (consumer heartbeat time)"
    assert (
        f"0 ({127 << 16 | 500:08X}h is written for the session, then 0 again)" in listed[watchdog]
    )
    assert "set: 607D:01 (min position limit)" not in listed, "the drive's limit is tighter"


def test_limits_of_a_file_that_are_narrower_than_the_drives_are_fine() -> None:
    narrow = {"q_min": -1, "q_max": 1, "velocity": 1, "acceleration": 5, "torque": 500}
    with bench() as bus:
        assert refusals(checked(bus, drives_of(1, limits=narrow))) == {}


def reversed_current(frame: can.Message) -> None:
    """Reverse the sign of the current in a TPDO."""
    if frame.arbitration_id & 0x780 == 0x180:
        (current,) = struct.unpack_from("<h", frame.data, 6)
        struct.pack_into("<h", frame.data, 6, -current)


def test_a_current_of_the_wrong_sign_is_found_from_friction_alone() -> None:
    with bench(alter=reversed_current) as bus:
        found = refusals(checked(bus, drives_of(1, 2, 3)))
        assert bus.left_off
    assert "friction -" in found["sign of the current"]
    assert "set current.sign: -1" in found["sign of the current"]


def test_stating_the_sign_of_the_current_mends_it() -> None:
    current = drives_of(2).axes[0].current.model_dump() | {"sign": -1}
    with bench(alter=reversed_current) as bus:
        assert refusals(checked(bus, drives_of(2, current=current))) == {}


def test_a_current_that_shows_nothing_but_zero_leaves_its_sign_open() -> None:
    def dead(frame: can.Message) -> None:
        if frame.arbitration_id & 0x780 == 0x180:
            frame.data[6:8] = b"\0\0"

    with bench(alter=dead) as bus:
        warnings = select_grade(Grade.WARNING, checked(bus, drives_of(1)))
    assert "too little to decide" in warnings["sign of the current"]


@pytest.mark.parametrize(
    ("key", "grade", "remedy"),
    [
        ("y", Grade.OK, ""),
        ("o", Grade.REFUSED, "set sign: -1 in the drives file"),
        ("w", Grade.REFUSED, "correct gear_ratio"),
    ],
)
def test_which_way_the_joint_turned_is_asked_of_the_operator(
    key: str, grade: Grade, remedy: str
) -> None:
    operator = Answering(key)
    with bench() as bus:
        verdicts = checked(bus, drives_of(1), operator)
    (direction,) = [v for v in verdicts if v.check == "sign and size of the motion"]
    assert direction.grade is grade
    assert remedy in direction.remedy
    assert any("moved +2° and back" in line for line in operator.shown)


def test_where_nobody_can_be_asked_the_direction_is_a_warning() -> None:
    with bench() as bus:
        warnings = select_grade(Grade.WARNING, checked(bus, drives_of(1)))
    assert "not asked" in warnings["sign and size of the motion"]


def test_a_velocity_unit_of_another_size_ends_the_move_at_once() -> None:
    with bench() as bus:
        found = refusals(checked(bus, drives_of(6, velocity_unit="rpm"), Scripted()))
        assert bus.left_off
    assert "max profile velocity (607F)" not in found
    assert "velocity_unit" in str(found)


def test_without_consent_nothing_is_powered_on() -> None:
    with bench() as bus:
        with pytest.raises(StoppedByOperator, match="did not agree"):
            checked(bus, drives_of(1), Scripted(agreed=False))
        assert not bus.powered


@pytest.mark.parametrize("look", [1, 100, 270, 400])
def test_a_key_stops_all_axes_at_any_time(look: int) -> None:
    with bench() as bus:
        with pytest.raises(StoppedByOperator):
            checked(bus, drives_of(1, 2), Scripted(**{" ": look}))
        assert bus.powered
        assert bus.left_off


def test_whoever_stops_reading_verdicts_leaves_no_axis_powered() -> None:
    with bench() as bus:
        verdicts = check(CanopenBus(bus), drives_of(1), MOVES, Scripted())
        for verdict in verdicts:
            if verdict.check == "sign of the current":
                break
        assert bus.powered
        verdicts.close()
        assert bus.left_off


def test_a_brake_that_does_not_hold_is_found_after_the_power_has_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(build, "BRAKE_OVER_PEAK", 0.0)
    with bench() as bus:
        found = refusals(checked(bus, drives_of(2)))
    assert "check the brake" in found["holding without power (brake)"]


def test_a_bus_that_is_too_slow_for_its_sync_is_refused_without_power() -> None:
    slow = drives_of(1, 2, 3, 4, 5, 6).model_copy(update={"bitrate": 250_000})
    with bench() as bus:
        found = refusals(checked(bus, slow))
        assert not bus.powered
    assert "86.5% at 250 Hz and 250 kbit/s (at most 70%); lengthen sync_period" in found["load"]


def test_the_load_of_six_axes_is_that_of_the_worst_case_of_stuffing() -> None:
    six = drives_of(1, 2, 3, 4, 5, 6)
    assert (frame_bits(0), frame_bits(8)) == (55, 135)
    assert cycle_time(six) == pytest.approx(865e-6)
    assert achievable_rate(six) == pytest.approx(809.2, abs=0.1)


def test_slow_answers_bound_the_rate_of_sync() -> None:
    assert achievable_rate(drives_of(1), answer=0.01) == pytest.approx(80)


def test_sync_is_off_by_when_it_was_sent_and_by_how_much_answers_vary() -> None:
    with bench() as inner, StopwatchBus(inner, drives_of(1)) as bus:
        sent = 0.004 * np.arange(1001) + np.tile([0.0, 2e-4], 501)[:1001]
        bus.sent = [*sent, 5.0, 5.3]  # a pause, then SYNCs without answers so far
        bus.answers = [*np.linspace(1e-3, 1.5e-3, 1001), 0.0, 0.0]
        assert bus.jitter(0.004) == pytest.approx(2e-4 + 0.99 * 5e-4, rel=1e-3)


def test_the_stopwatch_takes_the_last_answer_to_each_sync() -> None:
    ticks = iter([0.0, 0.001, 0.003, 1.0, 1.002])
    with bench() as inner, StopwatchBus(inner, drives_of(1, 2), lambda: next(ticks)) as bus:
        answers = iter([0x181, 0x182, None, 0x701, 0x181])
        inner._inner.recv = lambda _=None: (
            None if (number := next(answers)) is None else can.Message(arbitration_id=number)
        )
        for _ in range(2):
            bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))
            while len(bus.answers) < 2 and bus.recv(0) is not None:
                pass
        bus.recv(0)
        bus.recv(0)
        assert bus.answers == pytest.approx([0.003, 0.002])


def check_personality(name: str, **changes: Any) -> list[Verdict]:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True, personality=name) as bus:
        return checked(bus, drives_of(1, **changes))


def test_what_a_drive_lacks_is_told_once_with_what_follows() -> None:
    verdicts = check_personality("bare")
    assert refusals(verdicts) == {}
    stated = [v for v in verdicts if v.grade is Grade.WARNING and "6007" in str(v)]
    assert len(stated) == 1
    assert "to a lost heartbeat" in stated[0].remedy
    assert stated[0].check == "objects needed for measuring"


def test_a_drive_that_cannot_watch_our_heartbeat_is_refused() -> None:
    lacking = refusals(check_personality("no-watchdog"))["objects needed for measuring"]
    assert "1016:01 (consumer heartbeat time) is missing" in lacking


def test_a_drive_that_cannot_watch_our_heartbeat_serves_where_something_else_stops_it() -> None:
    reason = "the cell's safety controller cuts the power"
    verdicts = check_personality("no-watchdog", allow_no_heartbeat=reason)
    assert refusals(verdicts) == {}
    (stated,) = [v for v in verdicts if "1016" in str(v)]
    assert (stated.grade, stated.check) == (Grade.WARNING, "objects needed for measuring")


def test_what_showed_without_power_is_not_stated_again_with_power() -> None:
    assert [v for v in check_personality("bare") if v.check == "configuration"] == []
    rounded = [v for v in check_personality("rounding") if v.check == "configuration"]
    assert {v.place for v in rounded} == {"joint 1 (node 1)"}
    assert all("the drive rounds or limits it" in v.found for v in rounded)
    assert len(rounded) > 3


class Holding:
    """Object dictionary of a drive with some values and no other objects."""

    label = "joint 1 (node 1)"

    def __init__(self, values: dict[int, int]) -> None:
        self._values = values

    def find(self, entry: Entry) -> int | None:
        return self._values.get(entry.index)


@pytest.mark.parametrize("basis", ["per mille of rated current", "per mille of rated torque"])
def test_a_tighter_limit_of_current_is_stated_whatever_the_current_is_shown_in(basis: str) -> None:
    current = drives_of(1).axes[0].current.model_dump() | {"basis": basis}
    axis = drives_of(1, current=current).axes[0]
    server: Any = Holding({0x6073: 500})
    stated = [v for v in check_limits(server, axis) if v.check == "max current (6073)"]
    assert [v.grade for v in stated] == [Grade.WARNING]


def test_a_drive_in_rpm_that_the_file_takes_for_increments_is_refused_before_it_moves() -> None:
    verdicts = check_personality("tenth-rpm")
    assert "max profile velocity (607F)" in select_grade(Grade.WARNING, verdicts)
    found = refusals(verdicts)
    assert "0.1 rpm (FFB44700h) (file: inc/s)" in found["SI unit velocity (60A9)"]
    assert "nothing was powered on" in found["motion"]


def test_rms_and_peak_confused_show_in_the_torque_constant() -> None:
    with bench() as bus:
        constant = drives_of(1).axes[0].torque_constant
        warnings = select_grade(
            Grade.WARNING, checked(bus, drives_of(1, torque_constant=constant * math.sqrt(2)))
        )
    assert "rms and peak are confused" in warnings["torque constant"]


def test_where_the_drive_confirms_its_ratings_the_torque_constant_is_wrong() -> None:
    with bench() as bus:
        constant = drives_of(1).axes[0].torque_constant
        found = unpowered(bus, drives_of(1, torque_constant=2 * constant))
        warnings = select_grade(Grade.WARNING, found)
    assert f"correct torque_constant: {constant:.3g}" in warnings["torque constant"]


def test_an_amplitude_that_is_stated_as_the_other_is_named() -> None:
    axis = drives_of(1).axes[0]
    other = {"rms": "peak", "peak": "rms"}[axis.torque_constant_amplitude]
    with bench() as bus:
        drives = drives_of(1, torque_constant_amplitude=other)
        warnings = select_grade(Grade.WARNING, unpowered(bus, drives))
    stated = f"torque_constant_amplitude: {axis.torque_constant_amplitude} or current.amplitude"
    assert stated in warnings["torque constant"]


def test_where_the_kernel_sends_sync_it_does_so_for_a_check_as_well() -> None:
    with (
        SocketcanLike(can.Bus("manutec-r15", "sim_plant", ignore_config=True)) as bus,
    ):
        powered = check_powered(CanopenBus(bus), drives_of(1), MOVES, Scripted())
        rate = next(v for v in powered if v.check == "achievable rate of SYNC")
        by_us = bus.by_us
        assert bus.period == drives_of(1).sync_period
        powered.close()
        assert bus.period is None
    assert bus.by_kernel > 100
    assert by_us < 20  # time must pass until the drives are operational
    assert "slowest answer" in str(rate)


@pytest.mark.parametrize("value", ["position", "current"])
@pytest.mark.parametrize("every", [2, 3, 5, 8])
def test_a_value_that_is_renewed_less_often_than_sync_is_named_with_the_period_to_use(
    value: str, every: int, tmp_path: Path
) -> None:
    plan = tmp_path / "faults.yaml"
    fault = f"{{what: {value}-slow, axis: 2, at: {{time: 0}}, size: {4 * every}}}"
    plan.write_text(f"faults: [{fault}]")
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True, faults=str(plan)) as bus:
        verdicts = checked(bus, drives_of(2))
    refused = refusals(verdicts)
    assert list(refused) == [f"refresh of the {value}"]
    (message,) = refused.values()
    assert f"every {every} SYNCs ({4 * every} ms)" in message
    assert f"set sync_period: {0.004 * every:g} in the drives file" in message


@pytest.mark.parametrize("ratio", [0.6, 2.0, 5.0, 30.0])
@pytest.mark.parametrize("every", [1.0, 1.75, 2.0, 3.0, 5.0, 8.0])
def test_how_often_a_noisy_value_is_renewed_shows_whatever_its_steps(
    ratio: float, every: float
) -> None:
    """`ratio` is the noise in steps; coarse values repeat by chance, as if renewed every 1 to 2
    SYNCs.
    """
    if every == 1.75 and ratio < 5:
        return
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(0.0, ratio, 2000)
        values = np.round(noise[np.floor(np.arange(600) / every).astype(int)])
        assert refresh_period([values[:300], values[300:]], 1.0) == pytest.approx(
            every, rel=0.15
        ), seed


def test_a_value_that_hardly_changes_shows_no_period() -> None:
    values = np.repeat([0.0, 1.0, 0.0], 50)
    assert math.isnan(refresh_period([values], 1.0))
