"""Columns of a second source with another clock rate, or with jumps, are detected."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import TABLE_3_A

from hil.friction.direction import friction_direction
from hil.imports.evidence import Evidence, Excerpt, beyond_noise
from hil.imports.mechanics import mechanical_suspicions
from hil.imports.plausibility import coarse, suspicions
from hil.imports.two_clocks import clock_of_torques, clock_of_velocities
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot

PERIOD, W = 0.005, 2 * np.pi * np.array([0.31, 0.37, 0.47, 0.53, 0.61, 0.71])
MOVING = np.ones(6, dtype=bool)


def recorded(robot, begin, lag_of_tau, lag_of_qd):
    """Return 10 s of a free motion with friction; torques and velocities are by other clocks."""
    t, rng = begin + np.arange(0, 10, PERIOD), np.random.default_rng(1)

    def motion(at):
        phase = np.outer(at, W)
        return 0.5 * np.sin(phase), 0.5 * W * np.cos(phase), -0.5 * W**2 * np.sin(phase)

    q, qd, qdd = motion(t - lag_of_tau(t))
    tau = inverse_dynamics(robot, TABLE_3_A, q, qd, qdd) + robot.reflected_inertia * qdd
    tau += 10 * np.tanh(qd / 0.03) + 0.2 * rng.standard_normal(q.shape)
    qd = motion(t - lag_of_qd(t))[1] + 0.002 * rng.standard_normal(q.shape)
    q = motion(t)[0] + 1e-5 * rng.standard_normal(q.shape)
    return Excerpt(PERIOD, q, tau, qd, 1500, begin)


def said(robot, lag_of_tau=lambda t: 0 * t, lag_of_qd=lambda t: 0 * t):
    excerpts = [recorded(robot, begin, lag_of_tau, lag_of_qd) for begin in (0.0, 25.0)]
    found = [*clock_of_torques(excerpts, robot, MOVING), *clock_of_velocities(excerpts, MOVING)]
    assert not any(each.certain for each in found)
    return [each.message.partition(";")[0].partition(" than the positions: ") for each in found]


def test_friction_that_reverses_over_a_distance_is_named_beside_a_delay(manutec):
    excerpts = [recorded(manutec, begin, np.zeros_like, np.zeros_like) for begin in (0, 20, 60)]
    late = []
    for each in excerpts:
        way = np.transpose([friction_direction(q, 0.02) for q in each.q.T])
        late.append(replace(each, tau=each.tau + 100 * way - 10 * np.tanh(each.qd / 0.03)))
    (found,) = clock_of_torques(late, manutec, MOVING)
    assert " ms, or friction reverses only over some distance (presliding); " in found.message


@pytest.mark.parametrize("lag", [0.0, 0.05, -0.02])
def test_one_clock_raises_no_suspicion_of_two_whatever_the_lag(manutec, lag):
    found = said(manutec, lambda t: lag + 0 * t, lambda t: lag + 0 * t)
    assert [words.split(" of some ")[0] for words, *_ in found] == [
        f"torques of all joints have a {'delay' if lag > 0 else 'lead'}"
    ] * bool(lag)
    assert "presliding" not in str(found)


def test_a_delay_of_more_than_half_a_period_of_the_motion_is_none_of_two_clocks(
    manutec, monkeypatch
):
    monkeypatch.setitem(globals(), "W", 2 * W)
    ((words, *_), *_) = said(manutec, lambda t: 0.3 + 0 * t)
    assert words == "torques of all joints have a delay of some 300 ms"


def test_a_delay_is_as_well_a_low_pass_or_commanded_positions(manutec):
    excerpts = [recorded(manutec, 0.0, lambda t: 0.05 + 0 * t, lambda t: 0 * t)]
    (delay,) = clock_of_torques(excerpts, manutec, MOVING)
    assert "or low-passed, or positions are commanded ones" in delay.message


@pytest.mark.parametrize(
    ("lag", "words"),
    [
        (lambda t: 0.004 * t, r"their lag goes from \d+ ms at 1 s to 13\d ms at 34 s, like clocks"
                              r" that differ by 0\.4\d? %"),
        (lambda t: -0.1 * (t > 25), r"their lag jumps by -(9\d|10\d) ms between \d+ and 26 s"),
    ],
)  # fmt: skip
def test_a_lag_that_changes_is_of_another_clock(manutec, lag, words):
    ((torques, _, changes),) = said(manutec, lag_of_tau=lag)
    assert torques == "torques of all joints have another clock"
    assert re.fullmatch(words, changes), changes
    ((velocities, _, changes),) = said(manutec, lag_of_qd=lag)
    assert velocities == "velocities of all joints have another clock"
    assert re.fullmatch(words, changes), changes


@pytest.mark.parametrize(("share", "refused"), [(0.004, False), (0.012, True)])
def test_velocities_by_another_clock_are_not_said_to_follow_no_position(manutec, share, refused):
    lag = lambda t: share * (t - 17.0)  # noqa: E731 - which lowers sizes and correlations
    excerpts = [recorded(manutec, begin, lambda t: 0 * t, lag) for begin in (0.0, 25.0)]
    correlation = [np.corrcoef(e.qd[:, 5], np.gradient(e.q[:, 5]))[0, 1] for e in excerpts]
    assert (min(correlation) < 0.9) == refused
    (first, *rest) = suspicions(excerpts, Evidence.join(excerpts), manutec)
    assert first.message.startswith("velocities of all joints have another clock than the")
    assert (first.certain, first.check) == (refused, "velocity")
    assert not [each for each in rest if each.location[-1] == "velocity"]


def test_noise_of_coarse_positions_is_no_lead_of_the_torques():
    # the lead has viscous friction stand for the inertia that the noise of accelerations lowers
    robot = Robot.load(Path(__file__).parents[2] / "robots" / "cartesian.yaml")
    t, w = np.arange(0, 10, 0.004)[:, None], 2 * np.pi * np.array([0.41, 0.47, 0.53])
    q, qd, qdd = 0.3 * np.sin(w * t), 0.3 * w * np.cos(w * t), -0.3 * w**2 * np.sin(w * t)
    tau = np.array([172.0, 56.0, 22.0]) * qdd + [0.0, 0.0, 219.0]
    tau += np.array([100.0, 50.0, 20.0]) * qd + 10.0 * np.sign(qd)
    excerpts = [Excerpt(0.004, 0.001 * np.round(q / 0.001), tau, qd, 1500)]
    shown = ~coarse(Evidence.join(excerpts))
    assert shown.any()
    assert not list(clock_of_torques(excerpts, robot, shown))


@pytest.mark.parametrize("seed", [0, 2])
def test_noise_of_coarse_positions_is_no_other_rate_or_clock(manutec, seed):
    rng, t = np.random.default_rng(seed), np.arange(0, 20, 0.004)[:, None]
    w = 2 * np.pi * np.array([0.1, 0.2, 0.3, 0.5])
    a = rng.normal(size=(4, 6)) / w[:, None]
    a *= 0.4 * manutec.velocity_limit / (np.abs(a).T @ w)
    phase, each = rng.uniform(0, 6.28, (4, 6)), [*zip(w, range(4), strict=True)]
    q, qd, qdd = (
        sum(f**n * a[k] * np.sin(f * t + phase[k] + n * np.pi / 2) for f, k in each)
        for n in range(3)
    )
    tau = inverse_dynamics(manutec, TABLE_3_A, q, qd, qdd) + manutec.reflected_inertia * qdd
    tau += 0.1 * tau.std(axis=0) * (np.sign(qd) + qd / qd.std(axis=0))
    step = 2 * np.pi / 1024
    excerpts = [Excerpt(0.004, step * np.round(q / step), tau, qd, 1500)]
    assert not list(mechanical_suspicions(excerpts, manutec, ~coarse(Evidence.join(excerpts))))


def test_a_joint_that_another_reading_explains_less_counts_against_it_whatever_the_noise():
    left, here = np.array([4.0, 4.0, 1.0]), np.array([1.0, 3.5, 2.0])
    assert beyond_noise(left, here, np.full(3, 1.0)).tolist() == [3.0, 3.5, 1.0]
    assert beyond_noise(left, here, np.full(3, np.inf)).tolist() == [1.0, 3.5, 1.0]
