"""Unusable recordings of each kind of measurement, with bounds from both sides."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import any_clock
import numpy as np
import pytest
from any_clock import FRICTION, GRAVITY, INERTIA, PERIOD, ROBOT, WAVE, followed, record

from drivers.drive_bus import SampleFlag, Tripped
from hil.measuring.checks.encoder_jumps import refuse_jumps
from hil.measuring.checks.recording_checks import check, constant_velocity
from hil.planning.strokes import MARGIN, SHORTEST_WINDOW
from hil.runs.recording import IDLE

if TYPE_CHECKING:
    from hil.planning.strokes import Strokes
    from hil.planning.trajectory import Trajectory
    from hil.runs.recording import Recording

STROKES = [GRAVITY, FRICTION, INERTIA]


def carried_out(measurement: Strokes) -> Recording:
    """Return the strokes of a measurement exactly as planned, without rests."""
    return any_clock.carried_out(measurement, rests=0)


def found(recording: Recording, measurement: Strokes | Trajectory = GRAVITY) -> set[str]:
    return {finding.check for finding in check(recording, measurement, ROBOT)}


def flagged(recording: Recording, flag: SampleFlag, share: float) -> Recording:
    """Flag a share of the samples of the second axis, which is at rest."""
    flags = recording.flags.copy()
    flags[: round(share * len(flags)), 1] |= np.uint8(flag)
    return replace(recording, flags=flags)


@pytest.mark.parametrize("measurement", STROKES, ids=lambda m: m.kind)
def test_strokes_as_planned_may_be_used_and_at_a_tenth_less_speed_may_not(
    measurement: Strokes,
) -> None:
    sound = carried_out(measurement)
    assert found(sound, measurement) == set()
    assert "velocity" in found(replace(sound, q=0.88 * sound.q), measurement)
    assert "velocity" not in found(replace(sound, q=0.96 * sound.q), measurement)


@pytest.mark.parametrize("measurement", STROKES, ids=lambda m: m.kind)
def test_a_velocity_that_is_off_for_syncs_that_came_late_names_the_pacing(
    measurement: Strokes,
) -> None:
    sound = carried_out(measurement)
    late = PERIOD * np.cumsum(np.arange(sound.n_samples) % 5 == 0)
    for recording, pacing in (
        (replace(sound, time=sound.time + late), True),
        (replace(sound, q=0.8 * sound.q), False),
    ):
        off = [f for f in check(recording, measurement, ROBOT) if f.check == "velocity"]
        assert off
        assert {"--pacing lock-step" in finding.message for finding in off} == {pacing}
        assert {"velocity and acceleration units" in f.message for f in off} == {not pacing}


@pytest.mark.parametrize(("share", "findings"), [(0.9, {"window"}), (1.1, set())])
def test_constant_velocity_must_last(share: float, findings: set[str]) -> None:
    ramp = 0.4**2 / 8.0 / 2
    stroke = 2 * ramp + 0.4 * (MARGIN + share * SHORTEST_WINDOW)
    short = GRAVITY.model_copy(update={"stroke": stroke})
    assert found(carried_out(short), short) & {"window"} == findings


def test_velocity_counts_as_constant_a_while_after_the_ramp_until_the_next() -> None:
    sound = carried_out(GRAVITY)
    for stroke in range(GRAVITY.n_strokes):
        window = constant_velocity(sound, GRAVITY, stroke) - sound.span(stroke).start
        duration, ramp = GRAVITY.profile(stroke).duration, 0.4 / 8.0
        begin, end = PERIOD * window[0], PERIOD * window[-1]
        assert begin == pytest.approx(ramp + MARGIN, abs=1.5 * PERIOD)
        assert end == pytest.approx(duration - ramp, abs=1.5 * PERIOD)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_trajectory_may_be_used_where_no_axis_is_astray(axis: int) -> None:
    sound = followed()
    assert found(sound, WAVE) == set()
    for away, findings in ((0.04, set()), (0.06, {"astray"})):
        q = sound.q.copy()
        q[300:310, axis] += away
        assert found(replace(sound, q=q), WAVE) == findings


@pytest.mark.parametrize("axis", [0, 1])
def test_a_stuck_current_of_any_axis_that_is_read_keeps_a_recording_from_being_used(
    axis: int,
) -> None:
    sound = followed()
    tau = sound.tau.copy()
    tau[300:400, axis] = tau[300, axis]
    assert found(replace(sound, tau=tau), WAVE) == {"current"}


def test_a_current_may_read_the_same_while_the_axis_rests() -> None:
    sound = carried_out(GRAVITY)
    still = sound.stroke < 2
    tau = np.where(still[:, None], 5.0, sound.tau)
    resting = replace(sound, tau=tau, stroke=np.where(still, -1, sound.stroke).astype(np.int16))
    assert "current" not in found(resting)
    assert "current" in found(replace(sound, tau=tau))


@pytest.mark.parametrize("flag", [SampleFlag.DOUBLED, SampleFlag.LATE])
def test_doubled_and_late_telegrams_may_be_one_in_a_hundred(flag: SampleFlag) -> None:
    sound = carried_out(GRAVITY)
    assert found(flagged(sound, flag, 0.009)) == set()
    assert found(flagged(sound, flag, 0.015)) == {"telegrams"}


@pytest.mark.parametrize(("every", "cause"), [(8, "every 8 SYNCs: set the inhibit time"), (0, "")])
def test_a_drive_that_answers_now_and_then_by_rule_names_its_inhibit_time(
    every: int, cause: str
) -> None:
    sound = carried_out(GRAVITY)
    rng = np.random.default_rng(4)
    gone = np.arange(sound.n_samples) % every > 0 if every else rng.random(sound.n_samples) < 0.5
    q, tau, flags = sound.q.copy(), sound.tau.copy(), sound.flags.copy()
    q[gone, 1], tau[gone, 1], flags[gone, 1] = np.nan, np.nan, SampleFlag.MISSING
    spoilt = replace(sound, q=q, tau=tau, flags=flags)
    (gaps,) = [f for f in check(spoilt, GRAVITY, ROBOT) if f.check == "gaps"]
    assert (cause or "check wiring, termination") in gaps.message
    assert ("inhibit" in gaps.message) is bool(every)


def test_a_tenth_of_the_instants_may_be_uncertain_and_no_more() -> None:
    sound = carried_out(GRAVITY)
    assert found(flagged(sound, SampleFlag.UNTIMED, 0.09)) == set()
    assert found(flagged(sound, SampleFlag.UNTIMED, 0.11)) == {"timing"}
    assert not flagged(sound, SampleFlag.UNTIMED, 0.5).fresh[:10].any()


def test_a_sync_is_left_out_where_the_next_is_nearer_to_its_instant() -> None:
    sound = carried_out(GRAVITY)
    for late, findings in ((0.4, set()), (0.7, {"gaps"})):
        delays = np.zeros(sound.n_samples)
        delays[10::20] = late * PERIOD
        assert found(replace(sound, time=sound.time + np.cumsum(delays))) & {"gaps"} == findings


def test_steps_of_a_coarse_encoder_are_no_jump_and_larger_ones_are() -> None:
    n, step = 1000, 1e-3
    creeping = record(np.zeros((n, 2)), np.zeros(n), np.full(n, IDLE))
    for counts, resolution, jumps in ((1, step, False), (1, 0.0, True), (7, step, True)):
        q = creeping.q.copy()
        q[:, 0] = counts * step * (np.arange(n) // 250)
        if jumps:
            with pytest.raises(Tripped, match="axis 1: its position jumps"):
                refuse_jumps(replace(creeping, q=q), 8.0, (resolution, 0.0))
        else:
            refuse_jumps(replace(creeping, q=q), 8.0, (resolution, 0.0))
