"""Torques or velocities with another clock than the positions, as in merged files.

Rows of a merged file are simultaneous only if both sources measure time equally. A faster clock, or
lost samples, make the columns lag by a varying time, which no constant shift corrects. A quantity
recorded with a lag l that obeys y = X p without lag obeys

    y(t + l) = X(t) p,    so to first order    y(t + l0) = X(t) p - (l - l0) y'(t + l0).

This is solved by least squares over p and a lag l per part of the recording, common to all joints,
with Newton's iteration. For torques p holds base parameters and friction of the axes, for
velocities a scale per joint. Varying lags are stated if they leave half of the mean squares left by
a constant lag, or less, in the geometric mean over the joints; a constant lag of the torques if it
leaves half of those without a lag. Noise of the positions lowers inertias, and friction of shifted
torques stands for them; so what noise may leave does not count. Friction that reverses over a
presliding distance resembles a delay, and is named as well unless a delay leaves half of the mean
squares left by the best of some distances.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.finding import LEAVES
from hil.friction.direction import friction_direction
from hil.imports.evidence import Suspicion, beyond_noise, half_width, noise_shares
from hil.model.dynamics import regressor
from hil.model.motors import motor_torque

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.evidence import Excerpt
    from hil.imports.map_file import Check
    from hil.model.robot import Robot

PARTS, SHORTEST = 12, 2.0
"""Maximum number of parts of a recording, and minimum duration of a part [s].

Half a period of a slow motion distinguishes a lag from friction.
"""
ROUNDS = 20
"""Maximum number of Newton iterations; a lag of 0.1 s takes about six."""
PART = 4
"""Number of rows for each one that is looked at first."""
REACH = 0.1
"""Maximum change of a lag per iteration [s]: a sixth of a period of the fastest motion of arms."""
FAR = REACH * np.delete(np.arange(-10, 11), 10)
"""Further lags to begin with, where Newton's iteration ends in a lag that explains little [s]."""
UNEXPLAINED = 0.1
"""Share of the variance that no usual model leaves: a third of the torque."""
SHARES = 2.0 ** np.arange(-6.0, 1.0)
"""Presliding distances to compare with a lag, over the way of the lag at the greatest speed:
reversals are slower."""


class _Rows(NamedTuple):
    """Rows of an excerpt: samples, columns (n, n_joints, k), known torques, part numbers.

    `means` are those of the recorded column around every sample of the excerpt.
    """

    excerpt: Excerpt
    means: Array
    samples: Integers
    X: Array
    known: Array
    part: Integers


class _Lags(NamedTuple):
    """Lag and mean time of the parts [s], and residuals as shares of variance by joint."""

    lags: Array
    middles: Array
    left: Array


def clock_of_torques(excerpts: Sequence[Excerpt], robot: Robot, shown: Mask) -> Iterator[Suspicion]:
    """Yield a suspicion where all torques lag, by a changing or a constant time.

    Parameters
    ----------
    shown : ndarray of bool, shape (n_joints,)
        Joints that move, with accelerations beyond their noise.
    """

    def rows(q: Array, qd: Array, qdd: Array, after: float = 0.0) -> tuple[Array, Array]:
        way = np.sign(qd)
        if after:
            far = after * np.maximum(np.abs(qd).max(axis=0), np.finfo(float).tiny)
            way = np.transpose([friction_direction(*each) for each in zip(q.T, far, strict=True)])
        own = np.stack([np.ones_like(qd), way, qd], axis=2)
        columns = [regressor(robot, q, qd, qdd), _block_diagonal(own)]
        return np.concatenate(columns, axis=2), motor_torque(robot, q, qd, qdd)

    yield from _suspicion(excerpts, shown, "tau", rows, presliding=rows)


def clock_of_velocities(excerpts: Sequence[Excerpt], shown: Mask) -> Iterator[Suspicion]:
    """Yield a suspicion where the lag of all recorded velocities changes along the recording.

    Parameters
    ----------
    shown : ndarray of bool, shape (n_joints,)
        Joints whose recorded velocity can be compared with the derivative of the position.
    """
    varies = np.any([np.ptp(each.qd, axis=0) > 0 for each in excerpts], axis=0)
    shown = shown & varies  # a constant in place of a velocity has no lag
    yield from _suspicion(
        excerpts, shown, "qd", lambda _q, qd, _qdd: (_block_diagonal(qd[:, :, None]), 0.0 * qd)
    )


def _block_diagonal(own: Array) -> Array:
    """Return block-diagonal columns (n, n_joints, n_joints k) of values (n, n_joints, k)."""
    n, joints, k = own.shape
    found = np.zeros((n, joints, joints, k))
    found[:, range(joints), range(joints)] = own
    return found.reshape(n, joints, joints * k)


