"""Velocity source of each joint, and the reported choice."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import PERIOD, TRUTH, arm, recorded, some_motion

from hil.estimation.free_motion.settings import velocity_sources
from hil.estimation.import_methods import fit_free_motions
from hil.results.tables.model import statements

if TYPE_CHECKING:
    from collections.abc import Callable

    from free_run import FreeRecorded
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

CUT_OFF = 10.0


def add_velocity(change: Callable[[Array, int], Array], of_position: float = 1e-3) -> FreeRecorded:
    """Return recordings of coarse positions; `change` computes recorded velocities
    from time and number.
    """
    data = recorded(arm(), TRUTH, of_position=of_position, n=3)
    return [
        (motion, replace(recording, qd=change(recording.time, seed)))
        for seed, (motion, recording) in enumerate(data)
    ]


def late(seconds: float) -> Callable[[Array, int], Array]:
    """Return delayed velocities with slight noise."""

    def shifted(time: Array, seed: int) -> Array:
        qd = some_motion(time - seconds, seed)[1]
        return qd + 1e-3 * np.random.default_rng(seed).standard_normal(qd.shape)

    return shifted


def sources(data: FreeRecorded) -> list[tuple[bool, str]]:
    found = velocity_sources([recording for _, recording in data], CUT_OFF)
    return [(source.recorded, source.reason) for source in found]


def test_one_with_less_noise_is_taken() -> None:
    for taken, reason in sources(add_velocity(late(0.0))):
        assert taken
        assert "times the noise of the derivative" in reason


def test_one_with_more_noise_is_not() -> None:
    data = recorded(arm(), TRUTH, of_position=1e-6, velocity=0.2)
    for taken, reason in sources(data):
        assert not taken
        assert reason.startswith("the recorded velocity has ")
        assert reason.endswith(" times the noise of the derivative")


@pytest.mark.parametrize(("periods", "taken"), [(0.3, True), (-0.3, True), (3, False), (-3, False)])
def test_one_that_lags_by_more_than_half_a_period_is_not_taken(periods: float, taken: bool) -> None:
    for is_taken, reason in sources(add_velocity(late(periods * PERIOD))):
        assert is_taken == taken
        if not taken:
            amount, unit, which = reason.removeprefix("the recorded velocity is ").split()
            assert float(amount) == pytest.approx(1e3 * abs(periods) * PERIOD, rel=0.1)
            assert (unit, which) == ("ms", "late" if periods > 0 else "early")


def test_one_that_contradicts_the_positions_is_not_taken() -> None:
    data = add_velocity(lambda time, seed: 1.5 * late(0.0)(time, seed))
    assert (
        sources(data) == [(False, "the recorded velocity differs from the derivative by 50 %")] * 2
    )


def test_joints_are_judged_one_by_one() -> None:
    def second_alone(time: Array, seed: int) -> Array:
        qd = late(0.0)(time, seed)
        qd[:, 0] = np.nan
        return qd

    first, second = sources(add_velocity(second_alone))
    assert first == (False, "none was recorded")
    assert second[0]


def test_one_that_some_recordings_lack_is_not_taken() -> None:
    data = add_velocity(late(0.0))
    data[1] = (data[1][0], replace(data[1][1], qd=None))
    assert sources(data) == [(False, "none was recorded")] * 2


def test_the_lag_of_a_recorded_velocity_is_no_lag_of_the_torque() -> None:
    fit = fit_free_motions(arm(), add_velocity(late(0.49 * PERIOD), of_position=1e-4)).details
    assert fit is not None
    assert fit.recorded_velocity == (1, 2)
    assert all(abs(each.value) < 0.1 * PERIOD for each in fit.lag)


def test_a_joint_that_stands_still_has_no_velocity_to_choose() -> None:
    data = [(m, replace(r, q=0 * r.q, qd=0 * r.q)) for m, r in recorded(arm(), TRUTH, n=1)]
    assert sources(data) == [(False, "the axis does not move")] * 2


def test_identification_states_which_velocities_it_took_and_why() -> None:
    data = add_velocity(
        lambda time, seed: np.column_stack(
            [late(0.0)(time, seed)[:, 0], late(0.02)(time, seed)[:, 1]]
        )
    )
    fit = fit_free_motions(arm(), data).details
    assert fit is not None
    assert fit.recorded_velocity == (1,)
    (stated,) = (text for text in statements(fit) if text.startswith("velocity of"))
    assert stated.startswith("velocity of axis 1 as recorded (0.")
    assert "; of axis 2 from the position (the recorded velocity is 2" in stated


def test_a_model_is_the_same_where_a_joint_without_velocity_is_recorded_beside_one_with() -> None:
    def second_alone(time: Array, seed: int) -> Array:
        qd = late(0.0)(time, seed)
        qd[:, 0] = np.nan
        return qd

    estimate = fit_free_motions(arm(), add_velocity(second_alone, of_position=1e-4))
    assert np.isfinite(estimate.values).all()
    np.testing.assert_allclose(estimate.values, TRUTH, atol=0.1)
