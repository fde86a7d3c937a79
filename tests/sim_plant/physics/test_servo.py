"""Loops, events and sensors of the plant's servos."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_plant.machine_protocol import AxisEvent, Reading
from sim_plant.physics import state as st
from sim_plant.plant import Plant
from sim_plant.plant_file import Noise, OtherRipple, load_plant_file

STILL = Noise(torque=0.0, ripple=0.0)
DIRECTION = (1, 1, -1, 1, -1, 1)
ZERO = (0, 0, 12000, -8000, 5000, 0)
GEAR = (105.0, 210.0, 60.0, 99.0, 79.2, 99.0)
PEAK = (945.0, 1890.0, 540.0, 210.0, 186.0, 75.0)
INCREMENTS_PER_RAD = tuple(4096 * gear / math.tau for gear in GEAR)


def machine(**changes: object) -> Plant:
    plant = Plant(load_plant_file("manutec-r15").model_copy(update=changes))
    for servo in plant.axes:
        servo.enable()
    return plant


def move(plant: Plant, i: int, target: float, velocity: float, acceleration: float) -> None:
    """Move an axis, given joint values in SI units."""
    scale = INCREMENTS_PER_RAD[i]
    goal = DIRECTION[i] * target * scale + ZERO[i]
    plant.axes[i].move(goal, velocity * scale, acceleration * scale, acceleration * scale)


def read(plant: Plant) -> list[Reading]:
    return [Reading(*row) for row in np.reshape(plant.read(), (len(plant.axes), -1)).tolist()]


def events_of(plant: Plant) -> list[tuple[float, int, AxisEvent]]:
    """Return a growing list of the plant's events: instant [s], axis, events."""
    seen: list[tuple[float, int, AxisEvent]] = []
    plant.handle_event = lambda axis, bits: seen.append((plant.time, axis, AxisEvent(bits)))
    return seen


@pytest.mark.parametrize("i", range(6))
def test_an_axis_arrives_within_two_increments_and_stands(i: int) -> None:
    plant = machine()
    move(plant, i, 0.3, 0.5, 3.0)
    plant.advance(3.0)
    reading = read(plant)[i]
    assert abs(reading.position - (DIRECTION[i] * 0.3 * INCREMENTS_PER_RAD[i] + ZERO[i])) <= 2
    assert reading.events == AxisEvent.DONE | AxisEvent.STANDSTILL


def test_all_six_axes_follow_their_profiles_at_once_within_ten_milliradians() -> None:
    plant = machine()
    limits = [(axis.drive.velocity_max, axis.drive.acceleration_max) for axis in plant.file.axes]
    for i, (velocity, acceleration) in enumerate(limits):
        move(plant, i, 0.8, 0.5 * velocity, 0.3 * acceleration)
    for _ in range(1500):
        plant.advance(0.001)
        assert np.abs(plant.profile[:, st.DEMAND] - plant.state[:, st.Q]).max() < 10e-3


def test_torque_stops_at_its_limit_and_says_so() -> None:
    plant = machine(noise=STILL)
    plant.axes[0].set_torque_limit(300)
    seen = events_of(plant)
    move(plant, 0, 1.0, 3.0, 15.0)
    limit = 0.3 * PEAK[0] / 3
    for _ in range(300):
        plant.advance(0.001)
        torque = plant.state[0, st.TORQUE]
        assert abs(torque) <= limit * (1 + 1e-12)
        saturated = bool(read(plant)[0].events & AxisEvent.SATURATED)
        assert saturated == (abs(torque) >= limit)
    assert any(axis == 0 and bits & AxisEvent.SATURATED for _, axis, bits in seen)


def test_the_integral_part_does_not_wind_up_behind_a_saturated_torque() -> None:
    plant = machine(noise=STILL)
    move(plant, 0, 0.0, 1.0, 5.0)
    plant.axes[0].set_torque_limit(30)  # 9.45 N m cannot overcome friction
    limit = 0.03 * PEAK[0] / 3
    move(plant, 0, 0.5, 1.0, 5.0)
    plant.advance(5.0)
    assert plant.state[0, st.Q] < 1e-3
    assert abs(plant.state[0, st.INTEGRAL]) <= limit
    move(plant, 0, -0.5, 1.0, 50.0)
    plant.advance(1.0)
    assert plant.state[0, st.TORQUE] == pytest.approx(-limit)


def test_a_disabled_axis_has_no_torque() -> None:
    plant = machine()
    plant.advance(1.0)
    assert abs(plant.state[1, st.TORQUE]) > 300
    plant.axes[1].disable()
    plant.advance(0.002)
    assert plant.state[1, st.TORQUE] == 0.0


