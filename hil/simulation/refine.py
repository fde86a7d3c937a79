"""Output error: parameters for which the simulated motion fits the recorded one.

Starting from an identified model, base parameters and coefficients of friction move until the
simulated positions fit the recorded ones: nonlinear least squares of the position errors of pieces,
each axis weighed by its error at the start. A piece is as long as the start simulates it well
(`GOOD`): as long as errors are about linear in the parameters.

Errors of a simulation are torques integrated twice, so they agree over seconds. The covariance is
the sandwich of scores summed over blocks of time, with Bartlett's weights for neighbouring blocks
(Newey and West, Econometrica 55 (1987) 703-708).

A piece is at most a sixth of the longest recording. A third of the pieces is held out first, each
third in turn where there are few. If the parameters found from the others simulate these pieces
worse than the start, the start is kept; otherwise all pieces are fitted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import NotEnoughData
from hil.friction.law import CoupledFriction, TermValue
from hil.least_squares.solving import inverse
from hil.model.dynamics import regressor
from hil.results.band_residual import band_residual
from hil.results.recorded_torque import in_si
from hil.results.refined import Refined
from hil.runs.pooling import pooled
from hil.simulation.arm import Arm
from hil.simulation.lanes import Lanes, Piece, sensitivities, simulate
from hil.simulation.replay import INITIAL, LOST, drive_of, initial_state, stretches

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array, Indices
    from hil.results.model import Model
    from hil.runs.recording import Recording
    from hil.runs.run import Run
    from hil.simulation.arm import Drive
    from hil.simulation.replay import Controller

GOOD = 0.1
"""Largest error of the start within a piece, over the largest range of like axes."""
SHORTEST, LONGEST = 0.5, 32.0
"""Lengths of pieces [s]; tried in steps of a factor of two."""
FREE = 10.0
"""Standard errors of the start within which parameters that no motion shows stay about."""
EVALUATIONS = 12
"""Maximum number of simulations of a fit."""
ENOUGH = 1e-3
"""Relative change of the sum of squares at which a fit ends."""
FOLDS = 3
"""One of so many pieces is held out."""
MANY = 12
"""Number of pieces from which on those of one fold are enough to judge."""
AWAY = 1e3
"""Error of a simulation without an end, over the start's."""
BLOCKS = 16
"""Number of blocks for the covariance, at least."""


