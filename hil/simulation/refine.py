"""Output error: parameters for which the simulated motion fits the recorded one.

Starting from an identified model, base parameters and coefficients of friction move until the
simulated positions fit the recorded ones: nonlinear least squares of the position errors of pieces,
each axis weighed by its error at the start. A piece is as long as the start simulates all axes well
(`GOOD`), where errors are nearly linear in the parameters, and at most a share of the longest
recording, so that there are pieces to hold out.

The law of friction with the least torque error may simulate badly. Two laws are therefore refined:
that of the start and, if it has more terms, offset, Coulomb and viscous friction alone. A third of
the pieces is held out, each third in turn if there are few. Each law is fitted to the others and
simulates the pieces held out. The law with the least sum of squared position errors there, weighed
as in the fit, is fitted to all pieces. If neither law has less than the start, the start is kept.

Errors of a simulation are torque errors integrated twice, so they are correlated over seconds. The
covariance is the sandwich of scores summed over blocks of time, with Bartlett's weights for
neighbouring blocks (Newey and West, Econometrica 55 (1987) 703-708).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.free_motion.result import FreeMotionFit
from hil.friction.law import TermValue
from hil.friction.terms import CLASSICAL, USUAL
from hil.least_squares.solving import inverse
from hil.model.dynamics import regressor
from hil.results.band_residual import band_residual
from hil.results.recorded_torque import convert_torques
from hil.results.refined import Refined
from hil.runs.pooling import pooled
from hil.simulation.arm import Arm
from hil.simulation.lanes import Lanes, Motion, Piece, sensitivities, simulate
from hil.simulation.replay import INITIAL, LOST, initial_state, recorded_drive, stretches

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array, Indices
    from hil.friction.law import AxisLaw
    from hil.results.model import Model
    from hil.runs.recording import Recording
    from hil.runs.run import Run
    from hil.simulation.arm import Drive

GOOD = 0.1
"""Largest error of the start within a piece, relative to the largest range of like axes."""
SHORTEST, LONGEST = 0.5, 32.0
"""Lengths of pieces [s]; tried in steps of a factor of two."""
FREE = 10.0
"""Standard deviation of the prior of all unknowns about the start, in its standard errors: keeps
parameters without effect on the motion."""
EVALUATIONS = 12
"""Maximum number of simulations of a fit."""
ENOUGH = 1e-3
"""Relative change of the sum of squares at which a fit ends."""
FOLDS = 3
"""Number of folds; one is held out."""
MANY = 12
"""Number of pieces from which a single fold is enough."""
DIVERGED = 1e3
"""Error of a diverged simulation, relative to the start's."""
BLOCKS = 16
"""Minimum number of blocks for the covariance."""
FRICTION: tuple[Literal["law"], Literal["plain"]] = "law", "plain"
"""Refined laws of friction: that of the start; offset, Coulomb and viscous friction, if fewer."""


