"""Mechanical checks of a map before the estimation: signs, exchanged columns, units.

These errors make all results meaningless, so the import is refused. Excerpts of the recording are
read in alternative ways (`hil.estimation.excluded.alternatives`), and all base parameters are
fitted under each reading: signs, columns in another order, degrees for radians, zeros by quarters
of a turn, gravity along another axis, another rate. Readings are compared by their misfit sum n_a
log s_a^2, the likelihood of the residual mean squares s_a^2 of the axes, and by the chi square lost
where motions of negative kinetic energy are excluded. The map is refused if another reading gains
as much as one axis with a ninth of its mean square; a half suffices for two axes whose torques
follow no motion. If most of the residual of an axis would be driving friction, any reading with an
equal fit and without such friction refuses the map. All other causes are left to the estimate,
which uses the whole recording.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.excluded.alternatives import (
    NONE_LEFT,
    ROWS,
    STARTS,
    Reading,
    discrete,
    explained,
    likeliest_signs,
    searched,
    sized,
)
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.evidence import measured
from hil.estimation.excluded.finding import EXPLAINS, LEAVES, TOGETHER
from hil.estimation.excluded.result import located
from hil.estimation.excluded.words import rank_of
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.imports.evidence import Suspicion, beyond_noise, noise_shares
from hil.imports.two_clocks import clock_of_torques, late_torques
from hil.least_squares.standstill import SLOW as AT_REST
from hil.least_squares.uncertainty import TWICE
from hil.model.base_parameters import base_parameters
from hil.model.drive_train_file import USUAL_BOUND
from hil.planning.free_motion import FreeMotion
from hil.runs.recording import IDLE, Recording

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.excluded.alternatives import Explained
    from hil.estimation.excluded.evidence import Evidence
    from hil.estimation.signals import Prepared, Signals
    from hil.imports.evidence import Excerpt
    from hil.model.robot import Robot

PLACES = {
    "wrong sign of a position": ("position", "sign"),
    "wrong sign of a torque": ("torque", "sign"),
    "two positions exchanged": ("position", "column"),
    "two torques exchanged": ("torque", "column"),
    "torque constant": ("torque", "unit"),
    "position scale": ("position", "unit"),
    "joint offset": ("position", "offset"),
}
"""Keys of a joint in the map, by cause; for other causes the place is the whole joint."""


MAP_KEYS: dict[str, tuple[str | int, ...]] = {
    "position scale": ("joints",),
    "gravity": ("robot",),
    "no gravity": ("joints",),
    "sampling rate": ("time",),
    "wrong sign of all torques": ("joints", 0, "torque", "sign"),
}
"""Keys of the map for causes that concern no single joint."""
NOTHING = 0.8
"""Minimum residual share of the torque variance for torques unrelated to the motion.

Public recordings of five machines leave at most 0.05, noise in place of torques leaves 0.89.
"""
LAGS = (0.2, 0.4, 0.8)
"""Lags of torques to try [s], beyond those that `clock_of_torques` finds.

Causes are a stack of software, or another computer's clock. Lags between differ from one of these
by a third, which leaves a ninth of the mean squares.
"""
UNEXPLAINED = 0.02
"""Minimum residual share of the torque variance for far lags: a twin has 7 % at 200 ms."""
RATES = {
    size: f"sampling rate some {1.0 + size / 100.0:g} times that stated"
    for size in STARTS["sampling rate"]
}
"""Words of the rates to try, by size [%]."""
EDGES = RATES[min(RATES)], RATES[max(RATES)]
"""Words of the least and the greatest rate."""
DEGREE = np.pi / 180.0
"""Factor of positions in degrees stated as radians."""
SLOW = 0.004
"""Time between the compared samples [s].

A period of a robot's fastest motion, at 20 Hz, has twelve samples. Faster recordings are replaced
by means, of positions and torques alike.
"""
SPREAD = 4
"""Number of excerpts compared in addition to those with the most motion of a joint.

