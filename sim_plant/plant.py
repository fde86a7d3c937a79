"""The machine behind the drives: arm, friction and servos, put together and advanced in time.

`Plant` is what the drives' firmware sees (`sim_plant.machine_protocol.Machine`). All state stands
in a few arrays that the compiled step works on; `Servo` is the view of one axis of them, and turns
the firmware's units (increments of the motor shaft, per mille of rated torque) into joint angle and
torque. Randomness comes from one seeded generator, so that the same seed and the same frames give
the same bytes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError
from sim_plant.drive_settings import DriveSettings
from sim_plant.machine_protocol import AxisEvent, Reading
from sim_plant.physics import friction, machine_step, profile_generator, servo, soft_gears
from sim_plant.physics import state as st
from sim_plant.physics.gear_modes import refuse_steps_too_long
from sim_plant.plant_file import PlantFile, load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from sim_plant.plant_file import Axis as AxisFile

    Array = NDArray[np.float64]

VENDOR_ID, PRODUCT_CODE, REVISION = 0x4D2, 0x402, 0x10000
"""Identity that the plant's drives report; they exist nowhere else."""
STOCK = 4096
"""Rows of random numbers drawn at a time."""
PERIOD = STOCK * machine_step.SLOW_STEPS
"""Steps that a stock of random numbers lasts."""
BRAKE_OVER_PEAK = 1.2
GEAR_DAMPING = 0.05
"""Of a soft gear, share of critical damping."""
_run = machine_step.run_and_latch


def load_plant(name_or_path: str, seed: int | None = None) -> Plant:
    """Build a packaged plant by name or the one of a plant file.

    Parameters
    ----------
    name_or_path : str
    seed : int, optional
        Instead of the file's.

    Raises
    ------
    FileError
        No such plant, or a file that does not fit.
    """
    return Plant(load_plant_file(name_or_path), seed)


class Servo:
    """One axis as its firmware sees it; see `sim_plant.machine_protocol.Axis`."""

    def __init__(self, plant: Plant, index: int) -> None:
        self._plant, self._index = plant, index
        self._const, self._state = plant.const[index], plant.state[index]
        self._profile = plant.profile[index]
        self._scale, self._zero = self._const[st.COUNTS_PER_RAD], self._const[st.ZERO]

    def enable(self) -> None:
        """Energise, release the brake and hold the present position."""
        self._state[st.INTEGRAL] = self._state[st.OUTSIDE] = 0.0
        self.hold()
        self._state[st.ENABLED] = 1.0

    def disable(self) -> None:
        """Remove the torque and close the brake."""
        self._state[st.ENABLED] = 0.0
        self.hold()

    def move(
        self, target: float, velocity: float, acceleration: float, deceleration: float
    ) -> None:
        """Start a trapezoid from the present demand to `target` [inc, inc/s, inc/s^2]."""
        scale = abs(self._scale)
        goal = (target - self._zero) / self._scale
        segments = profile_generator.trapezoid(
            self._profile[st.DEMAND],
            self._profile[st.DEMAND_V],
            goal,
            velocity / scale,
            acceleration / scale,
            deceleration / scale,
        )
        profile_generator.load(self._profile, self._plant.time, segments, goal)
        self._moving()

    def follow(self, target: float, period: float) -> None:
        """Lead the demand towards `target` [inc] over `period` [s]."""
        goal = (target - self._zero) / self._scale
        profile_generator.follow(self._profile, self._plant.time, goal, period)
        self._moving()

    def stop(self, deceleration: float) -> None:
        """Bring the demand to rest [inc/s^2] and hold."""
        v = float(self._profile[st.DEMAND_V])
        rate = deceleration / abs(self._scale)
        segments = [(abs(v) / rate, math.copysign(rate, -v))]
        profile_generator.load(self._profile, self._plant.time, segments, None)
        self._moving()

    def hold(self) -> None:
        """Freeze the demand at the present measured position."""
        self._profile[st.DEMAND], self._profile[st.DEMAND_V] = self._state[st.Q], 0.0
        profile_generator.load(self._profile, self._plant.time, [], None)

    def set_torque_limit(self, per_mille: int) -> None:
        """Limit the torque command to this much of rated torque."""
        self._state[st.TORQUE_LIMIT] = per_mille * abs(self._const[st.TORQUE_PER_MILLE])

    def set_following_window(self, window: float, timeout: float) -> None:
        """Set the following error window [inc, inf = off] and the time that it may last [s]."""
        self._state[st.WINDOW] = window / abs(self._scale)
        self._state[st.WINDOW_TIME] = timeout

    def rebase(self, shift: int) -> None:
        """Show positions that are by `shift` [increments] greater from now on."""
        self._const[st.ZERO] += shift
        self._zero = self._const[st.ZERO]

    def recount(self, factor: float) -> None:
        """Count positions in another unit, so many for one now."""
        self._const[st.COUNTS_PER_RAD] *= factor
        self._const[st.ZERO] = round(self._const[st.ZERO] * factor)
        self._scale, self._zero = self._const[st.COUNTS_PER_RAD], self._const[st.ZERO]

    def _moving(self) -> None:
        self._plant.events[self._index] &= ~int(AxisEvent.DONE)
        self._state[st.EVENTS] = self._plant.events[self._index]


