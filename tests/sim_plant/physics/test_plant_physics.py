"""The plant as a whole: energy, payload, and reproducibility by the seed."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as h

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from sim_plant.physics import friction
from sim_plant.physics import state as st
from sim_plant.plant import PERIOD, Plant, load_plant
from sim_plant.plant_file import Body, Noise, Payload, PlantFile, load_plant_file

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]

STEEL_DISC = Payload(mass=10.86, centre=(0.0, 0.0, 0.14), Ixx=0.02584, Iyy=0.02584, Izz=0.047)


def real_links() -> PlantFile:
    """Return the manutec-r15 with link masses, so that Pinocchio can compute their energy."""
    file = load_plant_file("manutec-r15")
    masses, offsets = (80.0, 40.0, 30.0, 15.0, 6.0, 3.0), (-0.2, 0.2, 0.1, -0.3, 0.05, 0.1)
    axes = tuple(
        axis.model_copy(
            update={"link": Payload(mass=m, centre=(0.1, 0, z), Ixx=0.4, Iyy=0.3, Izz=0.5).body()}
        )
        for axis, m, z in zip(file.axes, masses, offsets, strict=True)
    )
    return file.model_copy(update={"axes": axes, "drift": False})


def free_arm(step: float, torque: Array) -> Plant:
    """Return an arm without friction and ripple, with constant motor torques."""
    plant = Plant(
        real_links().model_copy(update={"step": step, "noise": Noise(torque=0.0, ripple=0.0)})
    )
    for servo in plant.axes:
        servo.enable()
    without = [st.F_COULOMB, st.F_DEGRESSIVE, st.F_VISCOUS, st.BRISTLE_DAMPING]
    plant.const[:, [*without, st.KP, st.KV, st.KI]] = 0.0
    for i in range(6):
        friction.refresh(plant.const, plant.state, i)
    plant.state[:, st.QD] = [0.5, -1.0, 1.0, 2.0, -1.5, 1.0]
    plant.state[:, st.TORQUE] = plant.state[:, st.INTEGRAL] = torque
    plant.state[:, st.TORQUE_LIMIT] = math.inf
    return plant


def energy(plant: Plant) -> float:
    """Return kinetic energy, including motors, and potential energy [J], by Pinocchio."""
    model = pin.Model()
    for k, axis in enumerate(plant.file.axes):
        about_x = pin.utils.rotate("x", math.radians(axis.frame.alpha_deg))
        place = pin.SE3(about_x, about_x @ [axis.frame.d, 0, axis.frame.r])
        joint = model.addJoint(k, pin.JointModelRZ(), place, axis.name)
        b = axis.link
        body = pin.Inertia.FromDynamicParameters(
            np.array([b.m, b.sx, b.sy, b.sz, b.Ixx, b.Ixy, b.Iyy, b.Ixz, b.Iyz, b.Izz])
        )
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    data, (q, qd) = model.createData(), plant.state[:, [st.Q, st.QD]].T.copy()
    mass = np.array(pin.crba(model, data, q))
    mass = np.triu(mass) + np.triu(mass, 1).T + np.diag(plant.const[:, st.MOTOR_INERTIA])
    return float(qd @ mass @ qd / 2 + pin.computePotentialEnergy(model, data, q))


TORQUE = np.array([20.0, -150.0, 60.0, 5.0, -4.0, 2.0])


@pytest.mark.parametrize("torque", [np.zeros(6), TORQUE], ids=["swinging free", "driven"])
def test_work_of_the_motors_is_the_change_of_the_arms_energy(torque: Array) -> None:
    plant = free_arm(0.001, torque)
    start, begin = energy(plant), plant.state[:, st.Q].copy()
    speeds = plant.state[:, st.QD].copy()
    for _ in range(20):
        plant.advance(0.1)
        work = float(torque @ (plant.state[:, st.Q] - begin))
        assert energy(plant) - start == pytest.approx(work, abs=0.01)
    assert np.abs(plant.state[:, st.QD] - speeds).max() > 1.0


def test_halving_the_step_quarters_the_error() -> None:
    ends = []
    for step in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        plant = free_arm(step, TORQUE)
        plant.state[:, st.QDD] = 0.0
        plant.advance(1.0)
        ends.append(plant.state[:, st.Q].copy())
    errors = [np.abs(a - b).max() for a, b in pairwise(ends)]
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.3)
    assert errors[1] / errors[2] == pytest.approx(4.0, abs=0.3)


def test_a_payload_adds_its_mass_first_moment_and_inertia_to_the_last_link() -> None:
    file = load_plant_file("manutec-r15")
    payload = Payload(mass=2.0, centre=(0.1, 0.2, 0.3), Ixx=0.01, Iyy=0.02, Izz=0.03)
    loaded = file.model_copy(update={"payload": payload})
    assert loaded.bodies()[:-1] == file.bodies()[:-1]
    inertia = pin.Inertia(2.0, np.array(payload.centre), np.diag([0.01, 0.02, 0.03]))
    m, sx, sy, sz, ixx, ixy, iyy, ixz, iyz, izz = inertia.toDynamicParameters()
    expected = Body(
        m=m, sx=sx, sy=sy, sz=sz, Ixx=ixx, Iyy=iyy, Izz=izz + 0.3760, Ixy=ixy, Ixz=ixz, Iyz=iyz
    )
    found = loaded.bodies()[-1]
    assert found.model_dump() == pytest.approx(expected.model_dump(), abs=1e-12)


def test_the_papers_payload_changes_the_base_parameters_as_equation_22_says(
    manutec: Robot,
) -> None:
    file = load_plant_file("manutec-r15")
    base = base_parameters(manutec)
    change = base.matrix @ (
        _standard(file.model_copy(update={"payload": STEEL_DISC}), manutec)
        - _standard(file, manutec)
    )
    expected = [
        2.715, -2.715, 0, 2.715, 5.430, 5.787, 5.787,
        -7.928, 0, 0, 0.2387, 0.2387, -1.520, 0.047,
    ]  # fmt: skip
    assert change == pytest.approx(np.array(expected), abs=6e-4)


def _standard(file: PlantFile, robot: Robot) -> Array:
    values = {
        f"{name}{k}": value
        for k, body in enumerate(file.bodies(), 1)
        for name, value in body.model_dump().items()
    }
    return np.array([values[name] for name in robot.standard_parameters])


def test_a_heavier_hand_needs_more_torque_to_hold() -> None:
    file = load_plant_file("manutec-r15")
    needed = []
    for payload in (None, STEEL_DISC):
        plant = Plant(file.model_copy(update={"payload": payload}))
        for servo in plant.axes:
            servo.enable()
        plant.advance(1.0)
        needed.append(plant.state[1, st.LOAD])
    # at q = 0 the upper arm is level and the forearm upright: the lever is l1
    assert needed[1] - needed[0] == pytest.approx(-10.86 * 9.81 * 0.5, abs=0.5)


def test_the_gears_transmit_what_the_arm_takes_and_the_motors_the_rest(manutec: Robot) -> None:
    plant = load_plant("manutec-r15")
    session(plant, [0.05])
    q, qd, qdd = plant.state[:, [st.Q, st.QD, st.QDD]].T.copy()
    begin = plant.state[:, st.TORQUE].copy()
    step = plant.file.step
    plant.advance(step)
    found = plant.state[:, st.QDD]
    assert np.abs(found).max() > 1.0
    base = base_parameters(manutec)
    p = base.matrix @ _standard(plant.file, manutec)
    arm = inverse_dynamics(manutec, p, q + step / 2 * qd, qd + step / 2 * qdd, found)
    assert plant.state[:, st.LOAD] == pytest.approx(arm, abs=1e-9)
    motor = (begin + plant.state[:, st.TORQUE]) / 2
    rest = motor - plant.state[:, st.FRICTION] - plant.const[:, st.MOTOR_INERTIA] * found
    ripple = 3 * 0.003 * np.array([axis.drive.peak_torque for axis in plant.file.axes])
    assert (np.abs(rest - arm) <= ripple).all()


def session(plant: Plant, pieces: list[float]) -> bytes:
    """Return every reading and the whole state of a motion of all axes."""
    for servo, axis in zip(plant.axes, plant.file.axes, strict=True):
        per_rad = axis.drive.gear_ratio * axis.drive.increments / math.tau
        servo.enable()
        servo.move(axis.drive.zero + per_rad, 0.4 * per_rad, 4 * per_rad, 4 * per_rad)
    readings = []
    for duration in pieces:
        plant.advance(duration)
        readings.append(plant.read())
    return np.array(readings).tobytes() + plant.state.tobytes() + plant.profile.tobytes()


def test_the_same_seed_gives_the_same_bytes() -> None:
    pieces = [0.004] * 500
    assert session(load_plant("manutec-r15", 7), pieces) == session(
        load_plant("manutec-r15", 7), pieces
    )


def test_another_seed_gives_other_noise_and_other_friction() -> None:
    one, other = load_plant("manutec-r15", 7), load_plant("manutec-r15", 8)
    assert session(one, [0.1]) != session(other, [0.1])
    assert (one.state[:, st.WANDER] != other.state[:, st.WANDER]).all()
    assert one.const.tobytes() == other.const.tobytes()


def test_the_seed_is_the_plant_files_by_default() -> None:
    pieces = [0.01] * 10
    assert session(load_plant("manutec-r15"), pieces) == session(
        load_plant("manutec-r15", load_plant_file("manutec-r15").seed), pieces
    )


@settings(deadline=None, max_examples=25)
@given(h.lists(h.integers(0, 40_000), min_size=1, max_size=12))
def test_time_in_pieces_is_time_at_once(quarters: list[int]) -> None:
    """Pieces of a quarter of a step, since pieces need not be whole steps."""
    whole, pieces = load_plant("manutec-r15"), load_plant("manutec-r15")
    step = whole.file.step
    at_once = session(whole, [sum(quarters) * step / 4])
    for servo, axis in zip(pieces.axes, pieces.file.axes, strict=True):
        per_rad = axis.drive.gear_ratio * axis.drive.increments / math.tau
        servo.enable()
        servo.move(axis.drive.zero + per_rad, 0.4 * per_rad, 4 * per_rad, 4 * per_rad)
    for quarter in quarters:
        pieces.advance(quarter * step / 4)
    assert pieces.time == whole.time == pytest.approx(sum(quarters) // 4 * step)
    readings = np.array([pieces.read()]).tobytes()
    assert readings + pieces.state.tobytes() + pieces.profile.tobytes() == at_once


@pytest.mark.parametrize("at", [PERIOD - 2, PERIOD - 1, PERIOD, PERIOD + 1, 2 * PERIOD - 1])
def test_stocks_of_random_numbers_are_renewed_however_time_passes(
    at: int,
) -> None:
    one, two = load_plant("manutec-r15"), load_plant("manutec-r15")
    step = one.file.step
    one.advance(at * step)
    one.advance(20 * step)
    two.advance((at + 20) * step)
    assert one.state.tobytes() == two.state.tobytes()
    assert one._normal.tobytes() == two._normal.tobytes()
    assert one._normal.tobytes() != load_plant("manutec-r15")._normal.tobytes()
