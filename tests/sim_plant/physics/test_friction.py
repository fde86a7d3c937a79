"""The plant's friction against its formula, and its slow states against their formulas."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as h

from sim_plant.physics import friction
from sim_plant.physics import state as st
from sim_plant.plant import Plant
from sim_plant.plant_file import Noise, PlantFile, load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

CREEP = (42.0, 105.0, 42.0, 21.8, 30.1, 10.9)
FULL_SPEED = (69.0, 156.0, 71.0, 52.0, 44.0, 27.0)
SPEED_LIMIT = (3.0, 1.5, 5.2, 3.1, 3.1, 4.1)
ASYMMETRY = (0.004, -0.006, 0.005, -0.008, 0.006, -0.005)
HEAT_TIME = (2100.0, 2400.0, 1800.0, 1320.0, 1200.0, 960.0)
STILL = Noise(torque=0.0, ripple=0.0)


def characteristic(
    i: int, v: float, warmth: float, settled: float, wander: float = 0.0, eps: float | None = None
) -> float:
    """Return the stated formula, term by term."""
    f0, fm, vmax = CREEP[i], FULL_SPEED[i], SPEED_LIMIT[i]
    eps = ASYMMETRY[i] if eps is None else eps
    s, speed = math.copysign(1.0, v), abs(v)
    coulomb = 0.8 * f0
    rest = fm - coulomb
    e_c, e_d, e_v = (math.exp(-kappa * (warmth - 15)) for kappa in (0.006, 0.015, 0.022))
    stribeck = 1 + 0.10 * math.exp(-((speed / (0.004 * vmax)) ** 2))
    total = coulomb * e_c * (1 + 0.12 * settled) * stribeck
    total += (
        0.45 * rest * e_d * (1 + 0.25 * settled) * 2 / math.pi * math.atan(speed / (0.08 * vmax))
    )
    total += 0.55 * rest / vmax * e_v * (1 + 0.10 * settled) * speed
    return s * total * (1 + wander) * (1 + s * eps)


def machine(**changes: object) -> Plant:
    return Plant(load_plant_file("manutec-r15").model_copy(update=changes))


def set_friction(file: PlantFile, **changes: object) -> PlantFile:
    axes = tuple(
        axis.model_copy(update={"friction": axis.friction.model_copy(update=changes)})
        for axis in file.axes
    )
    return file.model_copy(update={"axes": axes})


def slide(plant: Plant, i: int, v: float) -> float:
    """Return friction torque after the bristle has bent."""
    for _ in range(5000):
        found = friction.torque(plant.const, plant.state, i, v, 1e-3)
    return float(found)


@given(
    i=h.integers(0, 5),
    share=h.floats(0.002, 1.0),
    forward=h.booleans(),
    warmth=h.floats(0.0, 40.0),
    settled=h.floats(0.0, 1.0),
    wander=h.floats(-0.03, 0.03),
)
def test_sliding_friction_is_as_stated(
    default: Plant,
    i: int,
    share: float,
    forward: bool,
    warmth: float,
    settled: float,
    wander: float,
) -> None:
    v = share * SPEED_LIMIT[i] * (1 if forward else -1)
    default.state[i, [st.TEMPERATURE, st.LUBRICANT, st.WANDER]] = warmth, settled, wander
    friction.refresh(default.const, default.state, i)
    default.state[i, [st.ENABLED, st.LOAD]] = 1.0, 0.0
    expected = characteristic(i, v, warmth, settled, wander)
    assert slide(default, i, v) == pytest.approx(expected, rel=1e-9)


@pytest.fixture(scope="module")
def default() -> Plant:
    return machine()


@pytest.mark.parametrize("share", [-0.6, -0.05, 0.01, 0.2, 0.9])
def test_motor_torque_of_an_axis_in_steady_motion_is_its_friction(share: float) -> None:
    """Joint 1 is not loaded by gravity; all others are held."""
    plant = machine(drift=False, noise=STILL)
    drive = plant.file.axes[0].drive
    per_rad = drive.gear_ratio * drive.increments / math.tau
    v = share * drive.velocity_max
    for servo in plant.axes:
        servo.enable()
    plant.axes[0].move(4 * v * per_rad, abs(v) * per_rad, 15 * per_rad, 15 * per_rad)
    plant.advance(3.0)
    assert plant.state[0, st.QD] == pytest.approx(v, rel=1e-6)
    assert plant.state[0, st.TORQUE] == pytest.approx(characteristic(0, v, 5.0, 1.0), rel=1e-5)


def test_symmetric_friction_is_the_same_both_ways() -> None:
    plant = machine(symmetric=True)
    plant.state[:, st.ENABLED] = 1.0
    for i in range(6):
        forward = slide(plant, i, 0.3)
        assert slide(plant, i, -0.3) == pytest.approx(-forward, rel=1e-12)
        assert forward == pytest.approx(characteristic(i, 0.3, 5.0, 1.0, eps=0.0), rel=1e-9)


def test_friction_grows_with_the_transmitted_torque() -> None:
    plant = Plant(set_friction(load_plant_file("manutec-r15"), load=0.1))
    plant.state[:, st.ENABLED] = 1.0
    plant.state[:, st.LOAD] = -200.0
    for i in range(6):
        plain = characteristic(i, 0.3, 5.0, 1.0)
        assert slide(plant, i, 0.3) == pytest.approx(plain + 20.0 * (1 + ASYMMETRY[i]), rel=1e-9)


def test_transmitted_torque_of_an_axis_at_rest_is_the_arms_weight() -> None:
    """Joint 2 carries 48.491 kg m at q2 = 0 with the forearm's -15.836 kg m at q3 = 90 deg."""
    file = load_plant_file("manutec-r15").model_copy(update={"noise": STILL})
    plant = Plant(set_friction(file, load=0.05))
    for servo in plant.axes:
        servo.enable()
    plant.advance(3.0)
    arm = _gravity_torque(plant)
    assert np.abs(arm).max() > 300
    assert plant.state[:, st.LOAD] == pytest.approx(arm, abs=0.01)


