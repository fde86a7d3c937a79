"""Elastic gears, backlash and a lagging current have the effects stated in the plant file."""

from __future__ import annotations

import math

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from sim_plant.machine_protocol import AxisEvent
from sim_plant.physics import soft_gears as fl
from sim_plant.physics import state as st
from sim_plant.plant import Plant
from sim_plant.plant_file import Drive, Noise, load_plant_file

SOFT = (570e3, 570e3, 240e3, 20e3, 10e3, 20e3)
"""Stiffness of gears at which the arm oscillates at about 20 Hz and the hand at about 40 Hz [N
m/rad].
"""
ELBOW = 2
"""Joint 3, which carries the weight of the forearm."""


def machine(drive=None, position=(0, 0, 0, 0, 0, 0), **changes):
    """Return the manutec-r15, noiseless and switched on; `drive` gives each axis's own keys."""
    file = load_plant_file("manutec-r15")
    axes = tuple(
        axis.model_copy(
            update={
                "drive": Drive.model_validate({**axis.drive.model_dump(), **own}),
                "position_deg": degrees,
            }
        )
        for axis, own, degrees in zip(file.axes, drive or [{}] * 6, position, strict=True)
    )
    quiet = {"noise": Noise(torque=0.0, ripple=0.0), "drift": False, **changes}
    plant = Plant(file.model_copy(update={"axes": axes, **quiet}))
    for servo in plant.axes:
        servo.enable()
    return plant


def soft(**own):
    return [{"stiffness": stiffness, **own} for stiffness in SOFT]


def swing(plant, i, angle):
    """Move one axis by `angle` [rad] and yield at every step of the motion."""
    per_rad = plant.const[i, st.COUNTS_PER_RAD]
    zero = plant.const[i, st.ZERO]
    goal = (plant.profile[i, st.DEMAND] + angle) * per_rad + zero
    plant.axes[i].move(goal, 0.5 * abs(per_rad), 4 * abs(per_rad), 4 * abs(per_rad))
    while not plant.events[i] & AxisEvent.DONE:
        plant.advance(plant.file.step)
        yield


def angle_behind(plant):
    """Return the angle by which the motors are ahead of the links [rad]."""
    return plant.state[:, st.Q] - plant.flaws[:, fl.LINK_Q]


def test_a_soft_gear_under_gravity_deflects_by_torque_over_stiffness():
    plant = machine(soft(), position=(0, 0, 50, 20, 60, 0))
    plant.advance(4.0)
    torque = plant.state[:, st.LOAD]
    assert abs(torque[1]) > 300
    assert abs(torque[2]) > 90
    assert angle_behind(plant) == pytest.approx(torque / SOFT, abs=1e-8)


def test_a_soft_gear_bears_what_a_rigid_one_bears():
    rigid, elastic = machine(), machine(soft())
    for plant in (rigid, elastic):
        plant.advance(4.0)
    assert elastic.state[:, st.LOAD] == pytest.approx(rigid.state[:, st.LOAD], abs=1.0)


def test_a_link_on_its_gear_oscillates_at_the_root_of_stiffness_over_inertia():
    stiffness = 1e3
    plant = machine([*[{}] * 5, {"stiffness": stiffness}])
    plant.advance(1.0)
    plant.flaws[5, fl.LINK_Q] += 1e-4
    crossings, before = [], 1.0
    for step in range(500):
        plant.advance(plant.file.step)
        now = plant.flaws[5, fl.LINK_QD]
        crossings += [step * plant.file.step] if now * before < 0 else []
        before = now
    inertia = 0.376  # Izz6; the motor, held by friction, is 36 times as stiff
    found = math.pi / np.mean(np.diff(crossings))
    assert found == pytest.approx(math.sqrt(stiffness / inertia), rel=0.05)


def test_a_load_that_turns_round_moves_the_link_by_the_backlash():
    width, behind = 2e-4, []
    for degrees in (60, -60):
        # joint 2 level at 0: the forearm leans to one side and to the other
        plant = machine(soft(backlash=width), position=(0, 0, degrees, 0, 0, 0))
        plant.advance(4.0)
        torque = plant.state[ELBOW, st.LOAD]
        behind.append((angle_behind(plant)[ELBOW] - torque / SOFT[ELBOW], torque))
    (first, up), (second, down) = sorted(behind)
    assert up < -50 < 50 < down
    assert second - first == pytest.approx(width, rel=1e-3)


def test_within_the_backlash_a_gear_bears_nothing():
    plant = machine(soft(backlash=1e-3))
    free = []
    for _ in swing(plant, 0, 0.5):
        inside = abs(angle_behind(plant)[0]) < 4.9e-4
        free += [plant.flaws[0, fl.TWIST]] if inside else []
    assert len(free) > 10
    assert not np.any(free)


@pytest.mark.parametrize("lag", [0.0, 0.003, 0.0045])
def test_a_lagging_current_shows_the_torque_of_then(lag):
    plant = machine([{"current_lag": lag}] * 6)
    torques, readings = [], []
    for _ in swing(plant, 0, 0.2):
        torques.append(plant.state[0, st.TORQUE])
        readings.append(
            np.reshape(plant.read(), (6, -1))[0, 2] * plant.const[0, st.TORQUE_PER_MILLE]
        )
    time = np.arange(len(torques)) * plant.file.step
    late = np.interp(time[10:] - lag, time, torques)
    resolution = plant.const[0, st.TORQUE_PER_MILLE]
    assert np.ptp(torques) > 100 * resolution
    assert readings[10:] == pytest.approx(late, abs=0.51 * resolution)


def test_gears_that_steps_cannot_follow_are_refused_with_the_step_that_can():
    with pytest.raises(FileError, match=r"too fast for steps of 1 ms; state step: 0\.0005"):
        machine([{"stiffness": 2.5 * stiffness} for stiffness in SOFT])


def test_the_step_that_the_error_states_can_follow():
    plant = machine([{"stiffness": 2.5 * stiffness} for stiffness in SOFT], step=0.0005)
    for _ in swing(plant, 3, 0.5):
        pass
    speeds = []
    for _ in range(10):
        plant.advance(0.2)
        speeds.append(np.abs(plant.flaws[:, fl.LINK_QD]).max())
    assert speeds[0] > 10 * speeds[-1]


def test_a_link_without_inertia_of_its_own_cannot_hang_on_a_soft_gear():
    file = load_plant_file("manutec-r15")
    bare = file.axes[5].model_copy(update={"link": file.axes[5].link.model_copy(update={"Izz": 0})})
    drive = bare.drive.model_copy(update={"stiffness": 1e4})
    axes = (*file.axes[:5], bare.model_copy(update={"drive": drive}))
    with pytest.raises(FileError, match="need a positive definite"):
        Plant(file.model_copy(update={"axes": axes}))


def test_backlash_needs_a_soft_gear():
    with pytest.raises(ValueError, match=r"backlash 0\.001 rad needs a stiffness too"):
        machine([{"backlash": 1e-3}] * 6)
