"""Torque ripple of orders outside the regression is found with order and amplitude."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded
from synthetic import TABLE_3_A, Friction, record

from hil.estimation.free_motion.columns import axis_columns
from hil.estimation.free_motion.motion import Processing, filtered_motion
from hil.estimation.ripple_orders import unmodelled_ripple
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.friction.ripple import RIPPLE_ORDERS
from hil.friction.terms import WAVES
from hil.model.robot import parse_robot
from hil.planning.design.by_counts import design

if TYPE_CHECKING:
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement

    Prepared = list[tuple[Measurement, Signals]]

SHARE = 0.01
"""Amplitude as share of the torque limit."""


@pytest.fixture(scope="module")
def slow_motors(manutec: Robot) -> Robot:
    """Return the robot with a tenth of the gear ratios, so that the window passes motor
    frequencies.
    """
    text = re.sub(
        r"gear_ratio: ([\d.]+)", lambda found: f"gear_ratio: {float(found[1]) / 10}", manutec.text
    )
    return parse_robot(text, "slow motors")


@pytest.fixture(scope="module")
def prepared(slow_motors: Robot) -> Prepared:
    plan = design(slow_motors, {"gravity": 24, "inertia": 36, "coupling": 3})
    rng = np.random.default_rng(4)
    return [
        (m, signals(record(slow_motors, m, TABLE_3_A, Friction(), noise=0.0025, rng=rng)))
        for m in plan.measurements
    ]


def rippled(robot: Robot, s: Signals, order: int, phase: float = 0.0) -> Signals:
    ripple = np.cos(order * robot.gear_ratio * s.q + phase)
    return replace(s, tau=s.tau + SHARE * robot.torque_limit * ripple)


def test_its_order_and_amplitude_are_found(slow_motors: Robot, prepared: Prepared) -> None:
    fit = SimultaneousFit(slow_motors, [(m, rippled(slow_motors, s, 8)) for m, s in prepared])
    found = unmodelled_ripple(slow_motors, fit)
    # strokes of the other axes are shorter than a revolution
    assert set(found.largest) >= {0, 1, 2}
    for axis, (order, amplitude) in found.largest.items():
        assert order == 8
        assert amplitude == pytest.approx(SHARE * slow_motors.torque_limit[axis], rel=0.2)
    assert (found.share[:3] > 0.3).all()


def test_what_it_does_to_the_parameters_is_foreseen(slow_motors: Robot, prepared: Prepared) -> None:
    plain = SimultaneousFit(slow_motors, prepared)
    fit = SimultaneousFit(slow_motors, [(m, rippled(slow_motors, s, 8)) for m, s in prepared])
    foreseen = unmodelled_ripple(slow_motors, fit).change
    happened = fit.solve() - plain.solve()
    assert np.linalg.norm(happened - foreseen) < 0.5 * np.linalg.norm(happened)


def test_it_is_found_whatever_its_phase_in_each_measurement(
    slow_motors: Robot, prepared: Prepared
) -> None:
    """The servo's reaction to ripple may change its phase at every speed."""
    phases = np.random.default_rng(1).uniform(0, 2 * np.pi, len(prepared))
    recorded = [
        (m, rippled(slow_motors, s, 9, phase))
        for (m, s), phase in zip(prepared, phases, strict=True)
    ]
    found = unmodelled_ripple(slow_motors, SimultaneousFit(slow_motors, recorded))
    assert {order for order, _ in found.largest.values()} == {9}
    assert set(found.largest) >= {0, 1, 2}


@pytest.mark.parametrize("order", [None, 2, 6])
def test_orders_that_the_regression_holds_are_not_among_them(
    slow_motors: Robot, prepared: Prepared, order: int | None
) -> None:
    if order is not None:
        prepared = [(m, rippled(slow_motors, s, order)) for m, s in prepared]
    assert unmodelled_ripple(slow_motors, SimultaneousFit(slow_motors, prepared)).largest == {}


def test_free_motions_offer_no_ripple_that_gravity_has_behind_a_low_gear() -> None:
    robot = arm(gear_ratio=2.0)
    ((_, recording), *_) = recorded(robot, TRUTH, n=1)
    settings = Processing(8.0, 8.0, np.full(2, 3.0), np.zeros(2, bool), np.zeros(2), np.zeros(2))
    motion = filtered_motion(recording, settings)
    rows = np.zeros((len(motion.q), len(TRUTH)))
    terms = ("offset", *(f"{wave} {n}" for n in RIPPLE_ORDERS for wave in WAVES))
    columns = axis_columns(robot, motion, 0, rows, TRUTH, terms)[:, -len(terms) :]
    shown = {term for term, column in zip(terms, columns.T, strict=True) if column.any()}
    assert shown == {"offset", *(f"{wave} {n}" for n in range(2, 7) for wave in WAVES)}
    assert "cosine 1" not in shown
