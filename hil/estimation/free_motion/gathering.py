"""Gather recordings of free motions for a fit: settings, products, gains, friction laws.

All solvers, and the fit of a load to two runs, start here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy import special

from hil.errors import NotEnoughData
from hil.estimation.condensed import ROTOR, drive_torques
from hil.estimation.free_motion.accumulation import division, recorded_products, too_short
from hil.estimation.free_motion.choice import (
    choose,
    classical_choice,
    covariance_of_choices,
    held_axes,
    usual,
    yielding_axes,
)
from hil.estimation.free_motion.drift import Drift, find_drift
from hil.estimation.free_motion.motion import filtered_motion
from hil.estimation.free_motion.nuisances import find_nuisances
from hil.estimation.free_motion.scaling import (
    Scaling,
    first_scaling,
    gain_name,
    linearise,
    open_gains,
    refined,
)
from hil.estimation.free_motion.settings import processing_of
from hil.estimation.free_motion.solution import BLOCKS
from hil.estimation.free_motion.survey import survey
from hil.estimation.options import DEFAULTS
from hil.friction.search import TRIED
from hil.friction.terms import BENT, CLASSICAL
from hil.least_squares.balance import Kind
from hil.least_squares.solving import undetermined
from hil.model.base_parameters import base_parameters
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.motion import Motion, Processing, Rests
    from hil.estimation.free_motion.settings import Reasons
    from hil.estimation.free_motion.survey import Survey
    from hil.estimation.free_motion.variants import Variant
    from hil.estimation.intervals import Edge
    from hil.estimation.options import Options
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.regression import Fit
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recorded, Recording


REVERSALS = 0.05
"""Share of samples below 2 % of an axis's speed that reversals explain: 1.3 % of a sine."""
STATIC = 1.25
"""Allowance for static friction over the Coulomb friction of a straight line through friction in
motion: with a Stribeck effect the former is greater."""


class Selected:
    """Repeatable iteration over selected recordings."""

    def __init__(
        self, recorded: Recorded, wanted: Callable[[RecordedMotion, Recording], bool]
    ) -> None:
        # an iterator is read into memory; a run is read anew each time
        self._recorded = list(recorded) if isinstance(recorded, Iterator) else recorded
        self._wanted = wanted

    def __iter__(self) -> Iterator[tuple[RecordedMotion, Recording]]:
        return (each for each in self._recorded if self._wanted(*each))


def free_motions(recorded: Recorded) -> Iterable[tuple[FreeMotion, Recording]]:
    """Return the free motions among recordings.

    Raises
    ------
    NotEnoughData
        There are no free motions.
    """
    found = Selected(recorded, lambda motion, _: isinstance(motion, FreeMotion))
    if not any(True for _ in found):
        raise NotEnoughData(
            "no free motions among the recordings; import some with hil import, or omit --method"
        )
    return cast("Iterable[tuple[FreeMotion, Recording]]", found)


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """Gathered recordings: input of a solver.

    Attributes
    ----------
    stretches : list of Motion
        Filtered stretches of the survey.
    lag_error : ndarray, shape (n_joints,)
        Standard errors of the lags of the torques [s].
    first : ndarray, shape (n_base,)
        First estimate, for load-dependent friction.
    recorded : Products
        Products of the recorded signals.
    drift : Drift
        Drift of the friction level; constant levels if gains are unknown.
    steady : Products
        `recorded` without this drift in the cells.
    edges : tuple of Edge
        Lags and compliances at the edge of the search range.
    """

    found: Survey
    stretches: list[Motion]
    processing: Processing
    lag_error: Array
    reasons: Reasons
    first: Array
    recorded: Products
    scaling: Scaling
    choice: Choice
    drift: Drift
    steady: Products
    edges: tuple[Edge, ...] = ()

    @property
    def products(self) -> Products:
        """Inner products of torques in SI, with columns of drifting levels."""
        return self.drift.applied(self.scaling.applied(self.steady))

    @property
    def choice_covariance(self) -> Array:
        """Covariance of the base parameters between alternative friction laws."""
        n = len(self.first)
        return covariance_of_choices(self.products, self.choice)[:n, :n]

    @property
    def effect(self) -> Array:
        """Change of the base parameters per relative change of torque constants, then rotors."""
        scaling, choice = self.scaling, self.choice
        whole = self.recorded.pieces[choice.slowest].total
        regression = choice.regression(scaling.applied(whole))
        # an unknown gain is estimated, and absorbs a change of the torque constant
        columns = scaling.columns(whole.layout)
        # a torque constant scales the recorded signal, including the torque of rotors
        torques = scaling.signal(whole.layout), drive_torques(whole)[1]
        effects = [regression.moved(whole.recast(each, columns, (ROTOR,))) for each in torques]
        return np.hstack(effects)[: len(self.first)]

    def rescaled(self, fit: Fit) -> Gathered:
        """Return a copy with the unknown gains of a fit and a new linearisation."""
        gains, unknown = self.scaling.gains.copy(), self.scaling.unknown
        gains[list(unknown)] *= np.exp([fit.x[fit.layout.index(gain_name(k))] for k in unknown])
        scaling = linearise(self.recorded, replace(self.scaling, gains=gains), self.choice)
        return replace(self, scaling=scaling)


