"""Defects visible in whole recordings only: encoder jumps, constant current."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.drive_bus import SampleFlag, Tripped
from hil.measuring.checks.encoder_jumps import refuse_jumps
from hil.measuring.checks.recording_checks import (
    ALWAYS,
    check,
    constant_velocity,
    frozen,
    half_sums,
    windows,
)
from hil.model.robot import Robot
from hil.planning.measurement import Gravity
from hil.runs.recording import IDLE, Recording

PERIOD, ACCELERATION = 0.004, 8.0
ROBOT = Robot.load("manutec-r15")
MEASUREMENT = Gravity(
    id="g", axis=1, q=(0.0, 0.0), stroke=0.4, velocity=0.4, acceleration=ACCELERATION, cycles=2
)


def recording(seed: int = 0, noise: float = 1.0, resolution: float = 0.1) -> Recording:
    """Return strokes of the first of two axes; positions in increments, torque with noise."""
    rng = np.random.default_rng(seed)
    strokes = [MEASUREMENT.profile(k) for k in range(MEASUREMENT.n_strokes)]
    times = [np.arange(0.0, profile.duration, PERIOD) for profile in strokes]
    pairs = list(zip(strokes, times, strict=True))
    q = np.concatenate([profile.q(t) for profile, t in pairs])
    velocity = np.concatenate([profile.motion(t)[1] for profile, t in pairs])
    n = len(q)
    torque = 100 * np.tanh(velocity / 0.02) + rng.normal(0, noise, n)
    numbers = np.concatenate([np.full(len(t), k, dtype=np.int16) for k, t in enumerate(times)])
    return Recording(
        time=PERIOD * np.arange(n),
        q=np.round(np.column_stack([q, np.zeros(n)]) / 1e-5) * 1e-5,
        tau=np.round(np.column_stack([torque, np.zeros(n)]) / resolution) * resolution,
        flags=np.zeros((n, 2), dtype=np.uint8),
        stroke=numbers,
        partner_stroke=np.full(n, -1, dtype=np.int16),
    )


def test_a_sound_motion_has_no_jumps() -> None:
    refuse_jumps(recording(), ACCELERATION)


@given(
    size=st.floats(1.5e-3, 0.1),
    sign=st.sampled_from([-1, 1]),
    at=st.integers(2, 1000),
    axis=st.integers(0, 1),
)
def test_a_jump_is_found_on_any_axis_at_any_time(
    size: float, sign: int, at: int, axis: int
) -> None:
    sound = recording()
    q = sound.q.copy()
    q[at:, axis] += sign * size
    with pytest.raises(Tripped, match=f"axis {axis + 1}: its position jumps by") as caught:
        refuse_jumps(replace(sound, q=q), ACCELERATION)
    assert "reference the axis anew" in str(caught.value)


def test_missing_samples_are_no_jump() -> None:
    sound = recording()
    q = sound.q.copy()
    q[100:110, 0] = np.nan
    refuse_jumps(replace(sound, q=q), ACCELERATION)


@given(seed=st.integers(0, 1000), jitter=st.floats(0.0, 0.4))
def test_a_sync_that_comes_late_is_no_jump(seed: int, jitter: float) -> None:
    sound = recording()
    late = np.random.default_rng(seed).uniform(-jitter / 2, jitter / 2, sound.n_samples) * PERIOD
    refuse_jumps(replace(sound, time=sound.time + late), ACCELERATION)


@given(
    seed=st.integers(0, 1000), noise=st.floats(0.05, 3.0), resolution=st.sampled_from([0.01, 0.1])
)
def test_a_sound_current_is_never_taken_for_a_stuck_one(
    seed: int, noise: float, resolution: float
) -> None:
    assert list(frozen(recording(seed, noise, resolution), MEASUREMENT, ROBOT)) == []


@given(begin=st.integers(0, 900), length=st.integers(25, 100))
def test_a_stuck_current_is_found(begin: int, length: int) -> None:
    sound = recording()
    tau = sound.tau.copy()
    tau[begin : begin + length, 0] = tau[begin, 0]
    (finding,) = frozen(replace(sound, tau=tau), MEASUREMENT, ROBOT)
    assert finding.check == "current"
    assert finding.value >= length
    assert "stuck, clipped or too coarse" in finding.message


def test_a_clipped_current_is_found() -> None:
    sound = recording()
    (finding,) = frozen(replace(sound, tau=np.clip(sound.tau, -90, 90)), MEASUREMENT, ROBOT)
    assert "90 N m" in finding.message


def steps(size: float) -> Recording:
    """Return strokes whose noise hides friction; the torque of the last one is `size` higher."""
    sound = recording(noise=0.0)
    tau = 0.01 * sound.tau + np.random.default_rng(5).normal(0.0, 20.0, sound.tau.shape)
    tau[sound.stroke == 3] += size
    return replace(sound, tau=tau)


def test_half_sums_may_differ_by_what_noise_makes_of_their_means_and_no_more() -> None:
    n = min(len(constant_velocity(recording(), MEASUREMENT, k)) for k in range(4))
    error = 20.0 / np.sqrt(n)
    assert list(half_sums(steps(0.0), MEASUREMENT, ROBOT)) == []
    (finding,) = half_sums(steps(20 * error), MEASUREMENT, ROBOT)
    assert finding.check == "half-sums"
    assert finding.bound == pytest.approx(4 * error, rel=0.5)


def test_findings_of_a_sliding_axis_are_in_metres_and_newtons() -> None:
    sliding = Robot.load(Path(__file__).parents[2] / "robots" / "cartesian.yaml")
    sound = recording()
    stuck_sensor = replace(sound, tau=np.zeros_like(sound.tau))
    (of_current,) = frozen(stuck_sensor, MEASUREMENT, sliding)
    assert " reads 0 N in " in of_current.message
    half_as_far = replace(sound, q=sound.q / 2)
    assert {f.message.count(" m/s") for f in windows(half_as_far, MEASUREMENT, sliding)} >= {2}
    jumped = sound.q.copy()
    jumped[500:, 0] += 0.1
    with pytest.raises(Tripped, match=r"jumps by 0.1 m at"):
        refuse_jumps(replace(sound, q=jumped), ACCELERATION, units=["m", "m"])


def lose_syncs(count: int) -> Recording:
    """Return a recording in which every fifteenth SYNC, `count` in all, is missing."""
    whole = recording()
    there = np.ones(whole.n_samples, dtype=bool)
    there[10 : 10 + 15 * count : 15] = False
    names = "time", "q", "tau", "flags", "stroke", "partner_stroke"
    return Recording(**{name: getattr(whole, name)[there] for name in names})


def test_one_sample_in_a_hundred_may_be_missing_and_no_more() -> None:
    """1016 SYNCs: ten may be missing."""
    most = recording().n_samples // 100
    assert "gaps" not in {each.check for each in check(lose_syncs(most), MEASUREMENT, ROBOT)}
    found = {each.check: each for each in check(lose_syncs(most + 1), MEASUREMENT, ROBOT)}
    assert (found["gaps"].value, found["gaps"].bound) == (most + 1, most)


def test_of_a_short_recording_one_sample_may_be_missing() -> None:
    whole = recording()
    names = "time", "q", "tau", "flags", "stroke", "partner_stroke"
    short = Recording(**{name: getattr(whole, name)[:60] for name in names})
    for missing in (1, 2):
        flags = short.flags.copy()
        flags[20 : 20 + missing, 0] = SampleFlag.MISSING
        found = [each.check for each in ALWAYS[0](replace(short, flags=flags), MEASUREMENT, ROBOT)]
        assert found == ["gaps"] * (missing > 1)


def test_a_limit_counts_while_the_axis_moves_alone() -> None:
    """An axis may be at its limit at rest and during travel, since these samples are not used."""
    sound = recording()
    stroke = sound.stroke.copy()
    stroke[:50] = IDLE
    flags = sound.flags.copy()
    flags[10:20, 0] = SampleFlag.LIMIT
    held = replace(sound, stroke=stroke, flags=flags)
    assert "saturation" not in {each.check for each in check(held, MEASUREMENT, ROBOT)}
    flags[100:103, 0] = SampleFlag.LIMIT
    found = {each.check: each for each in check(held, MEASUREMENT, ROBOT)}
    assert found["saturation"].value == 3


def test_a_limit_after_a_late_set_point_is_the_computers() -> None:
    """A drive without new set-points stops at once, with its full torque."""
    sound = recording()
    flags = sound.flags.copy()
    flags[100:103, 0] = SampleFlag.LIMIT
    late = replace(sound, flags=flags, time=sound.time + 0.1 * (np.arange(len(flags)) > 98))
    found = {each.check: each for each in check(late, MEASUREMENT, ROBOT)}
    assert found["saturation"].value == 3
    assert (
        "in 3 samples after late SYNCs, must be 0; stop other programs"
        in found["saturation"].message
    )
    flags[300, 0] = SampleFlag.LIMIT
    found = {each.check: each for each in check(late, MEASUREMENT, ROBOT)}
    assert "in 4 samples, 3 of them after late SYNCs" in found["saturation"].message
    assert "plan a smaller acceleration" in found["saturation"].message


@pytest.mark.parametrize("every", [2, 8])
def test_a_drive_that_answers_only_some_syncs_from_the_middle_on_is_named(every: int) -> None:
    sound = recording()
    flags, half = sound.flags.copy(), sound.n_samples // 2
    flags[half:, 0] |= np.uint8(SampleFlag.MISSING) * (np.arange(len(flags) - half) % every > 0)
    (finding,) = (f for f in ALWAYS[0](replace(sound, flags=flags), MEASUREMENT, ROBOT))
    assert f"answers only every {every} SYNCs: set the inhibit time (1800:03)" in finding.message


def test_telegrams_that_are_lost_at_random_are_no_inhibit_time() -> None:
    sound = recording()
    lost = np.random.default_rng(1).random(sound.flags.shape) < 0.3
    flags = sound.flags | np.uint8(SampleFlag.MISSING) * lost
    (finding,) = (f for f in ALWAYS[0](replace(sound, flags=flags), MEASUREMENT, ROBOT))
    assert "check wiring, termination and bus load" in finding.message
