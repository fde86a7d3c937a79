"""The builtin simulator: a model's rigid arm with exact stick-slip friction.

Friction acts in elements: one of each axis, and one of each motor that turns with two joints. An
element e slides at the speed w_e qd. Its friction has a part that is a function of the state, and a
level F_e >= 0 against the motion. An element at rest holds with any torque l_e between -F_e and
F_e:

    M(q) qdd + c(q, qd) + g(q) + f(q, qd, load) + W' l = tau
    l_e = F_e sgn(w_e qd) where element e slides, |l_e| <= F_e where it rests

Each element has a mode: forward, back, or at rest. Between two changes of a mode the equation is
smooth, and the explicit midpoint rule solves it: an error of order h^2. Elements at rest are
constraints w_e qdd = 0, whose multipliers are their friction. Modes change at two events:

- A sliding element stops. The instant is the root of the quadratic through the step's velocity,
  whose error is of order h^3; the step ends there.
- An element at rest needs more than F_e. The element starts to slide at the beginning of the next
  step, at most h late, with a velocity error of order h^2.

At an event the next modes follow from Gauss's principle: accelerations of the elements at rest are
those of least constraint,

    minimise |C^-1 (r - W' l)| over |l_e| <= F_e,  M = C C',

with r the torque left by all other elements. This is a bounded least-squares problem, whose
accelerations are unique since M is positive definite. An element within its bounds rests; one at a
bound slides against it. So the whole scheme is of order h^2 through any number of stops and
reversals (tested against closed solutions).

Presliding is left out: friction reverses at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from hil.errors import NotEnoughData
from hil.export.simple_friction import friction_of_joints
from hil.friction.direction import Direction
from hil.friction.terms import DIRECTED, LAWS, friction_columns
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.arrays import Array, Mask
    from hil.results.model import Model

Friction = Literal["law", "plain", "exported"]
STEP = 1e-3
"""Longest step [s]."""
FASTEST = 0.3
"""Longest step as a share of the shortest time constant, of friction or of a controller."""
MOST_STEPS = 64
"""Maximum number of steps in a period of the samples."""
MOST_EVENTS = 50
"""Maximum number of events in a step; beyond this number, elements that change direction stop at
the end of the step.
"""
SHORTEST = 1e-3
"""Shortest part of a step ended by an event: a lower bound that guarantees progress."""
ROUNDS = 200
"""Maximum number of corrections of accelerations for friction of the load."""
SETTLED = 1e-9
"""Change of accelerations at convergence of the corrections for friction of the load, relative to
the accelerations and 1 rad/s^2.
"""
SOME = 30
"""Number of positions and speeds for the choice of the step."""
SLOWEST = 0.01
"""Smallest of the speeds for the choice of the step, as a share of an axis's speed."""
AT_BOUND = 1e-9
"""Distance of an element from its greatest friction, as a share, at which it starts to slide."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Drive of an arm: torques, and a PD controller of positions.

        tau = torque + kp (q_wanted - q) + kd (qd_wanted - qd)

    Attributes
    ----------
    time : ndarray, shape (n,)
        Instants of the samples, linear in between [s].
    torque, wanted : ndarray, shape (n, n_joints)
        Torques and positions [N m or N, rad or m].
    kp, kd : ndarray, shape (n_joints,)
        Gains [N m/rad, N m s/rad, or N/m, N s/m]; 0 without a controller.
    """

    time: Array
    torque: Array
    wanted: Array
    kp: Array
    kd: Array
    _free: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_free", not (self.kp.any() or self.kd.any()))

    def __call__(self, instant: float, q: Array, qd: Array) -> Array:
        """Return the torques at an instant [s], given q and qd, shape (n_joints,) each."""
        time = self.time
        k = min(max(int(time.searchsorted(instant, "right")) - 1, 0), len(time) - 2)
        step = float(time[k + 1] - time[k])
        share = (instant - float(time[k])) / step
        torque: Array = self.torque[k] + share * (self.torque[k + 1] - self.torque[k])
        if self._free:
            return torque
        way = self.wanted[k + 1] - self.wanted[k]
        error, speed = self.wanted[k] + share * way - q, way / step
        return np.asarray(torque + self.kp * error + self.kd * (speed - qd))


class State(NamedTuple):
    """Positions and velocities (n_joints,), and modes of elements: 1, -1, or 0 at rest."""

    q: Array
    qd: Array
    mode: Array


