"""Wrong signs, order and units in a map are found by mechanics before any estimation."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from synthetic import TABLE_3_A

from hil.imports.evidence import Excerpt
from hil.imports.mechanics import mechanical_suspicions
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot, parse_robot

ROBOTS = Path(__file__).parents[2] / "robots"
PERIOD = 0.01
T = np.arange(0, 30, PERIOD)


def excerpt(q, tau):
    return Excerpt(PERIOD, q, tau, np.full_like(q, np.nan), 3000)


@pytest.fixture(scope="module")
def seen(manutec):
    """Free motion of the manutec-r15, with friction."""
    return excerpt(*motion_with_friction(manutec, T))


def motion_with_friction(robot, t):
    """Return positions and torques of a free motion of the manutec-r15 at instants."""
    w = 2 * np.pi * np.array([0.11, 0.13, 0.17, 0.19, 0.23, 0.29])
    q = 0.7 * np.sin(np.outer(t, w)) + np.array([0, 0.3, -0.4, 0, 0.5, 0])
    qd, qdd = 0.7 * w * np.cos(np.outer(t, w)), -0.7 * w**2 * np.sin(np.outer(t, w))
    motors = robot.reflected_inertia * qdd
    tau = inverse_dynamics(robot, TABLE_3_A, q, qd, qdd) + motors + 10 * np.tanh(qd / 0.03)
    return q, tau + np.random.default_rng(1).normal(0, 0.3, tau.shape)


def said(seen, robot, **changes):
    found = list(
        mechanical_suspicions(
            [replace(seen, **changes)], robot, np.ones(robot.n_joints, dtype=bool)
        )
    )
    assert all(each.certain for each in found)
    return [
        (each.location, each.message.partition(": this correction leaves")[0]) for each in found
    ]


def test_the_right_map_raises_no_suspicion(seen, manutec):
    assert said(seen, manutec) == []


@pytest.mark.parametrize(("duration", "step"), [(4, 0.01), (8, 0.01), (8, 0.03), (20, 0.03)])
def test_positions_in_steps_too_coarse_for_a_model_show_no_other_reading(manutec, duration, step):
    period = 0.002
    q, tau = motion_with_friction(manutec, np.arange(0, duration, period))
    coarse = Excerpt(period, step * np.round(q / step), tau, np.full_like(q, np.nan), len(q))
    assert said(coarse, manutec) == []


def test_a_joint_without_friction_raises_no_suspicion(seen, manutec):
    qd = np.gradient(seen.q, PERIOD, axis=0)
    assert said(seen, manutec, tau=seen.tau - 10 * np.tanh(qd / 0.03)) == []


def test_torques_that_all_have_the_wrong_sign(seen, manutec):
    ((place, message),) = said(seen, manutec, tau=-seen.tau)
    assert place == ("joints", 0, "torque", "sign")
    assert message == "torques of all joints have the wrong sign"


@pytest.mark.parametrize(("friction", "words"), [(0, "some motions would"), (1, "friction would")])
def test_torques_that_all_have_the_wrong_sign_where_no_rotor_is_known(
    seen, manutec, friction, words
):
    robot = parse_robot(
        re.sub(r"rotor_inertia: [\d.e-]+", "rotor_inertia: unknown", manutec.text), ""
    )
    tau = seen.tau - (1 - friction) * 10 * np.tanh(np.gradient(seen.q, PERIOD, axis=0) / 0.03)
    assert said(seen, robot, tau=tau) == []
    ((place, message),) = said(seen, robot, tau=-tau)
    assert place == ("joints", 0, "torque", "sign")
    assert message.startswith(f"torques of all joints have the wrong sign: {words}")


@pytest.mark.parametrize("axis", [2, 4])
@pytest.mark.parametrize("which", [("q", "tau"), ("tau",)])
def test_a_sign_on_an_arm_whose_last_axis_seems_to_have_a_negative_inertia(
    seen, manutec, which, axis
):
    # as with torques that a filter delays: the model is not exact, its noise not white
    qdd = np.gradient(np.gradient(seen.q, PERIOD, axis=0), PERIOD, axis=0)
    tau = seen.tau - np.eye(6)[5] * 3.0 * qdd
    wrong, inexact = np.where(np.arange(6) == axis, -1.0, 1.0), replace(seen, tau=tau)
    assert said(inexact, manutec) == []
    changes = {name: wrong * getattr(inexact, name) for name in which}
    ((place, _),) = said(inexact, manutec, **changes)
    assert place[:2] == ("joints", axis)


def test_columns_in_the_alphabetical_order_of_the_joints(seen, manutec):
    content = yaml.safe_load(manutec.text)
    names = ["s0", "s1", "e0", "e1", "w0", "w1"]
    for joint, name in zip(content["joints"], names, strict=True):
        joint["name"] = name
    robot = parse_robot(yaml.safe_dump(content, sort_keys=False), "")
    alphabetical = [names.index(name) for name in sorted(names)]
    assert said(seen, robot) == []
    ((place, message),) = said(
        seen, robot, q=seen.q[:, alphabetical], tau=seen.tau[:, alphabetical]
    )
    assert place == ("joints", 0)
    assert message == ("axes 1, 2, 3, 4: columns in the alphabetical order of the joints' names")


def test_columns_in_reverse_order(seen, manutec):
    ((place, message),) = said(seen, manutec, q=seen.q[:, ::-1], tau=seen.tau[:, ::-1])
    assert place == ("joints", 0)
    assert message == "axes 1, 2, 3, 4, 5, 6: columns in reverse order"


def test_torques_in_the_columns_of_their_neighbours(seen, manutec):
    ((place, message),) = said(seen, manutec, tau=np.roll(seen.tau, 1, axis=1))
    assert place == ("joints", 0, "torque", "column")
    assert message == (
        "axes 1, 2, 3, 4, 5, 6: torques in another order, those of axes 2, 3, 4, 5, 6, 1"
    )


@pytest.mark.parametrize("axes", [[0, 1, 3], [1, 2]])
def test_torques_of_several_axes_with_the_wrong_sign(seen, manutec, axes):
    tau = seen.tau.copy()
    tau[:, axes] *= -1
    ((place, message),) = said(seen, manutec, tau=tau)
    assert place == ("joints", axes[0], "torque", "sign")
    listed = (" and " if len(axes) == 2 else ", ").join(str(axis + 1) for axis in axes)
    assert message == f"axes {listed}: wrong sign of the torque"


def test_a_base_that_moves_is_no_order_of_columns(seen, manutec):
    """The recordings of axes 2 to 6, and a robot file without axis 1."""
    content = yaml.safe_load(manutec.text)
    del content["joints"][0], content["ties"]
    robot = parse_robot(yaml.safe_dump(content, sort_keys=False), "")
    found = said(seen, robot, q=seen.q[:, 1:], tau=seen.tau[:, 1:], qd=seen.qd[:, 1:])
    assert not any("order" in message for _, message in found)


def test_gravity_is_not_turned_for_one_axis_at_the_expense_of_others(seen, manutec):
    order = [2, 3, 0, 1, 5, 4]
    found = said(seen, manutec, q=seen.q[:, order], tau=seen.tau[:, order])
    assert not any("gravity" in message for _, message in found)


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.25, 2.0])
def test_a_rate_that_is_wrong_by_a_factor_common_to_all_axes(seen, manutec, factor):
    found = said(seen, manutec, period=PERIOD * factor)
    assert found == [(("time",), f"sampling rate some {factor:g} times that stated")]


@pytest.mark.parametrize("lag", [-0.9, -0.3, -0.02, 0.02, 0.15, 0.6])
def test_a_lag_of_all_torques_is_named_whatever_its_size(seen, manutec, lag):
    late = np.array([np.interp(T - lag, T, tau) for tau in seen.tau.T]).T
    shown = np.ones(manutec.n_joints, dtype=bool)
    (suspicion,) = mechanical_suspicions([replace(seen, tau=late)], manutec, shown)
    found = re.search(
        r"torques of all joints have a (lead|delay) of some (\d+) ms", suspicion.message
    )
    assert suspicion.first
    assert found
    assert found[1] == ("delay" if lag > 0 else "lead")
    assert float(found[2]) == pytest.approx(1e3 * abs(lag), rel=0.07, abs=5)
    assert not suspicion.certain


@pytest.mark.parametrize("turn", [90, -90])
def test_a_zero_that_is_a_quarter_turn_off(seen, manutec, turn):
    off = seen.q - np.radians([0, 0, turn, 0, 0, 0])
    assert said(seen, manutec, q=off) == [
        (("joints", 2, "position", "offset"), f"axis 3: joint offset error of some {turn} degrees")
    ]


def test_torques_of_a_joint_held_by_static_friction_show_no_motion(manutec):
    q = np.tile([0.0, 0.3, -0.4, 0.0, 0.5, 0.0], (len(T), 1))
    # a tenth of the time in motion, while the torque wanders throughout
    q[:, 0] += 0.1 * np.clip(np.sin(2 * np.pi * T / 15) / 0.15, -1, 1)
    tau = np.zeros_like(q)
    tau[:, 0] = 0.1 * np.cumsum(np.random.default_rng(3).standard_normal(len(T)))
    moves = np.arange(6) == 0
    (found,) = mechanical_suspicions([excerpt(q, tau)], manutec, moves)
    assert "joint 1 stands still in" in found.message
    assert "record motions without standstill" in found.message


def test_a_zero_that_is_a_little_off_is_left_to_the_estimate(seen, manutec):
    assert said(seen, manutec, q=seen.q + np.radians([0, 0, 5, 0, 0, 0])) == []


@pytest.mark.parametrize(("joint", "factor", "size"), [
    (0, 1000.0, "some 1000 times too large"),
    (1, 20.0, "some 20 times too large"),
    (2, 0.05, "some 20 times too small"),
    (4, 1e-3, "many times too small"),
])  # fmt: skip
def test_a_torque_in_another_unit_where_no_limits_tell(seen, manutec, joint, factor, size):
    tau = seen.tau.copy()
    tau[:, joint] *= factor
    ((place, message),) = said(seen, manutec, tau=tau)
    assert place == ("joints", joint, "torque", "unit")
    assert message == f"axis {joint + 1}: its torque is {size}"


@pytest.mark.parametrize("stated", ["[0, 0, 9.81]", "[9.81, 0, 0]", "[0, -9.81, 0]"])
def test_gravity_from_another_side(seen, manutec, stated):
    text = re.sub(r"^gravity: \[.*?\]", f"gravity: {stated}", manutec.text, flags=re.MULTILINE)
    ((place, words),) = said(seen, parse_robot(text, "tilted.yaml"))
    assert place == ("robot",)
    assert re.fullmatch(r"gravity points along \[\S+, \S+, -9.81\] in frame 0", words)


@pytest.mark.parametrize(
    ("which", "key", "words"),
    [
        (("q",), ("position", "sign"), "wrong sign of the position"),
        (("tau",), ("torque", "sign"), "wrong sign of the torque"),
        (("q", "tau"), (), "position and torque have the opposite sign"),
    ],
)
def test_a_sign(seen, manutec, which, key, words):
    turned = np.array([1, 1, -1, 1, 1, 1])
    changes = {name: turned * getattr(seen, name) for name in which}
    assert said(seen, manutec, **changes) == [(("joints", 2, *key), f"axis 3: {words}")]


@pytest.mark.parametrize(
    ("which", "key", "words"),
    [
        (("q",), ("position", "column"), "positions exchanged"),
        (("tau",), ("torque", "column"), "torques exchanged"),
        (("q", "tau"), (), "recordings exchanged"),
    ],
)
def test_two_joints_exchanged(seen, manutec, which, key, words):
    order = [0, 2, 1, 3, 4, 5]
    changes = {name: getattr(seen, name)[:, order] for name in which}
    assert said(seen, manutec, **changes) == [(("joints", 1, *key), f"axes 2 and 3: {words}")]


def test_two_torques_exchanged_of_axes_that_move_alike_among_others_that_are_right(manutec):
    # each torque contains the other's frequency, so it partly fits the wrong motion
    w = 2 * np.pi * np.array([0.11, 0.13, 0.13, 0.19, 0.23, 0.29])
    phase = np.array([0, 0, 0.6, 0, 0, 0])
    q = 0.7 * np.sin(np.outer(T, w) + phase) + np.array([0, 0.3, -0.4, 0, 0.5, 0])
    qd, qdd = 0.7 * w * np.cos(np.outer(T, w) + phase), -0.7 * w**2 * np.sin(np.outer(T, w) + phase)
    tau = inverse_dynamics(manutec, TABLE_3_A, q, qd, qdd) + manutec.reflected_inertia * qdd
    tau += 10 * np.tanh(qd / 0.03) + np.random.default_rng(1).normal(
        0, 0.15 * np.std(tau, axis=0), tau.shape
    )
    assert said(excerpt(q, tau), manutec) == []
    assert said(excerpt(q, tau[:, [0, 2, 1, 3, 4, 5]]), manutec) == [
        (("joints", 1, "torque", "column"), "axes 2 and 3: torques exchanged")
    ]


def test_degrees_that_are_stated_as_radians_where_no_limits_tell(seen, manutec):
    text = re.sub(r"(velocity|acceleration|torque)_limit: \S+", r"\1_limit: unknown", manutec.text)
    robot, one = parse_robot(text, "unlimited.yaml"), seen.q * [1, 1, 1, 1, 180 / np.pi, 1]
    assert said(seen, robot, q=one) == [
        (("joints", 4, "position", "unit"), "axis 5: its position is in degrees, stated as rad")
    ]
    ((place, words),) = said(seen, robot, q=np.degrees(seen.q))
    assert place == ("joints",)
    assert words == "positions of all joints that turn are in degrees, stated as rad"
    ((place, words),) = said(seen, robot, q=seen.q / (2 * np.pi))
    assert place == ("joints",)
    assert words == "positions of all joints that turn are in turns"


def test_friction_at_reversals_does_not_hide_joints_in_another_order(seen, manutec):
    qd = np.gradient(seen.q, PERIOD, axis=0)
    sticky = seen.tau + 60 * np.tanh(qd / 0.1) * np.exp(-np.abs(qd) / 0.02)
    order = [0, 2, 1, 3, 4, 5]
    ((_, words),) = said(seen, manutec, q=seen.q[:, order], tau=sticky[:, order])
    assert words == "axes 2 and 3: recordings exchanged"


def move_portal(masses):
    """Return a free motion of three prismatic axes, whose force is mostly friction."""
    w = 2 * np.pi * np.array([0.11, 0.13, 0.17])
    q, qd = 0.2 * np.sin(np.outer(T, w)), 0.2 * w * np.cos(np.outer(T, w))
    tau = masses * -(w**2) * q + np.array([30.0, 40.0, 50.0]) * np.tanh(qd / 0.01)
    tau[:, 2] += 9.81 * masses[2]
    tau += np.random.default_rng(3).normal(0, 0.01, tau.shape) * np.std(tau, axis=0)
    return excerpt(q, tau)


def test_a_map_that_explains_nearly_all_is_not_refused_for_one_that_explains_more():
    in_no_order_that_links_can_have = np.array([4.0, 8.0, 12.0])
    portal = Robot.load(str(ROBOTS / "cartesian.yaml"))
    assert said(move_portal(in_no_order_that_links_can_have), portal) == []


def test_a_force_of_the_wrong_sign_shows_by_friction_alone():
    seen, portal = (
        move_portal(np.array([12.0, 8.0, 4.0])),
        Robot.load(str(ROBOTS / "cartesian.yaml")),
    )
    assert said(seen, portal) == []
    ((place, words),) = said(seen, portal, tau=seen.tau * [-1, 1, 1])
    assert place == ("joints", 0, "torque", "sign")
    assert re.match(
        r"friction would accelerate joint 1: 9\d % of the residual's mean square", words
    )


def test_torques_that_are_exchanged_and_of_the_wrong_signs_as_well(seen, manutec):
    tau = seen.tau[:, [0, 1, 2, 4, 3, 5]] * [1, 1, 1, -1, -1, 1]
    ((place, words),) = said(seen, manutec, tau=tau)
    assert place == ("joints", 3, "torque", "column")
    assert words == "axes 4 and 5: torques exchanged"


def test_one_torque_that_fits_better_later_makes_those_of_all_joints_not_late(seen, manutec):
    noise = np.random.default_rng(2).normal(0, 1.0, seen.tau.shape) * 0.3 * seen.tau.std(axis=0)
    noise[:, 1] = 0.0
    tau = seen.tau.copy()
    tau[:, 1] = np.roll(tau[:, 1], round(0.05 / PERIOD))
    assert said(seen, manutec, tau=tau + noise) == []
