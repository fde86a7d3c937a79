"""Estimates beside the parameters: loads, omitted parameters, delays, drive gains."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import TABLE_3_A, Friction, record

from hil.estimation.absent_parameters import SEEN, examine, models, shifted_most
from hil.estimation.drive_train import directly_driven, find_drive_train
from hil.estimation.identify import estimate
from hil.estimation.loads.evidence import condensed_like, stroke_evidence
from hil.estimation.loads.joint import fit_load
from hil.estimation.noise_levels import noise_levels
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.estimation.two_step_methods import prepared_for
from hil.model.base_parameters import base_parameters, link_share
from hil.model.dynamics import gravity_torque
from hil.model.robot import Robot, parse_robot
from hil.planning.design.by_counts import design
from hil.planning.prediction.noise import stated_noise

LOAD = {"m6": 10.86, "sz6": 1.5204, "Ixx6": 0.2387, "Iyy6": 0.2387, "Izz6": 0.047}


@pytest.fixture(scope="module")
def robot():
    return Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def plan(robot):
    return design(robot, {"gravity": 12, "inertia": 24, "coupling": 3})


def campaign(robot, plan, p, seed):
    rng = np.random.default_rng(seed)
    return [(m, record(robot, m, p, Friction(), noise=0.0005, rng=rng)) for m in plan.measurements]


def loaded(robot):
    base = base_parameters(robot)
    phi = np.array([LOAD.get(name, 0.0) for name in robot.standard_parameters])
    return TABLE_3_A + base.matrix @ phi


def prepared(recorded):
    return [(m, signals(recording)) for m, recording in recorded]


@pytest.fixture(scope="module")
def runs(robot, plan):
    return campaign(robot, plan, TABLE_3_A, 1), campaign(robot, plan, loaded(robot), 2)


@pytest.fixture(scope="module")
def both(robot, runs):
    """Estimates of both runs, without and with the load."""
    return [estimate(robot, run) for run in runs]


def test_a_load_has_its_share_of_each_base_parameter(robot):
    shares = link_share(robot, 5)
    assert shares[0] == "l1^2 m6"
    assert shares[7] == "-l2 m6"
    assert shares[10:] == ("Ixx6", "Ixx6", "-sz6", "Izz6")


def found_between(robot, runs, mass=None, **gains):
    fit = SimultaneousFit(robot, prepared(runs[0]))
    bare, p = stroke_evidence(fit.recorded, fit.loaded), fit.solve()

    def add_load(change):
        items = condensed_like(robot, fit, prepared(runs[1]), p + change)
        return [stroke_evidence(items, fit.loaded)]

    return fit_load(robot, [bare], add_load, mass, **gains)


def test_mass_and_centre_of_a_load_are_found(robot, runs):
    found = found_between(robot, runs)
    quantities = {q.name: q for q in found.quantities()}
    assert quantities["mass"].value == pytest.approx(10.86, rel=2e-3)
    assert quantities["centre z"].value == pytest.approx(0.14, abs=5e-4)
    assert found.unseen == ("Ixy", "Ixz", "Iyz", "sx", "sy")
    assert found.rigid.p_value > 1e-4
    assert found.present.p_value < 1e-6


def test_a_known_mass_is_held_and_makes_the_rest_surer(robot, runs):
    free, held = found_between(robot, runs), found_between(robot, runs, 10.86)
    quantities = {q.name: q for q in held.quantities()}
    assert (quantities["mass"].value, quantities["mass"].standard_error) == (10.86, 0.0)
    assert held.rigid.directions == free.rigid.directions + 1
    for name in ("sz", "centre z", "Ixx"):
        found, alone = quantities[name], next(q for q in free.quantities() if q.name == name)
        assert found.standard_error <= 1.1 * alone.standard_error  # both are estimates
    assert quantities["centre z"].value == pytest.approx(0.14, abs=5e-4)


def test_every_axis_that_was_measured_has_a_residual_far_below_what_its_drive_can_give(both, robot):
    found = both[0].residual
    assert (found > 0.0).all()
    assert (found < 0.02 * robot.torque_limit).all()


def test_what_is_uncertain_of_drives_widens_a_load(robot, runs):
    uncertain = "torque_constant_uncertainty: 0.01, torque_constant:"
    stated = parse_robot(robot.text.replace("torque_constant:", uncertain), "uncertain")
    assert stated.stated_uncertainty[0] == 0.01
    plain, widened = found_between(robot, runs), found_between(stated, runs)
    assert widened.phi == pytest.approx(plain.phi)
    share = widened.mass.standard_error / widened.mass.value
    assert 0.003 < share < 0.012  # several torque constants, each wrong by 1 %
    assert plain.mass.standard_error < 0.2 * widened.mass.standard_error


def test_a_torque_constant_that_is_off_shows_by_a_known_mass(robot, runs):
    off = np.array([1.0, 1.02, 1.0, 1.0, 1.0, 1.0])
    wrong = [[(m, replace(r, tau=r.tau * off)) for m, r in run] for run in runs]
    found = found_between(robot, wrong, 10.86, gains=True)
    # the last axis only sees the load's unknown inertia, so its gain is uncertain
    assert 1 / found.gains[:5] == pytest.approx(off[:5], abs=5e-3)
    assert found.gains[5] == pytest.approx(1.0, abs=4 * found.gain_errors[5])
    assert found.gains[1] == pytest.approx(1 / 1.02, abs=2e-3)
    assert found.gain_errors[1] < 2e-3 < found.gain_errors[5]


def test_nothing_is_found_where_nothing_is_left_out(robot, runs):
    found = examine(robot, prepared(runs[0]))
    assert found.found == ()
    of_link_1 = {name for name in robot.standard_parameters if name.endswith("1")}
    assert of_link_1 - set(found.absorbed) == {"Izz1"}  # seen only as inertia about a vertical axis


@pytest.fixture(scope="module")
def off_axis(robot, runs):
    """Run of a machine with an off-axis centre of mass of link 4, and its examination."""
    complete = examine(robot, prepared(runs[0])).complete
    u = 0.05 * base_parameters(complete).matrix[:, complete.standard_parameters.index("sy4")]
    run = [(m, replace(r, tau=r.tau + gravity_torque(complete, u, r.q))) for m, r in runs[0]]
    return examine(robot, prepared(run)), run


def test_a_centre_of_mass_off_the_axis_is_ranked_first(off_axis):
    assert "sy4" in off_axis[0].alone[0].names


def test_what_is_left_out_shifts_the_sinusoid_that_gravity_is_over_an_angle(robot, off_axis):
    found, run = off_axis
    phase = shifted_most(estimate(robot, run), found, robot.torque_limit)
    angle, axis, over = np.linspace(-3.0, 3.0, 7), phase.axis - 1, phase.over - 1
    q = np.tile(phase.q, (len(angle), 1))
    q[:, over] = angle
    for p, sinusoid in zip(models(found), (phase.stated, phase.extended), strict=True):
        torque = gravity_torque(found.complete, p, q)[:, axis]
        assert sinusoid.evaluate(angle) == pytest.approx(torque, abs=1e-9)
    assert abs(phase.shift) > SEEN
    own = [m for m, _ in run if m.kind == "gravity" and m.index == axis]
    assert phase.angle == pytest.approx([m.q[over] for m in own], abs=1e-6)


def test_signals_behind_an_estimate_have_its_drive_train_taken_into_account(robot, runs):
    lag = np.array([0.004, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = estimate(robot, runs[0], "published")
    (_, plain), *_ = prepared_for(robot, found, runs[0])
    late = replace(found, drive_train=replace(directly_driven(robot), lag=lag))
    (_, advanced), *_ = prepared_for(robot, late, runs[0])
    assert np.array_equal(advanced.tau, plain.torque_advanced(lag).tau)
    assert not np.array_equal(advanced.tau, plain.tau)


def test_a_campaign_shows_the_noise_of_each_axis(robot, runs):
    found = noise_levels(robot, prepared(runs[0])).noise
    assert found.torque == pytest.approx(0.0005 * robot.torque_limit, rel=0.3)


def test_an_axis_that_was_not_measured_keeps_the_noise_that_is_stated(robot, runs):
    without = [(m, recording) for m, recording in runs[0] if 5 not in m.moved]
    found, stated = noise_levels(robot, prepared(without)).noise, stated_noise(robot)
    assert found.torque[5] == pytest.approx(stated.torque[5], rel=1e-3)
    assert found.wander[5] == pytest.approx(stated.wander[5], rel=1e-3)


def test_a_lag_of_the_torque_is_found_and_taken_back(robot, runs):
    late = np.array([0.004, 0.0, 0.006, 0.0, 0.002, 0.008])
    delayed = [(m, s.torque_advanced(-late)) for m, s in prepared(runs[0])]
    assert find_drive_train(robot, delayed).lag == pytest.approx(late, abs=3e-4)
