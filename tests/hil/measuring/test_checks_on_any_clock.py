"""All checks of a recording, with exact and with uncertain instants.

Each fault is added to the true motion of a sound recording, which is then sampled: exactly, at
instants that differ from their time stamps, or with telegrams doubled, late and missing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from any_clock import ACCELERATION, CLOCKS, ROBOT, SOUND

from drivers.drive_bus import SampleFlag, Tripped
from hil.measuring.checks.encoder_jumps import refuse_jumps
from hil.measuring.checks.recording_checks import check
from hil.runs.recording import IDLE, Recording

if TYPE_CHECKING:
    from collections.abc import Callable

LOOP = 0.02
"""Time in which a drive's loop corrects a jump [s]."""
SEEDS = range(20)
on_any_clock = pytest.mark.parametrize("clock", CLOCKS, ids=lambda each: each.__name__)


def jumped(recording: Recording, axis: int, at: int, size: float) -> Recording:
    """Add an encoder jump, after which the loop restores the shown position."""
    q, since = recording.q.copy(), recording.time[at:] - recording.time[at]
    q[at:, axis] += size * np.exp(-since / LOOP)
    return replace(recording, q=q)


def jumps(recording: Recording) -> str:
    try:
        refuse_jumps(recording, ACCELERATION)
    except Tripped as error:
        return str(error)
    return ""


@on_any_clock
@pytest.mark.parametrize("kind", SOUND)
@pytest.mark.filterwarnings("error")
def test_a_sound_motion_has_no_jumps(clock: Callable[..., Recording], kind: str) -> None:
    for seed in SEEDS:
        assert jumps(clock(SOUND[kind][1], np.random.default_rng(seed))) == ""


@on_any_clock
@pytest.mark.parametrize("kind", SOUND)
@pytest.mark.parametrize("size", [0.01, -0.01, 0.1, -1.0])
def test_a_jump_of_ten_milliradians_is_found_at_rest_and_in_motion(
    clock: Callable[..., Recording], kind: str, size: float
) -> None:
    sound, found = SOUND[kind][1], 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        axis, at = int(rng.integers(2)), int(rng.integers(5, sound.n_samples - 5))
        message = jumps(jumped(clock(sound, rng), axis, at, size))
        found += f"axis {axis + 1}: its position jumps by" in message
    assert found == len(SEEDS)


@on_any_clock
def test_a_jump_of_two_milliradians_is_found_at_rest(clock: Callable[..., Recording]) -> None:
    """Axis 2 rests while axis 1 moves; the telegram of the jump itself may be missing or late."""
    sound, found = SOUND["gravity"][1], 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        at = int(rng.integers(5, sound.n_samples - 5))
        found += "axis 2" in jumps(jumped(clock(sound, rng), 1, at, 2e-3))
    assert found >= 0.95 * len(SEEDS)


def test_a_jump_within_a_short_travel_is_found() -> None:
    """Jump and return are two of sixty samples, more than the tolerated one in a hundred."""
    short = {name: array[:60] for name, array in SOUND["gravity"][1].arrays.items()}
    for size in (2e-3, 0.01, 0.1):
        assert "axis 1" in jumps(jumped(Recording(**short), 0, 30, size))


def test_a_bend_of_whole_increments_is_not_judged_by_rounding() -> None:
    """Backlash throws the motor by three increments: the bend is five, the largest accepted."""
    resolution, n = 2 * np.pi / 4096 / 99, 400
    steps = np.zeros(n)
    steps[200:204] = 1, 4, 2, 1
    still = {name: array[:n] for name, array in SOUND["gravity"][1].arrays.items()}
    for more, found in ((0, 0), (1, 100)):
        steps[201] += more
        refused = 0
        for start in range(100):
            recording = Recording(**still)
            recording = replace(recording, q=resolution * (start + np.tile(steps, (2, 1)).T))
            try:
                refuse_jumps(recording, 0.5, resolution)
            except Tripped:
                refused += 1
        assert refused == found


def _slowed(sound: Recording) -> Recording:
    return replace(sound, q=0.85 * sound.q)


def _creep_interrupted(sound: Recording) -> Recording:
    """Stop the slow axis for 0.4 s in its first stroke."""
    q = sound.q.copy()
    q[200:300, 0] = q[200, 0]
    return replace(sound, q=q)


def _partner_at_rest(sound: Recording) -> Recording:
    return replace(sound, partner_stroke=np.full_like(sound.partner_stroke, IDLE))


def _astray(sound: Recording) -> Recording:
    q = sound.q.copy()
    q[300:310, 1] += 0.07
    return replace(sound, q=q)


def _stuck_current(sound: Recording) -> Recording:
    tau = sound.tau.copy()
    tau[100:180, 0] = tau[100, 0]
    return replace(sound, tau=tau)


def _changed_friction(sound: Recording) -> Recording:
    return replace(sound, tau=sound.tau + 15.0 * (sound.stroke == 3)[:, None])


def _saturated(sound: Recording) -> Recording:
    flags = sound.flags.copy()
    flags[100:103, 0] = SampleFlag.LIMIT
    return replace(sound, flags=flags)


def _lose_telegrams(sound: Recording) -> Recording:
    q, flags = sound.q.copy(), sound.flags.copy()
    q[100:150, 1], flags[100:150, 1] = np.nan, SampleFlag.MISSING
    return replace(sound, q=q, flags=flags)


def _doubled(sound: Recording) -> Recording:
    flags = sound.flags.copy()
    flags[100:150, 1] = SampleFlag.DOUBLED
    return replace(sound, flags=flags)


def _opposed(sound: Recording) -> Recording:
    return replace(sound, tau=-sound.tau)


FAULTS = [
    ("gravity", _opposed, "sign"),
    ("friction", _opposed, "sign"),
    ("coupling", _opposed, "sign"),
    ("gravity", _slowed, "velocity"),
    ("friction", _slowed, "velocity"),
    ("inertia", _slowed, "velocity"),
    ("coupling", _creep_interrupted, "stuck"),
    ("coupling", _partner_at_rest, "partner"),
    ("trajectory", _astray, "astray"),
    ("gravity", _stuck_current, "current"),
    ("gravity", _changed_friction, "half-sums"),
    ("gravity", _saturated, "saturation"),
    ("gravity", _lose_telegrams, "gaps"),
    ("gravity", _doubled, "telegrams"),
]


@on_any_clock
@pytest.mark.parametrize("kind", SOUND)
@pytest.mark.filterwarnings("error")
def test_a_sound_recording_passes_all_checks(clock: Callable[..., Recording], kind: str) -> None:
    measurement, sound = SOUND[kind]
    for seed in SEEDS:
        assert check(clock(sound, np.random.default_rng(seed)), measurement, ROBOT) == []


@on_any_clock
@pytest.mark.parametrize(("kind", "fault", "name"), FAULTS)
@pytest.mark.filterwarnings("error")
def test_each_check_finds_its_fault(
    clock: Callable[..., Recording], kind: str, fault: Callable[[Recording], Recording], name: str
) -> None:
    measurement, sound = SOUND[kind]
    for seed in SEEDS:
        findings = check(clock(fault(sound), np.random.default_rng(seed)), measurement, ROBOT)
        assert name in {finding.check for finding in findings}
