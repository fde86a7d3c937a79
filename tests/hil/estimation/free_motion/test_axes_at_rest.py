"""Axes exactly at rest: what they do not show is named, and all else is identified."""

from dataclasses import replace

import free_run
import numpy as np
import pytest
from free_run import (
    COULOMB,
    OFFSET,
    TRUTH,
    arm,
    classical,
    recorded,
    short_moves,
    some_motion,
    write_free_run,
)

import hil
from hil.estimation import import_methods
from hil.estimation.identify import estimate
from hil.estimation.options import Options
from hil.estimation.prior import Prior
from hil.least_squares.standstill import braked
from hil.model.dynamics import inverse_dynamics, regressor
from hil.model.motors import motor_torque
from hil.model.robot import Robot
from hil.runs.recording import Recording

BODIES = np.array([
    [0.5, 0.1, 0.0, 3.0, 0.0, 3.0, 4.0, 0.5, 0.2, 10.0],
    [0.2, 0.05, 0.0, 1.0, 0.0, 1.1, 1.5, -0.2, 0.1, 4.0],
])  # fmt: skip


def resting(axis):
    """Return a motion with an axis at 0.3 rad."""

    def motion(t, seed=0):
        made = some_motion(t, seed)
        for x, value in zip(made, (0.3, 0.0, 0.0), strict=True):
            x[:, axis] = value
        return made

    return motion


def recordings(monkeypatch, robot, axis, flicker=0.0):
    """Record with an axis at rest; its encoder shows `flicker` in half of the samples [rad]."""
    monkeypatch.setattr(free_run, "some_motion", resting(axis))
    p = np.pad(TRUTH, (0, robot_size(robot) - len(TRUTH)), constant_values=0.4)
    data, rng = recorded(robot, p), np.random.default_rng(2)
    for _, recording in data:
        recording.q[:, axis] += flicker * (rng.uniform(size=recording.n_samples) > 0.5)
    return data, p


def robot_size(robot):
    return regressor(robot, *np.zeros((3, 1, 2))).shape[-1]


def errors(robot, found, motion):
    """Return standard errors of the torques on a motion [N m], (n, 2)."""
    A = regressor(robot, *motion)
    return np.sqrt(np.einsum("njk,kl,njl->nj", A, found.covariance, A))


@pytest.mark.parametrize(("axis", "lost"), [(0, ("p1", "p2", "p3")), (1, ("p7",))])
@pytest.mark.parametrize("flicker", [0.0, 8e-5])
def test_motions_with_the_axis_at_rest_are_predicted(monkeypatch, axis, lost, flicker):
    robot = arm(rotor_inertia="unknown")
    data, p = recordings(monkeypatch, robot, axis, flicker)
    found = estimate(robot, data, "free motion")
    assert found.details.still == (axis + 1,)
    assert found.details.not_identified == lost
    motion = resting(axis)(np.arange(0.0, 20.0, 0.1), 9)
    error = errors(robot, found, motion)[:, 1 - axis]
    wrong = inverse_dynamics(robot, found.values, *motion) - inverse_dynamics(robot, p, *motion)
    assert error.max() < 0.5
    assert np.all(np.abs(wrong[:, 1 - axis]) < 5.0 * error.max())


def test_an_axis_at_rest_has_no_unusual_offset(monkeypatch):
    """Whatever the solution says of its offset, static friction is a part of it."""
    data, _ = recordings(monkeypatch, arm(), 1, 8e-5)
    solved = import_methods.solve

    def unusual(*args, **kwargs):
        return replace(solved(*args, **kwargs), unusual=(0, 1))

    monkeypatch.setattr(import_methods, "solve", unusual)
    assert estimate(arm(), data, "free motion").details.unusual == (1,)


@pytest.mark.parametrize("flicker", [0.0, 8e-5])
def test_the_torque_of_an_axis_held_by_its_brake_is_not_used(monkeypatch, flicker):
    robot = arm()
    data, p = recordings(monkeypatch, robot, 0, flicker)
    for _, recording in data:
        recording.tau[:, 0] = 1e-3 * np.sin(np.arange(recording.n_samples))
    found = estimate(robot, data, "free motion")
    assert any(
        "axis 1: its torque at rest does not follow" in each for each in found.details.remarks
    )
    motion = resting(0)(np.arange(0.0, 20.0, 0.1), 9)
    wrong = inverse_dynamics(robot, found.values, *motion) - inverse_dynamics(robot, p, *motion)
    error = errors(robot, found, motion)[:, 1]
    assert np.all(np.abs(wrong[:, 1]) < 5.0 * error.max())
    assert error.max() < 0.5


