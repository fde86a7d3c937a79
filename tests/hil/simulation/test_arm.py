"""Builtin simulator against closed solutions, the model's own dynamics, and MuJoCo."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from possible_models import model_of, possible
from stated_model import stated_model

from hil.errors import NotEnoughData
from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.friction.terms import LAWS
from hil.model.robot import Robot
from hil.results.consistency import find_consistent_robot
from hil.simulation.arm import Arm, Drive, Start, State

MASS, COULOMB = 2.0, 4.0


def never(k, q):
    return False


def law(**terms):
    values = {name: TermValue(value=x, standard_error=0.0) for name, x in terms.items()}
    return AxisLaw(law="Coulomb", speed=1.0, terms=values, plain=values, held_out={})


def carriage(viscous=0.0):
    """Return a horizontal prismatic axis of 2 kg with 4 N of Coulomb friction."""
    model = model_of(Robot.load("emps"), np.array([MASS]), np.array([0.01]), friction=False)
    return Arm(
        replace(model, friction_law=FrictionLaw(axes=(law(Coulomb=COULOMB, viscous=viscous),)))
    )


def integrate(arm, time, force, q=0.0, qd=0.0):
    n, none = len(time), np.zeros(1)
    drive = Drive(time, np.reshape(force, (n, 1)), np.zeros((n, 1)), none, none)
    (found,) = arm.run([Start(np.array([q]), np.array([qd]), time, never)], drive)
    return found[:, 0]


def test_an_axis_without_force_brakes_at_its_friction_and_then_rests():
    time = np.arange(0.0, 1.0, 0.0037)
    found = integrate(carriage(), time, np.zeros_like(time), qd=1.0)
    braking = COULOMB / MASS
    stop = 1.0 / braking
    t = np.minimum(time, stop)
    np.testing.assert_allclose(found, t - braking * t**2 / 2, atol=1e-9)
    rest = found[time > stop]
    assert len(rest) > 100
    assert np.ptp(rest) == 0.0


def test_viscous_friction_brakes_along_an_exponential_until_coulomb_s_stops_the_axis():
    time = np.arange(0.0, 1.0, 0.001)
    found = integrate(carriage(viscous=3.0), time, np.zeros_like(time), qd=1.0)
    rate, level = 3.0 / MASS, COULOMB / 3.0
    stop = np.log(1.0 + 1.0 / level) / rate
    t = np.minimum(time, stop)
    expected = (1.0 + level) * (1.0 - np.exp(-rate * t)) / rate - level * t
    np.testing.assert_allclose(found, expected, atol=2e-7)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_resting_axis_holds_until_a_growing_force_exceeds_its_friction(side):
    time, slope = np.arange(0.0, 1.0, 0.001), 10.0
    found = side * integrate(carriage(), time, side * slope * time)
    leaves = COULOMB / slope
    np.testing.assert_array_equal(found[time <= leaves], 0.0)
    np.testing.assert_allclose(
        found, slope * np.maximum(time - leaves, 0.0) ** 3 / (6 * MASS), atol=3e-6
    )


def stick_slip(step):
    time = np.arange(0.0, 1.0 + step / 2, step)
    force = 6.0 * np.sin(7.0 * time) + 2.0 * np.sin(3.0 * time)
    return integrate(carriage(viscous=0.7), time, force)[:: round(4e-3 / step)]


def test_through_many_stops_and_reversals_the_error_falls_with_the_square_of_the_step(monkeypatch):
    monkeypatch.setattr("hil.simulation.arm.STEP", 1.0)
    fine = stick_slip(4e-3 / 16)
    # a rest, and motion in both directions: the force crosses the friction
    assert (np.diff(fine) == 0.0).any()
    assert np.diff(fine).min() < 0.0 < np.diff(fine).max()
    coarse, quarter = (np.abs(stick_slip(h) - fine).max() for h in (4e-3, 1e-3))
    assert coarse < 1e-3 * np.ptp(fine)
    assert coarse > 6.0 * quarter


@pytest.mark.parametrize("path", ["ur10e", "scara", "two-arms"])
def test_axes_that_slide_accelerate_as_the_model_says(path):
    robot = Robot.load(Path(f"tests/robots/{path}.yaml"))
    p, error = possible(robot)
    model = replace(
        model_of(robot, p, error, friction=False),
        friction_law=stated_model(robot, friction=LAWS["all"]).friction_law,
    )
    slight = {
        name: TermValue(value=0.05 if name == "load" else each.value, standard_error=0.0)
        for name, each in model.friction_law.axes[0].terms.items()
    }
    axes = tuple(each.model_copy(update={"terms": slight}) for each in model.friction_law.axes)
    model = replace(model, friction_law=model.friction_law.model_copy(update={"axes": axes}))
    rng = np.random.default_rng(5)
    arm = Arm(model)
    for _ in range(4):
        q, qd, tau = rng.uniform(-1.0, 1.0, (3, 1, robot.n_joints))
        state = arm.start(q, qd)
        found, _, _ = arm.acceleration(state, 50.0 * tau)
        expected = model.forward_dynamics(q, qd, 50.0 * tau)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def ur10e(seed=0, name="ur10e"):
    robot = Robot.load(Path(f"tests/robots/{name}.yaml"))
    p, error = possible(robot, seed)
    return find_consistent_robot(model_of(robot, p, 1e-6 * error))


def swinging(model, time):
    """Return torques that swing a robot around, at, above and below its friction."""
    phases = np.arange(model.robot.n_joints)
    return model.gravity(np.zeros(len(phases))) + 12.0 * np.sin(9.0 * time[:, None] + phases)


def test_axes_at_rest_hold_together_and_each_is_freed_by_what_the_others_leave():
    model = ur10e()
    arm, q = Arm(model), np.zeros(6)
    holds = model.gravity(q)
    rest = State(*np.zeros((3, 1, 6)))
    assert not arm.resolved(rest, holds[None] + 2.9).mode.any()
    pushed = holds[None] + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3.5])
    free = arm.resolved(rest, pushed)
    qdd, friction, most = arm.acceleration(free, pushed)
    assert free.mode[0, 5] == 1.0
    assert (free.mode * qdd >= 0.0).all()
    assert (np.abs(friction) <= most + 1e-9).all()
    np.testing.assert_allclose(qdd[free.mode == 0.0], 0.0, atol=1e-9)


def test_both_simulators_move_a_tree_alike_whatever_the_order_of_its_joints():
    """MuJoCo counts the joints of a tree branch by branch, a robot file in its own order."""
    pytest.importorskip("mujoco")
    from hil.simulation.mujoco_arm import MujocoArm

    model, none = ur10e(name="two-arms"), np.zeros(6)
    waist, left, elbow, right, *others = model.robot.file.joints
    joints = (waist, left, right, elbow, *others)
    parents = (None, None, 1, 2, 3, None)
    mixed = model.robot.changed(
        joints=tuple(
            joint.model_copy(update={"parent": parent})
            for joint, parent in zip(joints, parents, strict=True)
        )
    )
    p, error = possible(mixed, 0)
    model = find_consistent_robot(model_of(mixed, p, 1e-6 * error))
    time = np.arange(0.0, 0.3, 0.002)
    drive = Drive(time, swinging(model, time), np.zeros((len(time), 6)), none, none)
    begin = [Start(none, none, time, never)], drive
    (expected,) = Arm(model, "exported").run(*begin)
    moved = np.ptp(expected, axis=0)
    assert (moved > 1e-3).any()
    (found,) = MujocoArm(model, 1e-4).run(*begin)
    assert (np.abs(found - expected).max(axis=0) < 0.02 * moved.max()).all()


def test_builtin_and_mujoco_agree_within_a_fiftieth_of_the_motion_and_closer_with_smaller_steps():
    pytest.importorskip("mujoco")
    from hil.simulation.mujoco_arm import MujocoArm

    model, none = ur10e(), np.zeros(6)
    # MuJoCo applies these torques as an actuator's bias
    pushed = law(Coulomb=3.0, viscous=0.5, offset=1.2)
    axes = (pushed, *model.friction_law.axes[1:])
    model = replace(model, friction_law=FrictionLaw(axes=axes))
    time = np.arange(0.0, 0.6, 0.002)
    drive = Drive(time, swinging(model, time), np.zeros((len(time), 6)), none, none)
    begin = [Start(none, none, time, never)], drive
    (expected,) = Arm(model, "exported").run(*begin)
    moved = np.ptp(expected, axis=0)
    assert (moved > 0.01).all()
    apart = [
        np.abs(MujocoArm(model, step).run(*begin)[0] - expected).max(axis=0) / moved
        for step in (1e-3, 1e-4)
    ]
    assert (apart[0] < 0.02).all()
    assert apart[1].max() < apart[0].max() / 3


def test_lanes_side_by_side_move_as_each_does_alone():
    model, none, rng = ur10e(), np.zeros(6), np.random.default_rng(2)
    time = np.arange(0.0, 0.4, 0.002)
    drive = Drive(time, swinging(model, time), np.zeros((len(time), 6)), none, none)
    starts = [
        Start(none, speed, time[k:], never) for k, speed in enumerate(rng.normal(0, 0.3, (5, 6)))
    ]
    starts.append(Start(none, none, time, lambda k, _: k == 30))
    arm = Arm(model)
    found = arm.run(starts, drive)
    assert np.isnan(found[5][30:]).all()
    for start, positions in zip(starts, found, strict=True):
        np.testing.assert_allclose(positions, arm.run([start], drive)[0], rtol=0, atol=1e-12)


def test_a_mass_matrix_that_is_not_positive_definite_is_refused():
    model = model_of(Robot.load("emps"), np.array([-1.0]), np.array([0.01]))
    none = np.zeros(1)
    drive = Drive(np.arange(3.0), np.zeros((3, 1)), np.zeros((3, 1)), none, none)
    with pytest.raises(NotEnoughData, match="not positive definite"):
        Arm(model).run([Start(none, none, np.arange(3.0), never)], drive)
