"""Both estimators: exact without disturbances, calibrated with noise."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import TABLE_3_A, Friction, record

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.identify import estimate
from hil.estimation.local_fits import local_fit
from hil.estimation.signals import signals
from hil.estimation.two_step_methods import TwoStep
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import gravity_torque, inverse_dynamics, mass_matrix
from hil.model.robot import Robot, parse_robot
from hil.planning.design.by_counts import design
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.planning.strokes import Partner

COUNTS = {"gravity": 16, "inertia": 30, "coupling": 3}
TWO_STEP_METHODS = "improved", "published"
NOISE = 0.0025
"""Standard deviation of a sample, as share of the torque limit."""


@pytest.fixture(scope="module")
def robot():
    return Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def plan(robot):
    return design(robot, COUNTS)


def campaign(robot, plan, friction):
    begin = 0.0
    for measurement in plan.measurements:
        recording = record(robot, measurement, TABLE_3_A, friction, begin=begin)
        begin = float(recording.time[-1]) + 1.0
        yield measurement, recording


@pytest.fixture(scope="module")
def symmetric(robot, plan):
    """Campaign on a machine with constant and symmetric friction, without noise."""
    return list(campaign(robot, plan, Friction()))


def noisy(robot, recordings, seed=0):
    rng = np.random.default_rng(seed)
    for measurement, recording in recordings:
        noise = NOISE * robot.torque_limit * rng.standard_normal(recording.tau.shape)
        yield measurement, replace(recording, tau=recording.tau + noise)


def relative_error(p):
    return np.linalg.norm(p - TABLE_3_A) / np.linalg.norm(TABLE_3_A)


Q = (0.1, -0.3, 0.4, 0.6, -0.8, 0.2)
GRAVITY = Gravity(id="g", axis=3, q=Q, stroke=0.6, velocity=0.4, acceleration=2.0, cycles=2)
INERTIA = Inertia(id="i", axis=2, q=Q, stroke=0.4, velocity=1.0, acceleration=6.0, cycles=3)
COUPLING = Coupling(
    id="c", axis=1, q=Q, stroke=1.4, velocity=0.25, acceleration=1.2, cycles=1,
    partner=Partner(axis=2, stroke=0.2, velocity=0.9, acceleration=6.0),
)  # fmt: skip


class TestLocalFits:
    def value(self, robot, measurement, friction):
        s = signals(record(robot, measurement, TABLE_3_A, friction))
        return local_fit(robot, measurement, s).evaluate(TABLE_3_A)

    def test_a_half_sum_is_the_gravity_torque(self, robot):
        local = self.value(robot, GRAVITY, Friction())
        expected = gravity_torque(robot, TABLE_3_A, np.array(local.q))[2]
        assert local.value == pytest.approx(expected, rel=2e-2)  # the window spans 0.4 rad
        assert local.value == pytest.approx(local.model, rel=1e-6)

    def test_a_half_difference_is_friction(self, robot):
        local = self.value(robot, GRAVITY, Friction())
        expected = 40 + 10 * 0.4 + 8 * np.cbrt(0.4)
        assert local.friction == pytest.approx(expected, rel=2e-2)

    def test_an_acceleration_shows_the_moment_of_inertia(self, robot):
        local = self.value(robot, INERTIA, Friction())
        M = mass_matrix(robot, TABLE_3_A, np.array(local.q))
        assert local.value == pytest.approx(M[1, 1], rel=1e-4)
        assert local.model == pytest.approx(local.value, rel=1e-4)

    def test_the_creeping_axis_shows_the_coupling_inertia(self, robot):
        still = Friction(coulomb=40, viscous=0, root=0)
        local = self.value(robot, COUPLING, still)
        assert (local.axis, local.partner) == (0, 1)
        assert local.value == pytest.approx(local.model, abs=0.1)

    def test_an_element_that_changes_along_the_way_is_that_where_the_partner_accelerates(
        self, robot
    ):
        """Eq. (21) neglects centrifugal torque, so the test has none."""
        partner = Partner(axis=2, stroke=1.2, velocity=1.5, acceleration=6.0)
        wide = COUPLING.model_copy(update={"stroke": 2.4, "velocity": 0.2, "partner": partner})
        still = Friction(coulomb=40, viscous=0, root=0)
        s = signals(record(robot, wide, TABLE_3_A, still))
        slow, fast = (inverse_dynamics(robot, TABLE_3_A, s.q, v, s.qdd) for v in (0 * s.qd, s.qd))
        local = local_fit(robot, wide, replace(s, tau=s.tau + slow - fast)).evaluate(TABLE_3_A)
        assert local.value == pytest.approx(local.model, rel=1e-4)
        mean = mass_matrix(robot, TABLE_3_A, np.array(local.q))[0, 1]
        assert abs(mean - local.model) > 0.03 * abs(local.model)

    @pytest.mark.parametrize("measurement", [GRAVITY, INERTIA], ids=lambda m: m.kind)
    def test_a_standard_error_is_what_noise_does_to_the_element(self, robot, measurement):
        clean = record(robot, measurement, TABLE_3_A, Friction())
        found = [
            local_fit(robot, measurement, signals(recording)).evaluate(TABLE_3_A)
            for _, recording in noisy(robot, [(measurement, clean)] * 100)
        ]
        scatter = np.std([local.value for local in found])
        stated = np.sqrt(np.mean([local.standard_error**2 for local in found]))
        assert stated == pytest.approx(scatter, rel=0.2)  # errors of 10 % from 100 draws

    def test_a_gravity_measurement_without_a_window_is_refused(self, robot):
        short = GRAVITY.model_copy(update={"stroke": 0.05})
        s = signals(record(robot, short, TABLE_3_A, Friction()))
        with pytest.raises(NotEnoughData, match="no window of constant velocity"):
            local_fit(robot, short, s)


class TestTwoStep:
    def test_a_row_counts_by_the_torque_limit_of_its_axis(self, robot, symmetric):
        """Eq. (16): an axis with a very large limit has no weight against the others."""
        local = [local_fit(robot, m, signals(recording)) for m, recording in symmetric]
        joints = list(robot.file.joints)
        joints[1] = joints[1].model_copy(update={"torque_limit": 1e9})
        strong = replace(robot, file=robot.file.model_copy(update={"joints": tuple(joints)}))
        wrong = [
            replace(each, sides=each.sides * [1.2, *[1.0] * 15])
            if each.measurement.index == 1
            else each
            for each in local
        ]
        of_others = [7, 12]  # p8 and p13 also occur in gravity of axis 3
        sound, found = (TwoStep(strong, each).solve()[of_others] for each in (local, wrong))
        assert found == pytest.approx(sound, rel=1e-6)
        assert TwoStep(robot, wrong).solve()[of_others] != pytest.approx(sound, rel=1e-3)


class TestExactness:
    def test_the_improved_method_finds_the_parameters_of_a_drifting_machine(self, robot, plan):
        friction = Friction(growth=-3e-4, offset=np.array([1.0, -2.0, 0.5, 0.3, -0.2, 0.1]))
        found = estimate(robot, campaign(robot, plan, friction))
        assert relative_error(found.values) < 1e-5

    def test_the_published_method_finds_what_a_symmetric_machine_has(self, robot, symmetric):
        found = estimate(robot, symmetric, "published")
        assert relative_error(found.values) < 3e-4

    def test_a_constant_offset_disturbs_the_published_method_only(self, robot, plan):
        friction = Friction(offset=np.array([1.0, -3.0, 2.0, 0.5, -0.5, 0.2]))
        recorded = list(campaign(robot, plan, friction))
        assert relative_error(estimate(robot, recorded).values) < 1e-5
        assert relative_error(estimate(robot, recorded, "published").values) > 3e-3

    def test_missing_samples_do_not_bias_the_result(self, robot, symmetric):
        rng = np.random.default_rng(4)

        def gappy_run():
            for measurement, recording in symmetric:
                q, tau = recording.q.copy(), recording.tau.copy()
                lost = rng.random(len(q)) < 0.004
                q[lost], tau[lost] = np.nan, np.nan
                yield measurement, replace(recording, q=q, tau=tau)

        assert relative_error(estimate(robot, gappy_run()).values) < 1e-5


class TestCalibration:
    @pytest.mark.long
    def test_intervals_of_95_percent_cover_about_that_often(self, robot, symmetric):
        drawn = [list(noisy(robot, symmetric, seed)) for seed in range(6)]
        for method in TWO_STEP_METHODS:
            inside, ratio = [], []
            reference = estimate(robot, symmetric, method)
            for found in (estimate(robot, each, method) for each in drawn):
                error = found.values - reference.values
                inside.append(np.abs(error) < found.half_width())
                ratio.append(error / found.standard_errors)
            assert 0.88 <= np.mean(inside) <= 1.0, method
            assert 0.4 < np.median(np.abs(ratio)) < 1.0, method  # 0.67 for a normal distribution

    def test_more_confidence_means_wider_intervals(self, robot, symmetric):
        found = estimate(robot, noisy(robot, symmetric))
        assert np.all(found.half_width(0.99) > found.half_width(0.95))


class TestDriveErrors:
    def uncertain(self, robot, key, value):
        text = robot.text.replace("torque_constant: ", f"{key}: {value}, torque_constant: ")
        return parse_robot(text, "uncertain.yaml")

    @pytest.mark.long
    @pytest.mark.parametrize("method", TWO_STEP_METHODS)
    def test_a_wrong_torque_constant_shifts_p_as_its_stated_uncertainty_says(
        self, robot, symmetric, method
    ):
        recordings = list(noisy(robot, symmetric))
        scale = np.ones(6)
        scale[1] = 1.02
        wrong = [(m, replace(r, tau=r.tau * scale)) for m, r in recordings]
        shift = estimate(robot, wrong, method).values - estimate(robot, recordings, method).values
        stated = self.uncertain(robot, "torque_constant_uncertainty", 0.02)
        carried = estimate(stated, recordings, method)
        assert np.linalg.norm(shift) > 0.5
        bound = np.sqrt(np.diag(carried.drive_covariance))
        assert np.all(np.abs(shift) <= 1.05 * bound + 1e-3)

    def test_a_wrong_rotor_inertia_goes_into_p4(self, robot, symmetric):
        stated = self.uncertain(robot, "rotor_inertia_uncertainty", 0.03)
        found = estimate(stated, symmetric)
        p4 = base_parameters(robot).names.index("p4")
        expected = 0.03 * 1.3e-3 * 210**2
        assert np.sqrt(found.drive_covariance[p4, p4]) == pytest.approx(expected, rel=0.05)


class TestRefusals:
    def test_a_campaign_without_couplings_is_refused_with_the_parameter_s_name(
        self, robot, symmetric
    ):
        partial = [item for item in symmetric if item[0].kind != "coupling"]
        with pytest.raises(NotIdentifiable, match=r"0 usable coupling measurements .* p3"):
            estimate(robot, partial)

    def test_useless_recordings_are_left_out_and_named(self, robot, symmetric):
        recordings = list(symmetric)
        measurement, recording = recordings[0]
        recordings[0] = measurement, replace(recording, tau=np.full_like(recording.tau, np.nan))
        with pytest.raises(NotEnoughData, match="no usable sample"):
            signals(recordings[0][1])
        short = GRAVITY.model_copy(update={"stroke": 0.05})
        recordings.append((short, record(robot, short, TABLE_3_A, Friction())))
        found = estimate(robot, recordings)
        assert [each.id for each in found.left_out] == [measurement.id, short.id]