def _suspicion(
    excerpts: Sequence[Excerpt],
    shown: Mask,
    key: str,
    columns: Callable[[Array, Array, Array], tuple[Array, Array]],
    presliding: Callable[..., tuple[Array, Array]] | None = None,
) -> Iterator[Suspicion]:
    if not shown.any():
        return
    period = excerpts[0].period
    # a part of the rows shows what all rows may confirm
    some, start = _rows(excerpts, shown, key, columns, PART), 0.0
    one, many = _found(some, shown)
    if np.exp(np.log(one.left).mean()) > UNEXPLAINED:
        together = _together(some)
        further = [_lags(together, shown, start=begin) for begin in FAR]
        best = min(further, key=lambda found: _left(found, one))
        if _left(best, one) <= LEAVES:
            start = float(best.lags[0])
            one, many = _found(some, shown, start)
    if abs(one.lags[0]) <= period / 2 and (many is None or _left(many, one) > np.sqrt(LEAVES)):
        return
    rows = _rows(excerpts, shown, key, columns, 1)
    one, many = _found(rows, shown, start)
    lag = float(one.lags[0])
    noise = noise_shares(excerpts)[shown] if key == "tau" else np.zeros(1)
    late = presliding is not None and abs(lag) > period
    if late:
        without = _lags(_together(rows), shown, reach=0.0)
        left = beyond_noise(without.left, one.left, noise)
        late = _left(one, without._replace(left=left)) <= LEAVES
    if many is not None:
        left = beyond_noise(one.left, many.left, noise)
        changes = _left(many, one._replace(left=left)) <= LEAVES
    # the instant of a row is known within a period; a lag that is found may change by half
    change = 0.0 if many is None else float(np.ptp(many.lags))
    least = LEAVES * abs(lag) if late else np.inf
    if many is not None and change > period and (change > least or changes):
        name = {"tau": "torque", "qd": "velocity"}[key]
        check: Check = "shape" if key == "tau" else "velocity"
        place = ("joints", 0, name)
        yield Suspicion(check, place, _words(name, many), certain=False, first=True)
    elif late and presliding:
        distances = SHARES * lag if lag > 0 else ()
        every = [_together(rows)]
        every += [
            _together(_rows(excerpts, shown, key, partial(presliding, after=far), 1))
            for far in distances
        ]
        without, best = (
            min((_lags(each, shown, *of) for each in every), key=lambda found: _left(found, one))
            for of in ((0.0,), (REACH, lag))
        )
        yield late_torques(lag, alike=_left(best, without) > LEAVES)


