"""Scale inner products of recorded signals to SI torques; estimate unknown gains.

A recorded signal y_i of axis i corresponds to the torque g_i y_i [N m or N]. If the map leaves a
gain g_i open, the gain is a further unknown. The noise is in the signal, so the signal stays on the
left,

    y_i = (A_i p + Qm_i + C_i c + F_i a_i) / g_i + e_i,

and products of model and gain on the right are linearised about the present solution, with the
relative change d_i of the gain as unknown (Gauss-Newton):

    g_i y_i - Qm_i = A_i p + C_i c + F_i a_i - d_i (A_i p + Qm_i + C_i c + F_i a_i)_present + e_i.

The column of d_i is the torque by the model, without the noise of the signal: with the signal
itself as a column that noise would bias every gain towards zero. All columns are combinations of
condensed columns, and so are their inner products.

The scale of an axis of unknown gain is fixed by an acting torque of known size: base parameters
shared with an axis of known gain, or rotors of known inertia (robot file). Without either,
parameters, gain and friction may be multiplied by a common factor without changing the torques: the
column of such a gain is a combination of the others. This does not depend on the values of the
parameters, except for a null set; so the parameters are drawn at random, and no signal is used. An
undetermined scale is refused rather than invented.

Iterations start from two values, and the result with the smaller misfit counts. The starts are
gains with torques of usual size, and the gains of the linear problem with the signals of unknown
gain as columns,

    -Qm_i = A_i p + C_i c + F_i a_i - g_i y_i,

biased by noise and friction, at times strongly.

An error of a known torque constant, or of a gain in a map, scales all torques of its axis, and
changes the solution, which is linear in the torques (`effect_of_drives`). No single recording shows
the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.condensed import ROTOR
from hil.estimation.free_motion.accumulation import Products
from hil.estimation.free_motion.choice import kept_by, usual
from hil.estimation.free_motion.result import GainValue
from hil.friction.terms import USUAL
from hil.least_squares.blocks import Blocks
from hil.least_squares.layout import embedded
from hil.least_squares.regression import Regression
from hil.least_squares.solving import IDENTIFIABLE, undetermined
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.choice import Choice
    from hil.least_squares.layout import Layout
    from hil.least_squares.regression import Fit
    from hil.model.robot import Robot

Condensed = TypeVar("Condensed", Blocks, Products)

ROUNDS = 50
"""Maximum number of Gauss-Newton rounds."""
CONVERGED = 1e-10
"""Relative change of the gains at convergence."""
STRIDE = 0.7
"""Largest change of a gain's logarithm in a round."""
FARTHEST = 1e3
"""Largest factor between the gain of the linear problem and a gain for torques of usual size."""
LOOSE = 0.2
"""Largest relative standard error of a determined gain."""
REMEDY = (
    "state one gain in the map or a rotor_inertia in the robot file, or record the same motion with"
    " a load of known mass (hil payload --mass --gains)"
)
_TINY = np.finfo(float).tiny


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Gains of the axes, and the linearisation point of unknown gains.

    Attributes
    ----------
    gains : ndarray, shape (n_joints,)
        Gains [N m or N for one unit of the signal]; 1 for signals in SI.
    unknown : tuple of int
        Axes with an unknown gain, from 0.
    x : ndarray, shape (n,)
        Base parameters, coupled motors' friction, then all friction terms of each axis.
    """

    gains: Array
    unknown: tuple[int, ...]
    x: Array

    @classmethod
    def known(cls, gains: Array) -> Scaling:
        """Create a scaling of known gains."""
        return cls(gains, (), np.zeros(0))

    def applied(self, recorded: Condensed) -> Condensed:
        """Return products of SI torque; gain changes are the last shared columns."""
        torque, rotor = self.signal(recorded.layout), recorded.layout.index(ROTOR)
        torque[:, 1 + rotor] = -1.0
        return recorded.recast(torque, self.columns(recorded.layout), (ROTOR,))

    def signal(self, layout: Layout) -> Array:
        """Return the signal times its gain, as a combination of columns, shape (n_joints, m)."""
        found = np.zeros((layout.n_channels, 1 + len(layout.shared) + len(layout.own)))
        found[:, 0] = self.gains
        return found

    def columns(self, layout: Layout) -> dict[str, Array]:
        """Return columns of the unknown gains as combinations, each of shape (n_joints, m)."""
        return _alone(layout, {axis: -modelled(layout, self.x, axis) for axis in self.unknown})


def gain_name(axis: int) -> str:
    """Return the name of the unknown change of an axis's gain."""
    return f"gain {axis + 1}"