An excerpt lasts ten seconds; of whole motions, at most a minute.
"""
ORDINARY = (4 * np.pi * DEGREE, 4 * np.pi)
"""Ranges of joints that contradict a position in degrees stated as radians [rad].
"""


def mechanical_suspicions(
    excerpts: Sequence[Excerpt], robot: Robot, shown: Mask
) -> Iterator[Suspicion]:
    """Yield suspicions of a map if another interpretation explains otherwise unexplained torques.

    Parameters
    ----------
    excerpts : sequence of Excerpt
    robot : Robot
    shown : ndarray of bool, shape (n_joints,)
        Joints that move, with accelerations beyond their noise; torque residuals of other joints
        carry no information on the columns.
    """
    excerpts = [_thinned(each) for each in _telling(excerpts)]
    prepared = [_motion(number, each) for number, each in enumerate(excerpts)]
    try:
        solver = SimultaneousFit(robot, prepared)
    except (NotIdentifiable, np.linalg.LinAlgError):  # no joint moves, or no parameter is visible
        return
    smooth = np.concatenate([s.smoothed(s.tau) for _, s in prepared])
    share = 1.0 / np.maximum(solver.weight * smooth.var(axis=0), np.finfo(float).tiny)
    if shown.any() and (share[shown] > NOTHING).all():
        yield Suspicion(
            "shape",
            ("joints", 0, "torque"),
            f"the model with friction leaves at least {100 * share[shown].min():.0f} % of the "
            f"torque variance of every moving joint unexplained: {_why_unrelated(prepared, shown)}",
        )
        return
    poor = share > UNEXPLAINED
    strangers = shown & (share > NOTHING)
    fast = bool(shown.any())
    misread = list(_misread(robot, excerpts, prepared, solver, strangers, poor & shown, fast=fast))
    yield from misread
    another = () if misread else list(clock_of_torques(excerpts, robot, shown))
    yield from another
    if not misread and not another and np.median(poor) >= 0.5:
        yield from _late(robot, prepared, solver, shown)


def _why_unrelated(prepared: Prepared, shown: Mask) -> str:
    """Return reason and remedy for torques unrelated to the motion of all joints.

    The ripple of a motor at a constant current is within the tolerance of its torque constant. A
    joint held by static friction has any torque up to that of sliding.
    """
    torque = np.concatenate([s.smoothed(s.tau) for _, s in prepared])
    speed = np.abs(np.concatenate([s.smoothed(s.link[1]) for _, s in prepared]))
    mean, change = torque.mean(axis=0), torque.std(axis=0)
    joint = int(np.flatnonzero(shown)[0])
    stands = speed[:, joint] < AT_REST * speed[:, joint].max()
    # most of the torque's variance is that of standstill
    if stands.mean() > 0.5 and np.std(torque[stands, joint]) > np.sqrt(0.5) * change[joint]:
        return (
            f"joint {joint + 1} stands still in {100 * stands.mean():.0f} % of the samples, and "
            "its torque changes as much there, as static friction allows; record motions without "
            "standstill"
        )
    if (change < USUAL_BOUND * np.abs(mean))[shown].all():
        return (
            f"torques hardly change (joint {joint + 1}: {mean[joint]:.3g}, standard deviation "
            f"{change[joint]:.2g}), so they show nothing of this motion; record motions whose "
            "torques change, or name the column of measured torques"
        )
    return (
        "torques do not match this motion; name the torque columns of the same recording and robot"
    )


class _Other(NamedTuple):
    """Another reading: gain of chi square, cause, axes from 0, and words."""

    gain: float
    brakes: bool
    cause: str
    axes: tuple[int, ...]
    words: str
    explained: Explained

    @property
    def named(self) -> str:
        """Axes and words."""
        return located([axis + 1 for axis in self.axes], self.words)


def _misread(
    robot: Robot,
    excerpts: Sequence[Excerpt],
    prepared: Prepared,
    solver: SimultaneousFit,
    strangers: Mask,
    poor: Mask,
    *,
    fast: bool,
) -> Iterator[Suspicion]:
    """Yield a suspicion if another reading of the map explains the torques.

    Masks have the shape (n_joints,). Torques of `strangers` do not follow the motion of their axes.
    A `poor` model of some axis permits several wrong signs, and of two axes another order of
    columns. Energies count if motion is `fast`: some axis has accelerations beyond the noise
    of its position.
    """
    thin = measured(robot, solver, prepared).thinned(ROWS)[0].project_out_own()
    stated = explained(robot, thin, Reading.stated(robot))
    # base parameters alone fit fewer rows than there are parameters, such as the few rows in motion
    # that coarse steps of a position leave: no misfit shows anything
    if (stated.counts[stated.counts > 0] < len(base_parameters(robot))).any():
        return
    astray = set(np.flatnonzero(strangers).tolist())
    others = sorted(_others(stated, poor=bool(poor.any())), key=lambda each: -each.gain)
    # torques without gravity or without coupling prefer any greater or smaller rate
    rates = [each for each in others if each.cause == "sampling rate"]
    sure = bool(rates) and rates[0].words not in EDGES and _no_worse(stated, rates[0])
    others = [each for each in others if each not in rates[sure:]]
    exchanged = [
        (cause, axes, words, signed)
        for cause, axes, words, reading in _readings(robot, thin)
        if "exchanged" in cause and astray.issuperset(axes)
        for signed in _signed(reading, axes)
    ]
    if others and "exchanged" in others[0].cause:
        exchanged.append((*others[0][2:5], others[0].explained.reading))
    sooner = len(exchanged)
    if poor.sum() > 1:
        exchanged += _reordered(robot, prepared)
    # friction of exchanged axes follows another motion, so it is fitted anew
    tried = [
        (*_left(robot, excerpts, reading, solver, cause, axes), k, cause, axes, words)
        for k, (cause, axes, words, reading) in enumerate(exchanged)
    ]
    total, left, k, cause, axes, words = min(tried, default=(np.inf, np.inf, 0, "", (), ""))
    # against a possible map, an exchange must leave at most a ninth of the mean squares: on
    # recordings of an arm without a valid model other readings leave 0.22, the correct readings of
    # the maps in `benchmarks/wrong_maps.py` at most 0.07
    pair = k < sooner and (not stated.possible or astray.issuperset(axes))
    exchange: list[Suspicion] = []
    if left <= (LEAVES if pair else EXPLAINS):
        message = (
            f"{located([axis + 1 for axis in axes], words)}: this correction leaves only "
            f"{100 * left:.2g} % of the model's mean square residual; {CAUSES[cause].remedy}"
        )
        exchange = [Suspicion("shape", ("joints", axes[0], *PLACES.get(cause, ())), message)]
        of_rivals = (
            _left(robot, excerpts, each.explained.reading, solver, each.cause, each.axes)[0]
            for each in others[:1]
            if "exchanged" not in each.cause
        )
        if total < min(of_rivals, default=np.inf):
            yield from exchange
            return
    n = float(stated.counts[stated.counts > 0].mean())
    variance = np.concatenate([s.smoothed(s.tau) for _, s in prepared]).var(axis=0)
    noise = noise_shares(excerpts) * np.maximum(variance, np.finfo(float).tiny)
    others = [each for each in others if "exchanged" not in each.cause and _no_worse(stated, each)]
    for other in others:
        # friction that drives contradicts the map, and so do negative energies together with the
        # misfit, so half of the mean square suffices
        least, explains = -n * float(np.log(EXPLAINS)), _explains(stated, other, noise)
        cures = fast and not stated.possible and other.explained.possible and other.gain >= least
        least = -n * float(np.log(LEAVES)) if other.brakes or cures else least
        # only the signs of all torques turn all energies, and leave the misfit as it is
        energy = not other.axes and other.gain >= least and "torques" in other.cause and fast
        if other.brakes or energy or explains >= least:
            same = [each for each in others if other.gain - each.gain <= TOGETHER]
            same.sort(key=lambda each: rank_of(each.cause, *each.axes))
            equal = [each.named for each in same[1:]]
            enough = _explains(stated, same[0], noise) >= least
            yield _suspicion(stated, same[0], equal, explains=enough)
            return
    yield from exchange


def _explains(stated: Explained, other: _Other, noise: Array) -> float:
    """Return the chi square that another reading explains beyond mean squares of `noise`.

    A reading of the torques alone has the noise of the stated motion, which leaves at most as much
    as this reading.
    """
    here = other.explained.left
    if other.explained.reading.key == stated.reading.key:
        noise = np.minimum(noise, here)
    return float(stated.counts @ np.log(beyond_noise(stated.left, here, noise) / here))


def _reordered(
    robot: Robot, prepared: Prepared
) -> Iterator[tuple[str, tuple[int, ...], str, Reading]]:
    """Yield readings with columns in another order: alphabetical as of ROS, reverse, best torques.

    The best order assigns torques to the motions that explain them, each with friction of its own.
    """
    stated, names = Reading.stated(robot), list(robot.joint_names)
    cause, turns = "all axes exchanged", robot.revolute
    for words, order in (
        (CAUSES[cause].words, [sorted(names).index(name) for name in names]),
        ("columns in reverse order", [*range(robot.n_joints)][::-1]),
    ):
        axes = tuple(axis for axis, channel in enumerate(order) if channel != axis)
        if axes and np.array_equal(turns[order], turns):
            reading = replace(stated, order=tuple(order), torques=tuple(order))
            yield cause, axes, words, reading
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - takes long to load

    tau = np.concatenate([s.smoothed(s.tau)[s.valid] for _, s in prepared])
    driven = np.flatnonzero(tau.any(axis=0))
    misfit = np.empty((robot.n_joints, len(driven)))
    for joint in driven.tolist():
        A = np.concatenate([
            s.smoothed(np.hstack(s.terms(robot, joint)))[s.valid] for _, s in prepared
        ])  # fmt: skip
        left = tau[:, driven] - A @ np.linalg.lstsq(A, tau[:, driven], rcond=None)[0]
        misfit[joint] = np.linalg.norm(left, axis=0)
    best = linear_sum_assignment(np.log(misfit[driven]))[1]
    moved = driven[best] != driven
    if moved.any():
        assigned = np.arange(robot.n_joints)
        assigned[driven] = driven[best]
        listed = ", ".join(str(channel + 1) for channel in assigned[driven[moved]])
        axes, torques = tuple(driven[moved].tolist()), tuple(assigned.tolist())
        cause, words = "two torques exchanged", f"torques in another order, those of axes {listed}"
        words = CAUSES[cause].words if len(axes) == 2 else words
        yield cause, axes, words, replace(stated, torques=torques)


def _several_signs(
    stated: Explained,
) -> Iterator[tuple[str, tuple[int, ...], str, Reading]]:
    """Yield the likeliest reading with wrong signs of several torques, but not of all."""
    reading = likeliest_signs(stated, TOGETHER)
    axes = tuple(np.flatnonzero(reading.sign_tau < 0).tolist())
    if 1 < len(axes) < np.count_nonzero(stated.counts):
        cause = "wrong sign of a torque"
        yield cause, axes, CAUSES[cause].words, reading


def _no_worse(stated: Explained, other: _Other) -> bool:
    """Return True unless gravity or a rate, common to all axes, spoils an axis.

    A mean square of n samples has a relative standard deviation of sqrt(2 / n).
    """
    scatter = 1.0 + TWICE * np.sqrt(2.0 / np.maximum(stated.counts, 1.0))
    common = other.cause in ("gravity", "sampling rate")
    return not common or bool((other.explained.left <= scatter * stated.left).all())


def _others(stated: Explained, *, poor: bool) -> Iterator[_Other]:
    """Yield the readings that explain the torques better, or as well without driving friction."""
    several = _several_signs(stated) if poor else ()
    braked, most = int(stated.driven.argmax()), float(stated.driven.max())
    drives = most >= 1.0 - LEAVES
    stated_misfit = stated.misfit + stated.negative
    least = -TOGETHER if drives else TOGETHER
    for cause, axes, words, reading in (*_readings(stated.robot, stated.evidence), *several):
        here = stated.instead_below(reading, stated_misfit - least)
        if here is not None and (here.possible or "exchanged" not in cause):
            gain = stated_misfit - here.misfit - here.negative
            # a reading without the motion's or the torque's sign cures driving friction by chance
            brakes = drives and reading.sign_q[braked] * reading.sign_tau[braked] < 0
            brakes &= (1.0 - here.driven.max()) * LEAVES >= 1.0 - most
            if gain > (least if brakes or not drives else TOGETHER):
                yield _Other(gain, brakes, cause, axes, words, here)
    cause = "torque constant"
    driven = np.unique(stated.evidence.axis[stated.evidence.recorded != 0]).tolist()
    for axis in driven if stated.torn else ():
        found = searched(stated, sized(stated.robot, cause, axis), STARTS[cause], NONE_LEFT)
        if found is None or not found[2].possible:
            continue
        size, bend, here = found
        share, error = 1.0 + size / 100.0, float(np.sqrt(2.0 / bend)) / 100.0
        if share <= 2.0 * error:  # a factor without bound is no gain: the axes hardly interact
            continue
        # two figures hold where twice the standard error is below a tenth
        known = share > 20.0 * error
        by = f"some {float(f'{max(share, 1.0 / share):.2g}'):g}" if known else "many"
        words = f"its torque is {by} times too {'large' if share < 1.0 else 'small'}"
        gain = stated_misfit - here.misfit - here.negative
        yield _Other(gain, False, cause, (axis,), words, here)


def _suspicion(
    stated: Explained, other: _Other, equal: Sequence[str], *, explains: bool
) -> Suspicion:
    """Return the suspicion of a sign, a scale, a zero or gravity, with equally good readings."""
    here, axes = other.explained, other.axes
    words = f"{'; or '.join([other.named, *equal])}: "
    place = ("joints", axes[0], *PLACES.get(other.cause, ())) if axes else MAP_KEYS[other.cause]
    remedy, driven = CAUSES[other.cause].remedy, int(stated.driven.argmax())
    if explains:
        left = here.left / stated.left
        reason = (
            f"this correction leaves only {100 * left.min():.2g} % of the mean square residual of "
            f"joint {int(left.argmin()) + 1}"
        )
    elif other.brakes:
        reason = (
            f"friction would accelerate joint {driven + 1}: {100 * stated.driven[driven]:.0f} % "
            "of the residual's mean square acts in the direction of motion"
        )
        if axes:
            words, remedy = "", "correct the sign of the torque or of the position"
            place = ("joints", driven, "torque", "sign")
    else:
        reason = "some motions would have a negative kinetic energy"
    return Suspicion("shape", place, f"{words}{reason}; {remedy}")


def _signed(reading: Reading, axes: Sequence[int]) -> Iterator[Reading]:
    """Yield a reading with both signs of each axis's torque: an exchange may change signs."""
    for signs in product((1.0, -1.0), repeat=len(axes)):
        found = reading
        for axis, sign in zip(axes, signs, strict=True):
            found = found.alter(axis, sign_tau=sign)
        yield found