def _rows(
    excerpts: Sequence[Excerpt],
    shown: Mask,
    key: str,
    columns: Callable[[Array, Array, Array], tuple[Array, Array]],
    step: int,
) -> list[_Rows]:
    """Return every `step`-th row of the excerpts."""
    rows, first, most = [], 0, max(PARTS, len(excerpts))
    for each in excerpts:
        samples, (q, qd, qdd, *_), _ = each.fitted
        samples, n = samples[::step], PARTS // len(excerpts)
        n = max(1, min(n, int(len(each.q) * each.period / SHORTEST)))
        X, known = columns(q[::step], qd[::step], qdd[::step])
        part = (first + np.arange(len(samples)) * n // len(samples)) * PARTS // most
        half, recorded = half_width(each.period), getattr(each, key)
        sums = np.vstack([np.zeros(recorded.shape[1]), np.cumsum(recorded, axis=0)])
        means = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
        rows.append(_Rows(each, means, samples, X[:, shown], known[:, shown], part))
        first += n
    return rows


def _together(rows: Sequence[_Rows]) -> list[_Rows]:
    return [each._replace(part=0 * each.part) for each in rows]


def _found(rows: Sequence[_Rows], shown: Mask, start: float = 0.0) -> tuple[_Lags, _Lags | None]:
    """Return a common lag, and the lags of several parts, beginning with the lag `start` [s]."""
    several = any(each.part.any() for each in rows)
    one = _lags(_together(rows), shown, start=start)
    return one, _lags(rows, shown, start=start) if several else None


def late_torques(lag: float, *, alike: bool = False) -> Suspicion:
    """Return the suspicion of torques with a constant lag [s], or of friction `alike`."""
    other = ", or friction reverses only over some distance (presliding)" * alike
    why = "torques are recorded later, or low-passed, or positions are commanded ones: "
    message = (
        f"torques of all joints have a {'delay' if lag > 0 else 'lead'} of some "
        f"{float(f'{1e3 * abs(lag):.2g}'):.0f} ms{other}; {why if lag > 0 else ''}"
        f"{CAUSES['torque delay'].remedy}"
    )
    return Suspicion("shape", ("joints", 0, "torque"), message, certain=False, first=True)


def _left(found: _Lags, other: _Lags) -> float:
    """Return the ratio of mean squares, the geometric mean over the joints.

    A clock affects all joints, but a model error only some.
    """
    logs = [np.log(each.left) for each in (found, other)]
    return float(np.exp((logs[0] - logs[1]).mean()))


def _words(name: str, found: _Lags) -> str:
    lags, at = found.lags, found.middles
    slope, begin = np.polyfit(at, lags, 1)
    steps = [
        float(np.sum((lags[:k] - lags[:k].mean()) ** 2) + np.sum((lags[k:] - lags[k:].mean()) ** 2))
        for k in range(1, len(lags))
    ]
    jump = 1 + int(np.argmin(steps))
    if len(lags) > 2 and steps[jump - 1] < np.sum((lags - begin - slope * at) ** 2):
        size = lags[jump:].mean() - lags[:jump].mean()
        change = f"jumps by {1e3 * size:.0f} ms between {at[jump - 1]:.0f} and {at[jump]:.0f} s"
    else:
        change = (
            f"goes from {1e3 * lags[0]:.0f} ms at {at[0]:.0f} s to {1e3 * lags[-1]:.0f} ms at"
            f" {at[-1]:.0f} s, like clocks that differ by {100 * abs(slope):.2g} %"
        )
    plural = {"torque": "torques", "velocity": "velocities"}[name]
    return (
        f"{plural} of all joints have another clock than the positions: their lag {change}; a "
        "constant shift does not correct this: merge the two sources by stamps of one clock, or "
        "choose rows with constant lag"
    )


def _lags(rows: Sequence[_Rows], shown: Mask, reach: float = REACH, start: float = 0.0) -> _Lags:
    """Find the lags of all parts of the recording; without lags for a `reach` of 0."""
    part = np.unique(np.concatenate([each.part for each in rows]), return_inverse=True)[1]
    X, known = (np.concatenate([getattr(r, name) for r in rows]) for name in ("X", "known"))
    time = np.concatenate([r.excerpt.begin + r.samples * r.excerpt.period for r in rows])
    one = np.eye(part.max() + 1)[part]
    lags, weight, tiny = np.full(one.shape[1], start), np.zeros(0), np.finfo(float).tiny
    finest = min(r.excerpt.period for r in rows) / 2  # rows are whole samples
    ends = np.cumsum([len(r.samples) for r in rows])[:-1]
    for number in range(ROUNDS):
        late = np.split(lags[part], ends)
        each = [_columns(r, lag) for r, lag in zip(rows, late, strict=True)]
        y, slopes = (np.concatenate(x)[:, shown] for x in zip(*each, strict=True))
        recorded, y = y, y - known
        columns = np.concatenate([X, -(reach > 0) * slopes[:, :, None] * one[:, None, :]], axis=2)
        if not len(weight):
            variance = np.maximum(recorded.var(axis=0), tiny)
            weight = 1.0 / np.maximum(y.var(axis=0), tiny)
        both = np.concatenate([columns, y[:, :, None]], axis=2) * np.sqrt(weight)[:, None]
        both = both.reshape(-1, both.shape[2])
        N, v = np.split(both[:, :-1].T @ both, [-1], axis=1)
        scale = np.sqrt(np.maximum(np.diag(N), tiny))
        x = np.linalg.lstsq(N / np.outer(scale, scale), v[:, 0] / scale, rcond=1e-10)[0] / scale
        left = np.mean((y - columns @ x) ** 2, axis=0)
        weight = 1.0 / np.maximum(left, tiny)
        change = np.clip(x[-len(lags) :], -reach, reach)
        lags = lags + change
        if number and np.abs(change).max() < finest:
            break
    return _Lags(lags, one.T @ time / one.sum(axis=0), np.maximum(left, tiny) / variance)


def _columns(rows: _Rows, lag: Array) -> tuple[Array, Array]:
    """Return means of the recorded column around `lag` [s] after the samples, and derivatives."""
    excerpt, means = rows.excerpt, rows.means
    half, last = half_width(excerpt.period), len(rows.means) - 1
    at = np.rint(rows.samples - half + lag / excerpt.period).astype(np.int64).clip(0, last)
    before, after = (at - half).clip(0), (at + half).clip(max=last)
    slopes = (means[after] - means[before]) / ((after - before) * excerpt.period)[:, None]
    return means[at], slopes