def _alone(layout: Layout, rows: Mapping[int, Array]) -> dict[str, Array]:
    """Return columns of the gains, shape (n_joints, m), from a row for every gain."""
    own = np.eye(layout.n_channels)[:, :, np.newaxis]
    return {gain_name(axis): own[axis] * row for axis, row in rows.items()}


def modelled(layout: Layout, x: Array, axis: int) -> Array:
    """Return the torque of an axis with its rotor, as a combination of columns, shape (m,)."""
    without = np.delete(np.arange(layout.size), layout.index(ROTOR))
    whole = embedded(x, without, layout.size)
    whole[layout.index(ROTOR)] = 1.0
    return np.concatenate([[0.0], whole[layout.place(axis)]])


def first_scaling(
    robot: Robot, recorded: Blocks, unknown: tuple[int, ...], p: Array | None = None
) -> Scaling:
    """Estimate gains with Coulomb and viscous friction at all speeds.

    Parameters
    ----------
    recorded : Blocks
        All samples in one block.
    p : ndarray, shape (n_base,), optional
        Base parameters from other recordings, which fix the scale.

    Raises
    ------
    NotIdentifiable
        The unknown gains leave a scale undetermined, or a signal is zero.
    """
    if not unknown:
        return Scaling.known(np.ones(robot.n_joints))
    silent = [axis for axis in unknown if not _mean_squares(recorded)[axis, 0] > _TINY]
    if silent:
        raise NotIdentifiable(
            f"{_gains_of(silent)} cannot be found: the signal is zero throughout; name the column"
            " of its torque or current in the map, or state the gain there"
        )
    if p is not None:
        return _fit_gains(recorded, unknown, p)
    _require_scale(robot, recorded, unknown)
    axes, usual_gains = list(unknown), np.ones(recorded.n_channels)
    usual_gains[axes] = np.sqrt(_usual_torque(recorded, unknown) / _mean_squares(recorded)[axes, 0])
    # solve the linear problem for the gains, bounded around usual ones, shape (n_joints,)
    axes, layout = list(unknown), recorded.layout
    torque = Scaling.known(np.ones(recorded.n_channels)).signal(layout)
    signals = _alone(layout, {axis: -torque[axis] for axis in axes})
    torque[axes, 0] = 0.0
    torque[:, 1 + layout.index(ROTOR)] = -1.0
    linear = recorded.recast(torque, signals, (ROTOR,))
    square = _mean_squares(recorded)[:, 0]
    weights = np.where(square > _TINY, 1.0 / np.maximum(usual_gains**2 * square, _TINY), 0.0)
    kept = kept_by(linear.layout, [USUAL] * recorded.n_channels)
    x = Regression(linear, weights, kept).solution
    gains = usual_gains.copy()
    gains[axes] = [x[linear.layout.index(gain_name(axis))] for axis in axes]
    starts = usual_gains, np.clip(gains, usual_gains / FARTHEST, usual_gains * FARTHEST)
    found = [_converged(recorded, unknown, gains) for gains in starts]
    # smaller differences are rounding errors, and the first start is used
    return min(found, key=lambda each: round(each[1], 6))[0]


def _converged(recorded: Blocks, unknown: tuple[int, ...], gains: Array) -> tuple[Scaling, float]:
    """Iterate gains from a start; return the logarithm of the misfit as well."""
    known = usual(Scaling.known(gains).applied(recorded))
    first = Scaling(gains, unknown, known.solution)
    scaling = _iterate(first, lambda here: usual(here.applied(recorded)), CONVERGED**0.5)
    left = Scaling.known(scaling.gains).applied(recorded).mean_squares(scaling.x)
    misfit = np.log(np.maximum(left / scaling.gains**2, _TINY))
    return scaling, float(recorded.counts.sum(axis=0) @ misfit)


