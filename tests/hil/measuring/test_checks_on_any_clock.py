"""Every check of a recording, where instants are exact, and where they are not.

Each fault is put into a sound recording as the axes truly moved, which is then sampled: exactly, at
instants that differ from their time stamps, or with telegrams doubled, late and missing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.drive_bus import SampleFlag, Tripped
from hil.measuring.checks.encoder_jumps import refuse_jumps
from hil.measuring.checks.recording_checks import check
from hil.model.robot import load_robot
from hil.planning.measurement import Coupling, Friction, Gravity, Inertia
from hil.planning.strokes import Partner
from hil.planning.trajectory import Trajectory
from hil.runs.recording import IDLE, Recording

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.planning.strokes import Strokes

PERIOD, ACCELERATION, LOOP = 0.004, 8.0, 0.02
"""Of SYNC, of all motions, and the time in which a drive's loop takes a jump back [s, rad/s^2]."""
ROBOT = load_robot("manutec-r15")
OWN = {"id": "m", "axis": 1, "q": (0.0, 0.0), "acceleration": ACCELERATION, "cycles": 2}
GRAVITY = Gravity(**OWN, stroke=0.4, velocity=0.4)
INERTIA = Inertia(**OWN, stroke=0.4, velocity=0.4)
FRICTION = Friction(**OWN, stroke=0.4, velocity=0.4)
COUPLING = Coupling(
    **OWN,
    stroke=0.3,
    velocity=0.1,
    partner=Partner(axis=2, stroke=0.2, velocity=0.5, acceleration=ACCELERATION),
)
WAVE = Trajectory(
    id="t",
    q=(0.0, 0.0),
    period=4.0,
    sine=((0.4, -0.2), (0.2, -0.1)),
    cosine=((0.2, -0.05), (0.4, -0.1)),
)
SEEDS = range(20)


def carried_out(measurement: Strokes) -> Recording:
    """Strokes as planned, with rests between them in which telegrams may go wrong."""
    q, stroke, partner = [], [], []
    for number in range(measurement.n_strokes):
        profile = measurement.profile(number)
        t = np.arange(0.0, profile.duration, PERIOD)
        second = _partner(measurement, t) if measurement.partners else np.full((len(t), 2), IDLE)
        rest = np.full(25, 1.0)
        q += [np.column_stack([profile.q(t), second[:, 0]])]
        q += [np.column_stack([rest * profile.end, rest * second[-1, 0]])]
        stroke += [np.full(len(t), number), rest * IDLE]
        partner += [second[:, 1], rest * IDLE]
    return of(np.concatenate(q), np.concatenate(stroke), np.concatenate(partner))


def _partner(measurement: Strokes, t: np.ndarray) -> np.ndarray:
    """Position and stroke number of the partner, which goes back and forth from 0.4 s on."""
    (partner,) = measurement.partners
    seen = np.full((len(t), 2), (partner.profile(measurement.q, 0).start, IDLE))
    for number in range(4):
        profile = partner.profile(measurement.q, number)
        since = t - 0.4 - number * (profile.duration + 0.1)
        seen[since >= 0] = np.column_stack([profile.q(since), np.full(len(t), number)])[since >= 0]
        seen[(since > profile.duration), 1] = IDLE
    return seen


def followed() -> Recording:
    path = WAVE.path(PERIOD)
    return of(path, np.zeros(len(path)), np.full(len(path), IDLE))


def of(q: np.ndarray, stroke: np.ndarray, partner: np.ndarray) -> Recording:
    velocity = np.gradient(q, PERIOD, axis=0)
    noise = np.random.default_rng(3).normal(0, 1.0, q.shape)
    return Recording(
        time=PERIOD * np.arange(len(q)),
        q=q,
        tau=100 * np.tanh(velocity / 0.02) + noise,
        flags=np.zeros(q.shape, dtype=np.uint8),
        stroke=stroke.astype(np.int16),
        partner_stroke=partner.astype(np.int16),
    )


SOUND: dict[str, tuple[Strokes | Trajectory, Recording]] = {
    each.kind: (each, carried_out(each)) for each in (GRAVITY, INERTIA, FRICTION, COUPLING)
} | {WAVE.kind: (WAVE, followed())}


def exact(recording: Recording, rng: np.random.Generator) -> Recording:
    del rng
    return recording