def _gravity_torque(plant: Plant) -> Array:
    """Return gravity torque by the principle of virtual work, from the first moments alone."""

    def potential(q: Array) -> float:
        rotation, origin, energy = np.eye(3), np.zeros(3), 0.0
        for k, axis in enumerate(plant.file.axes):
            a = math.radians(axis.frame.alpha_deg)
            about_x = np.array(
                [[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]]
            )
            c, s = math.cos(q[k]), math.sin(q[k])
            origin = origin + rotation @ [axis.frame.d, 0, 0]
            rotation = rotation @ about_x
            origin = origin + rotation @ [0, 0, axis.frame.r]
            rotation = rotation @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
            link = axis.link
            energy += 9.81 * (link.m * origin + rotation @ [link.sx, link.sy, link.sz])[2]
        return energy

    q, d = plant.state[:, st.Q], 1e-4
    return np.array([(potential(q + d * e) - potential(q - d * e)) / (2 * d) for e in np.eye(6)])


@pytest.mark.parametrize("held_by", ["brake", "servo"])
@pytest.mark.parametrize(("drift", "bound"), [(False, 1e-10), (True, 1e-6)])
def test_an_axis_at_rest_stays_still_without_chatter(
    held_by: str, drift: bool, bound: float
) -> None:
    """Creep up to a tenth of an increment is permitted, since the bristle yields to the load."""
    plant = machine(drift=drift)
    if held_by == "servo":
        for servo in plant.axes:
            servo.enable()
    start = plant.state[:, st.Q].copy()
    plant.advance(20.0)
    seen = []
    for _ in range(500):
        plant.advance(0.002)
        seen.append(plant.state[:, [st.Q, st.QD]].copy())
    q, qd = np.moveaxis(np.array(seen), 2, 0)
    assert np.abs(q - start).max() < 1e-3
    assert np.ptp(q, axis=0).max() < bound
    assert np.abs(qd).max() < 10 * bound


def slowly(plant: Plant, seconds: float, share: float, dt: float = 1.0) -> None:
    """Simulate slow states alone, all axes at `share` of their speed limits, without wander."""
    state, const = plant.state, plant.const
    state[:, st.QD] = share * np.array(SPEED_LIMIT)
    quiet = np.zeros(6)
    for _ in range(round(seconds / dt)):
        for i in range(6):
            state[i, st.FRICTION] = friction.level(const, state, i, state[i, st.QD])
        friction.drift(const, state, quiet, dt)


