"""The verdict on a model by its scores on another recording: rules, and the worst they find."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hil.results.verdict import WORDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.results.verdict import AxisScore, Word

NAIVE = 0.9
"""Share of the naive prediction's error from which on a model is of no use."""
INSIDE = 0.79
"""Share of samples inside predicted intervals of 95 % below which these are too narrow.

Samples of one recording share errors of parameters and of friction's level. Where these are half of
the variance and at the end of an interval of 95 % of their own, right intervals hold Phi(1.96
(sqrt(2) - 1)) = 0.79 of the samples; errors 1.56 times those stated, without any shared, as many.
"""
WORSE = 2.0
"""Residual over that of the identification from which on a model does not generalise."""
GOOD = 0.05
"""Relative error that is no reason to warn, however small the identification's was."""
GAIN = 0.1
"""By how much measured over predicted torque may differ from 1."""
UNEXCITED = 0.1
"""Error of the prediction by the parameters' own standard errors, as share of the torque."""
ASYMMETRY = 0.5
"""Share of the residual that may be a level which changes with the direction."""
LEVEL = 0.02
"""Of samples at one and the same greatest torque: the drive was at its limit."""


SURE = 3.0
"""Standard errors that a gain must be beyond that."""


class Verdict(NamedTuple):
    """A word and the sentence that says why."""

    word: Word
    reason: str


def judged(scores: Sequence[AxisScore], n_joints: int, reservations: Sequence[str] = ()) -> Verdict:
    """Return the worst of what speaks against a model; where nothing does, how well it predicts.

    Parameters
    ----------
    scores : sequence of AxisScore
    n_joints : int
    reservations : sequence of str
        What its identification says against it, whatever it predicts.
    """
    against = [*_findings(scores, n_joints), *map(_warn, reservations)]
    found = sorted(against, key=lambda each: -WORDS.index(each.word))
    return found[0] if found else Verdict("PASS", _praise(scores))


def _findings(scores: Sequence[AxisScore], n_joints: int) -> Iterator[Verdict]:
    """Everything that speaks against the model; of each kind the worst axis."""
    if not scores:
        yield _refuse(
            "no axis has enough samples in motion that can be used: away from reversals, faster"
            " than a few percent of its speed limit and clear of both ends of the recording; record"
            " a longer or faster motion"
        )
        return
    for rule in (
        _naive,
        _limited,
        _not_excited,
        _gain,
        _generalises,
        _friction,
        _asymmetric,
        _intervals,
        _without_friction,
    ):
        yield from rule(scores)
    missing = [k for k in range(1, n_joints + 1) if k not in [s.axis for s in scores]]
    if missing:
        yield _warn(f"axes {', '.join(map(str, missing))} do not move in this recording")