def test_the_brake_stops_a_disabled_axis_and_enabling_holds_it_where_it_is() -> None:
    plant = machine()
    move(plant, 1, -1.0, 1.0, 5.0)
    plant.advance(0.5)
    assert plant.state[1, st.QD] < -0.5
    plant.axes[1].disable()
    plant.advance(0.5)
    stopped = plant.state[1, st.Q]
    assert abs(plant.state[1, st.QD]) < 1e-4
    plant.axes[1].enable()
    plant.advance(1.0)
    assert plant.state[1, st.Q] == pytest.approx(stopped, abs=1e-3)


@pytest.mark.parametrize("i", range(6))
def test_the_brake_holds_what_the_axis_can_give(i: int) -> None:
    plant = machine(noise=STILL)
    for servo in plant.axes:
        servo.disable()
    plant.advance(0.5)
    start = plant.state[i, st.Q]
    plant.state[i, st.PUSH] = 0.9 * PEAK[i]  # gravity adds up to a quarter of it
    plant.advance(0.5)
    assert abs(plant.state[i, st.Q] - start) < 0.01


@pytest.mark.parametrize("timeout", [0.0, 0.05, 0.1])
def test_following_error_is_reported_after_its_time_and_not_before(timeout: float) -> None:
    plant = machine(noise=STILL)
    window = 0.01
    plant.axes[0].set_torque_limit(30)
    plant.axes[0].set_following_window(window * INCREMENTS_PER_RAD[0], timeout)
    seen = events_of(plant)
    move(plant, 0, 0.5, 1.0, 5.0)
    left = None
    for _ in range(400):
        plant.advance(0.001)
        outside = abs(plant.profile[0, st.DEMAND] - plant.state[0, st.Q]) > window
        if outside and left is None:
            left = plant.time
    assert left is not None
    reported = [time for time, axis, bits in seen if axis == 0 and bits & AxisEvent.FOLLOWING_ERROR]
    assert left + timeout - 0.0015 <= reported[0] <= left + timeout + 0.0015


def test_a_following_error_that_ends_in_time_is_not_reported() -> None:
    plant = machine(noise=STILL)
    plant.axes[0].set_following_window(0.01 * INCREMENTS_PER_RAD[0], 0.5)
    seen = events_of(plant)
    for _ in range(3):
        plant.axes[0].set_torque_limit(30)
        move(plant, 0, 0.05, 1.0, 5.0)
        plant.advance(0.4)
        assert plant.state[0, st.OUTSIDE] > 0.1
        plant.axes[0].set_torque_limit(3000)
        plant.advance(1.0)
        move(plant, 0, 0.0, 1.0, 5.0)
        plant.advance(1.0)
    assert not any(bits & AxisEvent.FOLLOWING_ERROR for _, _, bits in seen)


def test_a_following_window_that_is_off_reports_nothing() -> None:
    plant = machine(noise=STILL)
    seen = events_of(plant)
    plant.axes[0].set_torque_limit(0)
    plant.axes[0].set_following_window(math.inf, 0.0)
    move(plant, 0, 1.0, 1.0, 5.0)
    plant.advance(3.0)
    assert not any(bits & AxisEvent.FOLLOWING_ERROR for _, _, bits in seen)


def test_events_come_at_their_instant_in_the_middle_of_an_advance() -> None:
    plant = machine(noise=STILL)
    seen = events_of(plant)
    plant.advance(0.1)
    seen.clear()
    move(plant, 0, 0.5, 1.0, 4.0)  # 0.25 s, 0.25 s, 0.25 s
    plant.advance(2.0)
    done = [time for time, axis, bits in seen if axis == 0 and bits & AxisEvent.DONE]
    assert done[0] == pytest.approx(0.85, abs=0.0011)
    assert plant.time == pytest.approx(2.1)
    moving = [time for time, axis, bits in seen if axis == 0 and not bits & AxisEvent.STANDSTILL]
    assert 0.1 < moving[0] < 0.12


def test_what_the_firmware_does_at_an_event_takes_effect_at_once() -> None:
    plant = machine(noise=STILL)
    starts: list[float] = []

    def relay(axis: int, bits: int) -> None:
        if axis == 0 and bits & AxisEvent.DONE and not starts:
            starts.append(plant.time)
            move(plant, 5, 0.2, 1.0, 10.0)

    plant.advance(0.1)
    move(plant, 0, 0.5, 1.0, 4.0)
    plant.handle_event = relay
    plant.advance(2.0)
    assert starts == [pytest.approx(0.85, abs=0.0011)]
    assert plant.profile[5, st.START] == starts[0]
    assert plant.state[5, st.Q] == pytest.approx(0.2, abs=1e-3)