def _left(
    robot: Robot,
    excerpts: Sequence[Excerpt],
    reading: Reading,
    solver: SimultaneousFit,
    cause: str,
    axes: tuple[int, ...],
) -> tuple[float, float]:
    """Return what a reading of `axes` leaves after a full fit: sum of logarithms, and share.

    Logarithms are those of the mean squares of all axes with a motor, over the stated ones. The
    share is the geometric mean, for exchanged torques over two axes only, as they do not change the
    equations of the other axes. An order of more axes must explain the torques.
    """
    turned = robot.changed(gravity=tuple(reading.gravity.tolist()))
    read = [_motion(number, _read(each, reading)) for number, each in enumerate(excerpts)]
    weight = SimultaneousFit(turned, read).weight
    tau = np.concatenate([s.smoothed(s.tau) for _, s in read])
    driven = np.flatnonzero(tau.any(axis=0))
    if len(axes) > 2 and np.median(1.0 / (weight * tau.var(axis=0))[driven]) > UNEXPLAINED:
        return np.inf, np.inf
    logs = np.log(solver.weight / weight)
    of = axes if cause == "two torques exchanged" and len(axes) == 2 else driven
    return float(logs[driven].sum()), float(np.exp(logs[[*of]].mean()))


def _read(excerpt: Excerpt, reading: Reading) -> Excerpt:
    """Return the excerpt under a reading, without the direction of gravity."""
    q = reading.sign_q * reading.scale * excerpt.q[:, reading.order] + reading.zero
    return replace(excerpt, q=q, tau=reading.sign_tau * excerpt.tau[:, reading.torques])


