"""Periodic trajectory of all joints, or of a branch, as data: conventional identification.

Every joint follows a finite Fourier series (Swevers et al., *Optimal robot excitation and
identification*, IEEE Trans. Robotics and Automation 13, 1997),

    q_j(t) = q0_j + sum_k sine_jk sin(k w t) + cosine_jk cos(k w t),   w = 2 pi / period,

whose velocities and accelerations follow in closed form. At the beginning of a period all axes are
at rest without acceleration, so that a recording can begin and end there without any run-up:
sum_k k sine_jk = 0 and sum_k k^2 cosine_jk = 0.

The lag of axes behind the set-points is compared with the drives' windows. At constant speed an
axis lags by the speed times a delay: the drive's interpolation from one
set-point to the next, and one over the gain of its position loop unless it feeds the velocity
forward. A drive faults if the following error exceeds its window (6065) for longer than its timeout
(6066). The corridor that the driver checks has the same width.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from checked_files.yaml_file import FileModel
from hil.planning import CYCLES_MAX
from hil.planning.plan_values import Name, Positive, Real
from hil.planning.strokes import REST

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Self

    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.model.robot import Robot


Amplitudes = tuple[tuple[Real, ...], ...]
ACCELERATION_SHARE = 0.5
"""Usable share of each axis's acceleration limit. The limit holds for one accelerating axis; on a
trajectory all axes accelerate and load each other. At a share of 0.9, drives of the manutec-r15
saturate and fault."""
ROUNDED = 0.5e-6
"""Rounding error of amplitudes in plans, a bound on non-zero sums [rad or m]."""
_WHY = {"acceleration": f", {ACCELERATION_SHARE:.0%} of its limit, to allow for coupling"}


class Trajectory(FileModel):
    """Fourier series of joints, streamed set-point by set-point; joints without amplitudes rest.

    Attributes
    ----------
    q : tuple of float
        Mean configuration [rad or m].
    period : float
        Period of the fundamental [s].
    sine, cosine : tuple of tuple of float, shape (n_joints, n_harmonics)
        Amplitudes of each joint's harmonics [rad or m].
    cycles : int
        Number of periods in succession, without a stop in between.
    """

    streamed: ClassVar[Literal[True]] = True
    """True: set-points are streamed."""

    id: Name
    kind: Literal["trajectory"] = "trajectory"
    q: tuple[Real, ...] = Field(min_length=1)
    period: Positive
    sine: Amplitudes
    cosine: Amplitudes
    cycles: int = Field(default=1, ge=1, le=CYCLES_MAX)

    @model_validator(mode="after")
    def _shapes_agree(self) -> Self:
        for key in ("sine", "cosine"):
            rows = getattr(self, key)
            lengths = {len(row) for row in (*self.sine, *self.cosine)}
            if len(rows) != len(self.q) or len(lengths) != 1 or 0 in lengths:
                raise ValueError(
                    f"{key} must have one row for each of the {len(self.q)} joints of q, and all"
                    " rows of sine and cosine the same number of harmonics, at least one"
                )
        return self

    @property
    def moved(self) -> tuple[int, ...]:
        """Joint indices of the moving axes, from 0, with amplitudes."""
        rows = enumerate(zip(self.sine, self.cosine, strict=True))
        return tuple(joint for joint, (sine, cosine) in rows if any(sine) or any(cosine))

    @property
    def read(self) -> tuple[int, ...]:
        """Joint indices of the axes whose torques are read, from 0."""
        return self.moved

    @property
    def axes_in_words(self) -> str:
        """Moving axes in words."""
        some = ", ".join(str(joint + 1) for joint in self.moved)
        return "all axes" if len(self.moved) == len(self.q) else f"axes {some}"

    @property
    def preparation(self) -> float:
        """Zero: the recording follows the travel [s]."""
        return 0.0

    @property
    def once(self) -> Self:
        """Trajectory reduced to a period."""
        return self.model_copy(update={"cycles": 1})

    @property
    def start(self) -> tuple[float, ...]:
        """Configuration at the beginning and end of a period [rad]."""
        return tuple(float(q) for q in self.motion(0.0)[0])

    @property
    def end(self) -> tuple[float, ...]:
        """Configuration after half a period [rad]."""
        return tuple(float(q) for q in self.motion(self.period / 2)[0])

    @property
    def duration(self) -> float:
        """Expected time from rest to rest [s]."""
        return 2 * REST + self.cycles * self.period

    def motion(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Compute positions, velocities and accelerations, shapes (*t.shape, n_joints).

        Parameters
        ----------
        t : array_like
            Times since the start of the first period [s].
        """
        n = len(self.sine[0])
        order = 2 * np.pi / self.period * np.arange(1, n + 1)
        phase = np.asarray(t, dtype=float)[..., np.newaxis] * order
        s, c = np.sin(phase), np.cos(phase)
        a, b = np.array(self.sine).T, np.array(self.cosine).T
        return (
            np.array(self.q) + s @ a + c @ b,
            (c * order) @ a - (s * order) @ b,
            -(s * order**2) @ a - (c * order**2) @ b,
        )

    def within(self, t: ArrayLike) -> Array:
        """Clip times since the start of the first period to the duration of the motion."""
        inside: Array = np.clip(np.asarray(t, dtype=float), 0.0, self.cycles * self.period)
        return inside

    def path(self, sample_period: float) -> Array:
        """Return set-points with the rest before and after, shape (n, n_joints) [rad]."""
        t = sample_period * np.arange(-round(REST / sample_period), self.n_samples(sample_period))
        return self.motion(self.within(t))[0]

    def n_samples(self, sample_period: float) -> int:
        """Return the number of set-points from the start of the motion to the end of the rest."""
        return round((self.cycles * self.period + REST) / sample_period) + 1