def _fit_gains(recorded: Blocks, unknown: tuple[int, ...], p: Array) -> Scaling:
    """Estimate gains for known base parameters, which fix the scale.

    The torque by the model is a column with the reciprocal of the gain as coefficient: the noise is
    in the signal.
    """
    layout, base = recorded.layout, recorded.layout.shared[: len(p)]
    torque = Scaling.known(np.ones(recorded.n_channels)).signal(layout)
    model = np.zeros_like(torque)
    model[:, recorded.place(*base)] = p
    model[:, 1 + layout.index(ROTOR)] = 1.0
    columns = _alone(layout, {axis: model[axis] for axis in unknown})
    # axes with a known gain carry no information on other gains
    torque[[axis for axis in range(len(torque)) if axis not in unknown]] = 0.0
    found = usual(recorded.recast(torque, columns, (*base, ROTOR)))
    reciprocal = np.array([found.solution[found.layout.index(gain_name(axis))] for axis in unknown])
    lost = [axis for axis, each in zip(unknown, reciprocal, strict=True) if not each > 0]
    if lost:
        raise NotIdentifiable(
            f"{_gains_of(lost)} cannot be found: with the other parameters found, the signals "
            f"have no effect or the reverse sign; {REMEDY}"
        )
    gains = np.ones(recorded.n_channels)
    gains[list(unknown)] = 1.0 / reciprocal
    return Scaling(gains, unknown, usual(Scaling.known(gains).applied(recorded)).solution)


def linearise(recorded: Products, scaling: Scaling, choice: Choice) -> Scaling:
    """Linearise about the solution with chosen friction laws, for unchanged gains."""
    whole = recorded.pieces[choice.slowest].total
    known = choice.regression(Scaling.known(scaling.gains).applied(whole))
    return Scaling(scaling.gains, scaling.unknown, known.solution)


def refined(recorded: Products, scaling: Scaling, choice: Choice) -> Scaling:
    """Refine gains with chosen friction laws and the choice's weights.

    Weights refer to torques in SI, and are constant while the gains change.
    """
    whole = recorded.pieces[choice.slowest].total
    return _iterate(scaling, lambda here: choice.regression(here.applied(whole)))


def _iterate(
    scaling: Scaling, linearised: Callable[[Scaling], Regression], least: float = CONVERGED
) -> Scaling:
    """Take Gauss-Newton steps until no gain's logarithm changes by `least`."""
    for _ in range(ROUNDS if scaling.unknown else 0):
        here = linearised(scaling)
        x, layout, gains = here.solution, here.layout, scaling.gains.copy()
        places = [layout.index(gain_name(axis)) for axis in scaling.unknown]
        # far from the solution the linear step overshoots
        change = np.clip(x[places], -STRIDE, STRIDE)
        gains[list(scaling.unknown)] *= np.exp(change)
        scaling = Scaling(gains, scaling.unknown, np.delete(x, places))
        if np.abs(change).max() < least:
            break
    return scaling


def _mean_squares(recorded: Blocks) -> Array:
    """Return mean squares of signals and columns, shape (n_joints, m)."""
    counts = np.maximum(recorded.counts.sum(axis=0), 1.0)[:, np.newaxis]
    found = np.einsum("bjkk->jk", recorded.products) / counts
    found[:, 0] = np.maximum(found[:, 0], _TINY)
    return np.asarray(found)


def _usual_torque(recorded: Blocks, unknown: tuple[int, ...]) -> float:
    """Return the mean squared torque of known gain or rotor [N^2 m^2 or N^2]."""
    squares = _mean_squares(recorded)
    known = np.delete(squares[:, 0], unknown)
    known = known[known > _TINY]  # an axis without torque has no usual torque
    if known.size:
        return float(known.mean())
    return float(np.mean(squares[:, 1 + recorded.layout.index(ROTOR)])) or 1.0


def _require_scale(robot: Robot, recorded: Blocks, unknown: tuple[int, ...]) -> None:
    """Raise an error if the torques determine gains and base parameters only up to scale."""
    lost = _open(recorded, unknown)
    axes = [axis for axis in unknown if gain_name(axis) in lost]
    if not axes:
        return
    listed = ", ".join(name for name in base_parameters(robot).names if name in lost)
    both = f"{'it' if len(axes) == 1 else 'them'} {listed or 'all its friction'}"
    raise NotIdentifiable(
        f"{_gains_of(axes)} and with {both} are determined only up to scale: a common factor "
        f"changes no torque; {REMEDY}"
    )


