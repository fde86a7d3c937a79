"""Cosines and sines of joint angles in the compiled recursion, against NumPy's."""

import numpy as np
import pytest

from hil import Robot, regressor

recursion = pytest.importorskip("hil.model.recursion", reason="no C compiler at installation")


def positions(q: np.ndarray, theta: float = 0.0) -> np.ndarray:
    state = np.full((3, *q.shape), np.nan)
    ones = np.ones(q.shape[1])
    recursion.positions(q, theta * ones, 0.5 * ones, ones, state)
    return state


@pytest.mark.parametrize("largest", [1e-9, 1.0, 10.0, 1e3, 1e6, 1e9, 1e15])
def test_they_are_right_to_rounding_at_angles_of_any_size(largest: float) -> None:
    q = np.random.default_rng(7).uniform(-largest, largest, (1001, 3))
    cosine, sine, shift = positions(q, 0.25)
    assert np.abs(cosine - np.cos(0.25 + q)).max() <= 2.0**-52
    assert np.abs(sine - np.sin(0.25 + q)).max() <= 2.0**-52
    assert (shift == 0.5).all()


def test_quarter_turns_go_to_the_right_quadrant() -> None:
    q = np.arange(-9, 10)[:, np.newaxis] * np.pi / 2
    cosine, sine, _ = positions(q)
    assert np.abs(cosine - np.cos(q)).max() <= 2.0**-52
    assert np.abs(sine - np.sin(q)).max() <= 2.0**-52


def test_a_missing_angle_stays_missing_and_spoils_no_other() -> None:
    q = np.array([[0.3, np.nan, -2.0]])
    cosine, _, _ = positions(q)
    assert np.isnan(cosine).tolist() == [[False, True, False]]
    assert cosine[0, 2] == pytest.approx(np.cos(-2.0))


def test_a_large_angle_leaves_the_regressor_that_of_the_turned_joint() -> None:
    robot = Robot.load("manutec-r15")
    q, qd, qdd = np.random.default_rng(6).uniform(-2.0, 2.0, (3, 5, robot.n_joints))
    turned = q + 2 * np.pi * 2.0**22
    assert regressor(robot, turned, qd, qdd) == pytest.approx(
        regressor(robot, q, qd, qdd), abs=1e-6
    )
