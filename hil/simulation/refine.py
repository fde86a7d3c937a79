"""Refinement of a model by simulation: parameters move until simulated motions fit the recorded.

Output-error identification by the Gauss-Newton method, from the model of a regression. Residuals
are simulated less recorded positions in stretches that start anew from the recording (multiple
shooting), relative to each axis's initial error. Positions respond to a change of the parameters by
the equation linearised along the simulated motion,

    M dqdd + C dqd + K dq + S dp = 0

with C, K the derivatives of the torque by velocities and positions, and S the regressor with the
columns of friction. Axes at rest stay there. So sensitivities cost as much as one simulation,
whatever the number of parameters.

At a reversal of axis i its acceleration jumps from a- to a+, and dqd changes by
(a+ - a-) dqd_i / a_i-, since the instant of the reversal moves. Errors of the initial states are
left out: what they explain is removed from residuals and sensitivities.

Regression and simulation use the same recordings, so no error is counted twice: parameters move in
the directions that the simulation determines better than the regression does, in units of standard
errors, and stay in all others. Residuals are correlated in time. A stretch is one draw, and few
stretches are cut into at least `FEW_BLOCKS` pieces. The scatter of the draws' gradients over that
of independent samples is the design effect, by which samples count less, and the covariance is that
of the jackknife over the draws.

The last quarter of the stretches decides between start and refined parameters, by the rule of one
standard error (Breiman et al., Classification and Regression Trees, 1984): refined parameters are
refused if their gain is within the standard error, or else fitted to all stretches.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.free_motion.result import FEW_BLOCKS
from hil.friction.direction import Direction
from hil.friction.law import FrictionLaw, TermValue, law_columns
from hil.friction.terms import CLASSICAL, USUAL, coupled_friction
from hil.least_squares.uncertainty import TWICE
from hil.model.dynamics import inverse_dynamics, regressor
from hil.results.identified_robot import known_friction
from hil.results.refinement import Refinement
from hil.simulation.arm import Arm, Indefinite
from hil.simulation.replay import INITIAL, Lanes, possible

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.results.model import Model
    from hil.runs.recording import Recorded, Recording
    from hil.simulation.replay import Controller

HELD_OUT = 4
"""One in so many stretches is held out, the last ones."""
SHORT = 0.5
"""Length of stretches of robots under gravity, which fall without their controller [s]."""
MOST = 240
"""Maximum number of stretches; more are thinned evenly. Two minutes of `SHORT` stretches, by which
time and memory are bounded."""
GRID = 5e-3
"""Step of the sensitivities [s]: a fifth of the period of 40 Hz, above the bandwidth of motions."""
ROUNDS = 12
"""Maximum number of Gauss-Newton steps."""
CUTS = 2
"""Maximum number of times that a step is cut to a quarter if it does not reduce the error."""
SETTLED = 0.05
"""Largest step at convergence, in standard errors of the parameters: negligible beside them."""
LEAST = 1e-6
"""Smallest eigenvalue of the correlations of the regression; joint covariances of separate fits may
have eigenvalues below zero."""
SMALL = 1e-6
"""Step of difference quotients, relative to 1 rad, m, or their rates."""


class Layout:
    """Parameters of a model as a vector: base parameters, friction terms, coupled friction.

    Parameters
    ----------
    plain : bool
        True to replace each axis's law by its plain terms.
    """

    def __init__(self, model: Model, *, plain: bool) -> None:
        self.model, self.replaced = model, plain
        usual = {"law": USUAL, "covariance": (), "beside": (), "speeds": None}
        laws = known_friction(model, of_all=True).axes
        self._laws = [
            law.model_copy(update=usual | {"terms": law.plain}) if plain else law
            for law in laws
            if law is not None
        ]
        self.base = np.flatnonzero(model.identified)
        self.ends = np.cumsum([len(self.base), *(len(law.terms) for law in self._laws)])
        shared = model.friction_law.motor_terms
        last = [each.value for each in shared]
        own = (law.values for law in self._laws)
        self.start = np.concatenate([model.values[self.base], *own, last])
        n = len(self.base)
        variances = [each.standard_error**2 for each in shared]
        prior = np.diag(np.concatenate([np.zeros(self.ends[-1]), variances]))
        prior[:n, :n] = model.scatter_covariance[np.ix_(self.base, self.base)]
        for law, part in zip(self._laws, self._parts, strict=True):
            prior[part, part] = law.uncertainty
            if law.beside:
                prior[part, :n] = np.array(law.beside)[:, self.base]
                prior[:n, part] = prior[part, :n].T
        self.prior = prior

    @property
    def plain(self) -> bool:
        """True if no law has more terms than offset, Coulomb and viscous friction."""
        return all(set(law.terms) <= set(CLASSICAL) for law in self._laws)

    @property
    def _parts(self) -> list[slice]:
        return [slice(a, b) for a, b in zip(self.ends[:-1], self.ends[1:], strict=True)]

    @cached_property
    def roots(self) -> Array:
        """Root of the covariance of the regression: parameters per standard error, (p, p)."""
        scale = np.sqrt(np.diag(self.prior))
        scale = np.where(scale > 0, scale, 1.0)
        values, vectors = np.linalg.eigh(self.prior / np.outer(scale, scale))
        return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, LEAST)))

    def model_at(self, p: Array, covariance: Array | None = None) -> Model:
        """Return the model with parameters `p`, by default with the regression's covariance."""
        spread, n = self.prior if covariance is None else covariance, len(self.base)
        values, scatter = self.model.values.copy(), self.model.scatter_covariance.copy()
        values[self.base] = p[:n]
        scatter[np.ix_(self.base, self.base)] = spread[:n, :n]
        axes = []
        for own, part in zip(self._laws, self._parts, strict=True):
            beside = np.zeros((part.stop - part.start, len(values)))
            beside[:, self.base] = spread[part, :n]
            terms = TermValue.named(own.terms, p[part], spread[part, part])
            update = {
                "terms": terms,
                "covariance": tuple(map(tuple, spread[part, part].tolist())),
                "beside": tuple(map(tuple, beside.tolist())),
            }
            if own.law == USUAL:
                update["plain"] = terms
            axes.append(own.model_copy(update=update))
        rest = zip(p[self.ends[-1] :], np.diag(spread)[self.ends[-1] :], strict=True)
        shared = [TermValue.estimated(*each) for each in rest]
        pairs = zip(self.model.friction_law.coupled, shared[::2], shared[1::2], strict=True)
        coupled = tuple(
            each.model_copy(update={"viscous": viscous, "coulomb": coulomb})
            for each, viscous, coulomb in pairs
        )
        law = FrictionLaw(axes=tuple(axes), coupled=coupled)
        found = replace(self.model, values=values, scatter_covariance=scatter, friction_law=law)
        if found.details.with_law:
            details = found.details.model_copy(update={"axes": law.axes, "coupled": law.coupled})
            found = replace(found, details=details)
        return found

    def columns(self, model: Model, q: Array, qd: Array, qdd: Array) -> Array:
        """Return the change of the torques by the parameters, shape (n, n_joints, p)."""
        robot, n = model.robot, self.ends[-1]
        found = np.zeros((*q.shape, len(self.start)))
        A = regressor(robot, q, qd, qdd)
        found[..., : len(self.base)] = A[..., self.base]
        load = A @ model.values
        for axis, (law, part) in enumerate(zip(self._laws, self._parts, strict=True)):
            direction = Direction(np.sign(qd[:, axis]), np.zeros(len(q)))
            found[:, axis, part] = law_columns(robot, law, q, qd, load, axis, direction)
            if model.friction_law.coupled:
                found[:, axis, n:] = coupled_friction(robot, qd, axis)
        return found