class _Source(NamedTuple):
    """Recording with what drives the arm, and the samples of a stretch."""

    recording: Recording
    drive: Drive
    samples: Indices


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """Parameters that move: identified base parameters, then friction of axes and of motors."""

    model: Model

    @cached_property
    def base(self) -> Indices:
        return np.flatnonzero(self.model.identified)

    @cached_property
    def terms(self) -> list[tuple[int, str]]:
        """Axis from 0 and term of each coefficient of friction."""
        law = self.model.friction_law
        axes = () if law is None else law.axes
        return [
            (axis, name)
            for axis, each in enumerate(axes)
            for name, term in (each.terms.items() if each else ())
            if term.value
        ]

    @cached_property
    def start(self) -> Array:
        return np.concatenate([self.model.values[self.base], [each.value for each in self._values]])

    @cached_property
    def errors(self) -> Array:
        """Standard errors, of friction that states none a tenth of its value."""
        friction = [each.standard_error or 0.1 * abs(each.value) for each in self._values]
        found = np.concatenate([self.model.standard_errors[self.base], friction])
        return np.maximum(found, 1e-6 * np.abs(self.start) + 1e-12)

    @property
    def _values(self) -> list[TermValue]:
        law = self.model.friction_law
        if law is None:
            return []
        own = [law.axes[axis].terms[name] for axis, name in self.terms]  # type: ignore[union-attr]
        return own + [part for each in law.coupled for part in (each.viscous, each.coulomb)]

    def model_at(self, x: Array, covariance: Array | None = None) -> Model:
        """Return the model with these values, and their covariance."""
        model, n = self.model, len(self.base)
        values = model.values.copy()
        values[self.base] = x[:n]
        scatter = model.scatter_covariance
        if covariance is not None:
            scatter = scatter.copy()
            scatter[np.ix_(self.base, self.base)] = covariance[:n, :n]
        law = model.friction_law
        if law is None:
            return replace(model, values=values, scatter_covariance=scatter)
        V = np.diag(self.errors**2) if covariance is None else covariance
        axes = list(law.axes)
        for axis in {axis for axis, _ in self.terms}:
            places = [k for k, (own, _) in enumerate(self.terms, n) if own == axis]
            axes[axis] = self._axis(axis, x, V, places, known=covariance is not None)
        first = n + len(self.terms)
        motors = TermValue.named(map(str, range(len(x))), x, V)
        coupled = tuple(
            CoupledFriction(
                motor=each.motor, joint=each.joint, viscous=motors[str(first + 2 * k)],
                coulomb=motors[str(first + 2 * k + 1)],
            )
            for k, each in enumerate(law.coupled)
        )  # fmt: skip
        update = {"axes": tuple(axes), "coupled": coupled}
        free = model.friction and model.friction.model_copy(update=update)
        return replace(
            model, values=values, scatter_covariance=scatter, friction=free,
            friction_law=law.model_copy(update=update),
        )  # fmt: skip

    def _axis(self, axis: int, x: Array, V: Array, places: list[int], *, known: bool) -> object:
        law = self.model.friction_law.axes[axis]  # type: ignore[union-attr]
        names = [self.terms[k - len(self.base)][1] for k in places]
        terms = law.terms | TermValue.named(names, x[places], V[np.ix_(places, places)])
        update: dict[str, object] = {"terms": terms}
        if known:
            at = [list(terms).index(name) for name in names]
            own, beside = (
                np.zeros((len(terms),) * 2),
                np.zeros((len(terms), len(self.model.values))),
            )
            own[np.ix_(at, at)] = V[np.ix_(places, places)]
            beside[np.ix_(at, self.base)] = V[places, : len(self.base)]
            rows = [tuple(map(tuple, each.tolist())) for each in (own, beside)]
            update |= {"covariance": rows[0], "beside": rows[1] if law.beside else ()}
        return law.model_copy(update=update)

    def columns(self, arm: Arm) -> Callable[[Array, Array, Array, Array], Array]:
        """Torque per unknown, as `hil.simulation.lanes.sensitivities` takes it."""
        robot, coupled = self.model.robot, arm.elements[self.model.robot.n_joints :]

        def found(q: Array, qd: Array, qdd: Array, load: Array) -> Array:
            bodies = regressor(robot, q, qd, qdd)[..., self.base]
            own = arm.laws.columns(q, qd, np.where(qd < 0, -1.0, 1.0), load)
            friction = np.zeros((*q.shape, len(self.terms) + 2 * len(coupled)))
            for k, (axis, name) in enumerate(self.terms):
                friction[..., axis, k] = own[..., axis, arm.laws.names.index(name)]
            for k, row in enumerate(coupled, len(self.terms)):
                turning = qd @ row
                place = 2 * k - len(self.terms)
                friction[..., place] = turning[..., None] * row
                friction[..., place + 1] = np.sign(turning)[..., None] * row
            return np.concatenate([bodies, friction], axis=-1)

        return found


class _Simulated(NamedTuple):
    """Position errors (S, L, n), weighed and 0 where there are none, and their derivatives."""

    error: Array
    slope: Array | None


