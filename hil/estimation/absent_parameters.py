"""Test for link parameters wrongly declared absent in the robot file.

A robot file states the present link parameters. A parameter missing by mistake is not in the base
parameters, so its torque remains in the residuals (the paper's Fig. 7). Here the measurements are
condensed once for the robot with all ten parameters of every link, p_all = K_all p_standard, in
which the stated model is the linear subspace p_all = T p. Each absent parameter adds one direction
u, its column of K_all,

    p_all = T p + u delta;

delta is estimated together with p by the same least squares. The test statistic is delta over its
standard error, from leaving out one measurement at a time, so that differences between measurements
count as error (`hil.least_squares.uncertainty`). A direction in the span of T is absorbed: the
parameter has no visible effect. Directions equal up to the span of T, or not distinguished by the
given measurements, form one candidate.

After inclusion of the strongest candidate all others are tested again: candidates similar to the
included one lose significance. This is repeated until nothing is significant at `SIGNIFICANCE`,
divided among all candidates (Bonferroni).

A missing centre of mass shows as a phase shift of a gravity torque (the paper's Fig. 7). Gravity is
linear in the sine and cosine of each joint angle, so the gravity torque of one axis over the angle
of another is a sinusoid, determined by its values at three angles. A parameter missing in the robot
file shifts the sinusoid. Every pair of axes is examined at the measured configuration with the
largest stated sinusoid, and the pair with the largest shift is shown; among similar shifts the one
with the weakest motor, whose friction hides least.

A measurement at another configuration is transferred to the shown one: its value is the extended
model there, plus its own residual of the extended model, less the mean residual of all
measurements, which is direction-dependent friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from checked_files.yaml_file import FileModel
from hil.estimation.simultaneous import SimultaneousFit
from hil.least_squares.solving import eliminated, orthonormal, project_out, shares_without_nuisance
from hil.least_squares.uncertainty import correlation_of, leave_one_out
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import gravity_torque

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.estimate import Estimate
    from hil.estimation.local_fits import LocalValue
    from hil.estimation.signals import Prepared
    from hil.model.robot import Robot


SIGNIFICANCE = 0.001
"""Probability of a false finding for a complete robot file."""
ALIKE = 0.98
"""Smallest correlation between indistinguishable candidates."""
_SEEN = 1e-4
"""Smallest share of a visible direction's information left when stated parameters are estimated."""
_SAME = 1e-6
SEEN = 0.005
"""Smallest relevant shift [rad]; below, a missing parameter acts by its inertia only."""


class Candidate(FileModel):
    """Link parameters missing in the robot file, or a group of indistinguishable ones.

    Attributes
    ----------
    names : tuple of str
        Standard parameters, nearest to the base first.
    value, standard_error : float
        Estimate for the first name, with no other candidate included [kg m^2, kg m or kg].
    t : float
        Ratio of value to standard error.
    p_value : float
        Probability of a ratio at least as large by chance.
    beside : float, optional
        t in a fit with all significant candidates; None for significant candidates.
    """

    names: tuple[str, ...]
    value: float
    standard_error: float
    t: float
    p_value: float
    beside: float | None = None

    @property
    def label(self) -> str:
        """Joined names: ``sy4 or sz5``."""
        return " or ".join(self.names)


@dataclass(frozen=True, slots=True, eq=False)
class ModelErrors:
    """Missing link parameters required by the data, and stated ones not required.

    Attributes
    ----------
    complete : Robot
        The robot with all link parameters present.
    stated : ndarray, shape (n_all, n_base)
        T: base parameters of the robot file as those of `complete`.
    alone : tuple of Candidate
        Candidates tested separately, strongest evidence first.
    found : tuple of Candidate
        Significant candidates, each tested with the preceding ones included.
    p : ndarray, shape (n_base,)
        Stated parameters with `found` included.
    p_all : ndarray, shape (n_all,)
        Base parameters of `complete` with `found` included.
    p_values : ndarray, shape (n_base,)
        p-values of the stated parameters for the hypothesis zero.
    absorbed : tuple of str
        Missing parameters without visible effect in any measurement.
    unmeasured : tuple of str
        Missing parameters not identifiable from the given measurements.
    threshold : float
        Largest p-value of a significant candidate.
    """

    complete: Robot
    stated: Array
    alone: tuple[Candidate, ...]
    found: tuple[Candidate, ...]
    p: Array
    p_all: Array
    p_values: Array
    absorbed: tuple[str, ...]
    unmeasured: tuple[str, ...]
    threshold: float