def test_half_speed_warms_every_axis_by_25_k() -> None:
    plant = machine()
    slowly(plant, 6 * max(HEAT_TIME), share=0.5, dt=5.0)
    assert plant.state[:, st.TEMPERATURE] == pytest.approx(np.full(6, 25.0), abs=0.02)


def test_a_warm_axis_at_rest_cools_with_its_own_time_constant() -> None:
    plant = machine()
    plant.state[:, st.TEMPERATURE] = 25.0
    slowly(plant, 600.0, share=0.0)
    expected = 25.0 * np.exp(-600.0 / np.array(HEAT_TIME))
    assert plant.state[:, st.TEMPERATURE] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("seconds", [60.0, 120.0, 300.0])
def test_lubricant_settles_at_rest_within_minutes(seconds: float) -> None:
    plant = machine()
    plant.state[:, st.LUBRICANT] = 0.0
    slowly(plant, seconds, share=0.0, dt=0.1)
    expected = np.full(6, 1 - math.exp(-seconds / 180.0))
    assert plant.state[:, st.LUBRICANT] == pytest.approx(expected, rel=1e-3)


def test_lubricant_is_stirred_up_by_motion_within_a_minute() -> None:
    plant = machine()
    slowly(plant, 45.0, share=0.25, dt=0.1)
    assert plant.state[:, st.LUBRICANT] == pytest.approx(np.full(6, math.exp(-1)), rel=2e-3)


def test_friction_wanders_by_one_percent_over_a_minute() -> None:
    plant = machine()
    rng = np.random.default_rng(0)
    n, dt = 40_000, 5.0
    seen = np.empty((n, 6))
    for k in range(n):
        friction.drift(plant.const, plant.state, rng.standard_normal(6), dt)
        seen[k] = plant.state[:, st.WANDER]
    assert seen.std() == pytest.approx(0.01, rel=0.05)
    after_a_minute = np.mean(seen[:-12] * seen[12:]) / seen.var()
    assert after_a_minute == pytest.approx((1 - dt / 60.0) ** 12, abs=0.03)
    between_axes = np.corrcoef(seen.T)[np.triu_indices(6, 1)]
    assert np.abs(between_axes).max() < 0.1


def moving_about(plant: Plant, seconds: float) -> None:
    for servo, axis in zip(plant.axes, plant.file.axes, strict=True):
        per_rad = axis.drive.gear_ratio * axis.drive.increments / math.tau
        servo.enable()
        servo.move(axis.drive.zero + per_rad, 0.5 * per_rad, 5 * per_rad, 5 * per_rad)
    plant.advance(seconds)


@pytest.mark.parametrize("strength", [1.0, 3.0])
def test_drift_has_a_strength_that_scales_warmth_lubricant_and_wander(strength: float) -> None:
    plant = machine(drift_strength=strength)
    i, warmth, settled, wander = 3, 31.0, 0.4, -0.02
    plant.state[i, [st.TEMPERATURE, st.LUBRICANT, st.WANDER]] = warmth, settled, wander
    friction.refresh(plant.const, plant.state, i)
    plant.state[i, [st.ENABLED, st.LOAD]] = 1.0, 0.0
    warmer = 15 + strength * (warmth - 15)
    expected = characteristic(i, 0.8, warmer, strength * settled, wander)
    assert slide(plant, i, 0.8) == pytest.approx(expected, rel=1e-6)


def test_a_strong_wander_is_a_multiple_of_the_plain_one() -> None:
    found = []
    for strength in (1.0, 3.0):
        plant = machine(drift_strength=strength)
        normal = np.random.default_rng(5).standard_normal((400, 6))
        for row in normal:
            friction.drift(plant.const, plant.state, row, 1.0)
        found.append(plant.state[:, st.WANDER].copy())
    assert found[1] == pytest.approx(3 * found[0])


@pytest.mark.parametrize(("drift", "changes"), [(True, True), (False, False)])
def test_friction_changes_only_if_it_is_to_drift(drift: bool, changes: bool) -> None:
    plant = machine(drift=drift)
    slow = [st.TEMPERATURE, st.LUBRICANT, st.WANDER, st.C_NOW, st.D_NOW, st.V_NOW]
    before = plant.state[:, slow].copy()
    moving_about(plant, 3.0)
    unequal: Callable[[Array, Array], Array] = np.not_equal
    assert bool(unequal(plant.state[:, slow], before).all()) is changes
    assert bool(unequal(plant.state[:, slow], before).any()) is changes
