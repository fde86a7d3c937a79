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

Simulations run side by side as lanes, the leading axis of all arrays. Lanes advance from sample to
sample together, each through its own events.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from hil.errors import NotEnoughData
from hil.export.simple_friction import friction_of_joints
from hil.friction.direction import Direction
from hil.friction.terms import DIRECTED, LAWS, friction_columns
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_inertia

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array, Indices, Mask
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


class Indefinite(NotEnoughData):
    """Model whose mass matrix is not positive definite along the motion."""


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

    def __call__(self, instant: Array, q: Array, qd: Array) -> Array:
        """Return the torques of lanes at instants (lanes,) [s], given q and qd; all (lanes, n)."""
        time = self.time
        k = np.clip(time.searchsorted(instant, "right") - 1, 0, len(time) - 2)
        step = (time[k + 1] - time[k])[:, None]
        share = (instant - time[k])[:, None] / step
        torque: Array = self.torque[k] + share * (self.torque[k + 1] - self.torque[k])
        if self._free:
            return torque
        way = self.wanted[k + 1] - self.wanted[k]
        error, speed = self.wanted[k] + share * way - q, way / step
        return np.asarray(torque + self.kp * error + self.kd * (speed - qd))


class Start(NamedTuple):
    """Start of a simulation.

    Attributes
    ----------
    q, qd : ndarray, shape (n_joints,)
        State at the first instant.
    time : ndarray, shape (n,)
        Instants of the positions [s].
    lost : callable
        Function of the index of an instant and of the positions there; True ends the simulation.
    """

    q: Array
    qd: Array
    time: Array
    lost: Callable[[int, Array], bool]


class State(NamedTuple):
    """States of lanes: positions and velocities (lanes, n_joints), and modes of elements.

    Modes are 1, -1, or 0 at rest, shape (lanes, n_elements).
    """

    q: Array
    qd: Array
    mode: Array

    def take(self, lanes: Mask | Indices) -> State:
        """Return the states of some lanes."""
        return State(self.q[lanes], self.qd[lanes], self.mode[lanes])

    def put(self, lanes: Indices, other: State) -> None:
        """Replace the states of some lanes."""
        self.q[lanes], self.qd[lanes], self.mode[lanes] = other.q, other.qd, other.mode


class _Laws:
    """Friction of all axes at an instant, as columns of terms times coefficients.

    The sum is that of `hil.friction.law.friction_torque`, with axes in place of samples along the
    rows.
    """

    def __init__(self, model: Model, friction: Friction) -> None:
        n, laws = model.robot.n_joints, model.friction_law
        simple = friction_of_joints(model) if friction == "exported" else (None,) * n
        self.names = LAWS["Coulomb and viscous" if friction == "plain" else "all"]
        values, self.speed, self._slope = np.zeros((n, len(self.names))), np.ones(n), np.zeros(n)
        self._slowest, self._fastest = np.zeros(n), np.full(n, np.inf)
        for axis, (law, own) in enumerate(zip(laws.axes, simple, strict=True)):
            if own is not None:
                names = ("Coulomb", "viscous", "quadratic", "offset")
                stated = dict(zip(names, own.coasting[:4], strict=True))
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
        loads = values[:, self.names.index("load")] if "load" in self.names else np.zeros(n)
        self.load, self.loaded = np.array(loads), bool(loads.any())
        used: Mask = np.any(values, axis=0) & (np.array(self.names) != "load")
        used[0] = True  # at least one column, that of the offset
        self.names = tuple(name for name, there in zip(self.names, used, strict=True) if there)
        directed = np.isin(self.names, DIRECTED)
        self._level, self._other = values[:, used] * directed, values[:, used] * ~directed
        self._gear = np.nan_to_num(model.robot.gear_ratio)

    def evaluate(self, q: Array, qd: Array, side: Array) -> tuple[Array, Array]:
        """Return torque without directed terms, and level without load, (lanes, n).

        The level is that in directions `side`; it may be negative (`level`).
        """
        speed = np.abs(qd)
        known = np.minimum(np.maximum(speed, self._slowest), self._fastest)
        u, direction = side * known / self.speed, Direction(side.ravel(), np.zeros(side.size))
        angle = (self._gear * q).ravel()
        columns = friction_columns(u.ravel(), direction, angle=angle, terms=self.names)
        columns = columns.reshape(*q.shape, -1)
        level = side * (columns * self._level).sum(axis=-1) + self._slope * (speed - known)
        return (columns * self._other).sum(axis=-1), level

    def level(self, free: Array, load: Array) -> Array:
        """Return the level of friction under a load, given that without load, (lanes, n)."""
        return np.asarray(np.maximum(free + self.load * np.abs(load), 0.0))

    def steepest(self) -> Array:
        """Return each axis's greatest slope of friction over speed, (n,) [N m s/rad, N s/m]."""
        speeds = np.linspace(SLOWEST, 1.0, SOME)[:, None] * self.speed
        none = np.zeros_like(speeds)
        other, level = self.evaluate(none, speeds, none + 1.0)
        torques = other + np.maximum(level, 0.0)
        slopes = np.diff(torques, axis=0) / np.diff(speeds, axis=0)
        return np.asarray(np.abs(slopes).max(axis=0))


