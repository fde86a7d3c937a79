"""Arrays of the physics and settings of the drives, built from a plant file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sim_plant.drive_settings import DriveSettings
from sim_plant.physics import friction, soft_gears
from sim_plant.physics import state as st
from sim_plant.physics.loop_stability import Loops

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sim_plant.physics.reflected_inertia import Arm
    from sim_plant.plant_file import PlantAxis, PlantFile

    Array = NDArray[np.float64]

VENDOR_ID, PRODUCT_CODE, REVISION = 0x4D2, 0x402, 0x10000
"""Identity reported by the plant's drives, and by no real device."""
BRAKE_OVER_PEAK = 1.2
GEAR_DAMPING = 0.05
"""Damping of a soft gear, as a share of critical damping."""


def arm(file: PlantFile) -> Arm:
    """Return joints, frames, bodies, gravity and joint kinds for the compiled dynamics."""
    angle = np.radians([axis.frame.alpha_deg for axis in file.axes])
    d, r = np.array([(axis.frame.d, axis.frame.r) for axis in file.axes]).T
    cos, sin = np.cos(angle), np.sin(angle)
    frames = np.column_stack([cos, sin, d, -sin * r, cos * r])
    bodies = np.array([body.row() for body in file.bodies()])
    return tuple(range(len(bodies))), frames, bodies, np.array(file.gravity), _kinds(file)


def _kinds(file: PlantFile) -> Array | None:
    kinds = np.array(
        [(axis.joint == "prismatic", np.radians(axis.frame.theta_deg)) for axis in file.axes],
        dtype=float,
    )
    return kinds if kinds.any() else None


def reach(file: PlantFile) -> Array:
    """Return the range of travel of all axes, shape (n, 2) [rad or m]."""
    return np.array([axis.drive.reach for axis in file.axes])


def loops(file: PlantFile) -> Loops:
    """Return the gains and inertias of all axes for the stability analysis."""
    drives, stated = [axis.drive for axis in file.axes], file.loops
    return Loops(
        np.array([drive.motor_inertia for drive in drives]),
        np.array([drive.load_inertia for drive in drives]),
        stated.position,
        stated.velocity,
        stated.integral,
        file.step,
    )


def constants(axis: PlantAxis, file: PlantFile) -> Array:
    """Return the constants of one axis (see `sim_plant.physics.state`)."""
    drive, f = axis.drive, axis.friction
    c = np.zeros(st.N_CONST)
    motor_inertia = drive.rotor_inertia * drive.gear_ratio**2
    inertia = motor_inertia + drive.load_inertia
    c[st.MOTOR_INERTIA], c[st.GEAR], c[st.VELOCITY_MAX] = (
        motor_inertia, drive.gear_ratio, drive.velocity_max,
    )  # fmt: skip
    c[st.KP], c[st.KV] = file.loops.position, inertia * file.loops.velocity
    c[st.KI] = c[st.KV] * file.loops.integral
    c[st.F_COULOMB] = 0.8 * f.creep
    c[st.F_DEGRESSIVE] = 0.45 * (f.full_speed - c[st.F_COULOMB])
    c[st.F_VISCOUS] = 0.55 * (f.full_speed - c[st.F_COULOMB]) / drive.velocity_max
    c[st.F_LOAD], c[st.ASYMMETRY] = f.load, 0.0 if file.symmetric else f.asymmetry
    c[st.PER_BRISTLE] = 1.0 / f.presliding
    c[st.PER_VELOCITY_MAX] = 1.0 / drive.velocity_max
    c[st.BRISTLE_DAMPING] = math.sqrt(f.creep / f.presliding * motor_inertia)
    c[st.BRAKE] = BRAKE_OVER_PEAK * drive.peak_torque
    c[st.HEAT_TIME], c[st.DRIFT] = f.heat_time, float(file.drift)
    c[st.DRIFT_STRENGTH] = file.drift_strength
    c[st.HEAT_PER_POWER] = _heat_per_power(c)
    *phases, other = _ripple_phases(drive.node, drive.axis)
    for k, phase in enumerate(phases):
        amplitude = file.noise.ripple * drive.peak_torque
        c[st.RIPPLE_SIN[k]], c[st.RIPPLE_COS[k]] = (
            amplitude * math.cos(phase), amplitude * math.sin(phase),
        )  # fmt: skip
    if file.noise.other_ripple:
        amplitude = file.noise.other_ripple.amplitude * drive.peak_torque
        c[st.OTHER_ORDER], c[st.OTHER_SIN], c[st.OTHER_COS] = (
            file.noise.other_ripple.order, amplitude * math.cos(other), amplitude * math.sin(other),
        )  # fmt: skip
    c[st.COUNTS_PER_RAD] = drive.direction * drive.gear_ratio * drive.increments / math.tau
    c[st.ZERO] = drive.zero
    motor = drive.direction * drive.gear_ratio
    c[st.TORQUE_PER_MILLE] = motor * drive.rated_torque_mNm * 1e-6
    c[st.CURRENT_PER_MILLE] = motor * drive.torque_constant * drive.rated_current_mA * 1e-6
    c[st.NOISE] = file.noise.torque * drive.peak_torque
    return c


