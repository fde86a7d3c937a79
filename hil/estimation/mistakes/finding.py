"""The likeliest mistake: whether anything is off, and which reading explains it best.

Quick tests come first: does one set of base parameters explain all parts of all measurements
(`misfit`), are friction and kinetic energy positive, and does one step of any size take a share of
the residual away that noise cannot. Where nothing is off that is all. Otherwise every candidate is
tried, and of those that mechanics allows, that are large and significant, the one which leaves
least is named. Where none of them explains the misfit, that is all that is stated.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.mistakes.candidates import (
    INSTANTS,
    of_drifts,
    of_missing_parameters,
    of_order,
    of_period,
    of_signs,
    of_sizes,
    of_slips,
    of_spring,
    waves,
)
from hil.estimation.mistakes.evidence import channels
from hil.estimation.mistakes.misfit import Campaign
from hil.estimation.mistakes.mistake import Mistake, MistakeName
from hil.estimation.mistakes.reading import Reading
from hil.estimation.mistakes.saturation import saturated
from hil.estimation.mistakes.search import linear, tried
from hil.estimation.signals import signals
from hil.least_squares.solving import orthonormal
from hil.least_squares.window import HALF_WIDTH
from hil.planning.measurement import shows_parameters

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.mistakes.candidates import Candidate
    from hil.estimation.mistakes.evidence import Channel
    from hil.estimation.mistakes.misfit import Explanation
    from hil.estimation.mistakes.search import Tried
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion, RecordedMotion
    from hil.runs.recording import Recording

    Prepared = Sequence[tuple[ParameterMotion, Signals]]

LEAVES = 0.5
"""Share of the sum of squares that a mistake leaves at most, where limits are unknown: what is
reached takes their place (`hil.friction.equation`), and friction of slow samples, which that lets
in, contradicts every model a little (public recordings of five machines: 0.75 and more)."""
AGREES = 1.15
"""Misfit of an axis up to which recordings agree with each other."""
CONTRADICTS = 3.0
"""Misfit from which on they do not, whatever the reason."""
CERTAIN = 7.0
"""Size over standard error from which on a mistake counts."""
TAKEN = 0.005
"""Share of the sum of squares that it must take away."""
EXPLAINED = 0.5
"""Share of the misfit that it must explain."""
AS_GOOD = 0.003
"""Share of the sum of squares by which two candidates are not distinguished."""
PER_UNKNOWN = 0.001
"""Share of the sum of squares that an unknown is worth, where candidates are compared."""


def find_mistake(
    robot: Robot, recorded: Iterable[tuple[RecordedMotion, Recording]]
) -> Mistake | None:
    """Find the likeliest mistake behind recordings; None where they agree with the robot.

    None too where too little was recorded to contradict itself, and for a robot of unknown limits
    where nothing explains most of the contradiction.
    """
    prepared = list(_prepared(recorded))
    found = channels(robot, prepared)
    if not found:
        return None
    stated = Reading.stated(robot)
    campaign = Campaign(found, stated)
    explained = campaign.explain(stated)
    if not _off(campaign, stated, explained):
        return None
    if (limit := saturated(robot, prepared)) is not None:
        return limit
    likeliest = _likeliest(campaign, stated, explained)
    if robot.limits_known or likeliest is None or likeliest.left <= LEAVES:
        return likeliest
    return None


def _prepared(
    recorded: Iterable[tuple[RecordedMotion, Recording]],
) -> Iterator[tuple[ParameterMotion, Signals]]:
    for measurement, recording in recorded:
        if shows_parameters(measurement):
            try:
                yield measurement, signals(recording)
            except NotEnoughData:
                continue


def _off(campaign: Campaign, stated: Reading, explained: Explanation) -> bool:
    """Whether anything speaks against what is stated."""
    if explained.misfit.max() > AGREES or not _possible(campaign, stated, explained):
        return True
    steps = (linear(campaign, each, explained) for each in _sizes(campaign, stated, explained))
    return any(taken > TAKEN and t > CERTAIN for taken, t in steps)


def _likeliest(campaign: Campaign, stated: Reading, explained: Explanation) -> Mistake | None:
    possible = _possible(campaign, stated, explained)
    candidates = _candidates(campaign, stated, explained)
    every = [tried(campaign, each, explained, wide=True) for each in candidates]
    counting = [
        each for each in every if each.t > CERTAIN and (_explains(each, explained) or not possible)
    ]
    allowed = [each for each in counting if _allowed(campaign, each)]
    ranked = sorted(allowed or (counting if possible else []), key=_worth)
    if not any(each.large for each in ranked):
        return _contradiction(campaign, stated, explained)
    # where a size that no one would call a mistake explains most, nothing is one
    return _named(ranked, explained) if ranked[0].large else None


def _candidates(campaign: Campaign, stated: Reading, explained: Explanation) -> Iterator[Candidate]:
    instants = np.quantile(_times(campaign), np.arange(1, INSTANTS) / INSTANTS)
    yield from of_signs(stated)
    yield from of_order(stated)
    yield from _sizes(campaign, stated, explained)
    yield from of_slips(stated, instants.tolist())
    yield from of_missing_parameters(stated)


def _sizes(campaign: Campaign, stated: Reading, explained: Explanation) -> Iterator[Candidate]:
    """All that has a size, and no instant at which it begins."""
    yield from of_sizes(stated)
    times = _times(campaign)
    if min(times) < max(times):
        yield from of_drifts(stated, min(times), max(times))
    for channel, left in campaign.residuals(explained):
        axis, size = channel.axis, float(np.sqrt(np.mean(channel.tau**2)))
        if size:
            yield of_spring(stated, axis, size)
            if stated.robot.revolute[axis]:
                yield of_period(stated, axis, _order(channel, left), size)


def _times(campaign: Campaign) -> list[float]:
    return [part.time for channel in campaign.channels for part in channel.parts]


def _order(channel: Channel, left: Array) -> int:
    """How often a turn the torque repeats that takes most of what is left away."""

    def taken(order: int) -> float:
        basis, _ = orthonormal(channel.without_friction(waves(channel.q[:, channel.axis], order)))
        return float(np.sum((basis.T @ left) ** 2))

    fastest = float(np.abs(channel.qd[:, channel.axis]).max())
    return max(range(1, max(2, int(np.pi / (HALF_WIDTH * fastest)))), key=taken)


def _named(ranked: Sequence[Tried], explained: Explanation) -> Mistake:
    """The best, with the next one of another name or axis if that leaves as little.

    A load comes before a zero that leaves as much: to home an axis that only carries a load would
    spoil what was right.
    """
    least = ranked[0].explanation.chi_square
    alike = [each for each in ranked if each.explanation.chi_square < (1.0 + AS_GOOD) * least]
    alike = [each for each in alike if each.large]
    best, *rest = sorted(alike, key=lambda each: each.candidate.name != MistakeName.LEFT_OUT)
    others = [
        _mistake(each, explained)
        for each in rest
        if (each.candidate.name, each.candidate.axes) != (best.candidate.name, best.candidate.axes)
    ]
    return replace(_mistake(best, explained), other=others[0] if others else None)


def _mistake(each: Tried, explained: Explanation) -> Mistake:
    axes = tuple(axis + 1 for axis in each.candidate.axes)
    left = each.explanation.chi_square / explained.chi_square
    change = None if each.candidate.more else each.explanation.p - explained.p
    words = each.candidate.words(each.theta, each.error)
    return Mistake(each.candidate.name, axes, words, left, change=change)


def _explains(each: Tried, explained: Explanation) -> bool:
    """Whether a candidate takes enough of the residual and of the misfit away."""
    before, after = explained.chi_square, each.explanation.chi_square
    excess, left = (float((x.misfit - 1.0).clip(0.0).sum()) for x in (explained, each.explanation))
    small = explained.misfit.max() < AGREES
    return before - after > TAKEN * before and (small or left < (1 - EXPLAINED) * excess)


def _worth(each: Tried) -> float:
    return each.explanation.chi_square * (1.0 + PER_UNKNOWN * each.candidate.unknowns)


def _possible(campaign: Campaign, reading: Reading, explained: Explanation) -> bool:
    """Whether friction takes power everywhere, and all motion has a positive energy."""
    p = explained.p
    return not campaign.driving(reading, p) and not campaign.negative(reading, p)


def _allowed(campaign: Campaign, each: Tried) -> bool:
    """Whether mechanics allows it; parameters added, which hardly show, may have any sign."""
    reading = each.candidate.reading(each.theta)
    if campaign.beyond(reading):
        return False
    if each.candidate.more:
        return not campaign.driving(reading, each.explanation.p)
    return _possible(campaign, reading, each.explanation)


def _contradiction(campaign: Campaign, stated: Reading, explained: Explanation) -> Mistake | None:
    """What is off, where no candidate explains it."""
    driven = campaign.driving(stated, explained.p)
    worst = int(np.argmax(explained.misfit))
    if driven:
        axes = tuple(axis + 1 for axis in driven)
        return Mistake(MistakeName.UNKNOWN, axes, "friction would drive it", 1.0)
    if campaign.negative(stated, explained.p):
        return Mistake(MistakeName.UNKNOWN, (), "some motions would have a negative energy", 1.0)
    if explained.misfit[worst] > CONTRADICTS:
        times = np.sqrt(explained.misfit[worst])
        detail = f"all measurements together leave {times:.1f} times what each leaves by itself"
        return Mistake(MistakeName.UNKNOWN, (campaign.channels[worst].axis + 1,), detail, 1.0)
    return None
