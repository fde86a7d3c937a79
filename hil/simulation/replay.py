"""Replay of a recorded motion: simulation of a model's arm with the recorded drive.

Drives repeat their recorded torques, or hold the recorded positions with a stated PD controller. A
stretch of a recording begins with `INITIAL` samples; a parabola fitted to these samples gives the
initial state of the simulation, in their middle; the samples after them are scored. The EMPS
benchmark is scored in this way, by the root mean square position error of the whole record,
simulated from the command and the first 20 positions. Errors of a free simulation add up, and an
upright arm falls. So a recording may be simulated in several stretches, each of which starts from a
recorded state.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

import numpy as np

from hil.errors import InvalidValue, NotEnoughData
from hil.results.model import loaded
from hil.results.provenance import named
from hil.results.recorded_torque import convert_torques
from hil.runs.run import opened
from hil.runs.set_points import set_points
from hil.show.outcome import Verdict
from hil.show.rounding import significant
from hil.show.table import figures, table
from hil.simulation.arm import Arm, Drive, Indefinite, Start

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.model import Model
    from hil.runs.recording import Recorded, Recording
    from hil.runs.run import Run
    from hil.show.table import Table
    from hil.simulation.arm import Friction

INITIAL = 20
"""Number of samples for the initial state of a stretch, as specified by nonlinearbenchmark.org for
EMPS.
"""
LOST = {True: 2 * np.pi, False: 1.0}
"""Error at which a stretch ends, for revolute and prismatic joints [rad], [m]: the motion is then
unrelated to the recorded one.
"""
UNITS = {"rad": (True, 1.0), "deg": (True, np.pi / 180), "m": (False, 1.0), "mm": (False, 1e-3)}
"""Units of a limit: True for revolute joints, and the factor to SI."""


class Controller(NamedTuple):
    """Position controller at the joints: kp (q_recorded - q) + kd (qd_recorded - qd).

    Gains have the units [N m/rad, N m s/rad; N/m, N s/m] and shape (n_joints,).
    """

    kp: Array
    kd: Array


class Simulator(Protocol):
    """Simulated arm with the interface of `hil.simulation.arm.Arm.run`."""

    def run(self, starts: Sequence[Start], drive: Drive) -> list[Array]:
        """Return the positions at the instants of each start, shape (n, n_joints)."""


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """Simulated recording.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Time of the scored samples [s].
    recorded, simulated : ndarray, shape (n, n_joints)
        Positions; NaN after a stretch was lost [rad or m].
    lost : tuple of float
        Instants at which stretches were lost [s].
    """

    measurement: str
    time: Array
    recorded: Array
    simulated: Array
    lost: tuple[float, ...] = ()

    @property
    def error(self) -> Array:
        """Return the simulated less the recorded position, shape (n, n_joints) [rad or m]."""
        return self.simulated - self.recorded

    @property
    def scored(self) -> Array:
        """Return the errors without lost samples, shape (n, n_joints) [rad or m]."""
        return self.error[np.isfinite(self.simulated[:, 0])]


@dataclass(frozen=True, eq=False)
class Replay:
    """Simulated recordings of a run.

    Attributes
    ----------
    how : str
        Description of drive, simulator and friction.
    """

    robot: Robot
    recordings: tuple[Replayed, ...]
    how: str

    @property
    def rms(self) -> Array:
        """Return the rms error over all scored samples, shape (n_joints,) [rad or m].

        Infinite if all samples were lost.
        """
        error = np.vstack([each.scored for each in self.recordings])
        return np.asarray(np.sqrt(np.mean(error**2, axis=0))) if len(error) else self.largest

    @property
    def largest(self) -> Array:
        """Return the largest error, shape (n_joints,) [rad or m]."""
        error = np.vstack([each.scored for each in self.recordings])
        least = 0.0 if len(error) else np.inf
        return np.asarray(np.abs(error).max(axis=0, initial=least))

    @property
    def covered(self) -> Array:
        """Return the range of the recorded positions, shape (n_joints,) [rad or m]."""
        recorded = np.vstack([each.recorded for each in self.recordings])
        return np.asarray(np.ptp(recorded, axis=0))

    @property
    def lost(self) -> str:
        """State the lost stretches; empty without any."""
        found = [
            f"{each.measurement} at {', '.join(f'{t:.2f}' for t in each.lost[:3])} s"
            for each in self.recordings
            if each.lost
        ]
        return (
            f"the simulation diverged from the recording: {'; '.join(found)}; later samples are "
            "not scored; restart more often, with --restart 0.5 (restart=0.5)"
            if found
            else ""
        )

    def verdict(self, limits: Mapping[bool, float]) -> Verdict:
        """Judge the largest errors by limits of revolute (True) and prismatic (False) joints.

        Without a limit, state the largest error relative to the range of its axis.
        """
        wide = [limits.get(bool(turns), np.inf) for turns in self.robot.revolute]
        past = np.flatnonzero(self.largest > wide).tolist()
        axes = "; ".join(
            f"axis {axis + 1} {self._shown(axis, self.largest)}, at most"
            f" {self._shown(axis, np.array(wide))} allowed"
            for axis in past
        )
        beyond = f"largest position error: {axes}" if past else ""
        reason = "; ".join(filter(None, (beyond, self.lost)))
        limited = bool(np.isfinite(wide).any())
        if reason:
            return Verdict(*(("failed", "failed") if limited else ("doubtful", "diverged")), reason)
        if limited:
            return Verdict("good", "good", "all position errors are within their limits")
        share = self.largest / np.where(self.covered, self.covered, np.inf)
        worst = int(np.argmax(share))
        error, covered = (self._shown(worst, each) for each in (self.largest, self.covered))
        text = f"largest error {error}, axis {worst + 1}, over a range of {covered}"
        return Verdict("note", "simulated", text)

    def unit(self, axis: int) -> tuple[str, float]:
        """Return the unit of an axis's shown positions, and its number in a radian or metre."""
        return ("deg", 180 / np.pi) if self.robot.revolute[axis] else ("mm", 1e3)

    def _shown(self, axis: int, values: Array) -> str:
        unit, factor = self.unit(axis)
        return f"{significant(factor * float(values[axis]), 3)} {unit}"

    def table(self, title: str = "Simulated and recorded positions") -> Table:
        """Return the table of the position errors of all axes."""
        rows = [
            (
                str(axis + 1),
                *(self._shown(axis, values) for values in (self.rms, self.largest, self.covered)),
                significant(100 * self.rms[axis] / self.covered[axis], 2)
                if self.covered[axis]
                else "",
            )
            for axis in range(self.robot.n_joints)
        ]
        return table(
            title,
            ("axis", *figures("rms error", "largest error", "range", "rms, % of the range")),
            rows,
            "Errors of the positions over all scored samples, and range of the recorded positions.",
            (self.how,),
        )