@pytest.mark.parametrize("axis", [0, 1])
def test_motions_of_the_axis_itself_are_unknown(monkeypatch, axis):
    robot = arm(rotor_inertia="unknown")
    found = estimate(robot, recordings(monkeypatch, robot, axis)[0], "free motion")
    assert np.mean(errors(robot, found, some_motion(np.arange(0.0, 20.0, 0.1)))[:, axis]) > 10.0


@pytest.mark.parametrize("method", ["improved", "free motion"])
def test_a_prior_of_bodies_leaves_a_rotor_without_data_unidentified(monkeypatch, method):
    robot = arm(rotor_inertia="unknown")
    data, _ = recordings(monkeypatch, robot, 1)
    found = estimate(robot, data, method, Options(prior=Prior(BODIES, 0.3)))
    assert found.details.not_identified == (("p7",) if method == "free motion" else ())
    assert found.covariance[6, 6] > 1.0
    assert np.isfinite(found.covariance).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_wrist_with_a_millionth_of_the_torque_costs_no_parameter_of_the_base(axis):
    """Weights by noise are 10^12 times as large for this wrist, far below its torque limit."""
    link = {
        "q_min": -3.0, "q_max": 3.0, "velocity_limit": 3.0, "acceleration_limit": 20.0,
        "torque_limit": 90.0, "parameters": ["Izz", "sx", "sy"],
    }  # fmt: skip
    frames = ({"alpha": 0}, {"alpha": 0, "d": "l"}, {"alpha": "pi/2", "d": "l"})
    robot = Robot.create(
        "fine_wrist",
        [link | {"frame": frame} for frame in frames],
        gravity=(0.0, -9.81, 0.0),
        lengths={"l": 0.5},
    )
    p = np.array([*TRUTH, *(1e-6 * np.ones(regressor(robot, *np.zeros((3, 1, 3))).shape[-1] - 6))])
    friction = 0.5 * np.array([4.0, 1.5, 2e-6])
    t, rng = free_run.PERIOD * np.arange(5000), np.random.default_rng(6)
    data = []
    for number, (motion, _) in enumerate(recorded(arm(), TRUTH)):
        moves = [
            np.column_stack(each)
            for each in zip(some_motion(t, number), some_motion(t, number + 9), strict=True)
        ]
        moves = [each[:, :3] for each in moves]
        for x, value in zip(moves, (0.3, 0.0, 0.0), strict=True):
            x[:, axis] = value
        tau = inverse_dynamics(robot, p, *moves) + friction * np.sign(moves[1])
        tau += 0.01 * np.sqrt(np.mean(tau**2, axis=0)) * rng.standard_normal(tau.shape)
        still = np.full(len(t), -1, np.int16)
        data.append(
            (
                motion.model_copy(update={"q": (0.0, 0.0, 0.0)}),
                Recording(
                    t, moves[0], tau, np.zeros(tau.shape, np.uint8), still, still, None, None
                ),
            )
        )
    found = estimate(robot, data, "free motion")
    assert found.details.still == (axis + 1,)
    assert len(found.details.not_identified) < 6
    assert max(found.details.relative_residual) < 0.05


@pytest.mark.parametrize("level", [0.0, 4.0])
def test_rests_with_a_closed_brake_are_left_out(level):
    """While an axis rests, its drive records a constant torque; the brake carries the load."""
    robot, data = arm(), recorded(arm(), TRUTH)
    rng = np.random.default_rng(3)
    for _, recording in data:
        t = recording.time
        motion = [each.copy() for each in some_motion(t, 1)]
        for axis, rests, end in ((0, t < 8, -1), (1, t > 12, 0)):
            for x, kept in zip(motion, (1.0, 0.0, 0.0), strict=True):
                x[rests, axis] = kept * x[rests, axis][end]
        recording.q[:] = motion[0]
        recording.tau[:] = inverse_dynamics(robot, TRUTH, *motion)
        recording.tau[:] += classical(motion[1]) + motor_torque(robot, *motion)
        recording.tau[:] += 0.3 * rng.standard_normal(recording.tau.shape)
        recording.tau[t < 8, 0] = recording.tau[t > 12, 1] = level
    found = estimate(robot, data, "free motion")
    assert "axes 1, 2: torques constant at rest" in "\n".join(found.details.remarks)
    assert np.all(np.abs(found.values - TRUTH) < 5.0 * found.half_width())
    assert max(found.details.relative_residual) < 0.2