class Fit(NamedTuple):
    """Parameters of a layout, with the positions of all stretches.

    Attributes
    ----------
    p : ndarray, shape (p,)
    model : Model
        Model of these parameters.
    positions : list of ndarray, shape (n, n_joints)
        Simulated positions of all stretches; NaN after a loss.
    errors : ndarray, shape (stretches, n_joints)
        Mean square of the position errors.
    lost : int
        Number of lost samples.
    """

    p: Array
    model: Model
    positions: list[Array]
    errors: Array
    lost: int


@dataclass(frozen=True, eq=False)
class Simulations:
    """Simulations of stretches with the parameters of a layout."""

    layout: Layout
    lanes: Lanes

    def run(self, p: Array) -> Fit:
        """Simulate all stretches; `Arm` refuses a model without a positive mass matrix."""
        model = self.layout.model_at(p)
        found = Arm(model, step=GRID).run(self.lanes.starts, self.lanes.drive)
        skip = INITIAL - INITIAL // 2
        pairs = zip(found, self.lanes.recorded, strict=True)
        squares = [(each[skip:] - recorded) ** 2 for each, recorded in pairs]
        errors = [np.nan_to_num(each).sum(axis=0) / len(each) for each in squares]
        lost = sum(int(np.isnan(each[:, 0]).sum()) for each in squares)
        return Fit(p, model, found, np.array(errors), lost)

    def response(self, fit: Fit, lanes: Indices, weights: Array) -> tuple[list[Array], list[Array]]:
        """Return weighed residuals, and their changes by the parameters in standard errors.

        The part that a change of the initial state explains is removed from both.

        Returns
        -------
        list of ndarray, shape (n n_joints,)
            Residuals of some lanes on a coarser grid.
        list of ndarray, shape (n n_joints, p)
        """
        residuals, changes = [], []
        skip = INITIAL - INITIAL // 2
        # lanes of equal number and period of samples are simulated together
        kinds: dict[tuple[int, float], list[int]] = {}
        for k, lane in enumerate(lanes.tolist()):
            time = self.lanes.starts[lane].time
            kinds.setdefault((len(time), round(float(np.median(np.diff(time))), 6)), []).append(k)
        for group in map(np.array, kinds.values()):
            own = lanes[group]
            times = [self.lanes.starts[lane].time for lane in own.tolist()]
            h = float(np.median(np.diff(times[0])))
            every = slice(None, None, max(1, round(GRID / h)))
            q = np.stack([np.nan_to_num(fit.positions[lane], nan=0.0) for lane in own.tolist()])
            moved = self._sensitivities(fit.model, q, h, every)
            for lane, each in zip(own.tolist(), moved, strict=True):
                recorded = np.vstack(
                    [np.full((skip, q.shape[2]), np.nan), self.lanes.recorded[lane]]
                )
                left = (fit.positions[lane] - recorded)[every]
                known = np.isfinite(left[:, 0])
                r = (weights * left[known]).ravel()
                J = (weights[:, None] * each[known]).reshape(len(r), -1)
                own, J = np.split(J, [2 * q.shape[2]], axis=1)
                basis, _ = np.linalg.qr(own)
                residuals.append(r - basis @ (basis.T @ r))
                changes.append(J - basis @ (basis.T @ J))
        return residuals, changes

    def _sensitivities(self, model: Model, q: Array, h: float, every: slice) -> Array:
        """Return the changes of positions along motions (lanes, n, n_joints), on a coarser grid.

        The changes are those by initial positions and velocities, and by the parameters.
        """
        qd = np.gradient(q, h, axis=1)
        qdd = np.gradient(qd, h, axis=1)
        q, qd, qdd = q[:, every], qd[:, every], qdd[:, every]
        lanes, n, joints = q.shape
        flat = [x.reshape(-1, joints) for x in (q, qd, qdd)]
        S = self.layout.columns(model, *flat) @ self.layout.roots
        S = np.concatenate([np.zeros((len(S), joints, 2 * joints)), S], axis=2)
        K, C, M = _linearised(model, *flat)
        C, K = C + np.diag(self.lanes.drive.kd), K + np.diag(self.lanes.drive.kp)
        S, K, C, M = (X.reshape(lanes, n, joints, -1) for X in (S, K, C, M))
        rests = qd == 0
        step = h * (every.step or 1)
        arm = Arm(model)
        jumps = 2.0 * arm.levels(flat[0]).reshape(q.shape)
        x, v = np.zeros((2, lanes, joints, S.shape[-1]))
        x[..., :joints] = v[..., joints : 2 * joints] = np.eye(joints)
        found = np.zeros((lanes, n, joints, S.shape[-1]))
        found[:, 0] = x
        for k in range(1, n):
            Mm, Cm, Km, Sm = ((X[:, k - 1] + X[:, k]) / 2 for X in (M, C, K, S))
            held = rests[:, k]
            # trapezoidal rule, with rows of axes at rest replaced by those of no velocity
            left = Mm / step + Cm / 2 + step / 4 * Km
            right = (Mm / step - Cm / 2 - step / 4 * Km) @ v - Km @ x - Sm
            left = np.where(held[..., None] | held[:, None], np.eye(joints), left)
            after = np.linalg.solve(left, np.where(held[..., None], 0.0, right))
            x += step / 2 * (np.where(held[..., None], 0.0, v) + after)
            v = np.asarray(after)
            found[:, k] = x
            for lane, axis in np.argwhere(qd[:, k - 1] * qd[:, k] < 0).tolist():
                a, forth = qdd[lane, max(k - 2, 0), axis], np.sign(qd[lane, k, axis])
                jump = -np.linalg.inv(M[lane, k])[:, axis] * forth * jumps[lane, k, axis]
                with np.errstate(divide="ignore"):  # no acceleration: a jump of any size is large
                    share = np.clip(jump[axis] / a, -1.0, 0.0) / jump[axis] if jump[axis] else 0.0
                v[lane] += share * jump[:, None] * v[lane, axis]
        return found