def _naive(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    worst = max(scores, key=lambda s: s.relative / max(s.naive, 1e-12))
    if worst.relative > NAIVE * worst.naive and worst.relative > GOOD:
        why = "the model does not hold for this motion"
        if worst.uncertain > UNEXCITED:
            why = (
                "the recordings that the model was made from do not excite what this motion needs:"
                f" standard errors amount to {worst.uncertain:.0%} of its torque"
            )
        if worst.of_bodies < NAIVE * worst.naive and worst.of_bodies < worst.relative:
            why = (
                f"with friction fitted in this recording it is off by {worst.of_bodies:.0%}: the"
                " bodies hold, the friction that the model states does not; identify it anew"
            )
        yield _refuse(
            f"axis {worst.axis}: the prediction is off by {worst.relative:.0%} of the torque, the"
            f" mean torque alone by {worst.naive:.0%}; {why}"
        )


def _gain(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    worst = max(scores, key=lambda s: abs(s.gain - 1.0))
    if abs(worst.gain - 1.0) > GAIN + SURE * worst.gain_error:
        yield _warn(
            f"axis {worst.axis}: gains inconsistent, measured torques are {worst.gain:.2f} times"
            f" those predicted, at most {GAIN:.0%} may be missing; torque constant or gain differ"
            " from those identified"
        )


def _limited(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    worst = max(scores, key=lambda s: s.limited)
    if worst.limited > LEVEL:
        yield _warn(
            f"axis {worst.axis}: saturated, {worst.limited:.0%} of the samples are at one and"
            " the same greatest torque; the drive was at its limit, record a slower motion"
        )


def _not_excited(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    worst = max(scores, key=lambda s: s.uncertain)
    if worst.uncertain > UNEXCITED:
        yield _warn(
            f"axis {worst.axis}: not excited, standard errors of the parameters amount to"
            f" {worst.uncertain:.0%} of this motion's torque, at most {UNEXCITED:.0%} may be;"
            " measure motions that show these parameters (hil plan --refine)"
        )


def _generalises(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    def over(s: AxisScore) -> float:
        return s.of_bodies * s.torque / (s.identified or 1.0)

    known = [s for s in scores if s.identified and s.of_bodies > GOOD]
    for worst in sorted(known, key=over)[-1:]:
        times = over(worst)
        if times > WORSE:
            yield _warn(
                f"axis {worst.axis}: the residual is {times:.1f} times that of the identification;"
                " the model does not generalise to this motion's range of speeds and positions"
            )


def _asymmetric(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    for worst in sorted(scores, key=lambda s: -s.asymmetry)[:1]:
        if worst.asymmetry > ASYMMETRY and worst.relative > GOOD:
            yield _warn(
                f"axis {worst.axis}: friction asymmetric, {worst.asymmetry:.0%} of the residual"
                " changes its sign with the direction; friction is not that of the identification"
            )


def _intervals(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    worst = min(scores, key=lambda s: s.inside)
    if worst.inside < INSIDE:
        yield _warn(
            f"axis {worst.axis}: {worst.inside:.0%} of the samples lie inside the predicted"
            f" intervals of 95 %, {INSIDE:.0%} are needed at least; these are too narrow for this"
            f" motion, whose torque is predicted within {worst.relative:.1%}"
        )


def _friction(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    for worst in sorted((s for s in scores if s.own_friction), key=lambda s: s.inside)[:1]:
        if worst.inside < INSIDE and worst.relative > max(GOOD, WORSE * worst.of_bodies):
            yield _warn(
                f"axis {worst.axis}: the rigid bodies hold, the friction that the model states does"
                f" not; with it the torque is off by {worst.relative:.0%}, and {worst.inside:.0%}"
                " of the samples lie inside intervals of 95 %: warmer, differently loaded, or other"
                " speeds than where it was identified; identify friction anew before torques are"
                " fed forward"
            )


def _without_friction(scores: Sequence[AxisScore]) -> Iterator[Verdict]:
    axes = ", ".join(str(s.axis) for s in scores if not s.own_friction)
    if axes:
        yield _warn(
            f"axis {axes}: the model states no friction, so that it does not predict what the"
            " drive has to give; judged with friction fitted in this recording"
        )


def _warn(reason: str) -> Verdict:
    return Verdict("WARN", reason)


def _refuse(reason: str) -> Verdict:
    return Verdict("REFUSE", reason)


def _praise(scores: Sequence[AxisScore]) -> str:
    worst, least = max(scores, key=lambda s: s.relative), min(scores, key=lambda s: s.inside)
    return (
        f"torques are predicted within {worst.relative:.1%} on every axis, axis {worst.axis} being"
        f" the worst, and {least.inside:.0%} of the samples or more lie inside intervals of 95 %;"
        f" the mean torque alone is off by {worst.naive:.0%} there{_of_bodies(scores)}"
    )


def _of_bodies(scores: Sequence[AxisScore]) -> str:
    """What is left with friction fitted in the recording, where that was done."""
    known = [s.refitted for s in scores if s.refitted is not None]
    if not known:
        return ""
    return f"; with friction fitted in this recording torques are within {max(known):.1%}"