def test_a_constant_torque_of_an_arm_at_rest_shows_its_weight():
    (_, recording), *_ = recorded(arm(), TRUTH)
    recording.q[:1000], recording.tau[:1000] = recording.q[1000], recording.tau[1000]
    assert not braked(recording.q, recording.tau, recording.period).any()
    recording.q[500:1000, 0] += np.linspace(0.0, 0.2, 500)
    assert (
        braked(recording.q, recording.tau, recording.period)[:1000].tolist()
        == [[False, True]] * 1000
    )
    recording.tau[:] = recording.tau.round(-1)  # rounding hides the changes
    assert not braked(recording.q, recording.tau, recording.period).any()


def test_moves_shorter_than_the_low_pass_between_closed_brakes(tmp_path):
    """The torque is 0 in pauses, also while all axes rest; what is left determines the model."""
    robot, data, rng = arm(), recorded(arm(), TRUTH, n=2, duration=60.0), np.random.default_rng(4)
    for _, recording in data:
        motion = short_moves(recording.time, rng)
        recording.q[:] = motion[0] + 2e-5 * rng.standard_normal(recording.q.shape)
        recording.tau[:] = inverse_dynamics(robot, TRUTH, *motion)
        recording.tau[:] += classical(motion[1]) + motor_torque(robot, *motion)
        recording.tau[:] += 0.3 * rng.standard_normal(recording.tau.shape)
        recording.tau[motion[1] == 0] = 0.0
    model = hil.identify(write_free_run(tmp_path / "run", robot, data))
    assert "axes 1, 2: torques constant at rest" in "\n".join(model.details.remarks)
    assert np.all(np.abs(model.values - TRUTH) < 5.0 * model.half_width())
    assert max(model.details.relative_residual) < 0.1
    assert model.band_residual.overall < 0.1


def record_in_turn(*, follows):
    """Record joints that move in turn; static friction in long rests has one sign, and takes the
    share `follows` of changes of the load up to Coulomb friction.
    """
    robot, data, rng = arm(), recorded(arm(), TRUTH, n=3, duration=60.0), np.random.default_rng(5)
    for number, (_, recording) in enumerate(data):
        t, motion = recording.time, [x.copy() for x in some_motion(recording.time, number)]
        rests = np.column_stack([t > 30.0, t < 30.0])
        for axis, end in ((0, 0), (1, -1)):
            for x, kept in zip(motion, (1.0, 0.0, 0.0), strict=True):
                x[rests[:, axis], axis] = kept * x[rests[:, axis], axis][end]
        recording.q[:] = motion[0]
        recording.tau[:] = load = inverse_dynamics(robot, TRUTH, *motion)
        static = np.zeros_like(load)
        for axis, rest in enumerate(rests.T):
            carried = load[rest, axis] - load[rest, axis].mean()
            static[rest, axis] = COULOMB[axis] * (0.7 - follows * carried / np.ptp(carried))
        recording.tau[:] += np.where(rests, OFFSET + static, classical(motion[1]))
        recording.tau[:] += motor_torque(robot, *motion) + 0.1 * rng.standard_normal(load.shape)
    return data


@pytest.mark.parametrize("follows", [0.0, 0.5])
def test_static_friction_of_long_rests_is_no_offset(follows):
    found = estimate(arm(), record_in_turn(follows=follows), "free motion")
    law = found.details.axes
    offsets = np.array([each.terms["offset"].value for each in law])
    errors = np.array([each.terms["offset"].standard_error for each in law])
    assert found.details.unusual == ()
    assert np.all(errors < 0.05 * COULOMB)
    assert np.all(np.abs(offsets - OFFSET) < 3.0 * errors)
    assert np.all(np.abs(found.values - TRUTH) < 2.0 * found.half_width())


def test_an_axis_that_only_gives_way_is_not_excited(monkeypatch):
    """A soft servo lets a standing axis move by some mrad, within or by jerks of its friction."""
    robot = arm()
    data, p = recordings(monkeypatch, robot, 1)
    rng = np.random.default_rng(4)
    for _, recording in data:
        noise = rng.standard_normal((2, recording.n_samples + 200))
        slow = [np.convolve(each, np.hanning(201) / 12.0, "valid") for each in noise]
        recording.q[:, 1] += 4e-3 * slow[0]
        recording.tau[:, 1] = 3.0 * slow[1]
    found = estimate(robot, data, "free motion")
    assert found.details.still == (2,)
    assert any("axis 2: moves by 0.0" in each for each in found.details.remarks)
    motion = resting(1)(np.arange(0.0, 20.0, 0.1), 9)
    wrong = inverse_dynamics(robot, found.values, *motion) - inverse_dynamics(robot, p, *motion)
    error = errors(robot, found, motion)[:, 0]
    assert np.all(np.abs(wrong[:, 0]) < 5.0 * error.max())
    assert error.max() < 1.0