class _Source(NamedTuple):
    """Samples of an uninterrupted stretch, with the drive of the arm."""

    recording: Recording
    drive: Drive
    samples: Indices


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """Parameters of a model that move.

    Attributes
    ----------
    base : ndarray of int
        Identified base parameters.
    terms : list of (int, str)
        Axis from 0 and name of each coefficient of friction; those of coupled motors follow.
    start, errors : ndarray, shape (n_unknowns,)
        Values of the model and their standard errors; a tenth of the value of a coefficient without
        standard error.
    """

    model: Model
    base: Indices
    terms: list[tuple[int, str]]
    start: Array
    errors: Array

    @classmethod
    def create(cls, model: Model) -> _Unknowns:
        """Collect the unknowns of a model."""
        base, law = np.flatnonzero(model.identified), model.friction_law
        known = [(axis, each) for axis, each in enumerate(law.axes) if each is not None]
        friction = [value for _, each in known for value in each.terms.values()] + law.motor_terms
        errors = [each.standard_error or 0.1 * abs(each.value) for each in friction]
        start = np.concatenate([model.values[base], [each.value for each in friction]])
        found = np.concatenate([model.standard_errors[base], errors])
        return cls(
            model, base, [(axis, name) for axis, each in known for name in each.terms], start,
            np.maximum(found, 1e-6 * np.abs(start) + 1e-12),
        )  # fmt: skip

    def model_at(self, x: Array, V: Array) -> Model:
        """Return the model with values `x` of the unknowns and their covariance `V`."""
        model, n = self.model, len(self.base)
        values, scatter = model.values.copy(), model.scatter_covariance.copy()
        values[self.base], scatter[np.ix_(self.base, self.base)] = x[:n], V[:n, :n]
        owners = np.array([axis for axis, _ in self.terms], dtype=int)
        axes = tuple(
            each and self._law(each, x, V, n + np.flatnonzero(owners == axis))
            for axis, each in enumerate(model.friction_law.axes)
        )
        own = zip(x[n + len(owners) :], np.diag(V)[n + len(owners) :], strict=True)
        motors = iter([TermValue.estimated(*each) for each in own])
        coupled = tuple(
            each.model_copy(update={"viscous": next(motors), "coulomb": next(motors)})
            for each in model.friction_law.coupled
        )
        law = {"axes": axes, "coupled": coupled}
        details = model.details
        if isinstance(details, FreeMotionFit):
            details = details.model_copy(update=law)
        return replace(
            model, values=values, scatter_covariance=scatter, details=details,
            friction_law=model.friction_law.model_copy(update=law),
        )  # fmt: skip

    def _law(self, law: AxisLaw, x: Array, V: Array, places: Indices) -> AxisLaw:
        """Return the law of an axis whose terms have these places among the unknowns."""
        own = V[np.ix_(places, places)]
        beside = np.zeros((len(places), len(self.model.values)))
        beside[:, self.base] = V[places, : len(self.base)]
        covariance, shared = (tuple(map(tuple, each.tolist())) for each in (own, beside))
        terms = TermValue.named(law.terms, x[places], own)
        return law.model_copy(update={"terms": terms, "covariance": covariance, "beside": shared})

    def arm_at(self, x: Array) -> Arm:
        """Return the arm with values `x` of the unknowns."""
        return Arm(self.model_at(x, np.diag(self.errors**2)))

    def columns(self, arm: Arm, q: Array, qd: Array, qdd: Array, load: Array) -> Array:
        """Return the torque per unknown, as `hil.simulation.lanes.sensitivities` takes it."""
        bodies = regressor(self.model.robot, q, qd, qdd)[..., self.base]
        own = arm.laws.columns(q, qd, np.where(qd < 0, -1.0, 1.0), load)
        coupled = arm.elements[self.model.robot.n_joints :]
        friction = np.zeros((*q.shape, len(self.terms) + 2 * len(coupled)))
        for k, (axis, name) in enumerate(self.terms):
            friction[..., axis, k] = own[..., axis, arm.laws.names.index(name)]
        for k, row in enumerate(coupled):
            place, turning = len(self.terms) + 2 * k, (qd @ row)[..., None]
            friction[..., place], friction[..., place + 1] = turning * row, np.sign(turning) * row
        return np.concatenate([bodies, friction], axis=-1)