def limits(stated: Sequence[str]) -> dict[bool, float]:
    """Parse limits such as ``2deg`` or ``5mm``, by revolute (True) and prismatic joints.

    Raises
    ------
    InvalidValue
        A limit is not a number with a unit.
    """
    found: dict[bool, float] = {}
    for text in stated:
        match = re.fullmatch(r"\s*([0-9.]+(?:e-?[0-9]+)?)\s*(deg|rad|mm|m)\s*", text)
        try:
            value = float(match[1]) if match else 0.0
        except ValueError:
            value = 0.0
        if match is None or not 0 < value < np.inf:
            raise InvalidValue(
                f"--max-error {text}: must be a number above 0 and one of {', '.join(UNITS)}, such"
                " as 2deg"
            )
        revolute, factor = UNITS[match[2]]
        found[revolute] = value * factor
    return found


def replay(
    run: Run | Path | str,
    model: Model | Path | str,
    *,
    simulator: Literal["builtin", "mujoco"] = "builtin",
    friction: Friction | None = None,
    controller: Controller | None = None,
    restart: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Replay:
    """Simulate the recordings of a run with a model of the robot.

    Parameters
    ----------
    run : Run or path
    model : Model or path
    simulator : {"builtin", "mujoco"}
        Simulator; MuJoCo gets bodies and friction by `hil.export`.
    friction : {"law", "plain", "exported"}, optional
        Friction of the builtin simulator (`hil.simulation.arm.Arm`); the law by default.
    controller : Controller, optional
        Controller that follows the recorded positions; by default drives repeat the recorded
        torques.
    restart : float, optional
        Interval after which the simulation restarts from the recorded state [s]; by default there
        is no restart.
    progress : callable
        Function called with the id of each measurement before its simulation.

    Raises
    ------
    NotEnoughData
        No recording is long enough, or the model is unsuitable for simulation.
    Mismatch
        A model of another robot.

    Examples
    --------
    >>> robot = hil.Robot.load("examples/pan_tilt/head.urdf")
    >>> rows = np.loadtxt("examples/pan_tilt/excitation.csv.gz", delimiter=",", skiprows=1)[:300]
    >>> q, tau = np.deg2rad(rows[:, 1:3]), 2.5 * rows[:, 3:5]
    >>> short = hil.Run.import_arrays(robot, rows[:, 0], q, tau)
    >>> hil.replay(short, "runs/head").recordings[0].measurement
    'r1-01'
    """
    run = opened(run)
    model = loaded(model, run.robot)
    arm: Simulator
    if simulator == "mujoco":
        from hil.simulation.mujoco_arm import MujocoArm  # noqa: PLC0415 - needs an extra

        if friction not in (None, "exported"):
            raise InvalidValue(
                f"friction {friction}: MuJoCo uses the exported friction; omit the option"
            )
        friction, arm = "exported", MujocoArm(model)
    else:
        friction = friction or "law"
        arm = Arm(model, friction)
    with named(run):
        recorded = ((each.measurement, each.recording) for each in run)
        lanes = Lanes.create(recorded, model, controller, restart, progress)
    bodies = ""
    try:
        found = lanes.simulated(arm)
    except Indefinite:
        found = lanes.simulated(Arm(possible(model), friction))
        bodies = ", nearest possible bodies: the model's mass matrix is not positive definite"
    drives = "recorded torques" if controller is None else "positions held by a PD controller"
    often = "" if restart is None else f", restarted every {restart:g} s"
    return Replay(run.robot, found, f"{drives}; {simulator}, friction: {friction}{bodies}{often}")


def possible(model: Model) -> Model:
    """Return a model with the values of the nearest physically possible bodies."""
    from hil.results.consistency import find_consistent_robot  # noqa: PLC0415 - slow to load

    bodies = model.consistent or find_consistent_robot(model).consistent
    return model if bodies is None else replace(model, values=bodies.p)


@dataclass(frozen=True, slots=True, eq=False)
class Lanes:
    """Stretches of recordings, to be simulated side by side.

    Attributes
    ----------
    starts : tuple of Start
        States `INITIAL` / 2 samples after the beginning of each stretch.
    drive : Drive
        Drive of all recordings, one after another on a common time axis.
    recorded : tuple of ndarray, shape (n, n_joints)
        Scored positions of each stretch [rad or m].
    owners : tuple of (str, float)
        Measurement of each stretch, and the shift of its times to the common axis [s].
    """

    starts: tuple[Start, ...]
    drive: Drive
    recorded: tuple[Array, ...]
    owners: tuple[tuple[str, float], ...]

    @classmethod
    def create(
        cls,
        recorded: Recorded,
        model: Model,
        controller: Controller | None = None,
        restart: float | None = None,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Lanes:
        """Return the stretches of some recordings.

        Raises
        ------
        NotEnoughData
            No recording is long enough.
        """
        starts, drives, scored, owners = [], [], [], []
        end = 0.0
        for motion, each in recorded:
            progress(motion.id)
            recording = convert_torques(model, motion, each)
            stretches = list(_stretches(recording, restart))
            if not stretches:
                continue
            drive = _drive(model, motion, recording, controller)
            shift = end - float(drive.time[0])
            drives.append(replace(drive, time=drive.time + shift))
            end = float(drives[-1].time[-1]) + 1.0
            for stretch in stretches:
                q = recording.q[stretch]
                starts.append(_start(model, recording.time[stretch] + shift, q))
                scored.append(q[INITIAL:])
                owners.append((motion.id, shift))
        if not starts:
            raise NotEnoughData(
                f"no recording has {2 * INITIAL} samples without a gap, which a simulation needs;"
                " record longer"
            )
        time, torque, wanted = (
            np.concatenate([getattr(each, name) for each in drives])
            for name in ("time", "torque", "wanted")
        )
        whole = replace(drives[0], time=time, torque=torque, wanted=wanted)
        return cls(tuple(starts), whole, tuple(scored), tuple(owners))

    def thinned(self, most: int) -> Lanes:
        """Return at most so many stretches, evenly spread."""
        n = len(self.starts)
        taken = np.arange(n) if n <= most else np.linspace(0, n - 1, most).round().astype(int)
        rows = zip(self.starts, self.recorded, self.owners, strict=True)
        starts, recorded, owners = zip(
            *(row for k, row in enumerate(rows) if k in set(taken.tolist())), strict=True
        )
        return replace(self, starts=starts, recorded=recorded, owners=owners)

    def simulated(self, arm: Simulator) -> tuple[Replayed, ...]:
        """Simulate all stretches; those of one measurement are joined."""
        skip = INITIAL - INITIAL // 2
        found = [each[skip:] for each in arm.run(self.starts, self.drive)]
        times = [
            each.time[skip:] - shift
            for each, (_, shift) in zip(self.starts, self.owners, strict=True)
        ]
        parts: dict[tuple[str, float], list[tuple[Array, Array, Array]]] = {}
        for owner, *part in zip(self.owners, times, self.recorded, found, strict=True):
            parts.setdefault(owner, []).append((part[0], part[1], part[2]))
        replayed = []
        for (name, _), pieces in parts.items():
            time, q, simulated = (np.concatenate(each) for each in zip(*pieces, strict=True))
            gone = np.diff(np.isnan(simulated[:, 0]).astype(int), prepend=0) == 1
            replayed.append(Replayed(name, time, q, simulated, tuple(time[gone].tolist())))
        return tuple(replayed)


def _stretches(recording: Recording, restart: float | None) -> Iterator[Indices]:
    """Yield the samples of stretches, with the samples before each start."""
    kept = np.flatnonzero(recording.fresh)
    steps = np.diff(recording.time[kept])
    gaps = np.flatnonzero(steps > INITIAL * np.median(steps)) + 1
    for piece in np.split(kept, gaps):
        many = len(piece) if restart is None else max(1, round(restart / recording.period))
        for first in range(0, len(piece) - 2 * INITIAL + 1, many):
            yield piece[first : first + INITIAL + many]


def _start(model: Model, time: Array, q: Array) -> Start:
    """Return the start of a stretch, by a parabola through its first samples."""
    middle = INITIAL // 2
    powers = np.vander(time[:INITIAL] - time[middle], 3, increasing=True)
    at, speed, _ = np.linalg.lstsq(powers, q[:INITIAL], rcond=None)[0]
    wide = np.array([LOST[bool(turns)] for turns in model.robot.revolute])

    def lost(k: int, now: Array) -> bool:
        return not (np.abs(now - q[middle + k]) <= wide).all()

    return Start(at, speed, time[middle:], lost)


def _drive(
    model: Model, motion: RecordedMotion, recording: Recording, controller: Controller | None
) -> Drive:
    """Return the drive of the arm for a recording, torques with the lag removed."""
    fresh, none = recording.fresh, np.zeros(model.robot.n_joints)
    time, q, tau = recording.time[fresh], recording.q[fresh], recording.tau[fresh]
    if controller is not None:
        wanted = set_points(motion, recording)
        return Drive(time, 0.0 * tau, q if wanted is None else wanted[fresh], *controller)
    lag = [each.value for each in model.details.lag] or none
    columns = zip(lag, tau.T, strict=True)
    torque = np.column_stack([np.interp(time + late, time, column) for late, column in columns])
    return Drive(time, torque, q, none, none)