def open_gains(recorded: Blocks, unknown: tuple[int, ...]) -> list[int]:
    """Return the axes, from 0, of unknown gains with an undetermined scale."""
    lost = _open(recorded, unknown) if unknown else set()
    return [axis for axis in unknown if gain_name(axis) in lost]


def _open(recorded: Blocks, unknown: tuple[int, ...]) -> set[str]:
    """Return the names of gains and shared unknowns with an undetermined scale."""
    found, n, gains = set[str](), recorded.n_channels, [gain_name(axis) for axis in unknown]
    # one random draw may miss an affected parameter; two hardly do
    for seed in range(2):
        x = _any_solution(recorded, unknown, seed)
        rows = np.stack([modelled(recorded.layout, x, axis) for axis in range(n)])
        size = np.einsum("ja,bjac,jc->j", rows, recorded.products, rows)
        blocks = Scaling(np.ones(n), unknown, x).applied(recorded)
        kept = kept_by(blocks.layout, [USUAL] * n)
        # ignore axes without torque, or with a torque at the level of rounding
        heard = size > max(np.finfo(float).eps ** 2 * size.max(), _TINY)
        weights = np.where(heard, 1.0 / np.where(heard, size, 1.0), 0.0)
        N, names = (
            Regression(blocks, weights, kept).normal.information,
            np.array(blocks.layout.names),
        )
        # what is undetermined without gains too is not open by the scale
        linear = np.flatnonzero(~np.isin(names[kept], gains))
        lost = undetermined(N, IDENTIFIABLE)
        lost[linear] &= ~undetermined(N[np.ix_(linear, linear)], IDENTIFIABLE)
        found |= set(names[kept][lost].tolist())
    return found


def _any_solution(recorded: Blocks, unknown: tuple[int, ...], seed: int) -> Array:
    """Draw parameters and classical friction at random, with torques of usual size."""
    layout, squares = recorded.layout, _mean_squares(recorded)[:, 1:]
    n_shared = len(layout.shared)
    size = np.concatenate([squares[:, :n_shared].mean(axis=0), squares[:, n_shared:].ravel()])
    rotor = layout.index(ROTOR)
    kept = kept_by(layout, [USUAL] * layout.n_channels)
    kept = kept[kept != rotor]
    drawn = embedded(np.random.default_rng(seed).standard_normal(len(kept)), kept, len(size))
    torque = np.sqrt(_usual_torque(recorded, unknown) / len(kept))
    found = np.where(size > 0, drawn, 0.0) * torque / np.sqrt(np.maximum(size, _TINY))
    return np.delete(found, rotor)


def _gains_of(axes: Sequence[int]) -> str:
    """Return the unknown gains of axes, from 0, in words."""
    listed = ", ".join(str(axis + 1) for axis in axes)
    many = len(axes) > 1
    return f"the unknown gain{'s' * many} of ax{'es' if many else 'is'} {listed}"


def found_gains(robot: Robot, scaling: Scaling, fit: Fit) -> tuple[GainValue, ...]:
    """Return the unknown gains of a solution with standard errors.

    Raises
    ------
    NotIdentifiable
        The recordings do not determine the gains precisely enough.
    """
    places = [fit.layout.index(gain_name(axis)) for axis in scaling.unknown]
    change, error = fit.x[places], np.sqrt(np.diag(fit.covariance)[places])
    loose = [axis for axis, each in zip(scaling.unknown, error, strict=True) if not each < LOOSE]
    if loose:
        raise NotIdentifiable(
            f"{_gains_of(loose)} cannot be found: a standard error of"
            f" {100 * error.max():.2g} % must be below {100 * LOOSE:g} %, so the parameters are"
            f" determined only up to scale; {REMEDY}"
        )
    values = scaling.gains[list(scaling.unknown)] * np.exp(change)
    return tuple(
        GainValue(
            axis=axis + 1,
            value=float(value),
            standard_error=float(value * each),
            unit="N m" if robot.revolute[axis] else "N",
        )
        for axis, value, each in zip(scaling.unknown, values, error, strict=True)
    )