def examine(robot: Robot, prepared: Prepared) -> ModelErrors:
    """Test the link parameters not stated in the robot file, and the stated ones."""
    whole = robot.free_links()
    K = base_parameters(whole).matrix
    stated = K @ base_parameters(robot).placement
    shares = SimultaneousFit(whole, prepared).shares
    measured = _Measured(*shares_without_nuisance(shares.N, shares.v, len(K)))
    # columns of K of visible missing parameters, and names of invisible ones
    inside, _ = orthonormal(stated)
    shown, absorbed = {}, []
    for name, u in zip(robot.standard_parameters, K.T, strict=True):
        if name in robot.present and name not in robot.ties:
            continue
        if np.linalg.norm(project_out(inside, u)) > _SAME:
            shown[name] = u
        elif name not in robot.ties:
            absorbed.append(name)
    # distinguishable candidates, and names of unidentifiable parameters
    names, U = list(shown), np.array(list(shown.values())).T.reshape(len(stated), -1)
    kept_out, total = measured.information(stated, U)
    seen = np.diag(kept_out) > _SEEN * np.diag(total)
    alike = np.abs(correlation_of(kept_out)) > ALIKE
    groups: dict[int, list[int]] = {}
    for k in np.flatnonzero(seen):
        first = next((g for g in groups if alike[g, k]), int(k))
        groups.setdefault(first, []).append(int(k))
    candidates = {tuple(names[k] for k in members): U[:, g] for g, members in groups.items()}
    unmeasured = tuple(name for name, k in zip(names, seen, strict=True) if not k)
    threshold = SIGNIFICANCE / max(len(candidates), 1)
    alone = _tested(measured, stated, candidates)
    found: list[Candidate] = []
    basis, rest = stated, alone
    # maximum number of included candidates
    while rest and rest[0].p_value < threshold and len(found) < 6:
        found.append(rest[0])
        basis = np.column_stack([basis, candidates[rest[0].names]])
        taken = [candidate.names for candidate in found]
        left = {names: u for names, u in candidates.items() if names not in taken}
        rest = _tested(measured, basis, left)
    value, error, p_value = measured.solve(basis)
    n, beside = stated.shape[1], {each.names: each.t for each in rest} if found else {}
    return ModelErrors(
        complete=whole,
        stated=stated,
        alone=tuple(each.model_copy(update={"beside": beside.get(each.names)}) for each in alone),
        found=tuple(
            _candidate(each.names, *row)
            for each, *row in zip(found, value[n:], error[n:], p_value[n:], strict=True)
        ),
        p=value[:n],
        p_all=basis @ value,
        p_values=p_value[:n],
        absorbed=tuple(absorbed),
        unmeasured=unmeasured,
        threshold=threshold,
    )


class _Measured(NamedTuple):
    """Contributions of the measurements to the normal equations of the complete robot."""

    shares: Array
    sides: Array

    def information(self, basis: Array, directions: Array) -> tuple[Array, Array]:
        """Return information on `directions`, (k, k): adjusted for `basis`, and not adjusted."""
        X, k = np.column_stack([directions, basis]), directions.shape[1]
        N = X.T @ self.shares.sum(axis=0) @ X
        return eliminated(N, basis.shape[1])[0], N[:k, :k]

    def solve(self, basis: Array) -> tuple[Array, Array, Array]:
        """Solve for coefficients of `basis`, standard errors and p-values, shape (k,) each."""
        x, covariance, degrees = leave_one_out(basis.T @ self.shares @ basis, self.sides @ basis)
        error = np.sqrt(np.diag(covariance))
        return x, error, np.asarray(2 * special.stdtr(degrees, -np.abs(x) / error))


def _tested(
    measured: _Measured, basis: Array, candidates: dict[tuple[str, ...], Array]
) -> list[Candidate]:
    """Test every candidate separately with `basis`, and sort by evidence."""
    tested = []
    for names, u in candidates.items():
        own, whole = measured.information(basis, u[:, np.newaxis])
        if own[0, 0] > _SEEN * whole[0, 0]:
            value, error, p_value = measured.solve(np.column_stack([basis, u]))
            tested.append(_candidate(names, value[-1], error[-1], p_value[-1]))
    return sorted(tested, key=lambda candidate: (candidate.p_value, -abs(candidate.t)))


def _candidate(names: tuple[str, ...], value: float, error: float, p_value: float) -> Candidate:
    figures = {"value": value, "standard_error": error, "t": value / error, "p_value": p_value}
    return Candidate(names=names, **{name: float(each) for name, each in figures.items()})


