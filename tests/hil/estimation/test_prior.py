"""A prior of the links' bodies completes unidentified parameters, and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING

import free_run
import numpy as np
import pytest
from free_run import arm, recorded, some_motion

from hil.errors import InvalidValue, UnknownName
from hil.estimation.free_motion.variants import DEFAULT
from hil.estimation.identify import estimate
from hil.estimation.options import Options
from hil.estimation.prior import Prior, Stated, least_unknowns, open_covariance
from hil.least_squares.solving import solved
from hil.model.dynamics import regressor
from hil.model.frames import parameter_map
from hil.model.robot import Robot

if TYPE_CHECKING:
    from free_run import FreeRecorded
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate

    Array = NDArray[np.float64]

BODIES = np.array([
    [0.5, 0.1, 0.0, 3.0, 0.0, 3.0, 4.0, 0.5, 0.2, 10.0],
    [0.2, 0.05, 0.0, 1.0, 0.0, 1.1, 1.5, -0.2, 0.1, 4.0],
])  # fmt: skip
"""Ixx, Ixy, Ixz, Iyy, Iyz, Izz, sx, sy, sz, m of each link."""
UNEXCITED, EXCITED = (0, 1, 2), (3, 4, 5)
"""Unexcited and excited base parameters if axis 1 is at rest: those of link 1, those of link 2."""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return arm()


@pytest.fixture(scope="module")
def truth(robot: Robot) -> Array:
    return Prior(BODIES, 0.3).predict(robot)[0]


@pytest.fixture(scope="module")
def moving(robot: Robot, truth: Array) -> FreeRecorded:
    """Recordings of both axes in motion: all parameters are excited."""
    return recorded(robot, truth)


@pytest.fixture(scope="module")
def one_still(robot: Robot, truth: Array) -> FreeRecorded:
    """Recordings with axis 1 at rest: its inertia is not observable, and weight resembles an
    offset.
    """

    def still(t: Array, seed: int = 0) -> tuple[Array, Array, Array]:
        q, qd, qdd = some_motion(t, seed)
        for x, value in ((q, 0.4), (qd, 0.0), (qdd, 0.0)):
            x[:, 0] = value
        return q, qd, qdd

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(free_run, "some_motion", still)
        return recorded(robot, truth)


def found(robot: Robot, data: FreeRecorded, bodies: Array | None = None) -> Estimate:
    prior = None if bodies is None else Prior(bodies, 0.3)
    return estimate(robot, data, DEFAULT, Options(prior=prior))


def test_without_a_prior_what_the_motion_does_not_excite_is_named(
    robot: Robot, one_still: FreeRecorded
) -> None:
    assert found(robot, one_still).details.not_identified == ("p1", "p2", "p3")


@pytest.mark.parametrize("wrong", [1.0, 2.0])
def test_a_prior_moves_nothing_where_data_say_all(
    robot: Robot, moving: FreeRecorded, wrong: float
) -> None:
    alone, beside = found(robot, moving), found(robot, moving, wrong * BODIES)
    np.testing.assert_array_equal(beside.values, alone.values)
    np.testing.assert_array_equal(beside.covariance, alone.covariance)
    assert not beside.prior_share.any()


def test_what_is_not_excited_has_the_stated_values_and_sigmas(
    robot: Robot, one_still: FreeRecorded
) -> None:
    p, root = Prior(BODIES, 0.3).predict(robot)
    made = found(robot, one_still, BODIES)
    for k in UNEXCITED:
        sigma = np.linalg.norm(root[k])
        assert made.values[k] == pytest.approx(p[k], abs=0.05 * sigma)
        assert made.standard_errors[k] == pytest.approx(sigma, rel=0.05)
        assert made.prior_share[k] > 0.95


def test_bodies_twice_as_heavy_leave_what_is_excited_unchanged(
    robot: Robot, one_still: FreeRecorded, truth: Array
) -> None:
    right, heavy = (found(robot, one_still, factor * BODIES) for factor in (1.0, 2.0))
    for k in EXCITED:
        assert abs(heavy.values[k] - right.values[k]) < 0.05 * right.standard_errors[k]
        assert abs(right.values[k] - truth[k]) < 4.0 * right.standard_errors[k]
        assert right.prior_share[k] < 0.05
    for k in UNEXCITED:
        assert heavy.values[k] == pytest.approx(2.0 * right.values[k], rel=0.05)


def test_friction_follows_what_the_prior_says_of_weight(
    robot: Robot, one_still: FreeRecorded, truth: Array
) -> None:
    """The prior of the weight does not change how well the recorded torques are explained."""
    right, heavy = (found(robot, one_still, factor * BODIES) for factor in (1.0, 2.0))
    np.testing.assert_allclose(heavy.residual, right.residual, rtol=0.01)


def test_a_prior_is_the_same_in_every_frame() -> None:
    """Standard deviations refer to the body, not to the frame of its parameters."""
    away = np.eye(4)
    away[:3, 3] = 0.4, -0.2, 0.7
    T = parameter_map(away)
    here, there = covariance(BODIES[:1]), covariance(BODIES[:1] @ T.T)
    np.testing.assert_allclose(there, T @ here @ T.T, rtol=1e-9, atol=1e-9)


def test_sigmas_of_mass_and_centre_are_shares_of_mass_and_size() -> None:
    gyration = np.array([0.3, 0.2, 0.1])
    spread = 5.0 * np.diag(gyration**2)
    own = np.trace(spread) * np.eye(3) - spread
    body = np.array([own[0, 0], 0, 0, own[1, 1], 0, own[2, 2], 0, 0, 0, 5.0])
    sigma = np.sqrt(np.diag(covariance(body[np.newaxis])))
    assert sigma[9] == pytest.approx(0.3 * 5.0)
    np.testing.assert_allclose(sigma[6:9], 0.3 * 5.0 * gyration / np.sqrt(2.0))


def covariance(bodies: Array) -> Array:
    root = Prior(bodies, 0.3).roots
    return root @ root.T


@pytest.mark.parametrize("relative", [0.0, -0.3, 1.5, np.nan])
def test_a_prior_of_no_share_is_refused(relative: float) -> None:
    with pytest.raises(InvalidValue, match="share"):
        Prior(BODIES, relative)


def test_figures_that_no_body_has_are_refused_with_their_link() -> None:
    with pytest.raises(InvalidValue, match="link 2"):
        Prior(BODIES * np.array([[1.0], [0.0]]), 0.3)


def test_methods_that_take_no_prior_say_so(robot: Robot, moving: FreeRecorded) -> None:
    with pytest.raises(UnknownName, match="takes no prior"):
        estimate(robot, moving, "published", Options(prior=Prior(BODIES, 0.3)))


def test_intervals_hold_the_truth_where_cad_errs_as_stated(robot: Robot) -> None:
    """Torques determine three combinations of six parameters; bodies are drawn about CAD values."""
    rng, of_cad = np.random.default_rng(7), Prior(BODIES, 0.3)
    mean, root = of_cad.predict(robot)
    inside = []
    for _ in range(300):
        p = mean + root @ rng.standard_normal(root.shape[1])
        W = rng.standard_normal((3, 6)) / 0.01
        b = W @ p + rng.standard_normal(3)
        N = W.T @ W
        made = of_cad.completed(robot, N, np.linalg.pinv(W) @ b, np.linalg.pinv(N))
        inside.append(np.abs(made.p - p) < 1.96 * np.sqrt(np.diag(made.covariance)))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)


def test_a_file_completes_what_the_recordings_leave_open_and_nothing_else(robot: Robot) -> None:
    """Two sums of parameters are open, all others determined to a tenth of a per cent."""
    rng = np.random.default_rng(5)
    file = Stated.create(robot, BODIES, np.zeros(len(robot.added_parameters)))
    p = 1.2 * (file.matrix @ file.values)
    well = np.diag((1e-3 * p) ** 2)
    kept, covariance = file.completed(p, well)
    np.testing.assert_array_equal(kept, p)
    np.testing.assert_array_equal(covariance, well)
    open_ = (rng.standard_normal((6, 2)) * np.abs(p)[:, np.newaxis]) * 1e3
    found = file.completed(p, well + open_ @ open_.T)[0]
    determined = np.linalg.svd(open_)[0][:, 2:]
    np.testing.assert_allclose(determined.T @ found, determined.T @ p, rtol=0, atol=1e-9)
    assert np.abs(found - p).max() > 0.01 * np.abs(p).max()


def test_directions_without_scatter_between_few_groups_are_not_taken_from_cad(robot: Robot) -> None:
    """Six parameters are determined; the scatter of four groups of time has a rank of three."""
    rng, of_cad = np.random.default_rng(3), Prior(BODIES, 0.3)
    p = of_cad.predict(robot)[0]
    for _ in range(20):
        W = rng.standard_normal((60, 6)) / 0.01
        N = W.T @ W
        groups = np.linalg.cholesky(np.linalg.inv(N)) @ rng.standard_normal((6, 3))
        made = of_cad.completed(robot, N, 1.2 * p, groups @ groups.T)
        np.testing.assert_array_equal(made.p, 1.2 * p)


def test_a_column_that_is_tiny_and_parallel_to_another_gets_no_large_value(manutec: Robot) -> None:
    """With axes at rest close to 0, cosines of 1 and sines of 1e-9 multiply the same motion."""
    t = np.linspace(0.0, 10.0, 400)
    q, qd, qdd = np.full((3, 400, 6), 1e-9)
    q[:, 1], qd[:, 1], qdd[:, 1] = np.sin(t), np.cos(t), -np.sin(t)
    rows = regressor(manutec, q, qd, qdd)
    W, rng = rows.reshape(-1, rows.shape[2]), np.random.default_rng(1)
    p = rng.standard_normal(W.shape[1])
    N, tau = W.T @ W, W @ p + 0.01 * rng.standard_normal(len(W))
    x = solved(N, W.T @ tau)
    least = least_unknowns(manutec, N) @ x
    assert np.abs(x).max() > 1e3 * np.abs(p).max()
    assert np.abs(least).max() < 2.0 * np.abs(p).max()
    np.testing.assert_allclose(W @ least, W @ x, atol=0.05)


def test_friction_of_a_precise_small_axis_leaves_parameters_of_a_large_one_identified() -> None:
    """Wrists have a hundredth of the torque and of the residual of a base."""
    joint = {"q_min": -3.0, "q_max": 3.0, "velocity_limit": 3.0, "acceleration_limit": 20.0}
    links = {"frame": {"alpha": 0, "d": "l"}, "parameters": ["Izz", "sx", "sy"]}
    large = Robot.create(
        "large",
        [joint | links | {"torque_limit": limit} for limit in (5000.0, 20.0)],
        gravity=(0.0, -9.81, 0.0),
        lengths={"l": 0.5},
    )
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.uniform(-0.1, 0.1, (3, 500, 2))
    A = regressor(large, q, qd, qdd)
    A[..., 0] = 0.0  # without data
    friction = np.stack([np.sign(qd[:, :1]) * [1, 0], np.sign(qd[:, 1:]) * [0, 1]], axis=-1)
    W = np.concatenate([A, friction], axis=-1) / np.array([50.0, 0.01])[:, None]
    W = W.reshape(1000, -1)
    N = W.T @ W
    np.testing.assert_array_equal(np.flatnonzero(np.diag(open_covariance(large, N))), [0])
    x = np.array([0.0, *rng.standard_normal(N.shape[0] - 1)])
    np.testing.assert_allclose(least_unknowns(large, N) @ x, x, atol=1e-6)