def _linearised(model: Model, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
    """Return derivatives of torque by positions, velocities and accelerations, (n, n_j, n_j)."""
    robot, p = model.robot, model.values
    arm, joints, none = Arm(model), robot.n_joints, np.zeros_like(q)

    def torque(q: Array, qd: Array) -> Array:
        return inverse_dynamics(robot, p, q, qd, qdd)

    by_q, by_qd = np.empty((2, len(q), joints, joints))
    for axis, unit in enumerate(SMALL * np.eye(joints)):
        by_q[:, :, axis] = torque(q + unit, qd) - torque(q - unit, qd)
        by_qd[:, :, axis] = torque(q, qd + unit) - torque(q, qd - unit)
    by_q, by_qd = by_q / (2 * SMALL), by_qd / (2 * SMALL)
    by_qd += arm.slopes(q, qd)
    mass, _ = arm.mass_and_bias(q, none)
    return by_q, by_qd, mass


def refine(
    model: Model,
    recorded: Recorded,
    *,
    controller: Controller | None = None,
    restart: float | None = None,
) -> Model:
    """Refine a model by simulation, if that reduces the position error of held-out stretches.

    Parameters
    ----------
    model : Model
        Model of the same recordings; friction of all axes is known.
    recorded : iterable of (RecordedMotion, Recording)
    controller : Controller, optional
        As in `hil.replay`.
    restart : float, optional
        Length of a stretch [s]; by default `SHORT` under gravity, otherwise a quarter
        of the longest recording.

    Raises
    ------
    NotEnoughData
        Fewer than four stretches, unknown friction, or a law that cannot be simulated.
    """
    recorded = tuple(recorded)
    length = restart or _length(model, [each for _, each in recorded])
    lanes = Lanes.create(recorded, model, controller, length).thinned(MOST)
    n = len(lanes.starts)
    if n < HELD_OUT:
        raise NotEnoughData(
            f"{n} stretches of {length:.2g} s; refinement by simulation needs {HELD_OUT}: record"
            " longer, or omit --refine"
        )
    early, late = np.split(np.arange(n), [n - max(1, n // HELD_OUT)])
    begun = model
    try:
        simulations, start, friction = _start(model, lanes)
    except Indefinite:
        model = possible(model)
        simulations, start, friction = _start(model, lanes)
        friction += ", beginning with the nearest possible bodies"
    scale = np.sqrt(start.errors[early].mean(axis=0))
    weights = 1.0 / np.where(scale > 0, scale, np.inf)
    refined, directions, _ = _minimised(simulations, start, early, weights)
    before, after = (np.sqrt(each.errors[late].mean(axis=0)) for each in (start, refined))
    gain, scatter = _gain(start.errors[late], refined.errors[late])
    kept = gain > scatter and refined.lost <= start.lost
    found = start.model if simulations.layout.replaced else begun
    if kept:
        best, directions, covariance = _minimised(simulations, refined, np.arange(n), weights)
        found = simulations.layout.model_at(best.p, covariance)
        degrees = np.minimum(found.degrees_of_freedom, n - 1.0)
        found = replace(found, degrees_of_freedom=degrees)
    record = Refinement(
        start_digest=begun.digest,
        kept=kept,
        friction=friction,
        start=tuple(before.tolist()),
        refined=tuple(after.tolist()),
        stretches=n,
        held_out=len(late),
        length=length,
        directions=(directions.shape[1], len(start.p)),
    )
    return replace(found, refinement=record)


def _length(model: Model, recordings: Sequence[Recording]) -> float:
    """Return the default length of a stretch [s]."""
    q = np.vstack([each.q[each.fresh][::100] for each in recordings])
    if np.any(np.abs(model.gravity(q)) > np.nan_to_num(model.residual)):
        return SHORT
    longest = max(recordings, key=lambda each: float(np.ptp(each.time)))
    return (float(np.ptp(longest.time)) - INITIAL * longest.period) / HELD_OUT


def _start(model: Model, lanes: Lanes) -> tuple[Simulations, Fit, str]:
    """Return simulations with the model's law, or with plain terms where those simulate better.

    Plain terms are used where the mean difference of the stretches' errors exceeds twice its
    standard error.
    """
    law, plain_terms = (Simulations(Layout(model, plain=each), lanes) for each in (False, True))
    by_law = law.run(law.layout.start)
    if law.layout.plain:
        return law, by_law, "friction by the chosen law"
    by_plain = plain_terms.run(plain_terms.layout.start)
    gain, scatter = _gain(by_law.errors, by_plain.errors)
    if gain > TWICE * scatter:
        ratio = 1.0 / np.sqrt(1.0 - gain / np.count_nonzero(by_law.errors.mean(axis=0)))
        why = f"friction by plain terms; the chosen law simulates {ratio:.3g} times their error"
        return plain_terms, by_plain, why
    return law, by_law, "friction by the chosen law"


def _gain(errors: Array, others: Array) -> tuple[float, float]:
    """Return the gain of other errors of stretches, with standard error.

    Errors are relative to the mean error of an axis. The scatter of a single stretch is unknown, 0.
    """
    scale = errors.mean(axis=0)
    apart = ((errors - others) / np.where(scale > 0, scale, np.inf)).sum(axis=1)
    scatter = float(np.std(apart, ddof=1)) / np.sqrt(len(apart)) if len(apart) > 1 else 0.0
    return float(apart.mean()), scatter


def _minimised(
    simulations: Simulations, start: Fit, lanes: Indices, weights: Array
) -> tuple[Fit, Array, Array]:
    """Return the fit of least error of some lanes, the moved directions, and the covariance.

    Directions are columns, in standard errors of the regression.
    """

    def gradients(fit: Fit) -> tuple[float, Array, Array]:
        """Return the sum of squares, and gradients of draws and information over the variance."""
        residuals, changes = simulations.response(fit, lanes, weights)
        total = sum(float(each @ each) for each in residuals)
        variance = total / sum(each.size for each in residuals)
        draws, information = [], []
        cuts = -(-FEW_BLOCKS // len(residuals))
        for left, change in zip(residuals, changes, strict=True):
            for part in np.array_split(np.arange(len(left)), cuts):
                draws.append(left[part] @ change[part])
                information.append(change[part].T @ change[part])
        return total, np.array(draws) / variance, np.array(information) / variance

    roots, best = simulations.layout.roots, start
    cost, draws, parts = gradients(best)
    information = parts.sum(axis=0)
    effect = max(1.0, float(np.sum(draws**2) / np.trace(information)))
    values, vectors = np.linalg.eigh(information / effect)
    directions: Array = vectors[:, values > 1.0]
    for _ in range(ROUNDS):
        within = directions.T @ parts.sum(axis=0) @ directions
        step = -directions @ np.linalg.solve(within, directions.T @ draws.sum(axis=0))
        for _ in range(1 + CUTS):
            with suppress(NotEnoughData):  # steps too far leave no positive mass matrix
                tried = simulations.run(best.p + roots @ step)
                found = gradients(tried)
                if tried.lost <= best.lost and found[0] < cost:
                    break
            step = step / 4
        else:
            break
        best, (cost, draws, parts) = tried, found
        if np.abs(step).max() < SETTLED:
            break
    every = directions.T @ parts @ directions
    left_out = np.linalg.solve(every.sum(axis=0) - every, (draws @ directions)[..., None])[..., 0]
    scatter = (1.0 - 1.0 / len(draws)) * directions @ left_out.T @ left_out @ directions.T
    stays = np.eye(len(roots)) - directions @ directions.T
    return best, directions, roots @ (scatter + stays) @ roots.T
