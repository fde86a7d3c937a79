"""What the model leaves out: a test for each link parameter that the robot file calls absent.

A robot file states which link parameters are present. One that is wrongly left out is not in the
base parameters, so its torque has nowhere to go but into the residuals (the paper's Fig. 7). Here
the measurements are condensed once for the robot with all ten parameters of every link,
p_all = K_all p_standard, in which the stated model is the linear subspace p_all = T p. Each absent
parameter adds one direction u, its column of K_all,

    p_all = T p + u delta;

delta is estimated with everything else at once, by the same least squares as p. Its evidence is
delta over its standard error, from leaving out one measurement at a time, so that what differs from
one measurement to the next counts as error (`hil.least_squares.uncertainty`). A direction inside
T's span is absorbed: that parameter cannot show. Directions that agree but for T's span, or that
these very measurements do not distinguish, stand together as one candidate.

After the strongest candidate has been taken in, all others are tested anew: what only resembled it
loses its evidence. This goes on until nothing is significant at `SIGNIFICANCE`, shared out among
all candidates (Bonferroni).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.simultaneous import SimultaneousFit
from hil.least_squares.solving import (
    eliminated,
    orthonormal,
    project_out,
    shares_without_nuisance,
)
from hil.least_squares.uncertainty import correlation_of, leave_one_out
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.signals import Prepared
    from hil.model.robot import Robot


SIGNIFICANCE = 0.001
"""Chance of any finding at all where nothing is left out."""
ALIKE = 0.98
"""Correlation from which on the measurements do not distinguish two candidates."""
_SEEN = 1e-4
"""Least share of a direction's information that the stated parameters cannot imitate."""
_SAME = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """One or several link parameters that the robot file leaves out and that look alike.

    Attributes
    ----------
    names : tuple of str
        Standard parameters, nearest to the base first.
    direction : ndarray, shape (n_all,)
        Change of all base parameters by one unit of the first name.
    value, standard_error : float
        Of the first name, estimated beside the stated model alone [kg m^2, kg m or kg].
    t : float
        Their ratio.
    p_value : float
        Of a ratio at least so great by chance.
    """

    names: tuple[str, ...]
    direction: Array
    value: float
    standard_error: float
    t: float
    p_value: float

    @property
    def label(self) -> str:
        """The names as one: ``sy4 or sz5``."""
        return " or ".join(self.names)


@dataclass(frozen=True, slots=True, eq=False)
class ModelErrors:
    """Which left-out parameters the data call for, and which stated ones they do not need.

    Attributes
    ----------
    complete : Robot
        The robot with all link parameters present.
    stated : ndarray, shape (n_all, n_base)
        T: base parameters of the robot file as those of `complete`.
    alone : tuple of Candidate
        Each tested by itself, strongest evidence first.
    found : tuple of Candidate
        The significant ones, each tested beside those before it.
    after : tuple of Candidate
        The others, beside all of `found`, strongest first.
    p, standard_error : ndarray, shape (n_base,)
        Stated parameters with `found` taken in.
    p_values : ndarray, shape (n_base,)
        Of the stated parameters' being zero.
    absorbed : tuple of str
        Left-out parameters that cannot show, whatever is measured.
    unmeasured : tuple of str
        Left-out parameters that are not identifiable from these measurements.
    threshold : float
        p-value below which a candidate is significant.
    """

    complete: Robot
    stated: Array
    alone: tuple[Candidate, ...]
    found: tuple[Candidate, ...]
    after: tuple[Candidate, ...]
    p: Array
    standard_error: Array
    p_values: Array
    absorbed: tuple[str, ...]
    unmeasured: tuple[str, ...]
    threshold: float

    @property
    def p_all(self) -> Array:
        """Base parameters of `complete` with `found` taken in, shape (n_all,)."""
        total: Array = self.stated @ self.p
        for candidate in self.found:
            total = total + candidate.direction * candidate.value
        return total


