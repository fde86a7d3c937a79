"""Torque ripple is fitted only where it is distinguishable from other torques."""

import numpy as np
import pytest
from synthetic import Friction, record

from hil.estimation.identify import estimate
from hil.friction.ripple import orders_left_out, ripple_left_out, ripple_orders
from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.planning.prediction.information import predict
from hil.planning.prediction.noise import stated_noise

TRUTH = np.array([0.6, 0.1, 0.5, 2.0])


def pan_tilt(gear=1.0, half=2.0, kind="revolute"):
    """Return a robot with a vertical axis, and a horizontal axis with gravity."""
    joints = [({"alpha": 0}, ["Izz"]), ({"alpha": "-pi/2"}, ["Ixx", "Iyy", "Izz", "sx"])]
    return Robot.create(
        "pan-tilt",
        [
            {
                "type": kind, "frame": frame, "parameters": parameters,
                "q_min": -half, "q_max": half, "velocity_limit": 4.0, "acceleration_limit": 40.0,
                "torque_limit": 80.0,
                "drive": {"gear_ratio": gear, "rotor_inertia": 0.01, "torque_constant": 4.0},
            }
            for frame, parameters in joints
        ],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("gear", "half", "orders"),
    [
        (100.0, 2.0, (1, 2, 3, 4, 5, 6)),
        (2.0, 2.0, (2, 3, 4, 5, 6)),
        (1.0, 3.15, (4, 5, 6)),  # orders 1 and 2 are columns of gravity and of inertia themselves
        (1.0, 2.0, ()),  # less than a turn: all orders look alike
        (3.0, 0.35, ()),
    ],
)
def test_orders_that_can_be_distinguished(gear, half, orders):
    assert ripple_orders(pan_tilt(gear, half), 1) == orders


def test_a_sliding_axis_has_no_sines_but_those_of_its_motor():
    assert ripple_orders(pan_tilt(40.0, 0.1, "prismatic"), 0) == (1, 2, 3, 4, 5, 6)


def test_behind_gears_nothing_is_left_out(manutec):
    assert orders_left_out(manutec) == {}
    assert ripple_left_out(manutec) == ""


def test_what_is_left_out_is_said_with_its_reason():
    said = ripple_left_out(pan_tilt(1.0, 3.15))
    assert "axis 1, gear ratio 1: 1 to 3; axis 2, gear ratio 1: 1 to 3" in said
    assert "cannot be distinguished from gravity" in said


def test_gravity_of_a_direct_drive_is_identified():
    """First-order ripple is not fitted, because gravity has the same column."""
    robot = pan_tilt()
    plan = design(robot, {"gravity": 8, "inertia": 16})
    assert np.isfinite(
        predict(robot, plan.measurements, 0.004, stated_noise(robot)).deviation
    ).all()
    friction, rng = Friction(1.5, 0.4, 0.3, offset=np.zeros(2)), np.random.default_rng(2)
    recorded = [
        (m, record(robot, m, TRUTH, friction, noise=0.0025, rng=rng)) for m in plan.measurements
    ]
    found = estimate(robot, recorded)
    assert found.values == pytest.approx(TRUTH, abs=0.01)