def gather(
    robot: Robot,
    recorded: Recorded,
    variant: Variant,
    options: Options = DEFAULTS,
    *,
    open_scale: bool = False,
    p: Array | None = None,
) -> Gathered:
    """Gather recordings: choose the settings from the data and condense the motions.

    Parameters
    ----------
    options : Options
        Friction law, and nuisances to be estimated.
    open_scale : bool
        Fix an undetermined scale of unknown gains by setting one gain to 1.
    p : ndarray, shape (n_base,), optional
        Base parameters from recordings of other kinds, which fix the scale of unknown gains; by
        default the free motions must fix the scale.

    Raises
    ------
    NotEnoughData
        No free motions, or too short ones.
    NotIdentifiable
        Unknown gains leave base parameters undetermined.
    Mismatch
        The gain of an axis is known in some motions and unknown in others.
    """
    motions = free_motions(recorded)
    found = survey(motions)
    processing, reasons = processing_of(found)
    chosen = variant.terms == "chosen"
    if (found.still or found.nearly_still) and not found.unknown_gains:
        held, yielding = _held(robot, found, processing)
        found = replace(found, yielding=yielding)
        processing = replace(processing, held=(*held, *yielding))
    if chosen and not found.unknown_gains:
        processing = replace(processing, rests=_choose_rests(robot, found, processing))
    nuisances = find_nuisances(robot, found, processing, options.nuisance if chosen else ())
    processing = nuisances.processing
    stretches = _unspoilt_stretches(found, motions, processing)
    count = found.n_recordings
    usable = count, found.duration - count * stretches[0].spoilt
    divided = division(processing, found.duration, stretches, usable)
    beside = p if found.unknown_gains else None
    first, unknown = beside, found.unknown_gains
    if first is None:
        first, unknown = _first_estimate(robot, found, stretches, open_scale=open_scale)

    def condense(drifting: Array | None = None) -> Products:
        return recorded_products(
            robot,
            (filtered_motion(recording, processing) for _, recording in motions),
            divided,
            first,
            instruments=variant.solver == "instrumental",
            soft=processing.soft,
            drifting=drifting,
        )

    condensed = condense()
    scaling = first_scaling(robot, condensed.pieces[0].total, unknown, beside)
    products = (scaling if beside is None else Scaling.known(scaling.gains)).applied(condensed)
    laws = TRIED if options.friction == "auto" else (options.friction,)
    choice = (
        choose(products, laws, nuisances.plain)
        if chosen
        else classical_choice(products, weighted=variant.weighted)
    )
    # the joint fit determines a scale left open by these recordings (`rescaled`)
    scaling = (refined if beside is None else linearise)(condensed, scaling, choice)
    drift, steady = Drift.none(robot.n_joints), condensed
    if chosen and not unknown and "drift" in options.nuisance:
        drift = find_drift(products, choice, found.duration)
        if any(drift.spans):
            products = drift.applied(products)
            choice = choose(products, laws, nuisances.plain)
            x, count = choice.fitted(products).solution, products.n_pieces
            beyond = drift.beyond_mean(x, products.layout, count)
            steady = replace(condensed, cells=condense(beyond).cells)
    return Gathered(
        found=found,
        stretches=stretches,
        processing=processing,
        lag_error=nuisances.lag_error,
        reasons=reasons,
        first=first,
        recorded=condensed,
        scaling=scaling,
        choice=choice,
        drift=drift,
        steady=steady,
        edges=nuisances.edges,
    )


def gather_rates(
    robot: Robot,
    recorded: Recorded,
    variant: Variant,
    options: Options = DEFAULTS,
    p: Array | None = None,
) -> list[Gathered]:
    """Condense recordings separately by sampling rate, fastest first.

    A filter designed for one rate removes signal at another rate, or passes noise. Parameters and
    errors are those of `gather`. An unknown gain is common to all recordings, so there is one rate.
    """
    motions, firsts = free_motions(recorded), list[float]()
    for motion, recording in motions:
        if motion.unknown_gains:
            return [gather(robot, motions, variant, options, p=p)]
        firsts.append(recording.period)
    firsts.sort()
    # largest ratio of sampling periods within a rate: the filter depends on the rate, and the rates
    # of equal clocks differ by less
    limits = [b for a, b in pairwise(firsts) if b > 1.5 * a]
    rates = (
        Selected(motions, lambda _, each, a=a, b=b: a <= each.period < b)  # type: ignore[misc]
        for a, b in pairwise([0.0, *limits, np.inf])
    )
    return [gather(robot, each, variant, options, p=p) for each in rates]


def rate_regressions(gathered: Sequence[Gathered]) -> list[Kind]:
    """Return a regression for every rate, with separate channels, ready for a joint fit."""
    kinds = []
    for number, each in enumerate(gathered, start=1):
        fitted, cells = each.choice.fitted(each.products), each.products.cells[each.choice.slowest]
        names = tuple(f"{name} import {number}" for name in cells.channels)
        blocks = replace(fitted.blocks.grouped(BLOCKS), channels=names)
        cells = replace(cells, channels=names)
        kinds.append(Kind(fitted.transfer(blocks), cells, each.choice_covariance, each.effect))
    return kinds


