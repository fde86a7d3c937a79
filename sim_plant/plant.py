"""Machine of the drives: arm, friction and servos, assembled and advanced in time.

`Plant` implements the drives' interface to the machine (`sim_plant.machine_protocol.Machine`). All
state is in a few arrays for the compiled step (`sim_plant.build` makes them from a plant file);
`ServoAxis` is the view of a single axis. Randomness comes from one seeded generator, so that equal
seeds and equal frames give equal bytes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError, line_of, place, read_text
from sim_plant import build
from sim_plant.machine_protocol import AxisEvent, Reading
from sim_plant.physics import friction, machine_step, servo, soft_gears
from sim_plant.physics import state as st
from sim_plant.physics.gear_modes import refuse_steps_too_long
from sim_plant.physics.giving_load import GivingLoad
from sim_plant.physics.loop_stability import Unstable, refuse_hard_brakes, refuse_unstable
from sim_plant.physics.reflected_inertia import NotPositive, reflected_inertia
from sim_plant.plant_file import PlantFile, load_plant_file, plant_path
from sim_plant.servo_axis import ServoAxis

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STOCK = 4096
"""Rows of random numbers drawn at a time."""
PERIOD = STOCK * machine_step.SLOW_STEPS
"""Number of steps until the random numbers are drawn anew."""
_run = machine_step.run_and_latch


WHOLE = 1e-3
"""Tolerance for whole numbers of steps, as a share of a step: rounding errors."""


def load_plant(name_or_path: str, seed: int | None = None) -> Plant:
    """Build a packaged plant by name, or the plant of a plant file.

    Parameters
    ----------
    name_or_path : str
    seed : int, optional
        Seed instead of the file's.

    Raises
    ------
    FileError
        No such plant, or a file that does not fit.
    """
    file = load_plant_file(name_or_path)
    try:
        return Plant(file, seed)
    except Unstable as error:
        path = plant_path(name_or_path)
        line = line_of(read_text(path), error.place)
        raise FileError(f"{path}:{line}: {place(error.place)}: {error}") from error


class Plant:
    """Axes of an arm with physics; implements `sim_plant.machine_protocol.Machine`.

    Attributes
    ----------
    file : PlantFile
        Plant file.
    axes : tuple of ServoAxis
    drives : tuple of DriveSettings
        Settings of the drives.
    const, state, profile : ndarray, shape (n, ...)
        See `sim_plant.physics.state`.
    flaws : ndarray, shape (n, ...), or None
        See `sim_plant.physics.soft_gears`.
    events : list of int
        `AxisEvent` bits of each axis, as last reported.
    handle_event : callable
        Called with axis index and `AxisEvent` bits when these change.

    Raises
    ------
    Unstable
        Gains with which the drives do not hold the arm.
    FileError
        Links that are no bodies, or gears that steps cannot follow.
    """

    def __init__(self, file: PlantFile, seed: int | None = None) -> None:
        self.file = file
        n = len(file.axes)
        self._random = np.random.default_rng(file.seed if seed is None else seed)
        self._arm = build.arm(file)
        loose = file.payload is not None and file.payload.gives > 0
        self._giving = GivingLoad(self._arm, file.payload) if file.payload and loose else None
        self.const = np.array([build.constants(axis, file) for axis in file.axes])
        self.state = np.zeros((n, st.N_STATE))
        self.profile = np.zeros((n, st.N_PROFILE))
        self._refuse_unstable()
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
        whole = np.int64
        self._single = (
            np.empty(0, whole), np.empty((3, n), whole), np.empty((0, *self._image.shape), whole),
            *self._memory,
        )  # fmt: skip
        self._step, self._rest = file.step, 0.0
        self.events = [int(AxisEvent.DONE | AxisEvent.STANDSTILL)] * n
        for i, axis in enumerate(file.axes):
            s = self.state[i]
            s[st.Q] = axis.start
            s[st.TEMPERATURE] = axis.friction.temperature
            s[st.LUBRICANT] = axis.friction.lubricant
            s[st.TORQUE_LIMIT] = axis.drive.peak_torque
            s[st.WINDOW] = math.inf
            s[st.EVENTS] = self.events[i]
            friction.refresh(self.const, self.state, i)
        self.axes = tuple(self._axis(i) for i in range(n))
        for servo_axis in self.axes:
            servo_axis.hold()
        self.drives = tuple(build.settings(i, axis) for i, axis in enumerate(file.axes))
        self.handle_event: Callable[[int, int], None] = lambda _axis, _events: None
        self._compile()

    def _axis(self, index: int) -> ServoAxis:
        arrays = self.const, self.state, self.profile
        return ServoAxis(index, *arrays, self.events, lambda: self.time)

    def _refuse_unstable(self) -> None:
        motors, step = self.const[:, st.MOTOR_INERTIA], self.file.step
        try:
            inertia = reflected_inertia(self._arm, motors, build.reach(self.file))
        except NotPositive as error:
            raise FileError(f"{self.file.name}: {error}") from error
        refuse_unstable(build.loops(self.file), inertia)
        refuse_hard_brakes(self.const, inertia, step)

    def _soft_gears(self) -> Array | None:
        """Return soft gears and current lags of the plant file, checked; None without either."""
        found = build.flaws(self.file)
        if found is not None and found[:, soft_gears.STIFFNESS].any():
            try:
                refuse_steps_too_long(
                    self._arm, self.const, found, build.reach(self.file), self.file.step
                )
            except ValueError as error:
                raise FileError(f"{self.file.name}: {error}") from error
        return found

    def _compile(self) -> None:
        """Compile before the first SYNC, since a master does not wait for the compiler."""
        _run(0, 0, self._step, 0, *self._single)
        servo.latch(self.const, self.state, self.profile, self._noise[0], self._image, self.flaws)

    @property
    def time(self) -> float:
        """Time of the machine [s]."""
        return self._number * self.file.step

    def advance(self, duration: float) -> None:
        """Run the physics for `duration` [s]; a fraction of a step is kept for the next call."""
        if self._giving is not None:
            self._giving.settle(self.state[:, st.Q], duration)
        h = self._step
        rest = self._rest + duration
        steps = int(rest / h + WHOLE)
        self._rest = rest - steps * h
        self._latched = False
        while steps > 0:
            left = PERIOD - 1 - self._number % PERIOD
            if left == 0:
                self._random.standard_normal(out=self._normal)
                left = PERIOD
            some = steps if steps < left else left
            done = _run(some, self._number, h, self._noise_row, *self._single)
            self._latched = done == some
            self._number += abs(done)
            steps -= abs(done)
            if done < 0:
                self._report_events()

    def advance_quietly(
        self, durations: Sequence[float], watch: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Advance and latch several times, as long as no axis has news.

        See `sim_plant.machine_protocol.Machine`. The time in which random numbers run out is left
        to `advance`.
        """
        h, rests, steps = self._step, [self._rest], []
        left = PERIOD - 1 - self._number % PERIOD
        # only `advance` settles a load that yields
        drawn = 0 if self._giving else STOCK - 1 - self._noise_row
        for duration in durations[:drawn]:
            rest = rests[-1] + duration
            some = int(rest / h + WHOLE)
            left -= some
            rest -= some * h
            if left < 0 or rest > WHOLE * h:
                break
            steps.append(some)
            rests.append(rest)
        readings = np.empty((len(steps), *self._image.shape), dtype=np.int64)
        counts = np.array(steps, dtype=np.int64)
        if not steps:
            return readings.reshape(0, self._readings.size)
        done = _run(0, self._number, h, self._noise_row, counts, watch, readings, *self._memory)
        self._number += sum(steps[:done])
        self._noise_row += done
        self._rest = rests[done]
        self._latched = False
        return readings[:done].reshape(done, self._readings.size)

    def _report_events(self) -> None:
        events = self.state[:, st.EVENTS].astype(int).tolist()
        before, self.events[:] = tuple(self.events), events
        for i, (old, new) in enumerate(zip(before, events, strict=True)):
            if new != old:
                self.handle_event(i, new)

    def read(self) -> NDArray[np.int64]:
        """Latch encoders and current sensors of all axes at the present instant."""
        # on the wall clock a SYNC comes between two steps: the axes have moved since the last step
        ahead = self._rest if self._rest > WHOLE * self._step else 0.0
        if ahead or not self._latched:
            noise, at_step = self._noise[self._noise_row], self.state[:, st.Q].copy()
            self.state[:, st.Q] += ahead * self.state[:, st.QD]
            servo.latch(self.const, self.state, self.profile, noise, self._image, self.flaws)
            self.state[:, st.Q] = at_step
        self._latched = False
        self._noise_row += 1
        if self._noise_row == STOCK:
            self._random.standard_normal(out=self._noise)
            self._noise_row = 0
        return self._readings
