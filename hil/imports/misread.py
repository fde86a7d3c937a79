"""Columns with another meaning than stated in the map.

Positions, speeds and torques beyond the ranges and limits of the robot file, or far below;
velocities unrelated to the positions; torques that are another quantity; repeated columns. Errors
visible by mechanics alone are found in `mechanics`.
"""

from __future__ import annotations

import math
from itertools import combinations
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.excluded.causes import CAUSES
from hil.imports.evidence import Suspicion
from hil.model.drive_train_file import USUAL_BOUND
from hil.model.frames import ROUNDED_OFF
from hil.model.readers.limits import FARTHEST
from hil.runs.recording import CHANCE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.imports.evidence import Evidence, Excerpt
    from hil.model.robot import Robot

TOUCHES = math.ceil(-math.log2(CHANCE))
"""Minimum number of samples close to zero on one side that is not chance.

By chance, each sample is on either side with equal probability.
"""
SIDE, STRAIGHT = 0.1, 0.15
"""Length of the sides of a minimum at zero [s], half a period at 5 Hz, and the tolerance of their
middles over their ends: between a straight line, 1/2, and a parabola, 1/4."""
SHARP = 4
"""Minimum number of sharp minima: a smooth torque of one sign has none, and friction steps, at a
reversal, on one side only."""
OFTEN, CLOSE = 0.95, 0.05
"""Quantile for the ordinary step between samples, and distance from zero that counts as zero, in
ordinary steps.

At this distance both signs are equally likely.
"""
EXCEEDED, ABSURD = 1.0 + USUAL_BOUND, 10.0
"""Shares of a limit of speed or torque: stated above the first, refused above the second.

The first is the usual error of a torque constant. The second is between peak over rated torque, 2,
and the factors of gears and degrees, 50 and 57: their geometric mean.
"""
FITS = 0.9
"""Minimum correlation of two velocities of the same joint.

The correlation of a sinusoid delayed by a drive's filter is the cosine of the phase lag: 0.9 for 36
ms at 2 Hz, the fastest oscillation of robots.
"""
_NOISE = 1.0 - FITS
"""Noise, as a share of the power of both velocities, that reduces their correlation to `FITS`.

Such noise reduces the ratio of the velocities by the same share.
"""
THERMAL = 4e-21
"""Torque [N m] whose work over a radian is the thermal energy of a molecule at 20 °C, k T.

No sensor resolves less, nor less of a position or a velocity: an atom's nucleus has 1e-15 m.
"""
INDEPENDENT = 1.0 / 6.0
"""Time between independent samples of motion up to 3 Hz [s]: half a period."""
OTHER = (2.0 / (1.0 - _NOISE)) ** 0.5
"""Refused ratio of velocities.

Geometric mean of the effect of noise and of 2, the least effect of a wrong unit or of skipped
samples.
"""
_OTHERWISE = "correct unit, offset or column, or the range in the robot file"
_TURNS = (
    "a joint whose range is a whole turn may turn over: state a wider range in the robot file, or"
    " correct unit, offset or column"
)


def other_units(robot: Robot, joint: int) -> dict[str, float]:
    """Return factors from SI to other units, or to the motor's side, of positions or velocities."""
    gear = float(robot.gear_ratio[joint])
    turning = {"in mm": 1e3}
    if robot.revolute[joint]:
        turning = {"in deg": 180 / pi, "in rpm": 30 / pi, "in turns": 0.5 / pi}
    if gear == 1:
        return turning
    side = f"on the motor's side at a gear ratio of {gear:g}"
    both = {f"{unit} {side}": factor * gear for unit, factor in turning.items()}
    return turning | {side: gear} | both