class Arm:
    """Rigid arm of a model, with friction by its law, by plain terms, or as exported.

    Parameters
    ----------
    friction : {"law", "plain", "exported"}
        Friction law; its Coulomb, viscous and offset terms alone (`AxisLaw.plain`); or friction as
        exported to MuJoCo (`hil.export.simple_friction`), with the offset.
    step : float, optional
        Longest step [s]; `STEP` by default.

    Raises
    ------
    Indefinite
        The mass matrix is not positive definite.
    """

    def __init__(self, model: Model, friction: Friction = "law", step: float | None = None) -> None:
        self._step = STEP if step is None else step
        self._model, self._robot, n = model, model.robot, model.robot.n_joints
        self._laws = _Laws(model, friction)
        self._rotors = motor_inertia(model.robot, np.zeros(n))
        self._units = np.vstack([np.zeros((2, n)), np.eye(n)])
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
        """Return mass matrices with rotors, (lanes, n, n), and torques of motion and gravity."""
        at, speeds, accelerations = np.zeros((3, len(q), *self._units.shape))
        at[:], speeds[:, 0], accelerations[:] = q[:, None], qd, self._units
        found = inverse_dynamics(self._robot, self._model.values, at, speeds, accelerations)
        mass = found[:, 2:] - found[:, 1, None]
        return (mass + mass.swapaxes(1, 2)) / 2 + self._rotors, found[:, 0]

    def levels(self, q: Array) -> Array:
        """Return the level of friction at the beginning of a motion without load, (lanes, n)."""
        none = np.zeros_like(q)
        return self._laws.level(self._laws.evaluate(q, none, none + 1.0)[1], none)

    def slopes(self, q: Array, qd: Array) -> Array:
        """Return the derivatives of friction by velocities, (lanes, n, n) [N m s/rad, N s/m]."""
        speeds = self._laws.speed * SLOWEST * np.array([[[1.0]], [[-1.0]]]) + qd
        side = np.where(qd < 0, -1.0, 1.0)
        ends = [
            other + side * np.maximum(level, 0.0)
            for other, level in (self._laws.evaluate(q, each, side) for each in speeds)
        ]
        slope = (ends[0] - ends[1]) / (speeds[0] - speeds[1])
        return np.asarray(slope[..., None] * np.eye(q.shape[1]) + self._viscous)

    def acceleration(self, state: State, tau: Array) -> tuple[Array, Array, Array]:
        """Return accelerations in the present modes (lanes, n), friction at rest and its bounds."""
        return self._acceleration(state, tau)[:3]

    def _acceleration(self, state: State, tau: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return `acceleration`, mass matrices, and accelerating torques.

        The accelerating torques include friction of sliding axes (`mode` 1 or -1), but not that of
        sticking ones (`mode` 0). Friction of the load depends on accelerations, so a fixed-point
        iteration is used; it converges at the rate of the load's share in friction.
        """
        q, qd, mode = state
        mass, bias = self.mass_and_bias(q, qd)
        side = np.where(mode[:, : q.shape[1]] < 0, -1.0, 1.0)
        other, free = self._laws.evaluate(q, qd, side)
        torque, links = tau - bias - other - qd @ self._viscous, mass - self._rotors
        shared = np.broadcast_to(self._coulomb, (len(q), len(self._coulomb)))
        solve = _Solver(mass, self.elements, mode == 0)
        load, qdd = bias, np.zeros_like(q)
        for _ in range(ROUNDS):
            most = np.hstack([self._laws.level(free, load), shared])
            left = torque - (mode * most) @ self.elements
            found = solve(left)
            if (
                not self._laws.loaded
                or (np.abs(found - qdd) <= SETTLED * (1.0 + np.abs(found))).all()
            ):
                return found, solve.friction(left, found), most, mass, left
            qdd = found
            load = bias + (links @ found[..., None])[..., 0]
        raise NotEnoughData(
            f"the model of {self._robot.name}: load-dependent friction is as large as the load; "
            "use --friction plain"
        )

    def resolved(self, state: State, tau: Array) -> State:
        """Return the states with new modes of the elements at rest, by Gauss's principle."""
        _, _, most, mass, left = self._acceleration(state, tau)
        changed = state.mode.copy()
        factor = _factor(mass, self._robot.name)
        for lane, held in enumerate(state.mode == 0):
            across: Array = np.linalg.solve(factor[lane], self.elements[held].T)
            bound = most[lane, held] + 1e-300
            torque = np.asarray(np.linalg.solve(factor[lane], left[lane]))
            friction = _least_constraint(across, torque, bound)
            slides = np.abs(friction) >= (1.0 - AT_BOUND) * bound
            changed[lane, held] = np.where(slides, np.sign(friction), 0.0)
        return state._replace(mode=changed)

    def run(self, starts: Sequence[Start], drive: Drive) -> list[Array]:
        """Simulate from states at the first instants of some times.

        Returns
        -------
        list of ndarray, shape (n, n_joints)
            Positions; NaN from the first sample on for which `lost` returns True.
        """
        found = [np.full((len(each.time), len(each.q)), np.nan) for each in starts]
        for positions, each in zip(found, starts, strict=True):
            positions[0] = each.q
        q, qd = (np.stack(each) for each in zip(*((x.q, x.qd) for x in starts), strict=True))
        state, rate, k = self.start(q, qd), self.rate(drive), 0
        lanes = np.arange(len(starts))
        while (
            going := np.array([k + 1 < len(starts[lane].time) for lane in lanes.tolist()])
        ).any():
            lanes, state, k = lanes[going], state.take(going), k + 1
            begin, end = np.array([starts[lane].time[k - 1 : k + 1] for lane in lanes]).T
            # the number of steps for a period between samples, each at most step [s]
            longest = min(self._step, FASTEST / max(rate, 1e-9))
            n = int(np.clip(np.ceil(float((end - begin).max()) / longest - 1e-6), 1, MOST_STEPS))
            h = (end - begin) / n
            for part in range(n):
                state = self.step(state, begin + part * h, h, drive)
            kept: Mask = np.array(
                [not starts[lane].lost(k, q) for lane, q in zip(lanes, state.q, strict=True)]
            )
            lanes, state = lanes[kept], state.take(kept)
            for lane, positions in zip(lanes, state.q, strict=True):
                found[lane][k] = positions
        return found

    def start(self, q: Array, qd: Array) -> State:
        """Return states with modes by the signs of velocities; elements without velocity rest."""
        return State(q, qd, np.sign(qd @ self.elements.T))

    def step(self, state: State, begin: Array, h: Array, drive: Drive) -> State:
        """Return the states a time `h` after `begin` [s], (lanes,), through all events between."""
        now, left, going = begin.copy(), h.copy(), np.arange(len(h))
        final = State(*(each.copy() for each in state))
        for _ in range(MOST_EVENTS):
            after, stopping, share = self._try(state, now, left, drive)
            stops = np.asarray(stopping.any(axis=1))
            final.put(going, after)
            if not stops.any():
                return final
            going, share, left = going[stops], share[stops], left[stops]
            now, left = now[stops] + left * share, left * (1.0 - share)
            state = self._stopped(after.take(stops), stopping[stops])
            state = self.resolved(state, drive(now, state.q, state.qd))
            final.put(going, state)
            going, now, left, state = (
                going[left > 0], now[left > 0], left[left > 0], state.take(left > 0)
            )  # fmt: skip
            if not len(going):
                return final
        after, _, _ = self._try(state, now, left, drive, whole=True)
        turned = np.asarray(after.mode * (after.qd @ self.elements.T) < 0)
        final.put(going, self._stopped(after, turned))
        return final

    def _try(
        self, state: State, now: Array, h: Array, drive: Drive, *, whole: bool = False
    ) -> tuple[State, Mask, Array]:
        """Take a midpoint step up to the first stop: states, stopping elements, shares done."""
        tau = drive(now, state.q, state.qd)
        first, friction, most = self.acceleration(state, tau)
        if len(slipping := np.flatnonzero((np.abs(friction) > most).any(axis=1))):
            state = State(*(each.copy() for each in state))
            state.put(slipping, self.resolved(state.take(slipping), tau[slipping]))
            first[slipping] = self.acceleration(state.take(slipping), tau[slipping])[0]
        after, second = self._midpoint(state, first, now, h, drive)
        speeds, ends = (each.qd @ self.elements.T for each in (state, after))
        turned = state.mode * ends < 0
        share = np.ones(len(h))
        if whole or not turned.any():
            return after, np.zeros_like(turned), share
        slope, curve = (h[:, None] * x @ self.elements.T for x in (first, second - first))
        shares = np.full(turned.shape, np.inf)
        for at in zip(*np.nonzero(turned), strict=True):
            shares[at] = _first_root(speeds[at], slope[at], curve[at])
        some = np.flatnonzero(turned.any(axis=1))
        share[some] = np.maximum(shares[some].min(axis=1), SHORTEST)
        part, _ = self._midpoint(state.take(some), first[some], now[some], (share * h)[some], drive)
        after.put(some, part)
        return after, shares <= share[:, None], share

    def _midpoint(
        self, state: State, first: Array, now: Array, h: Array, drive: Drive
    ) -> tuple[State, Array]:
        (q, qd, mode), step = state, h[:, None]
        middle = State(q + step / 2 * qd, qd + step / 2 * first, mode)
        tau = drive(now + h / 2, middle.q, middle.qd)
        second, _, _ = self.acceleration(middle, tau)
        return State(q + step * middle.qd, qd + step * second, mode.copy()), second

    def _stopped(self, state: State, stopping: Mask) -> State:
        """Return the states with some elements stopped, by the velocity changes of least norm."""
        mode, qd = np.where(stopping, 0.0, state.mode), state.qd.copy()
        for lane in np.flatnonzero(stopping.any(axis=1)):
            rows = self.elements[mode[lane] == 0]
            qd[lane] -= np.linalg.lstsq(rows, rows @ qd[lane], rcond=None)[0]
        return State(state.q, qd, mode)

    def rate(self, drive: Drive) -> float:
        """Return the greatest rate of decay or oscillation of velocities along a motion [1/s]."""
        q = drive.wanted[:: max(1, len(drive.wanted) // SOME)]
        mass, _ = self.mass_and_bias(q, 0.0 * q)
        inverse = np.linalg.inv(_factor(mass, self._robot.name))
        lightest = (inverse**2).sum(axis=1).max(axis=0)
        slopes = self._laws.steepest() + np.abs(self._viscous).sum(axis=0) + drive.kd
        return float(np.maximum(lightest * slopes, np.sqrt(lightest * drive.kp)).max())


class _Solver:
    """Accelerations of lanes as a function of torques, with elements kept at rest."""

    def __init__(self, mass: Array, elements: Array, held: Mask) -> None:
        self._mass, self._held, n = mass, held, mass.shape[1]
        self._axes = held[:, :n]
        fixed = np.where(self._axes[:, :, None] | self._axes[:, None], np.eye(n), mass)
        self._inverse = np.linalg.inv(fixed)
        coupled = np.flatnonzero(held[:, n:].any(axis=1)).tolist()
        self._coupled = {lane: elements[held[lane]] for lane in coupled}

    def __call__(self, left: Array) -> Array:
        """Return the accelerations (lanes, n) under torques `left`."""
        found = (self._inverse @ np.where(self._axes, 0.0, left)[..., None])[..., 0]
        for lane, rows in self._coupled.items():
            free, across, own = self._held_by(lane, rows, left)
            found[lane] = free - across @ own
        return np.asarray(found)

    def friction(self, left: Array, found: Array) -> Array:
        """Return the friction of the elements at rest, (lanes, n_elements)."""
        friction, n = np.zeros(self._held.shape), left.shape[1]
        rest = left - (self._mass @ found[..., None])[..., 0]
        friction[:, :n] = np.where(self._axes, rest, 0.0)
        for lane, rows in self._coupled.items():
            friction[lane, self._held[lane]] = self._held_by(lane, rows, left)[2]
        return friction

    def _held_by(self, lane: int, rows: Array, left: Array) -> tuple[Array, Array, Array]:
        """Return accelerations without friction, those by unit friction, and the friction."""
        solved = np.linalg.solve(self._mass[lane], np.column_stack([left[lane], rows.T]))
        free, across = solved[:, 0], solved[:, 1:]
        own = np.asarray(np.linalg.lstsq(rows @ across, rows @ free, rcond=None)[0], dtype=float)
        return free, across, own


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
        raise Indefinite(
            f"the model of {name}: the mass matrix is not positive definite along the motion and "
            "cannot be simulated; identify the model from more motion, or see hil.Model.verdict"
        ) from error
