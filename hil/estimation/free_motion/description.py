"""Describe a solution as in `model.yaml`: friction, residuals, restrictions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.accumulation import SPEEDS
from hil.estimation.free_motion.columns import coupled_names
from hil.estimation.free_motion.offsets import only_directions, weight_in_offset
from hil.estimation.free_motion.result import FEW_BLOCKS, LOOSE, POOR
from hil.estimation.nuisances import STEP, compliance_names
from hil.friction.law import AxisLaw, CoupledFriction, OneWay, TermValue
from hil.friction.terms import BENT, CLASSICAL, LAWS
from hil.least_squares.standstill import braked, limited
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.free_motion.motion import Motion
    from hil.estimation.free_motion.solution import Solution
    from hil.estimation.free_motion.survey import Survey
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.regression import Fit
    from hil.model.robot import Robot

SHORT = 30.0
"""Shortest total duration of the recordings without a remark [s]."""
SILENT = (
    (
        braked,
        "constant at rest while others move, as with a closed brake",
        "add motions of several axes at once",
    ),
    (
        limited,
        "at a limit in up to {:.0%} of the samples",
        "raise this limit, or record slower motion",
    ),
)
"""Samples whose torque says nothing, with the reason and the remedy."""


def axis_friction(
    fit: Fit, plain: Fit, gathered: Gathered, products: Products
) -> tuple[AxisLaw, ...]:
    """Return law and coefficients of every axis, with the classical solution `plain`."""
    choice, processing = gathered.choice, gathered.processing
    levels = gathered.drift.found(fit.x, fit.layout, products.n_pieces)
    one_way, base = _one_way(products, fit), slice(len(gathered.first))
    found = []
    for axis, law in enumerate(choice.laws):
        rows = fit.covariance[_places(fit, axis, LAWS[law])]
        own = rows[:, _places(fit, axis, LAWS[law])]
        found.append(
            AxisLaw(
                law=law,
                speed=float(processing.speed[axis]),
                presliding=float(processing.presliding[axis]),
                bend=_value(fit, fit.layout.index(BENT, axis)),
                terms=_values(fit, axis, LAWS[law]),
                plain=_values(plain, axis, CLASSICAL),
                held_out=choice.held_out[axis],
                level=tuple(levels[axis].tolist()),
                one_way=one_way.get(axis),
                covariance=own.tolist(),
                beside=rows[:, base].tolist(),
            )
        )
    return tuple(found)


def _places(fit: Fit, axis: int, terms: Sequence[str]) -> Indices:
    return np.array([fit.layout.index(term, axis) for term in terms], dtype=np.intp)


def _values(fit: Fit, axis: int, terms: Sequence[str]) -> dict[str, TermValue]:
    return {term: _value(fit, fit.layout.index(term, axis)) for term in terms}


def _value(fit: Fit, place: int) -> TermValue:
    return TermValue.estimated(fit.x[place], fit.covariance[place, place])


def _one_way(products: Products, fit: Fit) -> dict[int, OneWay]:
    """Return the axes, from 0, moving in a single direction."""
    found = {}
    for axis, direction in only_directions(products.ways).items():
        places, both = _places(fit, axis, ("offset", "Coulomb")), np.array([1.0, direction])
        variance = float(both @ fit.covariance[np.ix_(places, places)] @ both)
        together = TermValue.estimated(float(both @ fit.x[places]), variance)
        found[axis] = OneWay(direction=direction, together=together)
    return found


def compliances(robot: Robot, soft: Sequence[int], fit: Fit) -> dict[int, TermValue]:
    """Return the compliances of the soft gears, by axis from 1."""
    places = {axis + 1: fit.layout.index(compliance_names(robot)[axis]) for axis in soft}
    return {
        axis: TermValue.estimated(STEP * fit.x[k], STEP**2 * fit.covariance[k, k])
        for axis, k in places.items()
    }


def coupled_friction(robot: Robot, fit: Fit) -> tuple[CoupledFriction, ...]:
    """Return the friction of the coupled motors."""
    return tuple(
        CoupledFriction(
            motor=motor + 1,
            joint=joint + 1,
            viscous=_value(fit, fit.layout.index(viscous)),
            coulomb=_value(fit, fit.layout.index(coulomb)),
        )
        for (motor, joint, _), (viscous, coulomb) in zip(
            robot.couplings, coupled_names(robot), strict=True
        )
    )


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Residuals of a solution over samples of every speed.

    Attributes
    ----------
    rms : ndarray, shape (n_joints,)
        Root mean square [N m or N].
    torque : ndarray, shape (n_joints,)
        Root mean square of the recorded torque, including that of the rotors.
    mean : ndarray, shape (n_joints,)
        Mean torque [N m or N].
    """

    rms: Array
    torque: Array
    mean: Array

    @classmethod
    def compute(cls, gathered: Gathered, products: Products, fit: Fit) -> Residuals:
        """Compute the residuals of a fit."""
        whole, recorded = products.pieces[0].total, gathered.recorded.pieces[0].squares
        counts = np.maximum(whole.counts[0], 1.0)
        # the offset column is 1, but for windows of closed brakes
        one = whole.place("offset")[0]
        along, size = whole.products[0, :, [0, one], one]
        mean = along / np.sqrt(counts * np.where(size > 0, size, 1.0))
        rms, torque = whole.mean_squares(fit.x), gathered.scaling.gains**2 * recorded / counts
        return cls(np.sqrt(rms), np.sqrt(torque), mean)

    @property
    def relative(self) -> tuple[float | None, ...]:
        """Residuals relative to the torque; None for an axis without torque."""
        return self._divide_by_torque(self.rms)

    @property
    def naive(self) -> tuple[float | None, ...]:
        """Relative residuals of a constant torque."""
        return self._divide_by_torque(np.sqrt(np.maximum(self.torque**2 - self.mean**2, 0.0)))

    @property
    def overall(self) -> float:
        """Residual relative to the torque, for the axes together."""
        least = np.sqrt(np.finfo(float).tiny)
        return float(np.linalg.norm(self.rms) / max(float(np.linalg.norm(self.torque)), least))

    def _divide_by_torque(self, left: Array) -> tuple[float | None, ...]:
        both = zip(left.tolist(), self.torque.tolist(), strict=True)
        return tuple(each / torque if torque > 0 else None for each, torque in both)


