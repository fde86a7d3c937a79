"""Draft of plant file and drives file for the virtual twin of a robot.

Values missing in the robot file are defaults, scaled from its limits: friction, noise and ripple as
shares of the torque limit, encoders by the speed limit, ratings by the torque limit, and the
velocity loops by the inertias at the motors. So the loops are stable by construction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim_plant.physics.loop_stability import Loops, best_loads, is_stable
from sim_plant.physics.reflected_inertia import reflected_inertia
from sim_plant.plant_file import (
    Body,
    Drive,
    Frame,
    Friction,
    Noise,
    PlantAxis,
    PlantFile,
)
from sim_plant.plant_file import Loops as LoopsOfFile
from sim_plant.twin.links import NoLinks, arm_of, draft_bodies, motors_of, reach_of
from sim_plant.twin.robot import LINK_PARAMETERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sim_plant.physics.reflected_inertia import ReflectedInertia
    from sim_plant.twin.robot import RobotDescription, RobotJoint

    Array = NDArray[np.float64]

STEP = 0.001
SYNC_PERIOD = 0.004
PEAK_OVER_RATED = 3.0
CREEP, FULL_SPEED = 0.05, 0.09
"""Friction of a gear at creep speed and at full speed, as shares of the torque limit."""
DIRECT = 0.2
"""Remaining share of the friction without a gear."""
GEARED = 8.0
"""Minimum gear ratio for the friction of a gear, and for a ripple distinct from gravity."""
ASYMMETRIES = (0.004, -0.006, 0.005)
HEAT_TIMES = (2100.0, 1800.0, 1500.0)
PRESLIDING = 5e-5
"""Presliding distance, as a share of the range of travel."""
COUNTS = 400
"""Minimum of encoder increments in a SYNC period at the speed limit."""
_DIGITS = 4


@dataclass(frozen=True, slots=True)
class Twin:
    """Drafted plant.

    Attributes
    ----------
    file : PlantFile
    inertia : ReflectedInertia
        Inertias at the motors.
    """

    file: PlantFile
    inertia: ReflectedInertia


def draft_twin(robot: RobotDescription) -> Twin:
    """Draft links, friction, drives and loops of a robot.

    Raises
    ------
    NoLinks
        The parameters that the robot file calls present belong to no machine.
    """
    bodies = np.array([[_rounded(x, 5) for x in body] for body in draft_bodies(robot)])
    motors, reach = motors_of(robot), reach_of(robot)
    inertia = reflected_inertia(arm_of(robot, bodies), motors, reach)
    loads = np.array([_rounded(x) for x in best_loads(inertia, motors)])
    loops = _loops(motors, loads, inertia)
    axes = [
        _axis(robot, number, bodies[number], float(loads[number]), float(inertia.least[number]))
        for number in range(len(robot.joints))
    ]
    geared = all(j.type == "prismatic" or j.drive.gear_ratio >= GEARED for j in robot.joints)
    noise = Noise() if geared else Noise(ripple=0.0)
    file = PlantFile(
        name=f"{robot.name}-twin", gravity=robot.gravity, loops=loops, noise=noise, axes=tuple(axes)
    )
    return Twin(file, inertia)


def _loops(motors: Array, loads: Array, inertia: ReflectedInertia) -> LoopsOfFile:
    """Return the usual bandwidths, reduced until the loops are stable."""
    usual = LoopsOfFile()
    for share in (1.0, 0.5, 0.25, 0.125):
        slower = LoopsOfFile(
            position=share * usual.position,
            velocity=share * usual.velocity,
            integral=share * usual.integral,
        )
        gains = slower.position, slower.velocity, slower.integral
        if is_stable(Loops(motors, loads, *gains, STEP), inertia):
            return slower
    raise NoLinks(
        "inertias at the motors vary too much over the workspace for control loops of fixed "
        "gains; state a rotor_inertia and a gear_ratio for each joint"
    )


def _axis(
    robot: RobotDescription, number: int, body: Array, load: float, least: float
) -> PlantAxis:
    joint = robot.joints[number]
    alpha, d, theta, r = robot.frames()[number]
    return PlantAxis(
        name=f"joint {number + 1}",
        joint=joint.type,
        frame=Frame(alpha_deg=math.degrees(alpha), d=d, theta_deg=math.degrees(theta), r=r),
        link=Body(**dict(zip(LINK_PARAMETERS, body.tolist(), strict=True))),
        drive=_drive(joint, number + 1, load),
        friction=_friction(joint, number, least),
        position=_start(joint),
    )


def _drive(joint: RobotJoint, node: int, load: float) -> Drive:
    drive = joint.drive
    per_ampere = drive.gear_ratio * drive.torque_constant
    milliampere = max(round(1e3 * joint.torque_limit / PEAK_OVER_RATED / per_ampere), 1)
    return Drive(
        node=node,
        gear_ratio=drive.gear_ratio,
        rotor_inertia=joint.rotor_inertia,
        torque_constant=drive.torque_constant,
        rated_torque_mNm=max(round(drive.torque_constant * milliampere), 1),
        rated_current_mA=milliampere,
        peak_torque=joint.torque_limit,
        increments=_increments(joint),
        velocity_max=joint.velocity_limit,
        acceleration_max=joint.acceleration_limit,
        range=(joint.q_min, joint.q_max),
        load_inertia=load,
    )


def _increments(joint: RobotJoint) -> int:
    """Return the encoder increments per motor revolution: 4096, doubled as speeds require."""
    increments = 4096
    turns = joint.velocity_limit * joint.drive.gear_ratio / math.tau * SYNC_PERIOD
    while increments * turns < COUNTS and increments < 1 << 20:
        increments *= 2
    return increments


def _friction(joint: RobotJoint, number: int, least: float) -> Friction:
    geared = joint.type == "prismatic" or joint.drive.gear_ratio >= GEARED
    scale = joint.torque_limit * (1.0 if geared else DIRECT)
    creep = _rounded(CREEP * scale)
    return Friction(
        creep=creep,
        full_speed=_rounded(FULL_SPEED * scale),
        heat_time=HEAT_TIMES[number % len(HEAT_TIMES)],
        asymmetry=ASYMMETRIES[number % len(ASYMMETRIES)],
        presliding=_presliding(joint, creep, least),
    )


def _presliding(joint: RobotJoint, creep: float, least: float) -> float:
    """Return a share of the range, or the distance needed to integrate a closed brake."""
    motor = joint.motor_inertia
    closed = creep + 1.2 * joint.torque_limit
    way = PRESLIDING * (joint.q_max - joint.q_min)
    while (closed / way * STEP**2 / 4 + math.sqrt(creep / way * motor) * STEP) / least > 0.5:
        way *= 1.25
    return _rounded(way, 2)


def _start(joint: RobotJoint) -> float:
    span = joint.q_max - joint.q_min
    inside = joint.q_min + 0.05 * span < 0 < joint.q_max - 0.05 * span
    return 0.0 if inside else _rounded((joint.q_min + joint.q_max) / 2)


def _rounded(value: float, digits: int = _DIGITS) -> float:
    return float(f"{value:.{digits}g}")
