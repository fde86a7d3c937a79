"""Base parameters and friction curves from strokes of one axis at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded
from hypothesis import given, settings
from hypothesis import strategies as st
from stroke_run import campaign, curved, strokes

from hil.estimation.back_and_forth import NAME
from hil.estimation.identify import default_method, estimate
from hil.model.dynamics import inverse_dynamics

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate

    Array = NDArray[np.float64]

ROBOT = arm()


def steady(qd: Array, time: Array, load: Array) -> Array:
    """Return the friction of `curved` without drift and load."""
    return curved(qd, np.full_like(time, np.inf), 0.0 * load)


@pytest.fixture(scope="module")
def found() -> Estimate:
    return estimate(ROBOT, campaign(ROBOT, TRUTH), NAME)


def test_parameters_are_found_under_friction_that_drifts_and_grows_with_the_load(
    found: Estimate,
) -> None:
    np.testing.assert_allclose(found.values, TRUTH, atol=0.02)
    assert np.sum(np.abs(found.values - TRUTH) <= found.half_width()) >= 5
    assert np.all(found.half_width() < 0.05)


@pytest.mark.parametrize("axis", [0, 1])
def test_half_differences_are_the_friction_over_the_speed(axis: int) -> None:
    found = estimate(ROBOT, campaign(ROBOT, TRUTH, steady), NAME)
    curve = found.details.curves[axis]
    for point in curve.points:
        expected = float(steady(np.array([[point.speed]]), np.zeros(1), np.zeros((1, 1)))[0, 0])
        assert point.friction == pytest.approx(expected, rel=0.01)
        assert point.half_width is not None
        assert point.half_width < 0.05 * expected
    assert len(curve.points) >= 8


def test_what_rigid_bodies_ask_for_is_shown_recording_by_recording(found: Estimate) -> None:
    for each in found.half_sums:
        left = each.measured - each.model
        assert np.sqrt(np.mean(left**2)) < 0.02 * np.ptp(each.model)
        assert np.isfinite(each.standard_error).all()


def test_a_way_back_that_is_faster_than_the_way_forth_is_accounted_for() -> None:
    found = estimate(ROBOT, campaign(ROBOT, TRUTH, steady, faster_back=0.08), NAME)
    np.testing.assert_allclose(found.values, TRUTH, atol=0.01)


@settings(max_examples=4)
@given(st.floats(0.0, 20.0), st.floats(0.0, 5.0), st.floats(0.0, 20.0), st.floats(0.02, 1.0))
def test_no_odd_friction_shifts_anything(
    coulomb: float, viscous: float, degressive: float, bend: float
) -> None:
    def odd(qd: Array, _: Array, __: Array) -> Array:
        size = coulomb + viscous * np.abs(qd) + degressive * np.tanh(np.abs(qd) / bend)
        return np.asarray(np.sign(qd) * size)

    found = estimate(ROBOT, campaign(ROBOT, TRUTH, odd, noise=0.0, pairs=2), NAME)
    np.testing.assert_allclose(found.values, TRUTH, atol=0.01)


def test_friction_that_wears_off_steadily_is_no_gravity() -> None:
    """A backward stroke always comes later: without a trend, friction would pass for gravity."""

    def trend(qd: Array, time: Array, _: Array) -> Array:
        return np.asarray(np.sign(qd) * (20.0 - 0.5 * time)[:, np.newaxis])

    found = estimate(ROBOT, campaign(ROBOT, TRUTH, trend, noise=0.0), NAME)
    np.testing.assert_allclose(found.values, TRUTH, atol=0.01)


def test_what_strokes_do_not_show_is_kept_out_and_the_rest_stands_for_sums() -> None:
    where = 0.3, 0.5
    data = [
        strokes(ROBOT, TRUTH, 0, where, way=0.8, period=period, friction=steady, pairs=8, name=name)
        for name, period in (("fast", 1.6), ("slow", 4.0))
    ]
    found = estimate(ROBOT, data, NAME)
    fit = found.details
    assert fit is not None
    assert found.combination is not None
    assert fit.not_identified
    lost = [int(name[1:]) - 1 for name in fit.not_identified]
    np.testing.assert_array_equal(found.values[lost], 0.0)
    assert {each.name for each in fit.combinations}.isdisjoint(fit.not_identified)
    assert all(" p" in each.stands_for for each in fit.combinations)
    assert np.all(np.abs(found.values - found.combination @ TRUTH) <= 1.5 * found.half_width())

    def inertia(p: Array) -> float:
        there, unit = np.array(where), np.array([1.0, 0.0])
        both = (inverse_dynamics(ROBOT, p, there, 0 * unit, k * unit)[0] for k in (1.0, 0.0))
        return float(np.subtract(*both))

    assert inertia(found.values) == pytest.approx(inertia(TRUTH), rel=0.02)


def test_uncertain_drives_make_parameters_uncertain() -> None:
    robot = arm(torque_constant_uncertainty=0.02)
    found = estimate(robot, campaign(robot, TRUTH), NAME)
    # all torques of both axes grow by 2 %, because gravity of the outer axis also loads this axis
    assert np.sqrt(found.drive_covariance[4, 4]) == pytest.approx(0.02 * TRUTH[4], rel=0.3)


def test_the_method_is_chosen_where_nothing_else_was_recorded() -> None:
    alone = [motion for motion, _ in campaign(ROBOT, TRUTH)]
    free = [motion for motion, _ in recorded(ROBOT, TRUTH, n=1)]
    assert default_method(alone) == (
        NAME, "all recordings are strokes of a single axis",
    )  # fmt: skip
    name, reason = default_method([*alone, *free])
    assert name == "free motion"
    assert "for 12 recordings with strokes of a single axis" in reason


def test_free_motions_among_them_are_passed_over_and_named() -> None:
    mixed = [*campaign(ROBOT, TRUTH), *recorded(ROBOT, TRUTH, n=1)]
    found = estimate(ROBOT, iter(mixed), NAME)
    assert [left.id for left in found.left_out] == ["r0"]
    assert "no strokes of a single axis" in found.left_out[0].reason


def test_friction_is_curved_enough_to_matter() -> None:
    """Otherwise the tests above would pass with Coulomb and viscous friction as well."""
    speeds = np.linspace(0.1, 2.0, 20)[:, np.newaxis]
    friction = curved(speeds, np.zeros(20), np.zeros((20, 1)))
    line = np.polyfit(speeds[:, 0], friction[:, 0], 1)
    assert np.max(np.abs(np.polyval(line, speeds[:, 0]) - friction[:, 0])) > 0.5