class _Fit:
    """Weighed position errors of pieces, as a function of the unknowns."""

    def __init__(self, unknowns: _Unknowns, pieces: Sequence[Piece], weights: Array) -> None:
        self._unknowns, self._weights = unknowns, weights
        self.lanes = Lanes.of(pieces, Arm(unknowns.model))
        self._at: Array | None = None

    def simulated(self, x: Array, *, slopes: bool = True) -> _Simulated:
        """Simulate, once for the same values."""
        known = self._at is not None and np.array_equal(x, self._at)
        if not known or (slopes and self._found.slope is None):
            arm = Arm(self._unknowns.model_at(x))
            with np.errstate(all="ignore"):
                motion = simulate(arm, self.lanes)
                error = (motion.q[1:] - self.lanes.recorded) * self._weights
                slope = None
                if slopes:
                    slope = sensitivities(arm, self.lanes, motion, self._unknowns.columns(arm))
                    slope *= self._weights[:, None]
            there = ~np.isnan(self.lanes.recorded)
            error = np.where(there, np.nan_to_num(error, nan=AWAY, posinf=AWAY, neginf=AWAY), 0.0)
            if slope is not None:
                slope = np.where(there[..., None], np.nan_to_num(slope), 0.0)
            self._at, self._found = x.copy(), _Simulated(error, slope)
        return self._found

    def rms(self, x: Array) -> Array:
        """Root mean square error of each axis, weighed, shape (n,)."""
        error = self.simulated(x, slopes=False).error
        return np.asarray(np.sqrt((error**2).sum(axis=(0, 1)) / self._counts))

    @property
    def _counts(self) -> Array:
        return np.maximum((~np.isnan(self.lanes.recorded)).sum(axis=(0, 1)), 1)

    def solve(self, x: Array, progress: Callable[[str], None]) -> Array:
        """Fit the unknowns, from `x` on."""
        from scipy.optimize import least_squares  # noqa: PLC0415 - takes long to load

        start, scale = self._unknowns.start, FREE * self._unknowns.errors

        def error(u: Array) -> Array:
            found = self.simulated(start + scale * u).error
            progress(f"position error {np.sqrt(np.mean(found**2)):.3g} of the start's")
            return np.concatenate([found.ravel(), u])

        def slope(u: Array) -> Array:
            found = self.simulated(start + scale * u).slope
            return np.vstack([found.reshape(-1, len(u)) * scale, np.eye(len(u))])

        found = least_squares(
            error, (x - start) / scale, slope, method="lm", x_scale="jac", ftol=ENOUGH, xtol=1e-6,
            max_nfev=EVALUATIONS,
        )  # fmt: skip
        return np.asarray(start + scale * found.x)

    def covariance(self, x: Array) -> tuple[Array, float]:
        """Covariance of the unknowns by blocks of time, and its degrees of freedom."""
        found = self.simulated(x)
        each = np.einsum("slnk,sln->lsk", found.slope, found.error)
        per_lane = -(-BLOCKS // each.shape[0])
        blocks = [part.sum(axis=0) for lane in each for part in np.array_split(lane, per_lane)]
        scale = self._unknowns.errors
        scores = np.array(blocks) * scale
        J = found.slope.reshape(-1, len(x)) * scale
        N = J.T @ J + np.eye(len(x)) / FREE**2
        n, reach = len(scores), max(1, round(len(scores) ** (1 / 3)))
        meat = scores.T @ scores
        for k in range(1, reach + 1):
            cross = scores[k:].T @ scores[:-k]
            meat += (1 - k / (reach + 1)) * (cross + cross.T)
        meat *= n / max(n - 1, 1)
        meat += np.eye(len(x)) / FREE**2
        bread = inverse(N)
        covariance = scale[:, None] * (bread @ meat @ bread) * scale
        return covariance, float(n - 1)


def refine(
    runs: Sequence[Run],
    model: Model,
    controller: Controller | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Model:
    """Fit a model's simulated motion to the recordings of its runs.

    Parameters
    ----------
    runs : sequence of Run
    model : Model
        The start.
    controller : Controller, optional
        As of `hil.simulation.replay.replay`; by default drives repeat the recorded torques.
    progress : callable
        Takes what is being done.

    Returns
    -------
    Model
        The refined one, or the start where that simulates held-out recordings better; `refined`
        says which.

    Raises
    ------
    NotEnoughData
        Recordings are too short, or the start leaves all of them within `SHORTEST`.
    """
    unknowns = _Unknowns(model)
    sources = [source for run in runs for source in _sources(run, model, controller)]
    longest = max(np.ptp(each.recording.time[each.samples]) for each in sources)
    length = min(_length(unknowns, sources), float(longest / (2 * FOLDS)))
    pieces = _cut(sources, length)
    size = _Fit(unknowns, pieces, np.ones(model.robot.n_joints)).rms(unknowns.start)
    weights = 1.0 / np.maximum(size, max(0.01 * size.max(), 1e-12))
    before, after = _held_out(unknowns, pieces, weights, progress)
    record = Refined(
        kept=bool((after * weights).sum() < (before * weights).sum()), length=length,
        before=tuple(np.sqrt(before).tolist()), after=tuple(np.sqrt(after).tolist()),
    )  # fmt: skip
    if not record.kept:
        return replace(model, refined=record)
    whole = _Fit(unknowns, pieces, weights)
    x = whole.solve(unknowns.start, progress)
    covariance, degrees = whole.covariance(x)
    found = unknowns.model_at(x, covariance)
    recorded = tuple(pooled(runs))
    return replace(
        found, refined=record, band_residual=band_residual(found, recorded),
        degrees_of_freedom=np.full_like(model.degrees_of_freedom, degrees),
    )  # fmt: skip


def _sources(run: Run, model: Model, controller: Controller | None) -> list[_Source]:
    found = []
    for each in run:
        recording = in_si(model, each.measurement, each.recording)
        drive = drive_of(model, each.measurement, recording, controller)
        found += [_Source(recording, drive, samples) for samples in stretches(recording, None)]
    return found


def _held_out(
    unknowns: _Unknowns, pieces: list[Piece], weights: Array, progress: Callable[[str], None]
) -> tuple[Array, Array]:
    """Mean squares of each axis on pieces held out: of the start, and of what the others give."""
    found = []
    for fold in range(1 if len(pieces) >= MANY else FOLDS):
        held = pieces[fold::FOLDS]
        x = _Fit(
            unknowns, [each for k, each in enumerate(pieces) if k % FOLDS != fold], weights
        ).solve(unknowns.start, progress)
        judge = _Fit(unknowns, held, weights)
        found.append([(judge.rms(each) / weights) ** 2 for each in (unknowns.start, x)])
    before, after = np.mean(found, axis=0)
    return before, after


def _cut(sources: Sequence[_Source], length: float) -> list[Piece]:
    """Pieces of about this length [s]."""
    pieces = []
    for recording, drive, samples in sources:
        long = recording.time[samples[-1]] - recording.time[samples[0]]
        for part in np.array_split(samples, max(1, round(long / length))):
            if len(part) > 2 * INITIAL:
                time, q = recording.time[part], recording.q[part]
                middle = INITIAL // 2
                # a parabola's velocity is off by the jerk, which shifts short pieces and parameters
                state = initial_state(time, q, degree=3)
                pieces.append(Piece(*state, time[middle:], q[middle:], drive))
    return pieces


def _length(unknowns: _Unknowns, sources: Sequence[_Source]) -> float:
    """Length of pieces [s] over which the start simulates all axes well."""
    robot = unknowns.model.robot
    ranges = np.max([np.ptp(each.recording.q[each.samples], axis=0) for each in sources], axis=0)
    like = [ranges[robot.revolute == turns].max() for turns in robot.revolute]
    limit = np.minimum(GOOD * np.array(like), [LOST[bool(turns)] for turns in robot.revolute])
    arm, best, length = Arm(unknowns.model), 0.0, SHORTEST
    longest = max(np.ptp(each.recording.time[each.samples]) for each in sources)
    while length <= LONGEST:
        pieces = _cut(sources, length)
        if len(pieces) < FOLDS:
            break
        lanes = Lanes.of(pieces, arm)

        def lost(k: int, q: Array, recorded: Array = lanes.recorded) -> bool:
            # a comparison with NaN holds for none: beyond the end of a piece nothing is lost
            return bool((np.abs(q - recorded[k]) > limit).any() or not np.isfinite(q).all())

        with np.errstate(all="ignore"):
            if simulate(arm, lanes, lost) is None:
                break
        best = length
        if length >= longest:
            break
        length *= 2
    if not best:
        raise NotEnoughData(
            f"the simulation leaves the recordings within {SHORTEST:g} s, or fewer than {FOLDS}"
            " pieces of that length were recorded: identify from more motion, or see hil replay"
        )
    return best
