"""Change of friction between recordings, on the scale of differences among earlier ones.

Friction is separate for each measurement in all other tests, so these show no change of friction.
Here the earlier recordings determine a curve phi(v) of Coulomb, viscous and cube-root terms for
each axis. For part k of the earlier or later recordings, the regression

    tau - A p - own columns = g_k phi(v) + o_k + e

gives the level g_k. Curves of friction are never exact, and their error depends on the speed: so
only speeds that both recordings have in common count, and rows are weighted so that both have the
same distribution over `BINS` classes of speed, by the smaller share of each class. The variance of
a level among the earlier parts and among the later parts is moderated over the axes (`moderated`)
and is at least the variance due to e. Recordings as a whole may differ by as much as their parts
do. Warmth changes friction of all axes together (`hil.results.changes`). So for three axes or more,
the median of the other axes' relative changes is subtracted from each change, and the rest is
tested. The median of m other axes with standard deviations s_j has the variance (pi / 2) m / (sum 1
/ s_j)^2, as for normal distributions with one mean.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.excluded.battery import FAMILIES, LEVEL
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.deviation import PARTS, parts_of
from hil.estimation.excluded.dispersion import moderated
from hil.estimation.excluded.limits import noncentrality
from hil.estimation.excluded.result import Found, Limit

if TYPE_CHECKING:
    from hil.arrays import Array, Indices
    from hil.estimation.excluded.evidence import Evidence
    from hil.model.robot import Robot

FRICTION = "friction"
SEVERAL = 3
"""Minimum number of axes for which the median change of the others is subtracted."""
BINS = 8
"""Number of classes of speed, each with as many earlier rows: over an eighth of them a smooth curve
of friction hardly differs in shape from that of the test."""
FEWEST = 30
"""Minimum number of rows for level and offset of a part: their error is a fifth of the noise."""


def friction_changes(
    robot: Robot, p: Array, evidence: Evidence
) -> tuple[tuple[Found, ...], tuple[Limit, ...]]:
    """Return axes with changed friction, and the smallest detectable changes by axis.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters of all recordings.
    evidence : Evidence
        Evidence with later rows.
    """
    shown = [(axis, x) for axis in range(robot.n_joints) if (x := _levels(p, evidence, axis))]
    if not shown:
        return (), ()
    axes, levels = zip(*shown, strict=True)
    change = np.array([x.later.mean() / x.earlier.mean() - 1.0 for x in levels])
    own = np.array([len(x.earlier) + len(x.later) - 2.0 for x in levels])
    squares = [((part - part.mean()) ** 2).sum() for x in levels for part in (x.earlier, x.later)]
    variance = np.sum(np.reshape(squares, (-1, 2)), axis=1) / own
    common = moderated(variance, own, np.eye(len(axes)))
    degrees = common.degrees + own
    variance = (common.degrees * common.dispersion + own * variance) / degrees
    variance = np.maximum(variance, [x.floor for x in levels])
    square = variance * (1.0 + 1.0 / PARTS)
    if len(axes) >= SEVERAL:
        others = ~np.eye(len(axes), dtype=bool)
        change = change - [np.median(change[each]) for each in others]
        precision = [np.sum(square[each] ** -0.5) for each in others]
        square = square + np.pi / 2.0 * (len(axes) - 1) / np.square(precision)
    error = np.sqrt(square)
    # the earlier level is 1; without a visible level no change of the level is visible
    known = special.stdtr(degrees, -1.0 / error) < LEVEL
    p_value = 2.0 * special.stdtr(degrees, -np.abs(change) / error)
    level = LEVEL / FAMILIES / len(axes)
    need = [np.sqrt(noncentrality(1, max(math.floor(each), 1), level)) for each in degrees]
    size = need * error + np.abs(change)  # as in `limits`
    cause = CAUSES[FRICTION]
    if len(axes) < SEVERAL:
        cause = cause._replace(words="friction greater by")
    found = tuple(
        Found(
            cause=FRICTION,
            axes=(axes[k] + 1,),
            detail=cause.sized(100.0 * change[k], 100.0 * error[k], "%"),
            size=100.0 * float(change[k]),
            error=100.0 * float(error[k]),
        )
        for k in np.argsort(p_value)
        if known[k] and p_value[k] < level
    )
    limits = tuple(
        Limit(
            cause=FRICTION,
            axis=axes[k] + 1,
            part="",
            unit="%",
            size=100.0 * float(size[k]) if known[k] else None,
            torque=levels[k].share,
        )
        for k in range(len(axes))
    )
    return found, limits


class _Levels(NamedTuple):
    """Friction levels of an axis by part, relative to the earlier recordings.

    Attributes
    ----------
    earlier, later : ndarray, shape (n_parts,)
    floor : float
        Variance of a level by the residual of the curve: a stroke shows one level, independent of
        its number of samples.
    share : float
        Share of the recorded torque due to 1 % of the friction.
    """

    earlier: Array
    later: Array
    floor: float
    share: float


def _levels(p: Array, evidence: Evidence, axis: int) -> _Levels | None:
    """Return the levels of an axis; None if some part does not show friction."""
    rows = np.flatnonzero(evidence.axis == axis)
    early, late = rows[~evidence.is_later[rows]], rows[evidence.is_later[rows]]
    own = evidence.own[:, evidence.own[early].any(axis=0)]
    v = evidence.motion[1, 1, :, axis]
    terms = np.column_stack([np.sign(v), v, np.cbrt(v), own])
    weights = _shared_speeds(np.abs(v), early, late)
    torque = evidence.torque - evidence.X @ p
    coefficients, *_ = np.linalg.lstsq(terms[early], torque[early], rcond=None)
    curve = terms[:, :3] @ coefficients[:3]
    rest = torque - terms[:, 3:] @ coefficients[3:]
    levels, floor = [], 0.0
    for part in (early, late):
        pieces = _pieces(part[weights[part] > 0], evidence.time, v)
        if pieces is None:
            return None
        fits = [_level(rest[at], curve[at], v[at], weights[at]) for at in pieces]
        levels.append(np.array([level for level, _ in fits]))
        floor += float(np.mean([variance for _, variance in fits])) / 2.0
    square = float(np.mean(evidence.recorded[rows] ** 2))
    # a model whose friction would drive the axis shows no change of it
    if min(each.mean() for each in levels) <= 0.0 or not square:
        return None
    share = 0.01 * float(np.sqrt(np.mean(curve[early] ** 2) / square))
    return _Levels(levels[0], levels[1], floor, share)


def _shared_speeds(speed: Array, early: Indices, late: Indices) -> Array:
    """Return weights of rows that give both recordings the same speeds."""
    weights = np.zeros(len(speed))
    if not (len(early) and len(late)):
        return weights
    edges = np.quantile(speed[early], np.linspace(0.0, 1.0, BINS + 1))
    inside = [
        part[(speed[part] >= edges[0]) & (speed[part] <= edges[-1])] for part in (early, late)
    ]
    at = [np.clip(np.searchsorted(edges, speed[part], "right") - 1, 0, BINS - 1) for part in inside]
    shares = [np.bincount(k, minlength=BINS) / max(len(k), 1) for k in at]
    least = np.minimum(*shares)
    for part, k, share in zip(inside, at, shares, strict=True):
        weights[part] = (least / np.maximum(share, np.finfo(float).tiny))[k]
    return weights


def _pieces(rows: Indices, time: Array, v: Array) -> list[Indices] | None:
    """Cut rows into two to `PARTS` parts with both directions of motion; None if impossible."""
    for n in range(PARTS, 1, -1):
        if len(rows) < n * FEWEST:
            continue
        part = parts_of(time[rows], n)
        pieces = [rows[part == k] for k in range(n)]
        if all(len(at) >= FEWEST and np.ptp(np.sign(v[at])) for at in pieces):
            return pieces
    return None


def _level(rest: Array, curve: Array, v: Array, weights: Array) -> tuple[float, float]:
    """Fit level and offset of a part; return the level and its variance by the residual."""
    terms, root = np.column_stack([curve, np.ones(len(curve))]), np.sqrt(weights)
    found, *_ = np.linalg.lstsq(terms * root[:, np.newaxis], rest * root, rcond=None)
    left = rest - terms @ found
    strokes = 1 + np.count_nonzero(np.diff(np.sign(v)))
    around = curve - np.average(curve, weights=weights)
    square, size = (float(np.average(x**2, weights=weights)) for x in (left, around))
    return float(found[0]), square / max(size, np.finfo(float).tiny) / strokes