def misread_velocities(evidence: Evidence, robot: Robot) -> Iterator[Suspicion]:
    """Yield suspicions of recorded velocities that contradict the derivatives of the positions."""
    for joint in np.flatnonzero(compared(evidence) & ~_within_error(evidence, robot)).tolist():
        own, other = evidence.recorded_qd[:, joint], evidence.qd[:, joint]
        at = ("joints", joint, "velocity")
        correlation = _correlation(own, other)
        if abs(correlation) < FITS:
            yield Suspicion("velocity", at, _fits_none(evidence, joint, correlation))
            continue
        scale = float(own @ other / (other @ other))
        # rounding, or a dead band, reduces the velocity by up to its own share
        rounding = float(evidence.noise_recorded[joint] / np.sqrt(np.mean(own**2)))
        if abs(scale - 1) > _NOISE + rounding:
            yield Suspicion(
                "velocity",
                at,
                f"is {scale:.4g} times the derivative of the position of joint {joint + 1};"
                f" {_why_scaled(scale, robot, joint)}",
                certain=scale < 0 or abs(np.log(scale)) > np.log(OTHER),
            )
    for joint in np.flatnonzero(_astray(evidence)).tolist():
        correlation = _correlation(evidence.recorded_qd[:, joint], evidence.qd[:, joint])
        message = _fits_none(evidence, joint, correlation)
        yield Suspicion("velocity", ("joints", joint, "velocity"), message)


def _within_error(evidence: Evidence, robot: Robot) -> Mask:
    """Return joints slower than the velocity error of a joint of the same kind that follows.

    Moving joints carry such joints a little, and sensors differ at such speeds.
    """
    error = np.zeros(len(evidence.moves))
    for joint in np.flatnonzero(compared(evidence)):
        own, other = evidence.recorded_qd[:, joint], evidence.qd[:, joint]
        if _correlation(own, other) >= FITS:
            alike = robot.revolute == robot.revolute[joint]
            error[alike] = np.maximum(error[alike], np.sqrt(np.mean((own - other) ** 2)))
    fastest = np.maximum(np.abs(evidence.qd), np.abs(evidence.recorded_qd)).max(axis=0)
    return np.asarray(fastest < error)


def compared(evidence: Evidence) -> Mask:
    """Return joints whose recorded velocity can be checked by the derivative of the position.

    Noise of either reduces the correlation below `FITS` if it has more than `_NOISE` of the power.
    The noise of a recorded velocity counts as that of a single sample, since rounding and dead
    bands are not averaged over neighbours. A constant column shows no rounding, but is no finer
    than the others.
    """
    recorded = np.isfinite(evidence.recorded_qd).all(axis=0)
    rounding = np.where(recorded, evidence.noise_recorded, 0.0)
    constant = recorded & (np.ptp(evidence.recorded_qd, axis=0) == 0)
    rounding[constant] = rounding.max(initial=0.0)
    power = np.mean(evidence.qd**2, axis=0)
    greater = np.maximum(power, np.nan_to_num(np.mean(evidence.recorded_qd**2, axis=0)))
    noisy = (evidence.noise_qd**2 > _NOISE * power) | (rounding**2 > _NOISE * greater)
    return np.asarray(recorded & evidence.moves & ~noisy)


def _astray(evidence: Evidence) -> Mask:
    """Return joints whose recorded velocity is certainly noise while the position shows motion.

    The covariance of a noisy velocity with the true one equals the power of the true one, within
    the standard error for the number of independent samples: one in `INDEPENDENT`.
    """
    power = np.mean(evidence.qd**2, axis=0)
    shown = np.isfinite(evidence.recorded_qd).all(axis=0) & evidence.moves & ~compared(evidence)
    shown &= (evidence.noise_qd**2 <= _NOISE * power) & (np.ptp(evidence.recorded_qd, axis=0) > 0)
    if not shown.any():
        return shown
    share = np.mean(evidence.qd * evidence.recorded_qd, axis=0)[shown] / power[shown]
    spread = np.mean(evidence.recorded_qd**2, axis=0)[shown] / power[shown]
    error = np.sqrt(spread * INDEPENDENT / evidence.duration)
    shown[shown] = np.abs(share) + 5.0 * error < 0.5
    return shown