def _late(
    robot: Robot, prepared: Prepared, solver: SimultaneousFit, shown: Mask
) -> Iterator[Suspicion]:
    """Yield a suspicion for torques that are late or early by one of the `LAGS`.

    A lag common to all joints leaves half of the mean squares or less, in the median over the
    joints `shown`, shape (n_joints,). A single joint may improve little, because many parameters
    fit a few seconds of motion.
    """
    if not shown.any():
        return

    def left_at(lag: float) -> tuple[float, float]:
        advanced = [(m, s.torque_advanced(np.full(robot.n_joints, lag))) for m, s in prepared]
        ratio = solver.weight / SimultaneousFit(robot, advanced).weight
        return float(np.median(ratio[shown])), lag

    left, lag = min(left_at(sign * lag) for lag in LAGS for sign in (1, -1))
    if left <= LEAVES:
        for step in (0.25, 0.12):  # to 6 %
            left, lag = min((left, lag), *(left_at(lag * (1 + k * step)) for k in (-1, 1)))
        yield late_torques(lag)


def _readings(robot: Robot, thin: Evidence) -> Iterator[tuple[str, tuple[int, ...], str, Reading]]:
    """Yield cause, axes from 0, words, and reading of alternative interpretations."""
    for cause, axes, reading in discrete(robot, thin):
        yield cause, axes, CAUSES[cause].words, reading
    stated, turning = Reading.stated(robot), np.flatnonzero(robot.revolute).tolist()
    ranges = np.ptp(thin.motion[1, 0], axis=0)
    for factor, words, unusual in (
        (DEGREE, "in degrees, stated as rad", ranges > ORDINARY[1]),
        (1 / DEGREE, "in rad", ranges < ORDINARY[0]),
        (2.0 * np.pi, "in turns", ranges < ORDINARY[1] / (2.0 * np.pi)),
    ):
        wrong = robot.revolute & unusual
        for axis in np.flatnonzero(wrong).tolist():
            reading = stated.alter(axis, scale=factor)
            yield "position scale", (axis,), f"its position is {words}", reading
        if np.array_equal(wrong, robot.revolute):
            every = replace(stated, scale=np.where(wrong, factor, 1.0))
            yield "position scale", (), f"positions of all joints that turn are {words}", every
    for axis in turning:
        for size in (size for size in STARTS["joint offset"] if size and size % 90.0 == 0.0):
            reading = sized(robot, "joint offset", axis)(size)
            yield (
                "joint offset",
                (axis,),
                f"{CAUSES['joint offset'].words} of some {size:g} degrees",
                reading,
            )
    for heading, sizes in ((0.0, (-90.0, 90.0, 180.0)), (90.0, (-90.0, 90.0))):
        for size in sizes if np.any(robot.gravity) else ():
            reading = sized(robot, "gravity", -1, 0.0, heading)(size)
            towards = ", ".join(f"{each:.3g}" for each in reading.gravity.round(9) + 0.0)
            yield "gravity", (), f"gravity points along [{towards}] in frame 0", reading
    for size, words in RATES.items() if np.any(robot.gravity) else ():
        yield "sampling rate", (), words, sized(robot, "sampling rate", -1)(size)


