"""Trapezoids of the plant's drives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as h

from sim_plant.physics import state as st
from sim_plant.physics.profile_generator import trapezoid
from sim_plant.plant import Plant, load_plant

LIMITS = h.floats(0.01, 100.0)
TRAPEZOIDS = {
    "p": h.floats(-10.0, 10.0),
    "v": h.floats(-20.0, 20.0),
    "target": h.floats(-10.0, 10.0),
    "velocity": LIMITS,
    "acceleration": LIMITS,
    "deceleration": LIMITS,
}


def corners(p: float, v: float, segments: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return position and velocity at the beginning and after every segment."""
    found = [(p, v)]
    for duration, a in segments:
        p, v = p + v * duration + a * duration**2 / 2, v + a * duration
        found.append((p, v))
    return found


@given(**TRAPEZOIDS)
@example(p=0.0, v=0.0, target=0.0, velocity=1.0, acceleration=1.0, deceleration=1.0)
@example(p=0.0, v=2.0, target=2.0, velocity=1.0, acceleration=1.0, deceleration=1.0)
@example(p=0.0, v=-2.0, target=-2.0, velocity=9.0, acceleration=1.0, deceleration=1.0)
@example(p=0.0, v=2.0, target=1.0, velocity=1.0, acceleration=1.0, deceleration=1.0)
def test_every_trapezoid_ends_at_rest_at_its_target_and_keeps_its_limits(
    p: float, v: float, target: float, velocity: float, acceleration: float, deceleration: float
) -> None:
    segments = trapezoid(p, v, target, velocity, acceleration, deceleration)
    assert len(segments) <= st.N_SEGMENTS
    assert all(duration >= 0 for duration, _ in segments)
    path = corners(p, v, segments)
    scale = max(abs(position) for position, _ in path) + v**2 / deceleration + 1.0
    fastest = max(abs(speed) for _, speed in path) + 1.0
    assert path[-1][0] == pytest.approx(target, abs=1e-9 * scale)
    assert path[-1][1] == pytest.approx(0.0, abs=1e-9 * fastest)
    speeds = [abs(speed) for _, speed in path]
    for before, after, (duration, a) in zip(speeds, speeds[1:], segments, strict=False):
        assert after <= max(velocity, before) * (1 + 1e-12) + 1e-9
        if duration > 1e-9:
            assert abs(a) == (acceleration if after > before else deceleration) or a == 0.0


@given(**TRAPEZOIDS)
def test_no_time_is_lost(
    p: float, v: float, target: float, velocity: float, acceleration: float, deceleration: float
) -> None:
    """A profile reaches the permitted speed, or has no constant speed; the axis reverses only if
    braking is too late.
    """
    *turn, change, cruise, braking = trapezoid(p, v, target, velocity, acceleration, deceleration)
    path = corners(p, v, [*turn, change, cruise, braking])
    assume(abs(target - path[len(turn)][0]) > 1e-6)
    toward = math.copysign(1.0, target - path[len(turn)][0])
    assert change[1] * toward > 0 or abs(v) >= min(velocity, abs(v))
    assert cruise[1] == 0.0
    assert braking[1] == -toward * deceleration
    top = abs(path[len(turn) + 1][1])
    if cruise[0] > 1e-6:
        assert top == pytest.approx(velocity, rel=1e-9)
    stop = p + v * abs(v) / (2 * deceleration)
    assert bool(turn) == (v * (target - stop) < 0)


class Desk:
    """Joint 1 of the plant in SI units."""

    def __init__(self) -> None:
        self.plant: Plant = load_plant("manutec-r15")
        self.per_rad = 105 * 4096 / math.tau
        for servo in self.plant.axes:
            servo.enable()

    def move(self, target: float, velocity: float, acceleration: float) -> None:
        limits = velocity * self.per_rad, acceleration * self.per_rad, acceleration * self.per_rad
        self.plant.axes[0].move(target * self.per_rad, *limits)

    def demand(self) -> tuple[float, float]:
        p, v = self.plant.profile[0, [st.DEMAND, st.DEMAND_V]]
        return float(p), float(v)


@given(h.data())
def test_a_new_set_point_in_mid_move_breaks_neither_position_nor_velocity(
    data: h.DataObject,
) -> None:
    desk = Desk()
    h_step, acceleration = 0.001, 10.0
    demand = [desk.demand()]
    for _ in range(3):
        target, speed = data.draw(h.floats(-1.0, 1.0)), data.draw(h.floats(0.1, 3.0))
        desk.move(target, speed, acceleration)
        for _ in range(data.draw(h.integers(1, 150))):
            desk.plant.advance(h_step)
            demand.append(desk.demand())
    p, v = np.array(demand).T
    assert np.abs(np.diff(v)).max() <= acceleration * h_step * (1 + 1e-9)
    mean = (v[1:] + v[:-1]) / 2
    assert np.abs(np.diff(p) - mean * h_step).max() <= acceleration * h_step**2


def test_demand_follows_the_closed_form_and_ends_exactly_at_the_target() -> None:
    desk = Desk()
    desk.plant.advance(0.1)
    desk.move(0.5, 1.0, 4.0)
    for k in range(1, 800):
        desk.plant.advance(0.001)
        t = k * 0.001
        rising, falling = min(t, 0.25), min(max(t - 0.5, 0.0), 0.25)
        cruising = min(max(t - 0.25, 0.0), 0.25)
        expected = 2 * rising**2 + cruising + falling - 2 * falling**2
        assert desk.demand()[0] == pytest.approx(expected, abs=1e-12)
    assert desk.demand() == (desk.plant.profile[0, st.TARGET], 0.0)
    assert desk.plant.profile[0, st.TARGET] == pytest.approx(0.5, abs=1e-15)


def test_a_stop_brakes_at_the_rate_commanded_and_stays() -> None:
    desk = Desk()
    desk.move(2.0, 1.0, 4.0)
    desk.plant.advance(0.5)
    p, v = desk.demand()
    desk.plant.axes[0].stop(5.0 * desk.per_rad)
    desk.plant.advance(0.1)
    assert desk.demand()[1] == pytest.approx(v - 0.5, abs=1e-9)
    desk.plant.advance(1.0)
    assert desk.demand() == (pytest.approx(p + v**2 / 10.0, abs=1e-9), 0.0)