class Plant:
    """All axes and the arm that they share; implements `sim_plant.machine_protocol.Machine`.

    Attributes
    ----------
    file : PlantFile
        What it was built from.
    axes : tuple of Servo
    drives : tuple of DriveSettings
        What each axis's drive reports about itself.
    const, state, profile : ndarray, shape (n, ...)
        See `sim_plant.physics.state`.
    flaws : ndarray, shape (n, ...), or None
        See `sim_plant.physics.soft_gears`.
    events : list of int
        `AxisEvent` bits of each axis, as last reported.
    on_event : callable
        Called with axis index and `AxisEvent` bits when these change.
    """

    def __init__(self, file: PlantFile, seed: int | None = None) -> None:
        self.file = file
        n = len(file.axes)
        self._random = np.random.default_rng(file.seed if seed is None else seed)
        self._arm = _arm(file)
        self.const = np.array([_constants(axis, file) for axis in file.axes])
        self.state = np.zeros((n, st.N_STATE))
        self.profile = np.zeros((n, st.N_PROFILE))
        self.flaws = self._soft_gears()
        self._number = 0
        self._normal = self._random.standard_normal((STOCK, n))
        self._noise = self._random.standard_normal((STOCK, n))
        self._noise_row = 0
        self._image = np.zeros((n, len(Reading._fields)), dtype=np.int64)
        self._readings = self._image.reshape(-1)
        self._latched = False
        self._memory = (
            *self._arm, self.const, self.state, self.profile,
            self._normal, self._noise, self._image, self.flaws,
        )  # fmt: skip
        self._step, self._rest = file.step, 0.0
        self.events = [int(AxisEvent.DONE | AxisEvent.STANDSTILL)] * n
        for i, axis in enumerate(file.axes):
            s = self.state[i]
            s[st.Q] = math.radians(axis.position_deg)
            s[st.TEMPERATURE] = axis.friction.temperature
            s[st.LUBRICANT] = axis.friction.lubricant
            s[st.TORQUE_LIMIT] = axis.drive.peak_torque
            s[st.WINDOW] = math.inf
            s[st.EVENTS] = self.events[i]
            friction.refresh(self.const, self.state, i)
        self.axes: Sequence[Servo] = tuple(Servo(self, i) for i in range(n))
        for axis_servo in self.axes:
            axis_servo.hold()
        self.drives = tuple(_settings(i, axis) for i, axis in enumerate(file.axes))
        self.on_event: Callable[[int, int], None] = lambda _axis, _events: None
        self._compile()

    def _soft_gears(self) -> Array | None:
        """What the plant file says of soft gears and lagging currents."""
        found = _flaws(self.file)
        if found is not None and found[:, soft_gears.STIFFNESS].any():
            reach = np.radians([axis.drive.range_deg for axis in self.file.axes])
            try:
                refuse_steps_too_long(self._arm, self.const, found, reach, self.file.step)
            except ValueError as error:
                raise FileError(f"{self.file.name}: {error}") from error
        return found

    def _compile(self) -> None:
        """Compile before the first SYNC, whose answer a master waits for only so long."""
        _run(0, 0, self._step, 0, *self._memory)
        servo.latch(self.const, self.state, self.profile, self._noise[0], self._image, self.flaws)

    @property
    def time(self) -> float:
        """Time of the machine [s]."""
        return self._number * self.file.step

    def advance(self, duration: float) -> None:
        """Let the physics run for `duration` [s]; what is no whole step is kept for next time."""
        h = self._step
        rest = self._rest + duration
        steps = int(rest / h + 1e-3)
        self._rest = rest - steps * h
        self._latched = False
        while steps > 0:
            left = PERIOD - 1 - self._number % PERIOD
            if left == 0:
                self._random.standard_normal(out=self._normal)
                left = PERIOD
            some = steps if steps < left else left
            done = _run(some, self._number, h, self._noise_row, *self._memory)
            self._latched = done == some
            self._number += abs(done)
            steps -= abs(done)
            if done < 0:
                self._report_events()

    def _report_events(self) -> None:
        events = self.state[:, st.EVENTS].astype(int).tolist()
        before, self.events = self.events, events
        for i, (old, new) in enumerate(zip(before, events, strict=True)):
            if new != old:
                self.on_event(i, new)

    def read(self) -> NDArray[np.int64]:
        """Latch encoders and current sensors of all axes at the present instant."""
        if not self._latched:
            noise = self._noise[self._noise_row]
            servo.latch(self.const, self.state, self.profile, noise, self._image, self.flaws)
        self._latched = False
        self._noise_row += 1
        if self._noise_row == STOCK:
            self._random.standard_normal(out=self._noise)
            self._noise_row = 0
        return self._readings