class Sinusoid(NamedTuple):
    """Sinusoid mean + cosine cos(angle) + sine sin(angle) [N m]."""

    mean: float
    cosine: float
    sine: float

    def evaluate(self, angle: Array) -> Array:
        """Return the torque at angles [rad]."""
        return self.mean + self.cosine * np.cos(angle) + self.sine * np.sin(angle)

    @property
    def amplitude(self) -> float:
        """Amplitude [N m]."""
        return float(np.hypot(self.cosine, self.sine))

    def phase_against(self, other: Sinusoid) -> float:
        """Return the phase lead over another sinusoid [rad], within +- pi."""
        own, others = (complex(s.cosine, -s.sine) for s in (self, other))
        return float(np.angle(own / others)) if others else 0.0


class Phase(FileModel):
    """Gravity torque over a joint angle: stated, extended and measured.

    Attributes
    ----------
    axis, over : int
        Axis of the torque, axis of the varied angle; from 1.
    q : tuple of float
        Configuration; the angle of `over` is varied [rad].
    stated, extended : Sinusoid
        Sinusoid of the robot file, and sinusoid with the missing parameters.
    angle, torque : tuple of float
        Measurements of the axis, transferred to configuration `q` [rad], [N m].
    standard_error : tuple of float
        Standard errors by the scatter within each measurement; None if unknown [N m].
    """

    axis: int
    over: int
    q: tuple[float, ...]
    stated: Sinusoid
    extended: Sinusoid
    angle: tuple[float, ...]
    torque: tuple[float, ...]
    standard_error: tuple[float | None, ...]

    @property
    def shift(self) -> float:
        """Phase of the extended sinusoid less that of the stated one [rad]."""
        return self.extended.phase_against(self.stated)


def shifted_most(best: Estimate, errors: ModelErrors, torque_limit: Array) -> Phase | None:
    """Find the pair of axes with the largest phase shift; None without a gravity effect."""
    local = [value for value in best.local if value.symbol == "g"]
    largest = [
        # the measurement with the largest stated sinusoid over the angle, and both sinusoids
        max(
            ((v, over, *_sinusoids(errors, v.q, v.axis, over)) for v in local if v.axis == axis),
            key=lambda each: each[2].amplitude,
        )
        for axis in {value.axis for value in local}
        for over in range(errors.complete.n_joints)
        if over != axis
    ]
    # smallest usable amplitude for a phase [N m]
    clear = [each for each in largest if each[2].amplitude > 0.5] or largest
    shifts = [abs(extended.phase_against(stated)) for *_, stated, extended in clear]
    if max(shifts, default=0.0) < SEEN:
        return None
    # smallest share of the largest shift among similar shifts
    alike = [each for each, s in zip(clear, shifts, strict=True) if s >= 0.8 * max(shifts)]
    value, over, stated, extended = min(alike, key=lambda each: torque_limit[each[0].axis])
    own = [v for v in local if v.axis == value.axis]
    return Phase(
        axis=value.axis + 1,
        over=over + 1,
        q=value.q,
        stated=stated,
        extended=extended,
        angle=tuple(float(v.q[over]) for v in own),
        torque=tuple(_brought(errors, own, value.q, over).tolist()),
        standard_error=tuple(v.standard_error for v in own),
    )


def _sinusoids(
    errors: ModelErrors, q: Sequence[float], axis: int, over: int
) -> tuple[Sinusoid, Sinusoid]:
    """Return stated and extended torque of an axis over a single angle at `q`."""
    turned = np.tile(q, (3, 1))
    turned[:, over] = [0.0, np.pi / 2, np.pi]
    found = []
    for p in models(errors):
        zero, quarter, half = _torque(errors, turned, axis, p)
        mean = (zero + half) / 2
        found.append(Sinusoid(float(mean), float((zero - half) / 2), float(quarter - mean)))
    return found[0], found[1]


def _brought(errors: ModelErrors, values: list[LocalValue], q: Sequence[float], over: int) -> Array:
    """Return measured torques transferred to `q`: extended model plus centred residuals."""
    stated, extended = models(errors)
    axis = values[0].axis
    there = np.array([value.q for value in values])
    here = np.tile(q, (len(values), 1))
    here[:, over] = there[:, over]
    left = np.array([value.value - value.model for value in values])
    left = left - _torque(errors, there, axis, extended - stated)
    torque: Array = _torque(errors, here, axis, extended) + left - left.mean()
    return torque


def models(errors: ModelErrors) -> tuple[Array, Array]:
    """Return base parameters of the complete robot: as stated, and with missing parameters."""
    return errors.stated @ errors.p, errors.p_all


def _torque(errors: ModelErrors, q: Array, axis: int, p: Array) -> Array:
    return gravity_torque(errors.complete, p, q)[:, axis]