class _Laws:
    """Friction of all axes at an instant, as columns of terms times coefficients.

    The sum is that of `hil.friction.law.friction_torque`, with axes in place of samples along the
    rows.
    """

    def __init__(self, model: Model, friction: Friction) -> None:
        n, laws = model.robot.n_joints, model.friction_law
        simple = friction_of_joints(model) if friction == "exported" else (None,) * n
        self.names = LAWS["all"] if friction == "law" else LAWS["Coulomb and viscous"]
        values, self.speed, self._slope = np.zeros((n, len(self.names))), np.ones(n), np.zeros(n)
        self._slowest, self._fastest = np.zeros(n), np.full(n, np.inf)
        for axis, (law, own) in enumerate(zip(laws.axes, simple, strict=True)):
            if own is not None:
                stated = {"offset": own.offset, "Coulomb": own.coulomb, "viscous": own.viscous}
            elif law is None or friction == "exported":
                continue
            else:
                self.speed[axis] = law.speed
                terms = law.terms if friction == "law" else law.plain
                stated = {name: each.value for name, each in terms.items()}
                if friction == "law" and law.speeds is not None:
                    self._slowest[axis], self._fastest[axis] = law.speeds
                    self._slope[axis] = law.slope
            values[axis] = [stated.get(name, 0.0) for name in self.names]
        used: Mask = np.any(values, axis=0)
        used[0] = True  # at least one column, that of the offset
        self.names = tuple(name for name, there in zip(self.names, used, strict=True) if there)
        directed = np.isin(self.names, DIRECTED)
        self._level, self._other = values[:, used] * directed, values[:, used] * ~directed
        self._none = np.zeros(n)
        self.loaded = "load" in self.names
        self._gear = np.nan_to_num(model.robot.gear_ratio)

    def evaluate(self, q: Array, qd: Array, side: Array, load: Array) -> tuple[Array, Array]:
        """Return torque without directed terms, and level for directions `side`, (n,) each."""
        speed = np.abs(qd)
        known = np.minimum(np.maximum(speed, self._slowest), self._fastest)
        u, direction = side * known / self.speed, Direction(side, self._none)
        columns = friction_columns(u, direction, load, self._gear * q, terms=self.names)
        level = side * (columns * self._level).sum(axis=1) + self._slope * (speed - known)
        return (columns * self._other).sum(axis=1), np.maximum(level, 0.0)

    def steepest(self) -> Array:
        """Return each axis's greatest slope of friction over speed, (n,) [N m s/rad, N s/m]."""
        none, forward = np.zeros(len(self.speed)), np.ones(len(self.speed))
        speeds = np.linspace(SLOWEST, 1.0, SOME)[:, None] * self.speed
        torques = [np.add(*self.evaluate(none, each, forward, none)) for each in speeds]
        slopes = np.diff(torques, axis=0) / np.diff(speeds, axis=0)
        return np.asarray(np.abs(slopes).max(axis=0))