def repeated_torques(stretches: Sequence[Motion]) -> tuple[float, ...]:
    """Return the share of the most frequent torque in the faster half of the samples, by axis.

    Above one half, the median distance of the torque from a single value is zero: a dead band, or
    the resolution, exceeds the change of the torque in motion.
    """
    shares = []
    for axis in range(stretches[0].q.shape[1]):
        ways, torques = [], []
        for motion in stretches:
            each, every = motion.recording, motion.rates.fine * motion.rates.coarse
            # distance in nine samples, as encoders of low resolution do not change in every sample
            way = np.abs(np.convolve(np.diff(each.q[:, axis]), np.ones(9), "same"))
            free = np.repeat(motion.telling[:, axis], every)[1 : each.n_samples]
            ways.append(way[free])
            torques.append(each.tau[1:, axis][free])
        way, torque = np.concatenate(ways), np.concatenate(torques)
        middle = np.median(way) if len(way) else 0.0
        _, counts = np.unique(torque[way >= middle], return_counts=True)
        shares.append(float(counts.max(initial=0) / max(counts.sum(), 1)))
    return tuple(shares)


def silent_axes(stretches: Sequence[Motion], still: Sequence[int]) -> tuple[str, ...]:
    """Return remarks on axes, from 0, with samples that a brake or a limit makes silent."""
    recordings, said = [each.recording for each in stretches], []
    for find, why, remedy in SILENT:
        found = np.concatenate([find(x.q, x.tau, x.period) for x in recordings])
        shares = found.mean(axis=0)
        shares[list(still)] = 0.0
        axes = [str(axis + 1) for axis in np.flatnonzero(shares).tolist()]
        if axes:
            many = len(axes) > 1
            axis = f"ax{'es' if many else 'is'} {', '.join(axes)}: torque{'s' * many}"
            said.append(f"{axis} {why.format(shares.max())}: not used there; {remedy}")
    return tuple(said)


