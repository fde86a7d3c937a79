"""Gravity and inertia show signs, order, zeros and units that the map has wrong."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import TABLE_3_A

from hil.imports.evidence import Evidence
from hil.imports.model_shape import shape_suspicions
from hil.imports.plausibility import friction_suspicions
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import load_robot, parse_robot

ROBOTS = Path(__file__).parents[2] / "robots"


@pytest.fixture(scope="module")
def evidence(manutec):
    """A free motion of the manutec-r15, with friction."""
    t = np.arange(0, 30, 0.1)
    w = 2 * np.pi * np.array([0.11, 0.13, 0.17, 0.19, 0.23, 0.29])
    q = 0.7 * np.sin(np.outer(t, w)) + np.array([0, 0.3, -0.4, 0, 0.5, 0])
    qd, qdd = 0.7 * w * np.cos(np.outer(t, w)), -0.7 * w**2 * np.sin(np.outer(t, w))
    motors = manutec.reflected_inertia * qdd
    tau = inverse_dynamics(manutec, TABLE_3_A, q, qd, qdd) + motors + 10 * np.tanh(qd / 0.03)
    tau += np.random.default_rng(1).normal(0, 0.3, tau.shape)
    return Evidence(q, qd, qdd, tau, np.full_like(q, np.nan), *np.zeros((2, 6)), np.ones(6, bool))


def found(evidence, manutec, **changes):
    return [s.message for s in shape_suspicions(replace(evidence, **changes), manutec)]


def test_the_right_map_raises_no_suspicion(evidence, manutec):
    assert found(evidence, manutec) == []


def test_a_light_joint_of_noisy_torques_is_not_taken_for_one_of_great_friction(evidence, manutec):
    friction = np.array([90, 90, 20, 0, 0, -5]) * np.tanh(evidence.qd / 0.03)
    tau = evidence.tau + friction
    tau[:, 5] += np.random.default_rng(2).normal(0, 0.5 * tau[:, 5].std(), len(tau))
    assert found(evidence, manutec, tau=tau) == []
    (message,) = found(evidence, manutec, tau=tau[:, [5, 1, 2, 3, 4, 0]])
    assert message.endswith("if, say, the torques of joints 1 and 6 are exchanged")


@pytest.mark.parametrize(("turn", "words"), [(np.pi / 2, "-pi/2"), (-np.pi / 2, "pi/2")])
def test_a_zero_that_is_a_quarter_turn_off(evidence, manutec, turn, words):
    shift = np.array([0, 0, turn, 0, 0, 0])
    (message,) = found(evidence, manutec, q=evidence.q + shift)
    assert message.endswith(f"if, say, the positions of joint 3 had {words} rad more")


def test_a_robot_without_friction_raises_no_suspicion_of_it(evidence, manutec):
    q, qd, qdd = evidence.q, evidence.qd, evidence.qdd
    frictionless = inverse_dynamics(manutec, TABLE_3_A, q, qd, qdd)
    assert list(friction_suspicions(replace(evidence, tau=frictionless), manutec)) == []


def test_torques_in_another_order(evidence, manutec):
    (message,) = found(evidence, manutec, tau=evidence.tau[:, [0, 2, 1, 3, 4, 5]])
    assert message.endswith("if, say, the torques of joints 2 and 3 are exchanged")


def test_joints_in_another_order(evidence, manutec):
    order = [0, 2, 1, 3, 4, 5]
    names = ("q", "qd", "qdd", "tau")
    changed = {name: getattr(evidence, name)[:, order] for name in names}
    (suspicion,) = shape_suspicions(replace(evidence, **changed), manutec)
    assert suspicion.message.endswith("if, say, joints 2 and 3 are exchanged")
    assert suspicion.location == ("joints", 1)


def test_degrees_of_all_joints_that_are_stated_as_radians(evidence, manutec):
    factor = np.degrees(1.0)
    changed = {name: factor * getattr(evidence, name) for name in ("q", "qd", "qdd")}
    (suspicion,) = shape_suspicions(replace(evidence, **changed), manutec)
    assert suspicion.certain
    assert "all joints that turn were in degrees, stated as rad" in suspicion.message


@pytest.mark.parametrize("stated", ["[0, 0, 9.81]", "[9.81, 0, 0]", "[0, -9.81, 0]"])
def test_gravity_from_another_side(evidence, manutec, stated):
    text = re.sub(r"^gravity: \[.*?\]", f"gravity: {stated}", manutec.text, flags=re.MULTILINE)
    (suspicion,) = shape_suspicions(evidence, parse_robot(text, "tilted.yaml"))
    assert suspicion.message.endswith("if, say, gravity were [0, 0, -9.81] m/s² in the base frame")
    assert suspicion.location == ("robot",)


def test_friction_at_reversals_does_not_hide_joints_in_another_order(evidence, manutec):
    sticky = evidence.tau + 60 * np.tanh(evidence.qd / 0.1) * np.exp(-np.abs(evidence.qd) / 0.02)
    order = [0, 2, 1, 3, 4, 5]
    changed = {name: getattr(evidence, name)[:, order] for name in ("q", "qd", "qdd")}
    changed["tau"] = sticky[:, order]
    (suspicion,) = shape_suspicions(replace(evidence, **changed), manutec)
    assert suspicion.certain
    assert suspicion.message.endswith("if, say, joints 2 and 3 are exchanged")


def test_a_map_that_explains_nearly_all_is_not_refused_for_one_that_explains_more():
    portal = load_robot(str(ROBOTS / "cartesian.yaml"))
    t = np.arange(0, 30, 0.1)
    w = 2 * np.pi * np.array([0.11, 0.13, 0.17])
    q, qd = 0.2 * np.sin(np.outer(t, w)), 0.2 * w * np.cos(np.outer(t, w))
    qdd = -(w**2) * q
    masses = np.array([4.0, 8.0, 12.0])  # in no order that links can have
    tau = masses * qdd + np.array([30.0, 40.0, 50.0]) * np.tanh(qd / 0.01)
    tau[:, 2] += 9.81 * masses[2]
    tau += np.random.default_rng(3).normal(0, 0.01, tau.shape) * np.std(tau, axis=0)
    seen = Evidence(q, qd, qdd, tau, np.full_like(q, np.nan), *np.zeros((2, 3)), np.ones(3, bool))
    assert not any(each.certain for each in shape_suspicions(seen, portal))