def latched_late(recording: Recording, rng: np.random.Generator) -> Recording:
    """SYNC reaches the drives 0.3 ms after its time stamp on average, up to a period after it."""
    late = np.minimum(rng.exponential(3e-4, recording.n_samples), PERIOD)
    stamps = recording.time + rng.normal(0.0, 1e-5, recording.n_samples)
    return replace(latched(recording, late), time=stamps)


def irregular(recording: Recording, rng: np.random.Generator) -> Recording:
    """SYNC is sent late, by up to 0.4 periods, and the time stamp says so."""
    late = rng.uniform(0.0, 0.4 * PERIOD, recording.n_samples)
    return replace(latched_late(latched(recording, late), rng), time=recording.time + late)


def latched(recording: Recording, late: np.ndarray) -> Recording:
    instants = recording.time + late
    q = [np.interp(instants, recording.time, each) for each in recording.q.T]
    return replace(recording, q=np.column_stack(q))


def badly_stamped(recording: Recording, rng: np.random.Generator) -> Recording:
    """One time stamp in two hundred is later than SYNC was by up to half a period."""
    late = rng.uniform(0.0, PERIOD / 2, recording.n_samples) * (
        rng.random(recording.n_samples) < 5e-3
    )
    return replace(latched_late(recording, rng), time=recording.time + late)


def disturbed(recording: Recording, rng: np.random.Generator) -> Recording:
    """Of a thousand samples two are doubled, two are late, after a missing one, and two skipped."""
    n = recording.n_samples
    q, tau, flags = recording.q.copy(), recording.tau.copy(), recording.flags.copy()
    for at in rng.choice(np.arange(2, n - 2), n // 500, replace=False):
        axis = rng.integers(2)
        q[at, axis] = tau[at, axis] = np.nan
        flags[at, axis] |= SampleFlag.MISSING
        q[at + 1, axis], tau[at + 1, axis] = recording.q[at, axis], recording.tau[at, axis]
        flags[at + 1, axis] |= SampleFlag.LATE
    often = np.ones(n, dtype=int)
    often[rng.choice(np.arange(1, n - 1), n // 500, replace=False)] = 2
    often[rng.choice(np.arange(1, n - 1), n // 500, replace=False)] = 0
    rows = np.repeat(np.arange(n), often)
    flags = flags[rows]
    flags[np.flatnonzero(np.diff(rows) == 0) + 1] |= np.uint8(SampleFlag.DOUBLED)
    return replace(
        recording, time=recording.time[rows], q=q[rows], tau=tau[rows], flags=flags,
        stroke=recording.stroke[rows], partner_stroke=recording.partner_stroke[rows],
    )  # fmt: skip


def all_of_it(recording: Recording, rng: np.random.Generator) -> Recording:
    return disturbed(irregular(recording, rng), rng)


CLOCKS = [exact, latched_late, irregular, badly_stamped, disturbed, all_of_it]
on_any_clock = pytest.mark.parametrize("clock", CLOCKS, ids=lambda each: each.__name__)


def jumped(recording: Recording, axis: int, at: int, size: float) -> Recording:
    """The encoder jumps, and the loop takes the axis back to what the encoder showed."""
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
    """Of sixty samples one jump and its way back are more than the one in a hundred of usual."""
    short = {name: array[:60] for name, array in SOUND["gravity"][1].arrays.items()}
    for size in (2e-3, 0.01, 0.1):
        assert "axis 1" in jumps(jumped(Recording(**short), 0, 30, size))


def _slowed(sound: Recording) -> Recording:
    return replace(sound, q=0.85 * sound.q)


def _creep_interrupted(sound: Recording) -> Recording:
    """The creeping axis stands for 0.4 s in its first stroke."""
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


def _without_telegrams(sound: Recording) -> Recording:
    q, flags = sound.q.copy(), sound.flags.copy()
    q[100:150, 1], flags[100:150, 1] = np.nan, SampleFlag.MISSING
    return replace(sound, q=q, flags=flags)


def _doubled(sound: Recording) -> Recording:
    flags = sound.flags.copy()
    flags[100:150, 1] = SampleFlag.DOUBLED
    return replace(sound, flags=flags)


FAULTS = [
    ("gravity", _slowed, "velocity"),
    ("friction", _slowed, "velocity"),
    ("inertia", _slowed, "velocity"),
    ("coupling", _creep_interrupted, "stuck"),
    ("coupling", _partner_at_rest, "partner"),
    ("trajectory", _astray, "astray"),
    ("gravity", _stuck_current, "current"),
    ("gravity", _changed_friction, "half-sums"),
    ("gravity", _saturated, "saturation"),
    ("gravity", _without_telegrams, "gaps"),
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