def check_trajectory(trajectory: Trajectory, robot: Robot, period: float) -> Iterator[str]:
    """Yield problems of a trajectory sampled every `period` [s].

    Yields
    ------
    str
        Joint, value, bound and remedy.
    """
    t = np.arange(0.0, trajectory.period + period, period)
    q, qd, qdd = trajectory.motion(t)
    for joint in range(robot.n_joints):
        share = ACCELERATION_SHARE
        unit = robot.position_unit(joint)
        for what, values, low, high, per in (
            ("position", q, float(robot.q_min[joint]), float(robot.q_max[joint]), unit),
            ("velocity", qd, *_about(robot.velocity_limit[joint]), f"{unit}/s"),
            ("acceleration", qdd, *_about(share * robot.acceleration_limit[joint]), f"{unit}/s^2"),
        ):
            along = values[:, joint]
            worst = float(along.min() if low - along.min() > along.max() - high else along.max())
            if not low <= worst <= high:
                yield (
                    f"{trajectory.id}: {what} of joint {joint + 1} reaches {worst:.5g} {per},"
                    f" outside {low:.5g} ... {high:.5g} {per}{_WHY.get(what, '')}; make the"
                    " amplitudes smaller or the period longer"
                )
        order = 2 * np.pi / trajectory.period * np.arange(1, len(trajectory.sine[0]) + 1)
        for what, values, limit, rounding in (
            ("velocity", qd, float(robot.velocity_limit[joint]), ROUNDED * order.sum()),
            ("acceleration", qdd, float(robot.acceleration_limit[joint]), ROUNDED * order @ order),
        ):
            # tolerance: a thousandth of the limits of velocity and acceleration
            if abs(values[0, joint]) > max(1e-3 * limit, rounding):
                yield (
                    f"{trajectory.id}: joint {joint + 1} begins with {what}"
                    f" {values[0, joint]:.3g}, must rest: choose sines with sum k sine_k = 0 and"
                    " cosines with sum k^2 cosine_k = 0"
                )


def _about(limit: float) -> tuple[float, float]:
    return -float(limit), float(limit)


MARGIN = 0.7
"""Share of the window available to the lag in a planned trajectory; torques and friction took up to
0.2 more on the manutec-r15."""
SAMPLES = 2000
"""Number of instants per period at which lags are evaluated."""


class Following(NamedTuple):
    """Following error limits and following delay of the axes.

    Attributes
    ----------
    window, time : ndarray, shape (n_joints,)
        Largest following error [rad or m], and its permitted duration [s].
    lag : ndarray, shape (n_joints,)
        Delay of the axes behind their set-points [s].
    """

    window: Array
    time: Array
    lag: Array

    @property
    def speed(self) -> Array:
        """Highest speeds within the margin [rad/s or m/s]."""
        return MARGIN * self.window / self.lag


class Lag(NamedTuple):
    """Largest lag of a trajectory relative to the window: axis from 0, lag and window."""

    trajectory: str
    axis: int
    most: float
    window: float


def find_largest_lag(trajectory: Trajectory, following: Following) -> Lag:
    """Return the axis with the largest lag relative to the window."""
    most = _lags(trajectory, following).max(axis=0)
    axis = int((most / following.window).argmax())
    return Lag(trajectory.id, axis, float(most[axis]), float(following.window[axis]))


def check_lag(trajectory: Trajectory, robot: Robot, following: Following) -> Iterator[str]:
    """Yield axes with a following error beyond the drive's window for longer than the timeout."""
    lags = _lags(trajectory, following)
    for axis, (window, time) in enumerate(zip(following.window, following.time, strict=True)):
        # the longest run of samples in the periodic sequence
        within = np.flatnonzero(~np.tile(lags[:, axis] > window, 2))
        longest = int(np.diff(within).max(initial=1)) - 1 if len(within) else SAMPLES
        lasts = longest * trajectory.period / SAMPLES
        if lasts > time:
            unit, most = robot.position_unit(axis), float(lags[:, axis].max())
            yield (
                f"{trajectory.id}: axis {axis + 1} lags {most:.3g} {unit} behind its set-points,"
                f" and for {lasts:.2g} s by more than its drive allows, {window:g} {unit} (6065)"
                f" for {time:g} s (6066); plan a slower trajectory, or state a wider"
                " following_error_window in the drives file"
            )


def _lags(trajectory: Trajectory, following: Following) -> Array:
    t = np.linspace(0.0, trajectory.period, SAMPLES, endpoint=False)
    return np.abs(trajectory.motion(t)[1]) * following.lag
