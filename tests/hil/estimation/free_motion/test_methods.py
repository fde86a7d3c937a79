"""All methods for free motions on recordings with known parameters."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.free_motion.solution import _independent, require_determined
from hil.estimation.free_motion.variants import VARIANTS
from hil.estimation.identify import default_method, estimate
from hil.estimation.prior import open_covariance
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import Gravity
from hil.runs.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Iterator

    from free_run import FreeRecorded

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot


WEIGHTED = "weighted least squares"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return arm()


def distance(found: Estimate) -> float:
    return float(np.linalg.norm(found.values - TRUTH) / np.linalg.norm(TRUTH))


@pytest.mark.parametrize("name", VARIANTS)
def test_every_method_finds_the_parameters_and_states_their_errors(robot: Robot, name: str) -> None:
    found = estimate(robot, recorded(robot, TRUTH), name)
    assert found.method == name
    assert distance(found) < 1e-3
    assert (np.abs(found.values - TRUTH) < 4 * found.standard_errors).all()
    assert (found.standard_errors > 0).all()


def test_uncertain_gains_are_carried_to_the_intervals() -> None:
    uncertain = arm(rotor_inertia=0.0, torque_constant_uncertainty=0.05)
    data = recorded(uncertain, TRUTH)
    found = estimate(uncertain, data, "least squares")
    # a common factor of all gains scales all parameters
    assert found.drive_effect.sum(axis=1) == pytest.approx(0.05 * found.values, rel=1e-6, abs=1e-9)
    assert found.drive_covariance == pytest.approx(found.drive_effect @ found.drive_effect.T)
    exact = estimate(arm(rotor_inertia=0.0), data, "least squares")
    assert found.values == pytest.approx(exact.values)
    assert (found.half_width() > 3 * exact.half_width()).all()
    for _, recording in data:
        recording.tau[:, 0] *= 1.05
    moved = estimate(uncertain, data, "least squares").values - found.values
    assert moved == pytest.approx(found.drive_effect[:, 0], rel=1e-6, abs=1e-9)


def test_uncertain_rotor_inertias_are_carried_to_the_intervals() -> None:
    uncertain, greater = arm(rotor_inertia_uncertainty=0.05), arm(rotor_inertia=1.05e-4)
    data = recorded(uncertain, TRUTH)
    found, other = (estimate(each, data, "least squares") for each in (uncertain, greater))
    moved = other.values - found.values
    assert found.drive_effect[:, 2:].sum(axis=1) == pytest.approx(moved, rel=1e-6)
    exact = estimate(arm(), data, "least squares")
    assert found.values == pytest.approx(exact.values)
    assert (found.half_width() > exact.half_width()).any()


@pytest.mark.long
def test_intervals_hold_the_truth_though_the_law_of_friction_is_wrong(robot: Robot) -> None:
    def strange(qd: np.ndarray) -> np.ndarray:
        return 6.0 * np.sign(qd) * (1.0 + 0.6 * np.exp(-((qd / 0.15) ** 2))) + 2.0 * np.sin(4 * qd)

    held, total = 0, 0
    for seed in range(0, 40, 10):
        found = estimate(robot, recorded(robot, TRUTH, strange, seed=seed), "free motion")
        held += int((np.abs(found.values - TRUTH) <= found.half_width()).sum())
        total += len(TRUTH)
    assert held >= 0.85 * total


def test_noise_of_the_positions_is_found_and_instruments_are_not_shifted_by_it(
    robot: Robot,
) -> None:
    data = set_cut_off(recorded(robot, TRUTH, of_position=1e-3), 25.0)
    plain, crossed = (
        estimate(robot, data, name) for name in ("weighted least squares", "instrumental variables")
    )
    assert plain.details.bias_test is not None
    assert plain.details.bias_test.biased
    assert distance(crossed) < 0.2 * distance(plain)


def test_without_such_noise_no_bias_is_stated(robot: Robot) -> None:
    found = estimate(robot, recorded(robot, TRUTH), "weighted least squares").details
    assert found is not None
    assert found.bias_test is not None
    assert not found.bias_test.biased


def test_residuals_are_those_of_all_samples_over_the_torque(robot: Robot) -> None:
    noisy = estimate(robot, recorded(robot, TRUTH, noise=3.0), "least squares")
    clean = estimate(robot, recorded(robot, TRUTH, noise=0.3), "least squares")
    assert noisy.details.overall_residual == pytest.approx(
        10 * clean.details.overall_residual, rel=0.3
    )
    assert noisy.residual.shape == (2,)


def test_a_short_recording_carries_a_warning(robot: Robot) -> None:
    found = estimate(robot, recorded(robot, TRUTH, n=1, duration=12.0), "free motion").details
    assert found is not None
    assert any("s needed: intervals may be too small" in remark for remark in found.remarks)


def test_few_blocks_carry_a_warning_that_names_them(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hil.estimation.free_motion.description.FEW_BLOCKS", 10**6)
    found = estimate(robot, recorded(robot, TRUTH), "free motion").details
    assert found is not None
    remarks = "\n".join(found.remarks)
    assert "independent blocks of time, at least 1000000 needed: intervals may be" in remarks


def test_recordings_in_which_nothing_moves_are_refused(robot: Robot) -> None:
    data, rng = recorded(robot, TRUTH), np.random.default_rng(1)
    for _, recording in data:
        recording.q[:] = 0.3 + 1e-4 * rng.standard_normal(recording.q.shape)
    with pytest.raises(NotIdentifiable, match="no axis moves in the recordings"):
        estimate(robot, data, "free motion")


def test_what_motions_of_all_axes_do_not_excite_is_refused_by_name(robot: Robot) -> None:
    data = recorded(robot, TRUTH)
    for _, recording in data:
        # link 2 keeps its orientation: neither its weight nor its inertia about its axis is seen
        recording.q[:, 1] = 0.3 - recording.q[:, 0]
    with pytest.raises(NotIdentifiable, match=r"do not excite .*axis \d.* \(p\d"):
        estimate(robot, data, "free motion")


@pytest.mark.parametrize(("excited", "lost"), [(3e-13, 0), (0.0, 1)])
def test_only_what_no_motion_excites_is_refused(robot: Robot, excited: float, lost: int) -> None:
    n = len(TRUTH)
    W = np.linalg.qr(np.random.default_rng(1).standard_normal((n, n)))[0]
    N = W @ np.diag([excited, *np.ones(n - 1)]) @ W.T
    pieces = SimpleNamespace(normal=SimpleNamespace(information=N))
    with pytest.raises(NotIdentifiable, match="do not excite") if lost else nullcontext():
        require_determined(robot, pieces, ())  # type: ignore[arg-type]
    wide = open_covariance(robot, N)
    assert len(_independent(wide)) == 1


@pytest.mark.parametrize("n_samples", [30, 120])
def test_recordings_shorter_than_the_low_pass_reaches_are_refused(
    robot: Robot, n_samples: int
) -> None:
    with pytest.raises(NotEnoughData, match="import longer ones"):
        estimate(robot, recorded(robot, TRUTH, duration=0.004 * n_samples), "free motion")


def test_without_free_motions_the_methods_state_what_they_need(robot: Robot) -> None:
    with pytest.raises(NotEnoughData, match="no free motions"):
        estimate(robot, [], "free motion")


def test_recordings_are_read_one_at_a_time_and_again(robot: Robot) -> None:
    data = recorded(robot, TRUTH)

    class Counted:
        begun = 0

        def __iter__(self) -> Iterator[tuple[FreeMotion, object]]:
            self.begun += 1
            return iter(data)

    counted = Counted()
    again = estimate(robot, counted, "free motion")  # type: ignore[arg-type]
    once = estimate(robot, iter(data), "free motion")
    assert counted.begun > 1
    assert again.values == pytest.approx(once.values, rel=1e-12)


def test_the_method_follows_from_what_was_recorded() -> None:
    free = FreeMotion(id="f", q=(0.0,), duration=1.0)
    stroke = Gravity(id="g", axis=1, q=(0.0,), stroke=1.0, velocity=0.5, acceleration=1.0, cycles=1)
    assert default_method([free])[0] == "free motion"
    assert default_method([stroke])[0] == "improved"
    method, reason = default_method([free, stroke])
    assert method == "joint"
    assert "1 of 2" in reason


def set_cut_off(data: FreeRecorded, cut_off: float) -> FreeRecorded:
    return [(motion.model_copy(update={"cut_off": cut_off}), each) for motion, each in data]


def test_the_default_leaves_no_more_than_weighted_least_squares_where_sensors_have_a_zero() -> None:
    # small angles: weight is nearly constant there, like a sensor offset
    data = recorded(arm(), TRUTH, n=2, duration=12.0, noise=0.05)
    for _, recording in data:
        middle = np.array([1.0, 0.5])
        q = middle + 0.1 * recording.q
        qd = 0.1 * np.gradient(recording.q, recording.time, axis=0)
        qdd = np.gradient(qd, recording.time, axis=0)
        recording.q[:] = q
        recording.tau[:] = inverse_dynamics(arm(), TRUTH, q, qd, qdd) + motor_torque(
            arm(), q, qd, qdd
        )
        recording.tau[:] += np.array([15.0, -9.0]) + 0.5 * np.sign(qd)
        recording.tau[:] += 0.05 * np.random.default_rng(1).standard_normal(q.shape)
    default, plain = (estimate(arm(), data, name) for name in ("free motion", WEIGHTED))
    assert (default.residual < 1.05 * plain.residual).all()


def test_recordings_of_two_rates_are_kinds_of_their_own(robot: Robot) -> None:
    """Each rate has its own filter; the parameters are common, the settings are those of the
    fastest.
    """
    whole = recorded(robot, TRUTH)
    slow = [(motion, thinned(recording, 2)) for motion, recording in whole[2:]]
    together = estimate(robot, [*whole[:2], *slow], "free motion")
    alone = estimate(robot, whole[:2], "free motion")
    assert together.n_measurements == 4
    assert together.details.cut_off == alone.details.cut_off
    assert (together.values != alone.values).any()
    assert distance(together) < 2e-3


def thinned(recording: Recording, every: int) -> Recording:
    """Return every second sample, as a slower controller records."""
    names = [each.name for each in fields(Recording) if getattr(recording, each.name) is not None]
    return replace(recording, **{name: getattr(recording, name)[::every] for name in names})