def test_a_move_forgets_that_the_last_one_was_done() -> None:
    plant = machine()
    plant.advance(0.1)
    assert read(plant)[0].events & AxisEvent.DONE
    move(plant, 0, 0.5, 1.0, 4.0)
    assert not read(plant)[0].events & AxisEvent.DONE


def test_encoders_count_increments_with_sign_and_zero_of_their_mounting() -> None:
    plant = Plant(load_plant_file("manutec-r15"))
    plant.state[:, st.Q] = q = np.array([0.1, -0.2, 0.3, -0.4, 0.5, -0.6])
    plant.state[:, st.QD] = qd = np.array([1.0, -1.0, 2.0, -2.0, 3.0, -3.0])
    plant.profile[:, st.DEMAND] = q + 0.01
    for i, reading in enumerate(read(plant)):
        scale = DIRECTION[i] * INCREMENTS_PER_RAD[i]
        assert reading.position == round(q[i] * scale + ZERO[i])
        assert reading.velocity == round(qd[i] * scale)
        assert reading.demand == round((q[i] + 0.01) * scale + ZERO[i])
        assert reading.following_error == reading.demand - reading.position


@pytest.mark.parametrize("torque", [-60.0, -1.0, 0.0, 0.04, 33.3])
def test_torque_and_current_read_per_mille_of_rated_with_the_sign_of_the_mounting(
    torque: float,
) -> None:
    plant = Plant(load_plant_file("manutec-r15").model_copy(update={"noise": STILL}))
    plant.state[:, st.TORQUE] = torque
    for i, reading in enumerate(read(plant)):
        drive = plant.file.axes[i].drive
        at_motor = DIRECTION[i] * torque / GEAR[i]
        assert reading.torque == round(1000 * at_motor / (drive.rated_torque_mNm / 1000))
        amperes = at_motor / drive.torque_constant
        assert reading.current == round(1000 * amperes / (drive.rated_current_mA / 1000))


def test_readings_stay_within_sixteen_bits() -> None:
    plant = Plant(load_plant_file("manutec-r15"))
    plant.state[:, st.TORQUE] = [1e6, -1e6, 1e6, -1e6, 1e6, -1e6]
    for reading in read(plant):
        assert {abs(reading.torque), abs(reading.current)} <= {32767, 32768}


def test_current_noise_is_white_with_a_quarter_of_a_percent_of_peak_torque() -> None:
    plant = Plant(load_plant_file("manutec-r15"))
    per_mille = np.array([[r.torque for r in read(plant)] for _ in range(10_000)], dtype=float)
    rated = [axis.drive.rated_torque_mNm * 1e-6 * axis.drive.gear_ratio for axis in plant.file.axes]
    noise = per_mille * rated
    assert noise.std(axis=0) == pytest.approx(0.0025 * np.array(PEAK), rel=0.03)
    assert np.abs(noise.mean(axis=0)).max() < 0.05 * noise.std()
    assert np.abs(np.corrcoef(noise.T)[np.triu_indices(6, 1)]).max() < 0.05
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.05


@pytest.mark.parametrize("other", [None, OtherRipple(order=4, amplitude=0.005)])
def test_a_servo_that_moves_evenly_works_against_the_ripple_of_its_motor(
    other: OtherRipple | None,
) -> None:
    """Orders 1, 2 and 6 of the motor's angle, each with 0.3 % of peak torque, and one chosen by the
    test.
    """
    plant = machine(noise=Noise(torque=0.0, other_ripple=other), drift=False)
    move(plant, 0, 2.0, 0.01, 1.0)  # slow, so that the velocity loop keeps the speed
    plant.advance(1.0)
    turn = math.tau / GEAR[0]
    angle, torque = [], []
    for _ in range(round(4 * turn / 0.01 / 0.001)):
        plant.advance(0.001)
        angle.append(GEAR[0] * plant.state[0, st.Q])
        torque.append(plant.state[0, st.TORQUE])
    orders = np.outer(angle, range(1, 9))
    columns = np.column_stack([np.cos(orders), np.sin(orders), np.ones(len(angle))])
    cosine, sine = np.linalg.lstsq(columns, np.array(torque), rcond=None)[0][:-1].reshape(2, 8)
    fourth = other.amplitude if other else 0.0
    expected = PEAK[0] * np.array([0.003, 0.003, 0, fourth, 0, 0.003, 0, 0])
    assert np.hypot(cosine, sine) == pytest.approx(expected, abs=0.02 * expected.max())
