"""Sound recordings of each kind, sampled at exact and at uncertain instants.

Each recording is sampled exactly, at instants that differ from their time stamps, or with telegrams
doubled, late and missing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import SampleFlag
from hil.model.robot import Robot
from hil.planning.measurement import Coupling, Friction, Gravity, Inertia
from hil.planning.strokes import Partner
from hil.planning.trajectory import Trajectory
from hil.runs.recording import IDLE, Recording

if TYPE_CHECKING:
    from hil.planning.strokes import Strokes

PERIOD, ACCELERATION = 0.004, 8.0
"""SYNC period [s], and acceleration of all motions [rad/s^2]."""
ROBOT = Robot.load("manutec-r15")
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


def carried_out(measurement: Strokes, rests: int = 25) -> Recording:
    """Return strokes as planned, with rests in between during which telegrams may be faulty
    [samples].
    """
    q, stroke, partner = [], [], []
    for number in range(measurement.n_strokes):
        profile = measurement.profile(number)
        t = np.arange(0.0, profile.duration, PERIOD)
        second = _partner(measurement, t) if measurement.partners else np.full((len(t), 2), IDLE)
        rest = np.full(rests, 1.0)
        q += [np.column_stack([profile.q(t), second[:, 0]])]
        q += [np.column_stack([rest * profile.end, rest * second[-1, 0]])]
        stroke += [np.full(len(t), number), rest * IDLE]
        partner += [second[:, 1], rest * IDLE]
    return record(np.concatenate(q), np.concatenate(stroke), np.concatenate(partner))


def _partner(measurement: Strokes, t: np.ndarray) -> np.ndarray:
    """Return position and stroke number of the partner, which moves back
    and forth from 0.4 s on.
    """
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
    return record(path, np.zeros(len(path)), np.full(len(path), IDLE))


def record(q: np.ndarray, stroke: np.ndarray, partner: np.ndarray) -> Recording:
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
    """Sample with SYNC 0.3 ms late at the drives on average, and up to a period late."""
    late = np.minimum(rng.exponential(3e-4, recording.n_samples), PERIOD)
    stamps = recording.time + rng.normal(0.0, 1e-5, recording.n_samples)
    return replace(latched(recording, late), time=stamps)


def irregular(recording: Recording, rng: np.random.Generator) -> Recording:
    """Sample with SYNC sent up to 0.4 periods late, and correct time stamps."""
    late = rng.uniform(0.0, 0.4 * PERIOD, recording.n_samples)
    return replace(latched_late(latched(recording, late), rng), time=recording.time + late)


def latched(recording: Recording, late: np.ndarray) -> Recording:
    instants = recording.time + late
    q = [np.interp(instants, recording.time, each) for each in recording.q.T]
    return replace(recording, q=np.column_stack(q))


def badly_stamped(recording: Recording, rng: np.random.Generator) -> Recording:
    """Sample with one time stamp in two hundred up to half a period late."""
    late = rng.uniform(0.0, PERIOD / 2, recording.n_samples) * (
        rng.random(recording.n_samples) < 5e-3
    )
    return replace(latched_late(recording, rng), time=recording.time + late)


def disturbed(recording: Recording, rng: np.random.Generator) -> Recording:
    """Sample with six faults in a thousand: two doubled, two late after a missing one, and two
    skipped."""
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
