"""Values renewed less often than SYNC are refused or flagged, and not used."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from any_clock import ACCELERATION, CLOCKS, PERIOD, ROBOT, SOUND

from drivers.drive_bus import DriveRefused, SampleFlag
from hil.estimation.signals import signals
from hil.measuring.checks.encoder_jumps import mark_old_values
from hil.measuring.checks.recording_checks import LASTING, check

if TYPE_CHECKING:
    from hil.runs.recording import Recording

AXES = cast(
    "Any",
    [
        SimpleNamespace(name=f"joint {n}", position_resolution=1e-5, torque_resolution=0.1)
        for n in (1, 2)
    ],
)
RENEWALS = [2, 3, 5, 8]


def held(values: np.ndarray, every: int) -> np.ndarray:
    return values[np.arange(len(values)) // every * every]


def stepped(recording: Recording) -> Recording:
    """Return the recording with the resolution of encoder and current."""
    q = np.round(recording.q / 1e-5) * 1e-5
    return replace(recording, q=q, tau=np.round(recording.tau / 0.1) * 0.1)


@pytest.mark.parametrize("clock", CLOCKS, ids=lambda each: each.__name__)
@pytest.mark.parametrize("kind", SOUND)
def test_nothing_is_old_in_a_sound_recording(clock: Any, kind: str) -> None:
    for seed in range(10):
        sound = stepped(clock(SOUND[kind][1], np.random.default_rng(seed)))
        flags = mark_old_values(sound, ACCELERATION, AXES).flags & SampleFlag.OLD
        assert np.mean(flags != 0) < 2e-3  # doubled telegrams repeat values


@pytest.mark.parametrize("every", RENEWALS)
@pytest.mark.parametrize("kind", SOUND)
def test_a_position_that_is_renewed_too_rarely_is_refused_with_the_period(
    kind: str, every: int
) -> None:
    sound = stepped(SOUND[kind][1])
    q = sound.q.copy()
    q[:, 0] = held(q[:, 0], every)
    with pytest.raises(DriveRefused, match="joint 1: position updated only every") as caught:
        mark_old_values(replace(sound, q=q), ACCELERATION, AXES)
    assert f"set sync_period: {every * PERIOD:.3g} or more" in str(caught.value)


def test_a_creep_by_twice_the_resolution_is_not_judged_by_rounding() -> None:
    sound = SOUND["gravity"][1]
    q, creep = sound.q.copy(), 2 * (np.arange(sound.n_samples) // 2)
    for start in range(50):
        q[:, 0] = 1e-5 * (start + creep)
        mark_old_values(replace(sound, q=q), 0.1, AXES)


@pytest.mark.parametrize("every", RENEWALS)
def test_a_current_that_is_renewed_too_rarely_is_flagged_and_only_fresh_ones_are_estimated(
    every: int,
) -> None:
    measurement, sound = SOUND["gravity"]
    sound = stepped(sound)
    tau = sound.tau.copy()
    tau[:, 0] = held(tau[:, 0], every)
    flagged = mark_old_values(replace(sound, tau=tau), ACCELERATION, AXES)
    assert np.mean(flagged.flags[:, 0] == SampleFlag.OLD) == pytest.approx(1 - 1 / every, abs=0.05)
    assert not flagged.flags[:, 1].any()
    (finding,) = (f for f in check(flagged, measurement, ROBOT) if f.check == "renewal")
    assert finding.check in LASTING
    assert f"every {every} SYNCs" in finding.message
    assert f"set sync_period: {every * PERIOD:.3g} in the drives file" in finding.message
    used = signals(flagged)
    assert used.period == pytest.approx(every * PERIOD)
    at = np.rint((used.time[used.valid] - flagged.time[0]) / PERIOD).astype(int)
    assert used.tau[used.valid, 0] == pytest.approx(sound.tau[at, 0], abs=1e-9)


@pytest.mark.parametrize("every", [*RENEWALS, 20])
def test_a_current_that_is_renewed_too_rarely_from_the_middle_on_is_flagged_from_there(
    every: int,
) -> None:
    measurement, sound = SOUND["gravity"]
    sound = stepped(sound)
    tau, half = sound.tau.copy(), len(sound.tau) // 2
    tau[half:, 0] = held(tau[half:, 0], every)
    flagged = mark_old_values(replace(sound, tau=tau), ACCELERATION, AXES)
    old = flagged.flags == SampleFlag.OLD
    assert np.mean(old[half:, 0]) == pytest.approx(1 - 1 / every, abs=0.05)
    assert np.mean(old[:half, 0]) < 0.02
    assert not old[:, 1].any()
    assert "renewal" in {finding.check for finding in check(flagged, measurement, ROBOT)}


def test_one_telegram_that_repeats_the_one_before_is_flagged_alone() -> None:
    sound = stepped(SOUND["gravity"][1])
    q = sound.q.copy()
    q[100, 0] = q[99, 0]
    flags = mark_old_values(replace(sound, q=q), ACCELERATION, AXES).flags
    assert np.flatnonzero(flags[:, 0]).tolist() == [100]