class Arm:
    """Rigid arm of a model, with friction by its law, by plain terms, or as exported.

    Parameters
    ----------
    model : Model
    friction : {"law", "plain", "exported"}
        Friction law; its Coulomb, viscous and offset terms alone (`AxisLaw.plain`); or Coulomb and
        viscous friction as exported to simulators (`hil.export.simple_friction`), with the offset.

    Raises
    ------
    NotEnoughData
        The mass matrix is not positive definite.
    """

    def __init__(self, model: Model, friction: Friction = "law") -> None:
        self._model, self._robot, n = model, model.robot, model.robot.n_joints
        self._laws = _Laws(model, friction)
        self._rotors = motor_inertia(model.robot, np.zeros(n))
        self._still, self._zero = np.zeros(n), np.zeros((n + 2, n))
        self._zero[2:] = np.eye(n)
        coupled = () if friction == "exported" else model.friction_law.coupled
        rows = [np.eye(n)]
        for motor, joint, ratio in model.robot.couplings[: len(coupled)]:
            row = np.zeros((1, n))
            row[0, [motor, joint]] = 1.0, ratio
            rows.append(row)
        self.elements = np.vstack(rows)
        self._coulomb = np.array([max(each.coulomb.value, 0.0) for each in coupled])
        self._viscous = np.zeros((n, n))
        for row, each in zip(self.elements[n:], coupled, strict=True):
            shared = each.viscous.value * np.outer(row, row)
            self._viscous += shared - np.diag(np.diag(shared))

    def mass_and_bias(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return the mass matrix with rotors, (n, n), and torque of motion and gravity, (n,)."""
        speeds = np.zeros_like(self._zero)
        speeds[0] = qd
        at = np.broadcast_to(q, speeds.shape)
        found = inverse_dynamics(self._robot, self._model.values, at, speeds, self._zero)
        mass = found[2:].T - found[1][:, None]
        return (mass + mass.T) / 2 + self._rotors, found[0]

    def _forces(
        self, q: Array, qd: Array, mode: Array, tau: Array, load: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return mass matrix, accelerating torque, friction bounds, and bias.

        The accelerating torque includes friction of sliding axes (`mode` 1 or -1), but not that of
        sticking ones (`mode` 0).
        """
        mass, bias = self.mass_and_bias(q, qd)
        n = len(q)
        side = np.where(mode[:n] < 0, -1.0, 1.0)
        other, level = self._laws.evaluate(q, qd, side, load)
        most = np.concatenate([level, self._coulomb])
        left = tau - bias - other - self._viscous @ qd - (mode * most) @ self.elements
        return mass, left, most, bias

    def acceleration(
        self, state: State, tau: Array, load: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Return accelerations in the present modes (n,), friction at rest and its bounds.

        Friction of the load depends on accelerations, so a fixed-point iteration is used; it
        converges at the rate of the load's share in friction.
        """
        q, qd, mode = state
        held, load = mode == 0, self._still if load is None else load
        qdd = self._still
        for _ in range(ROUNDS):
            mass, left, most, bias = self._forces(q, qd, mode, tau, load)
            found, friction = _accelerations(mass, left, self.elements, held)
            if (
                not self._laws.loaded
                or (np.abs(found - qdd) <= SETTLED * (1.0 + np.abs(found))).all()
            ):
                return found, friction, most
            qdd, load = found, bias + (mass - self._rotors) @ found
        raise NotEnoughData(
            f"the model of {self._robot.name}: load-dependent friction is as large as the load; "
            "use --friction plain"
        )

    def resolved(self, state: State, tau: Array) -> State:
        """Return the state with new modes of the elements at rest, by Gauss's principle."""
        q, qd, mode = state
        held = mode == 0
        load = self._still
        if self._laws.loaded:
            qdd, _, _ = self.acceleration(state, tau)
            mass, bias = self.mass_and_bias(q, qd)
            load = bias + (mass - self._rotors) @ qdd
        mass, left, most, _ = self._forces(q, qd, mode, tau, load)
        factor = _factor(mass, self._robot.name)
        across: Array = np.linalg.solve(factor, self.elements[held].T)
        bound = most[held] + 1e-300
        friction = _least_constraint(across, np.asarray(np.linalg.solve(factor, left)), bound)
        slides = np.abs(friction) >= (1.0 - AT_BOUND) * bound
        changed = mode.copy()
        changed[held] = np.where(slides, np.sign(friction), 0.0)
        return State(q, qd, changed)

    def run(
        self, q: Array, qd: Array, time: Array, drive: Drive, lost: Callable[[int, Array], bool]
    ) -> Array:
        """Simulate from a state at the first instant of `time`, shape (n,) [s].

        Returns
        -------
        ndarray, shape (n, n_joints)
            Positions; NaN from the first sample on for which `lost` returns True, given its index
            and positions.
        """
        found = np.full((len(time), len(q)), np.nan)
        state, rate = self.start(q, qd), self.rate(drive)
        found[0] = q
        for k, (begin, end) in enumerate(pairwise(time.tolist()), start=1):
            n = steps_in(end - begin, rate)
            for part in range(n):
                h = (end - begin) / n
                state = self.step(state, begin + part * h, h, drive)
            if lost(k, state.q):
                break
            found[k] = state.q
        return found

    def start(self, q: Array, qd: Array) -> State:
        """Return a state with modes by the signs of velocities; elements without velocity rest."""
        return State(q.copy(), qd.copy(), np.sign(self.elements @ qd))

    def step(self, state: State, begin: float, h: float, drive: Drive) -> State:
        """Return the state a time `h` after `begin` [s], through all events between."""
        end, now = begin + h, begin
        for _ in range(MOST_EVENTS):
            after, stopping, share = self._try(state, now, end - now, drive)
            if not stopping.any():
                return after
            now += (end - now) * share
            state = self.resolved(self._stopped(after, stopping), drive(now, after.q, after.qd))
            if now >= end:
                return state
        after, _, _ = self._try(state, now, end - now, drive, whole=True)
        turned = after.mode * (self.elements @ after.qd) < 0
        return self._stopped(after, turned)

    def _try(
        self, state: State, now: float, h: float, drive: Drive, *, whole: bool = False
    ) -> tuple[State, Mask, float]:
        """Take a midpoint step up to the first stop: state, stopping elements, share done."""
        tau = drive(now, state.q, state.qd)
        first, friction, most = self.acceleration(state, tau)
        if (np.abs(friction) > most).any():
            state = self.resolved(state, tau)
            first, _, _ = self.acceleration(state, tau)
        after, second = self._midpoint(state, first, now, h, drive)
        speeds, ends = (self.elements @ each.qd for each in (state, after))
        turned = state.mode * ends < 0
        if whole or not turned.any():
            return after, np.zeros_like(turned), 1.0
        slopes = h * self.elements @ np.column_stack([first, second - first])
        shares = np.full(len(turned), np.inf)
        shares[turned] = [
            _first_root(*each) for each in zip(speeds[turned], *slopes[turned].T, strict=True)
        ]
        share = max(float(shares.min()), SHORTEST)
        after, _ = self._midpoint(state, first, now, share * h, drive)
        return after, shares <= share, share

    def _midpoint(
        self, state: State, first: Array, now: float, h: float, drive: Drive
    ) -> tuple[State, Array]:
        q, qd, mode = state
        middle = State(q + h / 2 * qd, qd + h / 2 * first, mode)
        tau = drive(now + h / 2, middle.q, middle.qd)
        second, _, _ = self.acceleration(middle, tau)
        return State(q + h * middle.qd, qd + h * second, mode), second

    def _stopped(self, state: State, stopping: Mask) -> State:
        """Return the state with some elements stopped, by the velocity change of least norm."""
        mode = np.where(stopping, 0.0, state.mode)
        rows = self.elements[mode == 0]
        qd = state.qd - np.linalg.lstsq(rows, rows @ state.qd, rcond=None)[0]
        return State(state.q, qd, mode)

    def rate(self, drive: Drive) -> float:
        """Return the greatest rate of decay or oscillation of velocities along a motion [1/s]."""
        lightest = np.zeros(len(drive.kp))
        for q in drive.wanted[:: max(1, len(drive.wanted) // SOME)]:
            mass, _ = self.mass_and_bias(q, self._still)
            inverse = np.linalg.inv(_factor(mass, self._robot.name))
            lightest = np.maximum(lightest, (inverse**2).sum(axis=0))
        slopes = self._laws.steepest() + np.abs(self._viscous).sum(axis=0) + drive.kd
        return float(np.maximum(lightest * slopes, np.sqrt(lightest * drive.kp)).max())


def steps_in(period: float, rate: float) -> int:
    """Return the number of steps for a period between samples."""
    longest = min(STEP, FASTEST / max(rate, 1e-9))
    return int(np.clip(np.ceil(period / longest - 1e-6), 1, MOST_STEPS))


def _accelerations(mass: Array, left: Array, elements: Array, held: Mask) -> tuple[Array, Array]:
    """Return accelerations with elements kept at rest, and the required friction."""
    friction = np.zeros(len(elements))
    if not held.any():
        return np.asarray(np.linalg.solve(mass, left)), friction
    rows = elements[held]
    solved = np.linalg.solve(mass, np.column_stack([left, rows.T]))
    friction[held] = np.linalg.lstsq(rows @ solved[:, 1:], rows @ solved[:, 0], rcond=None)[0]
    return np.asarray(solved[:, 0] - solved[:, 1:] @ friction[held]), friction


def _least_constraint(across: Array, left: Array, bound: Array) -> Array:
    """Return friction within its bounds, shape (k,), with the least remaining torque."""
    if len(bound) == 1:
        size = float(across[:, 0] @ across[:, 0])
        return np.asarray(np.clip(across.T @ left / size, -bound, bound))
    from scipy.optimize import lsq_linear  # noqa: PLC0415 - takes long to load

    return np.asarray(lsq_linear(across, left, (-bound, bound), method="bvls").x)


def _first_root(speed: float, slope: float, curve: float) -> float:
    """Return the least root x > 0 of speed + slope x + curve x^2, at most 1."""
    roots = np.roots([curve, slope, speed])
    real = roots[np.isreal(roots)].real
    return float(min((x for x in real if 0 < x < 1), default=0.0 if speed == 0 else 1.0))


def _factor(mass: Array, name: str) -> Array:
    try:
        return np.asarray(np.linalg.cholesky(mass))
    except np.linalg.LinAlgError as error:
        raise NotEnoughData(
            f"the model of {name}: the mass matrix is not positive definite along the motion and "
            "cannot be simulated; identify the model from more motion, or see hil.Model.verdict"
        ) from error
