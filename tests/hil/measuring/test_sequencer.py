"""Sequencer on a recording fake with ideal axes."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from drivers.drive_bus import (
    DriveBus,
    DriveFault,
    DriveRefused,
    LimitExceeded,
    MoveFailed,
    Sample,
    SampleFlag,
)
from hil.measuring.sequencer import (
    Event,
    Finished,
    GaveUp,
    Recorded,
    Repeated,
    Started,
    Travelled,
    WarmingUp,
    measure,
)
from hil.model.robot import Robot
from hil.planning.measurement import Coupling, Gravity
from hil.planning.plan import Plan, WarmUp

Tamper = Callable[[Sample], Sample]


def run(plan: Plan, robot: Robot, bus: object, **options: object) -> list[Event]:
    with bus:
        return list(measure(plan, robot, bus, **options))


def only(plan: Plan, identifier: str, **changes: object) -> Plan:
    chosen = tuple(m for m in plan.measurements if m.id == identifier)
    return plan.model_copy(update={"measurements": chosen, **changes})


def recorded(events: list[Event]) -> dict[str, Recorded]:
    return {e.measurement.id: e for e in events if isinstance(e, Recorded)}


def test_the_fake_is_a_drive_bus(ideal_bus) -> None:
    assert isinstance(ideal_bus, DriveBus)


def test_a_plan_is_carried_out_in_order(small_plan, manutec, ideal_bus) -> None:
    events = run(small_plan, manutec, ideal_bus)
    assert [type(e) for e in events] == [Started, *[Travelled, Recorded] * 3, Finished]
    assert list(recorded(events)) == ["g1", "i1", "c1"]
    assert all(not e.findings and e.attempts == 1 for e in recorded(events).values())
    assert events[-1].gave_up == ()


def test_every_stroke_is_recorded_with_rest_around_it(small_plan, manutec, ideal_bus) -> None:
    gravity = recorded(run(small_plan, manutec, ideal_bus))["g1"]
    recording, measurement = gravity.recording, gravity.measurement
    np.testing.assert_allclose(np.diff(recording.time), 0.004)
    moving = np.flatnonzero(recording.stroke >= 0)
    assert (recording.stroke[:75] == -1).all()
    assert (recording.stroke[-75:] == -1).all()
    assert moving[0] == 75
    assert np.array_equal(np.unique(recording.stroke), [-1, 0, 1, 2, 3])
    for number in range(measurement.n_strokes):
        q = recording.q[recording.span(number), measurement.index]
        assert q[0] == pytest.approx(measurement.profile(number).start, abs=1e-3)
        assert q[-1] == pytest.approx(measurement.profile(number).end, abs=1e-9)
    assert (recording.partner_stroke == -1).all()


def test_strokes_follow_each_other_without_a_pause(small_plan, manutec, ideal_bus) -> None:
    recording = recorded(run(small_plan, manutec, ideal_bus))["g1"].recording
    numbers = recording.stroke[75:-75]
    assert (numbers >= 0).all()
    still = np.abs(np.diff(recording.q[75:-75, 1])) < 1e-12
    assert still.sum() * 0.004 < 4 * 0.05


def test_the_partner_goes_back_and_forth_while_the_axis_creeps(
    small_plan, manutec, ideal_bus
) -> None:
    event = recorded(run(small_plan, manutec, ideal_bus))["c1"]
    recording, measurement = event.recording, event.measurement
    assert isinstance(measurement, Coupling)
    for creep in range(2):
        during = recording.partner_stroke[recording.span(creep)]
        numbers = np.unique(during[during >= 0])
        assert len(numbers) >= 2
        for number in numbers:
            span = recording.partner_span(int(number))
            creeping = np.diff(recording.q[span, 0]) / 0.004
            np.testing.assert_allclose(np.abs(creeping), 0.05, rtol=1e-6)
            ends = recording.q[span, 1][[0, -1]]
            profile = measurement.partner.profile(measurement.q, int(number))
            np.testing.assert_allclose(ends, [profile.start, profile.end], atol=2e-3)


def test_travels_move_all_axes_at_once_at_their_share_of_the_limits(
    small_plan, manutec, ideal_bus
) -> None:
    run(small_plan, manutec, ideal_bus)
    first = [(index, move) for _, index, move in ideal_bus.moves[:6]]
    assert [index for index, _ in first] == list(range(6))
    for index, move in first:
        assert move.velocity == pytest.approx(small_plan.travel * manutec.velocity_limit[index])
        acceleration = small_plan.travel * manutec.acceleration_limit[index]
        assert move.acceleration == pytest.approx(acceleration)
        assert move.target == pytest.approx(small_plan.measurements[0].start[index])


def test_what_is_done_already_is_left_out(small_plan, manutec, ideal_bus) -> None:
    events = run(small_plan, manutec, ideal_bus, done=["g1", "c1"])
    assert list(recorded(events)) == ["i1"]
    assert events[0].pending == 1
    assert events[0].planned == 3


def test_the_time_left_falls_to_nothing_and_was_about_right(small_plan, manutec, ideal_bus) -> None:
    events = run(small_plan, manutec, ideal_bus)
    left = [event.remaining for event in events if isinstance(event, Started | Recorded)]
    assert left == sorted(left, reverse=True)
    assert events[-1].remaining == 0
    assert events[0].remaining == pytest.approx(ideal_bus.time, rel=0.15)


def test_warming_up_lasts_as_long_as_planned_and_stays_on_planned_paths(
    small_plan, manutec, ideal_bus
) -> None:
    plan = small_plan.model_copy(update={"warm_up": WarmUp(duration=20.0, fraction=0.3)})
    events = run(plan, manutec, ideal_bus)
    warming = [event for event in events if isinstance(event, WarmingUp)]
    assert warming[-1].done < 20.0
    first = next(event for event in events if isinstance(event, Travelled))
    assert 20.0 < first.time < 30.0
    planned = {m.start for m in plan.measurements} | {m.end for m in plan.measurements}
    targets = {
        tuple(move.target for _, _, move in ideal_bus.moves[k : k + 6])
        for k in range(0, 6 * len(warming), 6)
    }
    assert targets <= planned


def tampering(predicate: Callable[[Sample], bool], change: Tamper) -> Tamper:
    return lambda sample: change(sample) if predicate(sample) else sample


def missing(sample: Sample) -> Sample:
    return sample._replace(
        q=(math.nan, *sample.q[1:]),
        tau=(math.nan, *sample.tau[1:]),
        flags=(int(SampleFlag.MISSING), *sample.flags[1:]),
    )


def test_a_gap_leads_to_one_repetition(small_plan, manutec, ideal_bus) -> None:
    ideal_bus.tamper = tampering(lambda s: 2.5 < s.time < 2.7, missing)
    events = run(only(small_plan, "g1"), manutec, ideal_bus)
    assert [type(e) for e in events] == [Started, Travelled, Repeated, Recorded, Finished]
    assert events[2].findings[0].check == "gaps"
    assert "49 of" in events[2].findings[0].message
    assert "axis 1" in events[2].findings[0].message
    assert recorded(events)["g1"].attempts == 2
    assert recorded(events)["g1"].findings == ()


def test_the_end_states_how_long_the_robot_moved_before_the_recording_that_is_kept(
    small_plan, manutec, ideal_bus
) -> None:
    ideal_bus.tamper = tampering(lambda s: 2.5 < s.time < 2.7, missing)
    events = run(only(small_plan, "g1"), manutec, ideal_bus)
    begun = recorded(events)["g1"].recording.time[0]
    assert events[-1].before_first == pytest.approx(begun - events[0].time)
    assert events[-1].before_first > small_plan.measurements[0].duration


def test_few_gaps_that_are_flagged_do_no_harm(small_plan, manutec, ideal_bus) -> None:
    def change(sample: Sample) -> Sample:
        number = round(sample.time / 0.004)
        late = sample._replace(time=sample.time + 0.004 * (number > 700))
        return late if number % 150 else missing(late)

    ideal_bus.tamper = tampering(lambda s: s.time > 1.5, change)
    kept = recorded(run(only(small_plan, "g1"), manutec, ideal_bus))["g1"]
    assert np.isnan(kept.recording.q[:, 0]).sum() > 5
    assert np.diff(kept.recording.time).max() > 0.007
    assert (kept.attempts, kept.findings) == (1, ())


def test_what_fails_every_time_keeps_its_best_recording_and_says_so(
    small_plan, manutec, ideal_bus
) -> None:
    def change(sample: Sample) -> Sample:
        in_second_attempt = 6.0 < sample.time < 11.0
        if round(sample.time / 0.004) % (40 if in_second_attempt else 10):
            return sample
        return missing(sample)

    ideal_bus.tamper = tampering(lambda s: s.time > 1.5, change)
    events = run(only(small_plan, "g1"), manutec, ideal_bus)
    kinds = [Started, Travelled, Repeated, Repeated, GaveUp, Recorded, Finished]
    assert [type(e) for e in events] == kinds
    gaps = [e.findings[0].value for e in events if isinstance(e, Repeated | GaveUp)]
    assert gaps[-1] == min(gaps)
    kept = recorded(events)["g1"]
    assert kept.attempts == 3
    assert kept.findings[0].value == gaps[-1]
    assert np.isnan(kept.recording.q[:, 0]).sum() == gaps[-1]
    assert events[-1].gave_up == ("g1",)


def flagged(flag: SampleFlag, axis: int) -> Tamper:
    def change(sample: Sample) -> Sample:
        flags = list(sample.flags)
        flags[axis] |= flag
        return sample._replace(flags=tuple(flags))

    return change


@pytest.mark.parametrize(
    ("identifier", "change", "check", "words"),
    [
        (
            "g1",
            lambda s: s._replace(time=s.time + 0.2 * (s.time > 2.5)),
            "gaps",
            "50 SYNCs were too late",
        ),
        ("i1", flagged(SampleFlag.LIMIT, 2), "saturation", "axis 3 is at its internal limit"),
        ("g1", flagged(SampleFlag.LATE, 4), "telegrams", "telegrams of axis 5"),
        (
            "g1",
            lambda s: s._replace(q=tuple(0.9 * q for q in s.q)),
            "velocity",
            "must be 0.4 rad/s",
        ),
        ("i1", lambda s: s._replace(q=tuple(0.8 * q for q in s.q)), "velocity", "at least"),
        (
            "g1",
            lambda s: s._replace(tau=tuple(t * (1 + 0.1 * s.time) for t in s.tau)),
            "half-sums",
            "friction is not stationary",
        ),
        (
            "c1",
            lambda s: s._replace(q=(s.q[0] - math.sin(80 * s.q[0]) / 80, *s.q[1:])),
            "stuck",
            "the creeping axis slows to",
        ),
        (
            "c1",
            lambda s: s._replace(q=(s.q[0], -0.2 + 0.5 * (s.q[1] + 0.2), *s.q[2:])),
            "partner",
            "partner's stroke 1 (forward)",
        ),
    ],
)
def test_a_defect_is_found_with_value_bound_and_remedy(
    small_plan, manutec, ideal_bus, identifier, change, check, words
) -> None:
    plan = only(small_plan, identifier, attempts=1)
    ideal_bus.tamper = change
    findings = recorded(run(plan, manutec, ideal_bus))[identifier].findings
    found = [finding for finding in findings if finding.check == check]
    assert found
    assert words in found[0].message
    assert ";" in found[0].message
    assert found[0].excess > 1


def test_a_coupling_too_short_for_its_partner_is_found(small_plan, manutec, ideal_bus) -> None:
    coupling = small_plan.measurements[2].model_copy(update={"stroke": 0.03})
    plan = small_plan.model_copy(update={"measurements": (coupling,), "attempts": 1})
    findings = recorded(run(plan, manutec, ideal_bus))["c1"].findings
    assert any(f.check == "partner" and "must be at least 2" in f.message for f in findings)


def test_a_stroke_without_constant_velocity_is_found(small_plan, manutec, ideal_bus) -> None:
    gravity = small_plan.measurements[0]
    assert isinstance(gravity, Gravity)
    short = gravity.model_copy(update={"stroke": 0.02})
    plan = small_plan.model_copy(update={"measurements": (short,), "attempts": 1})
    findings = recorded(run(plan, manutec, ideal_bus))["g1"].findings
    assert [f.check for f in findings] == ["window"] * 4
    assert "must be at least 0.15 s" in findings[0].message


def test_an_axis_that_never_arrives_stops_the_run_in_robot_time(
    small_plan, manutec, ideal_bus
) -> None:
    ideal_bus.deaf = {1}
    with pytest.raises(MoveFailed, match=r"not at rest at the target after [\d.]+ s, expected"):
        run(small_plan, manutec, ideal_bus)
    assert ideal_bus.log == ["powered on", "halted", "powered off"]
    assert 5 < ideal_bus.time < 20


def test_whatever_the_bus_raises_the_axes_are_switched_off(small_plan, manutec, ideal_bus) -> None:
    def fail(sample: Sample) -> Sample:
        raise DriveFault("axis 2: following error")

    ideal_bus.tamper = tampering(lambda s: s.time > 3, fail)
    with pytest.raises(DriveFault):
        run(small_plan, manutec, ideal_bus)
    assert ideal_bus.log[-1] == "powered off"


def test_a_robot_outside_its_limits_is_not_moved(small_plan, manutec, ideal_bus) -> None:
    ideal_bus.tamper = lambda s: s._replace(q=(3.0, *s.q[1:]))
    with pytest.raises(LimitExceeded, match=r"axis 1: is at 3 rad, outside -2.88 ... 2.88"):
        run(small_plan, manutec, ideal_bus)
    assert not ideal_bus.moves


def test_a_target_outside_the_limits_is_not_commanded(small_plan, manutec, ideal_bus) -> None:
    outside = small_plan.measurements[0].model_copy(update={"q": (0.0, 0.0, 0.0, 0.0, 2.5, 0.0)})
    plan = small_plan.model_copy(update={"measurements": (outside,)})
    with pytest.raises(LimitExceeded, match=r"axis 5: target 2.5 rad is outside"):
        run(plan, manutec, ideal_bus)
    assert not ideal_bus.moves


def test_an_axis_without_a_position_is_not_moved(small_plan, manutec, ideal_bus) -> None:
    ideal_bus.tamper = missing
    with pytest.raises(MoveFailed, match="axis 1: no position in 20 samples"):
        run(small_plan, manutec, ideal_bus)
    assert not ideal_bus.moves


def test_a_bus_with_another_period_is_refused(small_plan, manutec, ideal_bus) -> None:
    ideal_bus.period = 0.01
    with pytest.raises(DriveRefused, match=r"every 0.01 s, the plan wants 0.004 s"):
        run(small_plan, manutec, ideal_bus)


def test_a_torque_that_counts_against_the_motion_ends_the_run_at_once_and_is_kept(
    small_plan, manutec, ideal_bus
) -> None:
    """All torques of the axis are wrong, so hours of measuring would be lost."""

    def reversed_friction(sample: Sample) -> Sample:
        speed = np.subtract(sample.q, before[0] or sample.q)
        before[0] = sample.q
        tau = np.array(sample.tau) - 2000.0 * np.sign(speed)
        return sample._replace(tau=tuple(tau.tolist()))

    before: list[Any] = [None]
    ideal_bus.tamper = reversed_friction
    events: list[Event] = []
    with pytest.raises(DriveRefused, match=r"has the wrong sign.*reverse current\.sign"):
        events.extend(_each(small_plan, manutec, ideal_bus, events))
    (kept,) = recorded(events).values()
    assert (kept.attempts, kept.findings[0].check) == (1, "sign")


def _each(plan: Plan, robot: Robot, bus: Any, events: list[Event]) -> list[Event]:
    with bus:
        for event in measure(plan, robot, bus):
            events.append(event)  # noqa: PERF402 - what came before the end counts
    return []