def _arm(file: PlantFile) -> tuple[tuple[int, ...], Array, Array, Array]:
    angle = np.radians([axis.frame.alpha_deg for axis in file.axes])
    d, r = np.array([(axis.frame.d, axis.frame.r) for axis in file.axes]).T
    cos, sin = np.cos(angle), np.sin(angle)
    frames = np.column_stack([cos, sin, d, -sin * r, cos * r])
    order = ("m", "sx", "sy", "sz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
    bodies = np.array([[getattr(body, key) for key in order] for body in file.bodies()])
    return tuple(range(len(bodies))), frames, bodies, np.array(file.gravity)


def _constants(axis: AxisFile, file: PlantFile) -> Array:
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
    for k, phase in enumerate(_ripple_phases(drive.node)):
        amplitude = file.noise.ripple * drive.peak_torque
        c[st.RIPPLE_SIN[k]], c[st.RIPPLE_COS[k]] = (
            amplitude * math.cos(phase), amplitude * math.sin(phase),
        )  # fmt: skip
    c[st.COUNTS_PER_RAD] = drive.direction * drive.gear_ratio * drive.increments / math.tau
    c[st.ZERO] = drive.zero
    motor = drive.direction * drive.gear_ratio
    c[st.TORQUE_PER_MILLE] = motor * drive.rated_torque_mNm * 1e-6
    c[st.CURRENT_PER_MILLE] = motor * drive.torque_constant * drive.rated_current_mA * 1e-6
    c[st.NOISE] = file.noise.torque * drive.peak_torque
    return c


def _flaws(file: PlantFile) -> Array | None:
    """What the plant file says of soft gears and lagging currents; None where there are none."""
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
        row[soft_gears.LINK_Q] = math.radians(axis.position_deg)
        if drive.stiffness is not None:
            inertia = 1 / (1 / drive.motor_inertia + 1 / drive.load_inertia)
            row[soft_gears.STIFFNESS] = drive.stiffness
            row[soft_gears.DAMPING] = 2 * GEAR_DAMPING * math.sqrt(drive.stiffness * inertia)
    return found


def _heat_per_power(const: Array) -> float:
    """Temperature rise per friction power, so that half speed leads to 25 K."""
    state = np.zeros((1, st.N_STATE))
    state[0, st.TEMPERATURE] = friction.STEADY_TEMPERATURE
    friction.refresh(const[np.newaxis], state, 0)
    speed = float(const[st.VELOCITY_MAX]) / 2
    power = friction.level(const[np.newaxis], state, 0, speed) * speed
    return friction.STEADY_TEMPERATURE / power if power > 0 else 0.0


def _ripple_phases(node: int) -> Array:
    """Fixed phases of the three ripple orders: a property of the motor, not of the seed."""
    phases: Array = np.random.default_rng(node).uniform(0.0, math.tau, 3)
    return phases


def _settings(index: int, axis: AxisFile) -> DriveSettings:
    drive = axis.drive
    per_rad = drive.gear_ratio * drive.increments / math.tau
    limits = sorted(
        round(drive.direction * side * math.radians(drive.range_deg) * per_rad) + drive.zero
        for side in (-1, 1)
    )
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
    )