def examine(robot: Robot, prepared: Prepared) -> ModelErrors:
    """Test every link parameter that `robot` leaves out, and those that it states."""
    whole = robot.free_links()
    K = base_parameters(whole).matrix
    stated = K @ base_parameters(robot).placement
    shares = SimultaneousFit(whole, prepared).shares
    measured = _Measured(*shares_without_nuisance(shares.N, shares.v, len(K)))
    absent, absorbed = _absent(robot, K, stated)
    candidates, unmeasured = _grouped(measured, stated, absent)
    threshold = SIGNIFICANCE / max(len(candidates), 1)
    alone = _tested(measured, stated, candidates)
    found: list[Candidate] = []
    basis, rest = stated, alone
    # candidates that are taken in one after the other at most
    while rest and rest[0].p_value < threshold and len(found) < 6:
        found.append(rest[0])
        basis = np.column_stack([basis, rest[0].direction])
        taken = [candidate.names for candidate in found]
        left = {names: u for names, u in candidates.items() if names not in taken}
        rest = _tested(measured, basis, left)
    value, error, p_value = measured.solve(basis)
    n = stated.shape[1]
    return ModelErrors(
        complete=whole,
        stated=stated,
        alone=tuple(alone),
        found=tuple(
            _candidate(c.names, c.direction, *row)
            for c, *row in zip(found, value[n:], error[n:], p_value[n:], strict=True)
        ),
        after=tuple(rest),
        p=value[:n],
        standard_error=error[:n],
        p_values=p_value[:n],
        absorbed=absorbed,
        unmeasured=unmeasured,
        threshold=threshold,
    )


def _absent(robot: Robot, K: Array, stated: Array) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns of K of left-out parameters that can show; names of those that cannot."""
    inside, _ = orthonormal(stated)
    shown, absorbed = {}, []
    for name, u in zip(robot.standard_parameters, K.T, strict=True):
        if name in robot.present and name not in robot.ties:
            continue
        if np.linalg.norm(project_out(inside, u)) > _SAME:
            shown[name] = u
        elif name not in robot.ties:
            absorbed.append(name)
    return shown, tuple(absorbed)


class _Measured(NamedTuple):
    """Shares of all measurements in the normal equations of `complete`'s base parameters."""

    shares: Array
    sides: Array

    def beside(self, basis: Array, directions: Array) -> tuple[Array, Array]:
        """Information on `directions` less what `basis` can imitate, (k, k); and all of it."""
        X, k = np.column_stack([directions, basis]), directions.shape[1]
        N = X.T @ self.shares.sum(axis=0) @ X
        return eliminated(N, basis.shape[1])[0], N[:k, :k]

    def solve(self, basis: Array) -> tuple[Array, Array, Array]:
        """Coefficients of `basis`, standard errors and p-values, shape (k,) each."""
        x, covariance, degrees = leave_one_out(basis.T @ self.shares @ basis, self.sides @ basis)
        error = np.sqrt(np.diag(covariance))
        return x, error, np.asarray(2 * special.stdtr(degrees, -np.abs(x) / error))


def _grouped(
    measured: _Measured, stated: Array, absent: dict[str, Array]
) -> tuple[dict[tuple[str, ...], Array], tuple[str, ...]]:
    """Candidates that these measurements distinguish, and names that they do not identify."""
    names, U = list(absent), np.array(list(absent.values())).T.reshape(len(stated), -1)
    beside, whole = measured.beside(stated, U)
    seen = np.diag(beside) > _SEEN * np.diag(whole)
    alike = np.abs(correlation_of(beside)) > ALIKE
    groups: dict[int, list[int]] = {}
    for k in np.flatnonzero(seen):
        first = next((g for g in groups if alike[g, k]), int(k))
        groups.setdefault(first, []).append(int(k))
    candidates = {tuple(names[k] for k in members): U[:, g] for g, members in groups.items()}
    return candidates, tuple(name for name, k in zip(names, seen, strict=True) if not k)


def _tested(
    measured: _Measured, basis: Array, candidates: dict[tuple[str, ...], Array]
) -> list[Candidate]:
    """Every candidate by itself beside `basis`, strongest evidence first."""
    tested = []
    for names, u in candidates.items():
        own, whole = measured.beside(basis, u[:, np.newaxis])
        if own[0, 0] > _SEEN * whole[0, 0]:
            value, error, p_value = measured.solve(np.column_stack([basis, u]))
            tested.append(_candidate(names, u, value[-1], error[-1], p_value[-1]))
    return sorted(tested, key=lambda candidate: (candidate.p_value, -abs(candidate.t)))


def _candidate(
    names: tuple[str, ...], u: Array, value: float, error: float, p_value: float
) -> Candidate:
    return Candidate(names, u, float(value), float(error), float(value / error), float(p_value))