class _Fit:
    """Position errors of pieces, weighed by axis, as a function of the unknowns."""

    def __init__(self, unknowns: _Unknowns, pieces: Sequence[Piece], weights: Array) -> None:
        self._unknowns, self._weights = unknowns, weights
        self._lanes = Lanes.create(pieces, Arm(unknowns.model))
        self._there = ~np.isnan(self._lanes.recorded)
        self._last: tuple[Array, Arm, Motion] | None = None

    def _simulated(self, x: Array) -> tuple[Arm, Motion]:
        """Simulate; once for the same values."""
        if self._last is None or not np.array_equal(x, self._last[0]):
            arm = self._unknowns.arm_at(x)
            with np.errstate(all="ignore"):
                self._last = x.copy(), arm, simulate(arm, self._lanes)
        return self._last[1:]

    def error(self, x: Array) -> Array:
        """Weighed errors, 0 beyond the end of a piece, shape (S, L, n)."""
        _, motion = self._simulated(x)
        error = (motion.q[1:] - self._lanes.recorded) * self._weights
        error = np.nan_to_num(error, nan=DIVERGED, posinf=DIVERGED, neginf=-DIVERGED)
        return np.where(self._there, error, 0.0)

    def slope(self, x: Array) -> Array:
        """Derivatives of `error`, shape (S, L, n, n_unknowns)."""
        arm, motion = self._simulated(x)
        with np.errstate(all="ignore"):
            found = sensitivities(
                arm, self._lanes, motion, lambda *state: self._unknowns.columns(arm, *state)
            )
        return np.where(self._there, 1.0, 0.0)[..., None] * np.nan_to_num(
            found * self._weights[:, None]
        )

    def squares(self, x: Array) -> Array:
        """Mean squared error of each axis, weighed, shape (n,)."""
        squares = (self.error(x) ** 2).sum(axis=(0, 1))
        return np.asarray(squares / np.maximum(self._there.sum(axis=(0, 1)), 1))

    def solve(self, progress: Callable[[str], None]) -> Array:
        """Fit the unknowns."""
        from scipy.optimize import least_squares  # noqa: PLC0415 - takes long to load

        start, scale = self._unknowns.start, FREE * self._unknowns.errors

        def error(u: Array) -> Array:
            found = self.error(start + scale * u)
            progress(f"position error {np.sqrt(np.mean(found**2)):.3g} of the start's")
            return np.concatenate([found.ravel(), u])

        def slope(u: Array) -> Array:
            found = self.slope(start + scale * u)
            return np.vstack([found.reshape(-1, len(u)) * scale, np.eye(len(u))])

        found = least_squares(
            error, np.zeros_like(start), slope, method="lm", x_scale="jac", ftol=ENOUGH, xtol=1e-6,
            max_nfev=EVALUATIONS,
        )  # fmt: skip
        return np.asarray(start + scale * found.x)

    def covariance(self, x: Array) -> tuple[Array, float]:
        """Return the covariance of the unknowns by blocks of time, and its degrees of freedom."""
        scale, slope = self._unknowns.errors, self.slope(x)
        lanes = np.einsum("slnk,sln->lsk", slope, self.error(x)) * scale
        parts = [each for lane in lanes for each in np.array_split(lane, -(-BLOCKS // len(lanes)))]
        scores = np.array([part.sum(axis=0) for part in parts])
        n, reach = len(scores), round(len(scores) ** (1 / 3))
        meat = scores.T @ scores
        for k in range(1, reach + 1):
            cross = scores[k:].T @ scores[:-k]
            meat += (1 - k / (reach + 1)) * (cross + cross.T)
        J, prior = slope.reshape(-1, len(x)) * scale, np.eye(len(x)) / FREE**2
        bread = inverse(J.T @ J + prior)
        covariance = bread @ (n / (n - 1) * meat + prior) @ bread
        return scale[:, None] * covariance * scale, float(n - 1)


def refine(
    runs: Sequence[Run], model: Model, progress: Callable[[str], None] = lambda _: None
) -> Model:
    """Fit a model's simulated motion to the recordings of its runs.

    Parameters
    ----------
    runs : sequence of Run
    model : Model
        The start.
    progress : callable
        Takes the position error of each simulation.

    Returns
    -------
    Model
        The refined model, or the start if no law simulates held-out pieces better; `refined` says
        which.

    Raises
    ------
    NotEnoughData
        Recordings are too short, or the start leaves all of them within `SHORTEST`.
    """
    start = _Unknowns.create(model)
    sources = [source for run in runs for source in _sources(run, model)]
    length = _length(model, sources)
    pieces = _cut(sources, length)
    size = np.sqrt(_Fit(start, pieces, np.ones(model.robot.n_joints)).squares(start.start))
    weights = 1.0 / np.maximum(size, max(0.01 * size.max(), 1e-12))
    laws = [start]
    if any(each and set(each.terms) - set(CLASSICAL) for each in model.friction_law.axes):
        laws.append(_Unknowns.create(_simplify_friction(model)))
    before, *errors = _held_out(laws, pieces, weights, progress)
    best = int(np.argmin([each.sum() for each in errors]))
    ratio = float(np.sqrt(errors[best].sum() / before.sum()))
    record = Refined(
        kept=ratio < 1.0, friction=FRICTION[best], length=length, ratio=ratio,
        before=tuple((np.sqrt(before) / weights).tolist()),
        after=tuple((np.sqrt(errors[best]) / weights).tolist()),
    )  # fmt: skip
    if not record.kept:
        return replace(model, refined=record)
    fit = _Fit(laws[best], pieces, weights)
    x = fit.solve(progress)
    covariance, degrees = fit.covariance(x)
    found = laws[best].model_at(x, covariance)
    return replace(
        found, refined=record, band_residual=band_residual(found, tuple(pooled(runs))),
        degrees_of_freedom=np.full_like(model.degrees_of_freedom, degrees),
    )  # fmt: skip


def _simplify_friction(model: Model) -> Model:
    """Return the model with offset, Coulomb and viscous friction of each axis alone."""
    update = {"law": USUAL, "presliding": 0.0, "covariance": (), "beside": (), "held_out": {}}
    axes = tuple(
        each and each.model_copy(update=update | {"terms": each.plain})
        for each in model.friction_law.axes
    )
    return replace(model, friction_law=model.friction_law.model_copy(update={"axes": axes}))


def _sources(run: Run, model: Model) -> list[_Source]:
    found = []
    for each in run:
        recording = convert_torques(model, each.measurement, each.recording)
        drive = recorded_drive(model, each.measurement, recording, None)
        found += [_Source(recording, drive, samples) for samples in stretches(recording, None)]
    return found


def _held_out(
    laws: Sequence[_Unknowns],
    pieces: Sequence[Piece],
    weights: Array,
    progress: Callable[[str], None],
) -> Array:
    """Mean squared errors on held-out pieces, of the start and of each law, (1 + n_laws, n)."""
    found = []
    for fold in range(1 if len(pieces) >= MANY else FOLDS):
        held = pieces[fold::FOLDS]
        others = [each for k, each in enumerate(pieces) if k % FOLDS != fold]
        squares = [_Fit(laws[0], held, weights).squares(laws[0].start)]
        for law in laws:
            x = _Fit(law, others, weights).solve(progress)
            squares.append(_Fit(law, held, weights).squares(x))
        found.append(squares)
    return np.asarray(np.mean(found, axis=0))


def _cut(sources: Sequence[_Source], length: float) -> list[Piece]:
    """Pieces of about this length [s]."""
    pieces = []
    for recording, drive, samples in sources:
        duration = float(np.ptp(recording.time[samples]))
        for part in np.array_split(samples, max(1, round(duration / length))):
            if len(part) > 2 * INITIAL:
                time, q = recording.time[part], recording.q[part]
                # the jerk biases the velocity of a parabola, and thereby parameters
                state = initial_state(time, q, degree=3)
                pieces.append(Piece(*state, time[INITIAL // 2 :], q[INITIAL // 2 :], drive))
    return pieces


def _length(model: Model, sources: Sequence[_Source]) -> float:
    """Return the length of pieces [s] over which the start simulates all axes well."""
    turns, arm = model.robot.revolute, Arm(model)
    ranges = np.max([np.ptp(each.recording.q[each.samples], axis=0) for each in sources], axis=0)
    like = np.array([ranges[turns == each].max() for each in turns])
    limit = np.minimum(GOOD * like, [LOST[bool(each)] for each in turns])
    longest = max(np.ptp(each.recording.time[each.samples]) for each in sources)
    best, length = 0.0, SHORTEST
    while length <= min(LONGEST, 2 * longest) and len(pieces := _cut(sources, length)) >= FOLDS:
        lanes = Lanes.create(pieces, arm)

        def lost(k: int, q: Array, recorded: Array = lanes.recorded) -> bool:
            # no comparison holds for NaN, beyond the end of a piece
            return bool((np.abs(q - recorded[k]) > limit).any() or not np.isfinite(q).all())

        with np.errstate(all="ignore"):
            if len(simulate(arm, lanes, lost).rests) < len(lanes.steps):
                break
        best, length = length, 2 * length
    if not best:
        raise NotEnoughData(
            f"the simulation leaves the recordings within {SHORTEST:g} s, or fewer than {FOLDS}"
            " pieces of that length were recorded: identify from more motion, or see hil replay"
        )
    return min(best, float(longest / (2 * FOLDS)))