def _fits_none(evidence: Evidence, joint: int, correlation: float) -> str:
    own = evidence.recorded_qd[:, joint]
    for other in range(evidence.q.shape[1]):
        if other != joint and abs(_correlation(own, evidence.qd[:, other])) > FITS:
            return (
                f"follows the position of joint {other + 1}, not of joint {joint + 1}; correct the"
                " order of the columns"
            )
    return (
        f"does not follow the position of joint {joint + 1} (correlation {correlation:.2f}); "
        "correct one of the columns, or omit velocity"
    )


def _correlation(a: Array, b: Array) -> float:
    scale = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / scale if scale else 0.0


def _why_scaled(scale: float, robot: Robot, joint: int) -> str:
    """Return the cause of a scale factor between velocities and positions, in words."""
    if scale < 0:
        return "one of the two has the wrong sign: correct sign"
    for unit, factor in other_units(robot, joint).items():
        for what, fits in (("velocity", scale / factor), ("position", scale * factor)):
            if abs(fits - 1) < _NOISE:
                return f"{what} is {unit}: correct its unit or side"
    return "correct unit, per_unit or the column of time"


def misread_torques(
    excerpts: Sequence[Excerpt], evidence: Evidence, robot: Robot
) -> Iterator[Suspicion]:
    """Yield suspicions of unsigned torques, velocities in place of torques, repeated columns."""
    yield from _twice(excerpts, evidence)
    yield from _unsigned_torques(excerpts)
    for joint in np.flatnonzero(evidence.moves).tolist():
        tau, qd = evidence.tau[:, joint], evidence.qd[:, joint]
        for unit, factor in ({"in SI": 1.0} | other_units(robot, joint)).items():
            # a velocity recorded as a torque differs by at most 5 %: a parabola through 2 x
            # `HALF_WIDTH` of positions attenuates a sinusoid by (w T)^2 / 10, 5 % at 5.6 Hz. No
            # robot has a viscous friction of exactly 1 N m s/rad alone
            if np.linalg.norm(tau - factor * qd) < 0.05 * np.linalg.norm(tau):
                yield Suspicion(
                    "still",
                    ("joints", joint, "torque"),
                    f"is the velocity of joint {joint + 1} {unit}; name the torque's column",
                )