def _telling(excerpts: Sequence[Excerpt]) -> list[Excerpt]:
    """Return excerpts from start to end, and those with the most motion of a joint."""
    ranges = np.array([each.extent.high - each.extent.low for each in excerpts])
    spread = np.linspace(0, len(excerpts) - 1, min(SPREAD, len(excerpts))).round().astype(int)
    return [excerpts[k] for k in np.union1d(spread, ranges.argmax(axis=0))]


def _thinned(excerpt: Excerpt) -> Excerpt:
    """Average successive samples within `SLOW`."""
    n = max(1, round(SLOW / excerpt.period))
    q, tau, qd = (
        x[: len(x) // n * n].reshape(-1, n, x.shape[1]).mean(axis=1)
        for x in (excerpt.q, excerpt.tau, excerpt.qd)
    )
    return replace(excerpt, period=n * excerpt.period, q=q, tau=tau, qd=qd)


def _motion(number: int, excerpt: Excerpt) -> tuple[FreeMotion, Signals]:
    n = len(excerpt.q)
    q, duration = tuple(excerpt.q.mean(axis=0).tolist()), n * excerpt.period
    idle, flags = np.full(n, IDLE, np.int16), np.zeros(excerpt.q.shape, np.uint8)
    time = excerpt.period * np.arange(n, dtype=np.float64)
    group = np.zeros(n, np.int16)
    recording = Recording(time, excerpt.q, excerpt.tau, flags, idle, idle, group=group)
    return FreeMotion(id=f"excerpt-{number}", q=q, duration=duration), signals(recording)