def flaws(file: PlantFile) -> Array | None:
    """Return soft gears and lags of the current sensors; None without either."""
    drives = [axis.drive for axis in file.axes]
    if not any(drive.stiffness or drive.current_lag for drive in drives):
        return None
    longest = math.ceil(max(drive.current_lag for drive in drives) / file.step)
    found = np.zeros((len(drives), soft_gears.HISTORY + longest + 2))
    for row, drive, axis in zip(found, drives, file.axes, strict=True):
        row[soft_gears.LAG], row[soft_gears.HALF_GAP] = (
            drive.current_lag / file.step,
            drive.backlash / 2,
        )
        row[soft_gears.LINK_Q] = axis.start
        if drive.stiffness is not None:
            inertia = 1 / (1 / drive.motor_inertia + 1 / drive.load_inertia)
            row[soft_gears.STIFFNESS] = drive.stiffness
            row[soft_gears.DAMPING] = 2 * GEAR_DAMPING * math.sqrt(drive.stiffness * inertia)
    return found


def _heat_per_power(const: Array) -> float:
    """Return the temperature rise per friction power; half the maximum speed leads to 25 K."""
    state = np.zeros((1, st.N_STATE))
    state[0, st.TEMPERATURE] = friction.STEADY_TEMPERATURE
    friction.refresh(const[np.newaxis], state, 0)
    speed = float(const[st.VELOCITY_MAX]) / 2
    power = friction.level(const[np.newaxis], state, 0, speed) * speed
    return friction.STEADY_TEMPERATURE / power if power > 0 else 0.0


def _ripple_phases(node: int, axis: int) -> Array:
    """Return phases of the torque ripple's orders: fixed for a motor, independent of the seed."""
    seed = node if axis == 1 else [node, axis]
    phases: Array = np.random.default_rng(seed).uniform(0.0, math.tau, 4)
    return phases


def settings(index: int, axis: PlantAxis) -> DriveSettings:
    """Return the settings of the drive of an axis: identity, ratings, limits."""
    drive = axis.drive
    per_rad = drive.gear_ratio * drive.increments / math.tau
    limits = sorted(round(drive.direction * end * per_rad) + drive.zero for end in drive.reach)
    gear = drive.gear_ratio.as_integer_ratio()
    return DriveSettings(
        name=axis.name,
        node_id=drive.node,
        vendor_id=VENDOR_ID,
        product_code=PRODUCT_CODE,
        revision=REVISION,
        serial=index + 1,
        rated_current=drive.rated_current_mA,
        rated_torque=drive.rated_torque_mNm,
        max_torque=round(1e6 * drive.peak_torque / drive.gear_ratio / drive.rated_torque_mNm),
        increments_per_revolution=drive.increments,
        gear=gear if max(gear) < 2**31 else (round(1000 * drive.gear_ratio), 1000),
        software_limits=(limits[0], limits[1]),
        max_motor_speed=math.ceil(drive.velocity_max * drive.gear_ratio * 60 / math.tau),
        max_acceleration=math.ceil(drive.acceleration_max * per_rad),
        axis=drive.axis,
    )