def _twice(excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[Suspicion]:
    n = evidence.q.shape[1]
    for i, j in combinations(range(n), 2):
        for key, arrays in (("position", [e.q for e in excerpts]),
                            ("torque", [e.tau for e in excerpts])):  # fmt: skip
            # joints at rest may have equal positions
            shown = key == "torque" or evidence.moves[i]
            if not shown or not all(np.array_equal(x[:, i], x[:, j]) for x in arrays):
                continue
            least = ROUNDED_OFF * max(float(np.abs(array[:, i]).max()) for array in arrays)
            if any(np.ptp(array[:, i]) > least for array in arrays):
                yield Suspicion(
                    "still",
                    ("joints", j, key),
                    f"is the same as that of joint {i + 1} in all samples; one of the two "
                    "columns belongs to another joint: correct it",
                )


def _unsigned_torques(excerpts: Sequence[Excerpt]) -> Iterator[Suspicion]:
    """Yield a suspicion of torques that often reach zero and never cross it."""
    found: dict[int, int] = {}
    sharp = 0
    for joint in range(excerpts[0].tau.shape[1]):
        parts = [excerpt.tau[:, joint] for excerpt in excerpts]
        if all(np.all(x >= 0) for x in parts) or all(np.all(x <= 0) for x in parts):
            bends = sum(_sharp_minima(np.abs(e.tau[:, joint]), e.period) for e in excerpts)
            sharp += bends
            found[joint] = max(bends, sum(_touches(np.abs(x)) for x in parts))
    if sum(found.values()) >= TOUCHES or sharp >= SHARP:
        joints = [joint for joint, times in found.items() if times]
        yield Suspicion(
            "still",
            ("joints", joints[0], "torque"),
            f"torques of joints {', '.join(str(joint + 1) for joint in joints)} reach zero "
            f"{sum(found.values())} times and never change sign, like absolute values of "
            "currents; name columns with signs",
        )


def _sharp_minima(x: Array, period: float) -> int:
    """Count minima close to zero with straight sides, as a crossing leaves in absolute values.

    Halfway to a minimum at zero a straight line has half of its value, a parabola a quarter.
    """
    half = max(1, round(SIDE / 2.0 / period))
    over = max(1, half // 4)
    smooth = np.convolve(x, np.full(over, 1.0 / over), "valid")
    if len(smooth) <= 4 * half:
        return 0
    # white noise of variance 1 has second differences of variance 6, with a median square of 0.455
    noise = np.sqrt(np.median(np.diff(x, 2) ** 2) / (6.0 * 0.455 * over))
    around = np.lib.stride_tricks.sliding_window_view(smooth, 4 * half + 1)
    at = around[around[:, 2 * half] == around.min(axis=1)]
    ends, middles = at[:, [0, -1]], at[:, [half, -half - 1]]
    sides = middles / np.maximum(ends, np.finfo(float).tiny)
    straight = (np.abs(sides - 0.5) < STRAIGHT).all(axis=1)
    least = ends.min(axis=1)
    return int(np.sum(straight & (at[:, 2 * half] < 0.1 * least) & (least > 10.0 * noise)))


def _touches(x: Array) -> int:
    """Count samples as close to zero as by chance, between neighbours as far as of a crossing."""
    step = np.quantile(np.abs(np.diff(x)), OFTEN)
    # neighbours of a crossing are far, at a quarter of the ordinary speed by half a step in all; a
    # torque of one sign that rests close to zero has smaller steps there
    crosses = x[:-2] + x[2:] > 0.5 * step
    return int(np.count_nonzero((x[1:-1] > 0) & (x[1:-1] < CLOSE * step) & crosses))


def small(
    evidence: Evidence, robot: Robot, key: str, most: Array, of: Array
) -> Iterator[Suspicion]:
    """Yield a suspicion if all joints use a small share of range or limit, as in another unit.

    Parameters
    ----------
    key : str
        Key of the map.
    most, of : ndarray, shape (n_joints,)
        Distances and ranges, or greatest torques and limits.
    """
    shares = most / of
    widest = int(np.argmax(shares))
    # maximum share of a limit or a range in a wrong unit or on the wrong side: between 1/57 for
    # degrees or 1/50 for gears, and the shares of useful motions
    if np.isfinite(shares).all() and evidence.moves.any() and 0 < shares[widest] < 0.03:
        unit = (robot.position_unit if key == "position" else robot.torque_unit)(widest)
        yield Suspicion(
            "range",
            ("joints", widest, key),
            f"{'moves by' if key == 'position' else 'has up to'} {most[widest]:.3g} {unit}, "
            f"{100 * shares[widest]:.2g} % of its {'range' if key == 'position' else 'limit'}, "
            "the largest share of all joints; check unit, "
            f"{'per_unit' if key == 'position' else 'gain'} and {key}_side",
            certain=False,
        )


def unmeasurable(evidence: Evidence) -> Iterator[Suspicion]:
    """Yield suspicions of columns too small for any sensor, such as bytes of other numbers."""
    columns = {"position": evidence.q, "velocity": evidence.recorded_qd, "torque": evidence.tau}
    for key, values in columns.items():
        most = np.abs(values).max(axis=0)
        for joint in np.flatnonzero(evidence.moves & (most > 0) & (most < THERMAL)).tolist():
            yield Suspicion(
                "range",
                ("joints", joint, key),
                f"values up to {most[joint]:.2g} are no {key}, at least {THERMAL:g} (SI) needed "
                "for any sensor: integers read as doubles, or unwritten memory, have such values; "
                "correct the driver that recorded them, or name another column",
            )


def range_suspicions(
    evidence: Evidence,
    robot: Robot,
    unknown_gains: Sequence[int],
    reached: Callable[[], tuple[Array, Array]] | None = None,
) -> Iterator[Suspicion]:
    """Yield suspicions of positions beyond the range, and of speeds and torques beyond limits.

    Parameters
    ----------
    reached : callable, optional
        Function that returns the least and greatest recorded positions, called for a message.
    """
    for joint in range(robot.n_joints):
        unit, q = robot.position_unit(joint), evidence.q[:, joint]
        low, high = float(robot.q_min[joint]), float(robot.q_max[joint])
        excess = max(float(q.max()) - high, low - float(q.min()))
        # the bounds of a joint without range are no claim of its range
        zero = 2.0 * (high - low) if high == -low == FARTHEST else _usual_zero(robot, joint)
        if excess > zero:
            # refused beyond two ranges: a whole turn of offset exceeds a joint's range of half a
            # turn by two ranges, degrees for radians exceed a range 57 times
            far = excess > 2.0 * (high - low)
            turns = far and _turns_over(evidence, robot, joint)
            least, most = (each[joint] for each in reached()) if reached else (q.min(), q.max())
            other = _other_unit(least, most, joint, robot) if far else _OTHERWISE
            yield Suspicion(
                "range",
                ("joints", joint, "position"),
                f"reaches from {least:.4g} to {most:.4g} {unit}, but joint {joint + 1} of"
                f" {robot.name} has {low:.4g} to {high:.4g} {unit};"
                f" {_TURNS if turns else other}",
                certain=far and not turns,
            )
            continue
        for key, values, limit, per in (
            ("position", evidence.qd, robot.velocity_limit, f"{unit}/s"),
            ("torque", evidence.tau, robot.torque_limit, "N m" if unit == "rad" else "N"),
        ):
            if key == "torque" and joint in unknown_gains:
                continue
            most = float(np.abs(values[:, joint]).max())
            # speed, torque or force beyond any robot [rad/s, m/s, N m or N]
            bound = float(np.fmin(limit[joint], 1e6))
            if most > EXCEEDED * bound:
                yield Suspicion(
                    "range",
                    ("joints", joint, key),
                    f"{'moves with' if key == 'position' else 'has'} up to {most:.4g} {per}, but"
                    f" joint {joint + 1} of {robot.name} is limited to {bound:.4g} {per}; correct"
                    " the unit, the gain or the side, or the limit in the robot file",
                    certain=most > ABSURD * bound,
                )


def _turns_over(evidence: Evidence, robot: Robot, joint: int) -> bool:
    """Return True if positions may count several turns of a joint, not another unit.

    Torques depend on the angle within a turn, so no number of turns contradicts a range of a whole
    turn. Another unit, or the motor's side, would enlarge speeds like positions.
    """
    whole = robot.q_max[joint] - robot.q_min[joint] >= 2 * pi - _usual_zero(robot, joint)
    most = float(np.abs(evidence.qd[:, joint]).max())
    return bool(robot.revolute[joint] and whole and most <= ABSURD * robot.velocity_limit[joint])


def _usual_zero(robot: Robot, joint: int) -> float:
    """Return the usual error of joint offsets [rad or m]."""
    return CAUSES["joint offset"].usual * (pi / 180 if robot.revolute[joint] else 1e-3)


def _other_unit(least: float, most: float, joint: int, robot: Robot) -> str:
    """Return the unit or side in which the positions are within the range, in words."""
    low, high = robot.q_min[joint], robot.q_max[joint]
    slack = _usual_zero(robot, joint)
    fitting = [
        unit
        for unit, factor in other_units(robot, joint).items()
        if "rpm" not in unit and low - slack <= least / factor and most / factor <= high + slack
    ]
    return f"they look like positions {' or '.join(fitting)}" if fitting else _OTHERWISE
