"""Change of friction between recordings, a column beside the columns of causes.

Friction is separate for each measurement in all other tests, so these show no change of friction.
Here all recordings share the friction of an axis, an odd function of the speed with a coefficient
for each of `CLASSES` classes of speed beside viscous and cube-root terms. So friction is compared
at speeds that both recordings have; later speeds outside have coefficients of their own. Offsets
are those of each measurement. The column of a change is 1 % of the earlier friction, in the later
recordings.

The three scales of `battery` apply. Friction that wanders makes parts differ. Model error may
resemble friction without any scatter, since a motion repeats it: a delay does, in proportion to the
frequency of the motion. But then it resembles the columns of other causes as well.

Warmth changes friction of all axes together (`hil.results.changes`). So for three axes or more,
the median of the other axes' changes is subtracted from each change, and the rest is tested. The
median of m other axes with standard deviations s_j has the variance (pi / 2) m / (sum 1 / s_j)^2,
as for normal distributions with one mean.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.excluded.battery import FAMILIES, LEVEL, Battery
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.columns import Column, Columns
from hil.estimation.excluded.deviation import parts_of
from hil.estimation.excluded.evidence import SAME
from hil.estimation.excluded.limits import noncentrality, torque_shares
from hil.estimation.excluded.result import Found, Limit
from hil.friction.terms import coupled_friction
from hil.least_squares.solving import orthonormal

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.excluded.evidence import Evidence
    from hil.model.robot import Robot

FRICTION = "friction"
SEVERAL = 3
"""Minimum number of axes for which the median change of the others is subtracted."""
CLASSES = 8
"""Number of classes of speed, each with as many earlier rows: over an eighth of them a smooth curve
of friction hardly differs in shape from the terms beside the classes."""


def friction_changes(
    robot: Robot, p: Array, evidence: Evidence, every: Columns, given: list[int]
) -> tuple[tuple[Found, ...], tuple[Limit, ...], Battery | None]:
    """Return axes with changed friction, the smallest detectable changes, and the tests' battery.

    In the battery all recordings share the friction of an axis; None without visible friction.

    Parameters
    ----------
    p : ndarray, shape (n_base,)
        Base parameters of all recordings.
    evidence : Evidence
        Evidence with later rows.
    every : Columns
        Columns of other causes of a change.
    given : list of int
        Indices of the columns of found causes.
    """
    evidence, friction = _shared(robot, p, evidence)
    if not friction:
        return (), (), None
    axes = sorted(friction)
    names = tuple(Column(FRICTION, axis) for axis in axes)
    values = 0.01 * np.column_stack([friction[axis] for axis in axes])
    late = values * evidence.is_later[:, np.newaxis]
    both = Columns((*names, *every.names), np.hstack([late, every.values]), every.free)
    early = ~evidence.is_later
    unchanged = Battery(evidence.only(early), Columns(names, values[early], every.free))
    scales = unchanged.part_scales(parts_of(unchanged.evidence.time))
    battery = Battery(evidence, both, [len(axes) + k for k in given], scales)
    every_test = [battery.test([k], itself=True) for k in range(len(axes))]
    tests = [test for test in every_test if test]
    if not tests:
        return (), (), None
    at = np.concatenate([test.columns for test in tests])
    raw = 0.01 * np.array([test.size[0] for test in tests])
    error = 0.01 * np.array([test.error[0] for test in tests])
    degrees = np.array([test.degrees for test in tests])
    # the earlier friction is 1; without visible friction no change of it is visible, and friction
    # that would drive the axis is a fault of the model
    known = (special.stdtr(degrees, -1.0 / error) < LEVEL) & (raw > -1.0)
    change, cause = raw, CAUSES[FRICTION]
    if len(tests) >= SEVERAL:
        others = ~np.eye(len(tests), dtype=bool)
        precision = np.array([np.sum(1.0 / error[each]) for each in others])
        change = raw - [np.median(raw[each]) for each in others]
        error = np.sqrt(error**2 + np.pi / 2.0 * (len(tests) - 1) / precision**2)
    else:
        cause = cause._replace(words="friction greater by")
    p_value = 2.0 * special.stdtr(degrees, -np.abs(change) / error)
    level = LEVEL / FAMILIES / len(tests)
    need = [np.sqrt(noncentrality(1, max(math.floor(each), 1), level)) for each in degrees]
    # as in `limits`; beside the rest, the change counts as a whole
    size = np.maximum(need * error + np.abs(change), 0.01 * battery.least_change(at) + np.abs(raw))
    shares = torque_shares(battery)
    found = tuple(
        Found(
            cause=FRICTION,
            axes=(axes[at[n]] + 1,),
            detail=cause.sized(100.0 * change[n], 100.0 * error[n], "%"),
            size=100.0 * float(change[n]),
            error=100.0 * float(error[n]),
        )
        for n in np.argsort(p_value)
        if known[n] and p_value[n] < level and battery.exceeds_the_rest(tests[n])
    )
    limits = tuple(
        Limit(
            cause=FRICTION,
            axis=axes[column] + 1,
            part="",
            unit="%",
            size=100.0 * float(size[n]) if known[n] else None,
            torque=float(shares[column]),
        )
        for n, column in enumerate(at)
    )
    return found, limits, battery


def _shared(robot: Robot, p: Array, evidence: Evidence) -> tuple[Evidence, dict[int, Array]]:
    """Return the evidence with common friction of all recordings, and earlier friction by axis.

    The columns of friction, and one of friction in proportion to the load, are the channels' own;
    offsets are those of parts. The earlier friction of axes, by axis from 0, has shape (n,) and is
    zero at other speeds. Axes whose friction would drive them, or that do not turn both ways in
    both recordings, have none.
    """
    parts = tuple((at, np.full((len(Q), 1), len(Q) ** -0.5)) for at, Q in evidence.parts)
    offsets = replace(evidence, parts=parts)
    v = evidence.motion[1, 1]
    terms = np.zeros((len(v), CLASSES + 5 + 2 * len(robot.couplings)))
    rest = evidence.torque - evidence.X @ p
    curves: dict[int, Array] = {}
    for axis in range(evidence.n_channels):
        mine = evidence.axis == axis
        early, late = (mine & (evidence.is_later == when) for when in (False, True))
        if not early.any():
            continue
        speed, sign = np.abs(v[:, axis]), np.sign(v[:, axis])
        edges = np.quantile(speed[early], np.linspace(0.0, 1.0, CLASSES + 1))
        # one class below and one above the earlier speeds
        of = np.searchsorted(edges, speed, "right") - (speed == edges[-1])
        inside = (of > 0) & (of <= CLASSES)
        if not all(np.isin((-1, 1), sign[rows & inside]).all() for rows in (early, late)):
            continue
        each = sign[:, np.newaxis] * (of[:, np.newaxis] == np.arange(CLASSES + 2))
        friction = np.column_stack([v[:, axis], np.cbrt(v[:, axis]), each])
        others = coupled_friction(robot, evidence.motion[1, 1], axis)
        known = offsets.project_out_friction(np.hstack([friction, evidence.own, others]))[early]
        torque = offsets.project_out_friction(rest)[early]
        coefficients = np.linalg.lstsq(known, torque, rcond=None)[0][: friction.shape[1]]
        curve = np.where(mine & inside, friction @ coefficients, 0.0)
        load = np.abs(evidence.X @ p) * sign
        basis, _ = orthonormal(np.column_stack([friction, load, others])[mine], SAME)
        terms[mine, : basis.shape[1]] = basis
        if float(curve[early] @ sign[early]) > 0.0:
            curves[axis] = curve
    return replace(offsets, own=np.column_stack([evidence.own, terms])), curves