def _held(
    robot: Robot, found: Survey, processing: Processing
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the axes held by a brake or by static friction: at rest, and giving way."""
    motions = [filtered_motion(each, processing) for each in found.stretches]
    pieces = _first_pieces(robot, found, motions)
    if pieces is None:
        return (), ()
    return held_axes(pieces, found.still), yielding_axes(pieces, found.nearly_still)


def _choose_rests(robot: Robot, found: Survey, processing: Processing) -> Rests:
    """Choose the use of torques at rest: left out if motion alone is certainly better.

    The torque of an axis at rest is weight within the static friction, by an error that lasts as
    long as the rest. A torque at rest further from the weight shows what the model lacks, and
    joints that move one by one show couplings at rest only.
    """
    uses: tuple[Rests, Rests] = ("level", "left out")
    of_all, of_motion = (
        [filtered_motion(each, replace(processing, rests=use)) for each in found.stretches]
        for use in uses
    )
    if all(np.array_equal(a.telling, b.telling) for a, b in zip(of_all, of_motion, strict=True)):
        return "level"
    every, moving = (_first_pieces(robot, found, motions) for motions in (of_all, of_motion))
    if every is None or moving is None:
        return "level"
    if moving.counts.sum() > (1.0 - REVERSALS) * every.counts.sum():
        return "level"
    n, fits = len(base_parameters(robot)), [usual(pieces) for pieces in (every, moving)]
    lost = [undetermined(each.normal.information)[:n] for each in fits]
    x, layout = fits[1].solution, moving.layout
    coulomb = x[[layout.index("Coulomb", axis) for axis in range(robot.n_joints)]]
    at_rest = every.squares_left(x).sum(axis=0) - moving.squares_left(x).sum(axis=0)
    counts = every.counts.sum(axis=0) - moving.counts.sum(axis=0)
    # variances of torques on the recorded motion, relative to the torques
    columns = every.total.products[0, :, 1 : n + 1, 1 : n + 1]
    driven = every.squares > 0
    columns = columns[driven] / every.squares[driven, np.newaxis, np.newaxis]
    errors = [np.sum(columns * each.fit().covariance[:n, :n]) for each in fits]
    # ratio of two variances by chance, at a level of 5 %
    chance = special.fdtri(len(moving) - 1, len(moving) - 1, 0.05) if len(moving) > 1 else 0.0
    better = (
        (lost[1] <= lost[0]).all()
        and (at_rest <= (STATIC * coulomb) ** 2 * counts).all()
        and errors[1] < chance * errors[0]
    )
    return "left out" if better else "level"


def _first_pieces(robot: Robot, found: Survey, motions: Sequence[Motion]) -> Blocks | None:
    """Condense the survey's stretches with classical friction; None without unspoilt samples."""
    motions = [motion for motion in motions if motion.used.sum() > 1]
    if not motions:
        return None
    first = np.zeros(len(base_parameters(robot)))
    divided = division(motions[0].processing, found.duration)
    recorded = recorded_products(robot, motions, divided, first, (*CLASSICAL, BENT))
    return Scaling.known(np.ones(robot.n_joints)).applied(recorded).pieces[0]


def _unspoilt_stretches(
    found: Survey, motions: Iterable[tuple[FreeMotion, Recording]], processing: Processing
) -> list[Motion]:
    """Filter the stretches of a survey; longer stretches where filter transients fill these."""
    stretches = [filtered_motion(each, processing) for each in found.stretches]
    if any(each.used.any() for each in stretches):
        return stretches
    spoilt = max(each.spoilt for each in stretches)
    # twice the spoilt duration, so that half remains
    longer = survey(motions, 2.0 * spoilt).stretches
    stretches = [filtered_motion(each, processing) for each in longer]
    if any(each.used.any() for each in stretches):
        return stretches
    raise too_short(found.longest, spoilt, processing)


def _first_estimate(
    robot: Robot, found: Survey, stretches: Sequence[Motion], *, open_scale: bool
) -> tuple[Array, tuple[int, ...]]:
    """Estimate base parameters over the survey's stretches, and select the unknown gains.

    Load-dependent friction needs the transmitted torque.
    """
    n_base = len(base_parameters(robot))
    processing, first = stretches[0].processing, np.zeros(n_base)
    divided, unknown = division(processing, found.duration), found.unknown_gains
    # the transmitted torque comes from a solution with rigid gears
    for soft in dict.fromkeys(((), processing.soft)):
        recorded = recorded_products(
            robot, stretches, divided, first, (*CLASSICAL, BENT), soft=soft
        )
        total = recorded.pieces[0].total
        while open_scale and (lost := open_gains(total, unknown)):
            unknown = tuple(axis for axis in unknown if axis != lost[0])
        scaled = first_scaling(robot, total, unknown).applied(total)
        first = usual(scaled).solution[:n_base]
    return first, unknown
