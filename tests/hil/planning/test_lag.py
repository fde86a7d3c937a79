"""Following error of a trajectory, limits of the drives, and a plan with a margin."""

from __future__ import annotations

import numpy as np
import pytest

from hil.model.robot import Robot
from hil.planning.design.trajectories import Search, design_trajectory
from hil.planning.dry_run import dry_run
from hil.planning.plan import make_plan
from hil.planning.trajectory import MARGIN, Following, Trajectory, check_lag, find_largest_lag

SEARCH = Search(random=20, refined=1, steps=5)
WAVE = Trajectory(
    id="t", q=(0.0,) * 6, period=4.0, sine=((0.2, -0.1),) * 6, cosine=((0.4, -0.1),) * 6
)


@pytest.fixture(scope="module")
def manutec() -> Robot:
    return Robot.load("manutec-r15")


def following(window: float, time: float, lag: float) -> Following:
    return Following(np.full(6, window), np.full(6, time), np.array([lag] * 5 + [2 * lag]))


def test_the_lag_is_speed_by_the_time_that_the_drive_is_late(manutec: Robot) -> None:
    speed = np.abs(WAVE.motion(np.linspace(0, 4, 5000))[1]).max()
    found = find_largest_lag(WAVE, following(0.05, 0.05, 0.01))
    assert (found.axis, found.window) == (5, 0.05)
    assert found.most == pytest.approx(0.02 * speed, rel=1e-4)
    assert not list(check_lag(WAVE, manutec, following(0.05, 0.05, 0.01)))


@pytest.mark.parametrize(("time", "problems"), [(0.05, 1), (3.0, 0)])
def test_a_lag_beyond_the_window_is_refused_if_it_lasts(
    manutec: Robot, time: float, problems: int
) -> None:
    result = dry_run(make_plan(manutec, [WAVE]), manutec, following=following(0.05, time, 0.04))
    about = [problem.message for problem in result.problems]
    assert len(about) == problems
    if about:
        assert about[0].startswith("t: axis 6 lags ")
        assert "0.05 rad (6065) for 0.05 s (6066)" in about[0]
    assert result.lags[0].axis == 5


def test_a_planned_trajectory_leaves_a_margin(manutec: Robot) -> None:
    late = following(0.05, 0.05, 0.03)
    planned = design_trajectory(manutec, search=SEARCH, speed=late.speed)
    assert find_largest_lag(planned, late).most <= 1.02 * MARGIN * 0.05
    assert find_largest_lag(design_trajectory(manutec, search=SEARCH), late).most > 0.1