def remarks(
    robot: Robot,
    products: Products,
    solution: Solution,
    found: Survey,
    condition: float,
    torque: Array,
    held: Sequence[int] = (),
) -> tuple[str, ...]:
    """Return remarks on short data, poor excitation and axes at rest.

    `condition` is the condition number with the classical friction law: terms of richer laws are
    similar to each other for any motion. `torque` is the root mean square of the torque of each
    axis, and `held` are the axes at rest whose torque is not used, from 0.
    """
    said = []
    few = f"{products.n_pieces} independent blocks of time, at least {FEW_BLOCKS}"
    short = f"{found.duration:.3g} s of recordings, at least {SHORT:g} s"
    if found.duration < SHORT or products.n_pieces < FEW_BLOCKS:
        lacking = short if found.duration < SHORT else few
        said.append(f"{lacking} needed: intervals may be too small; add recordings")
    if condition > POOR:
        said.append(
            f"condition number {condition:.3g}: some combinations of parameters and friction "
            "hardly influence the torque; add recordings of other motions"
        )
    if found.still:
        axes = ", ".join(str(axis + 1) for axis in found.still)
        moves = f"axis {axes} does" if len(found.still) == 1 else f"axes {axes} do"
        said.append(f"{moves} not move in the recordings: no friction identified")
    said += [
        f"axis {axis + 1}: moves by {found.reach[axis]:.2g} {robot.position_unit(axis)} only, as "
        "servo and friction give way to the other axes: not excited"
        for axis in found.yielding
    ]
    said += [
        f"axis {axis + 1}: its torque at rest does not follow the motion of the other axes; a "
        "brake or static friction may carry the load, so this torque is not used"
        for axis in held
    ]
    said += [
        f"axis {axis + 1}: gravity is constant along this slide, so the moved mass includes the "
        "rotor, and the friction offset the rotor's weight; torques stay the same; to separate "
        "the two, state the rotor_inertia in the robot file"
        for axis in weight_in_offset(robot)
    ]
    for axis, one in _one_way(products, solution.fit).items():
        said.append(
            f"axis {axis + 1} {one} {robot.torque_unit(axis)}; add recordings in both directions"
        )
    if not solution.possible:
        said.append(
            "the mass matrix is not positive definite, and parameters with a positive definite "
            "one explain the torques less well: do not simulate with these parameters; check "
            "signs, units, gear ratios and torque constants of the map and the robot file, and "
            "add recordings with greater acceleration"
        )
    elif solution.moved:
        said.append(
            "the mass matrix by least squares was not positive definite; it was corrected by "
            f"changes of parameters, at most {solution.moved:.2g} standard errors"
        )
    names = loose_parameters(robot, products.pieces[0], solution.fit, torque)
    if names:
        said.append(
            f"{', '.join(names)}: a standard error is more than {100 * LOOSE:g} % of an axis's"
            " torque; the motion excites them little"
        )
    return tuple(said)


def loose_parameters(robot: Robot, blocks: Blocks, fit: Fit, torque: Array) -> list[str]:
    """Return the base parameters with a standard error above `LOOSE` of an axis's torque.

    Parameters
    ----------
    blocks : Blocks
        All samples, axis by axis.
    torque : ndarray, shape (n_joints,)
        Root mean square of each axis's torque [N m or N].
    """
    base, whole = base_parameters(robot), blocks.total
    counts = np.maximum(whole.counts[0], 1.0)[:, np.newaxis]
    squares = np.einsum("jkk->jk", whole.products[0])[:, whole.place(*base.names)] / counts
    error = np.sqrt(np.diag(fit.covariance)[: len(base)] * squares)
    driven = torque > 0
    worst = (error[driven] / torque[driven, np.newaxis]).max(axis=0, initial=0.0)
    return [base.names[k] for k in np.flatnonzero(worst > LOOSE)]


def dead_zone(choice: Choice) -> float:
    """Return the slowest fitted speed as a share of the axis's speed."""
    return SPEEDS[choice.slowest - 1] if choice.slowest else 0.0
