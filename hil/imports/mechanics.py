"""Mechanical checks of a map before the estimation: signs, exchanged columns, units.

These errors make all results meaningless, so the import is refused. Excerpts of the recording are
read in alternative ways (`hil.estimation.excluded.alternatives`), and all base parameters are
fitted under each reading: a sign, two columns exchanged, degrees for radians, an offset by quarters
of a turn, gravity along another axis. The best reading that is mechanically possible is then fitted
with friction, and so are exchanges of axes with torques unrelated to their motion. Let r be the
ratio of the mean square residual of an alternative reading to that of the map's reading. The map is
refused if r is at most 1/9. The limit is 1/2 if mechanics contradict the map's reading: friction
would drive an axis, a motion would have a negative energy, or the torques of the exchanged axes
follow no motion. If most of the residual would be driving friction, any alternative with an equal
fit refuses the map. All other causes are left to the estimate, which uses the whole recording.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.excluded.alternatives import (
    ROWS,
    STARTS,
    Reading,
    discrete,
    explained,
    sized,
)
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.evidence import measured
from hil.estimation.excluded.finding import LEAVES, TOGETHER
from hil.estimation.excluded.result import located
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.imports.evidence import Suspicion
from hil.imports.two_clocks import clock_of_torques
from hil.model.drive_train_file import USUAL_BOUND
from hil.planning.free_motion import FreeMotion
from hil.runs.recording import IDLE, Recording

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.excluded.evidence import Evidence
    from hil.estimation.signals import Prepared, Signals
    from hil.imports.evidence import Excerpt
    from hil.model.robot import Robot

PLACES = {
    "wrong sign of a position": ("position", "sign"),
    "wrong sign of a torque": ("torque", "sign"),
    "two positions exchanged": ("position", "column"),
    "two torques exchanged": ("torque", "column"),
    "position scale": ("position", "unit"),
    "joint offset": ("position", "offset"),
}
"""Keys of a joint in the map, by cause; for other causes the place is the whole joint."""


MAP_KEYS = {"position scale": "joints", "gravity": "robot", "no gravity": "joints"}
"""Keys of the map for causes that concern no single joint."""
NOTHING = 0.8
"""Minimum residual share of the torque variance for torques unrelated to the motion.

Public recordings of five machines leave at most 0.05, noise in place of torques leaves 0.89.
"""
LAGS, FAR_LAGS = (0.05, 0.1), (0.2, 0.4, 0.8)
"""Lags of torques to try [s], beyond the lags fitted by estimates.

Causes are a filter, a stack of software, or another computer's clock. Lags between differ from one
of these by a third, which leaves a ninth of the mean squares.
"""
UNEXPLAINED = 0.02
"""Minimum residual share of the torque variance for far lags: a twin has 7 % at 200 ms."""
DEGREE = np.pi / 180.0
"""Factor of positions in degrees stated as radians."""
SLOW = 0.004
"""Time between the compared samples [s].

A period of a robot's fastest motion, at 20 Hz, has twelve samples. Faster recordings are replaced
by means, of positions and torques alike.
"""
SPREAD = 4
"""Number of excerpts compared in addition to those with the most motion of a joint.

An excerpt lasts at most ten seconds.
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
            f"torque variance of every moving joint unexplained: {_why_unrelated(smooth, shown)}",
        )
        return
    misread = _misread(robot, excerpts, prepared, solver, shown & (share > NOTHING))
    yield from misread or ()
    # lags are searched if the residual variance exceeds 0.3 %: twins of robots have 0.1 %, and 0.5
    # % with torques delayed by 50 ms
    if not misread and (share > 0.003).any():
        another = list(clock_of_torques(excerpts, robot, shown))
        yield from another
        far = bool(np.median(share) > UNEXPLAINED)
        if not another and (misread is None or far):
            yield from _late(robot, prepared, solver, shown, LAGS + FAR_LAGS * far)


def _why_unrelated(torque: Array, shown: Mask) -> str:
    """Return reason and remedy for torques (n, n_joints) unrelated to the motion of all joints.

    The ripple of a motor at a constant current is within the tolerance of its torque constant.
    """
    mean, change = torque.mean(axis=0), torque.std(axis=0)
    if (change < USUAL_BOUND * np.abs(mean))[shown].all():
        joint = int(np.flatnonzero(shown)[0])
        return (
            f"torques hardly change (joint {joint + 1}: {mean[joint]:.3g}, standard deviation "
            f"{change[joint]:.2g}), so they show nothing of this motion; record motions whose "
            "torques change, or name the column of measured torques"
        )
    return (
        "torques do not match this motion; name the torque columns of the same recording and robot"
    )


def _misread(
    robot: Robot,
    excerpts: Sequence[Excerpt],
    prepared: Prepared,
    solver: SimultaneousFit,
    strangers: Mask,
) -> list[Suspicion] | None:
    """Return suspicions if another reading of the map explains the torques.

    None if no other reading was tried. Torques of `strangers`, shape (n_joints,), do not follow the
    motion of their axes.
    """
    thin = measured(robot, solver, prepared).thinned(ROWS)[0].project_out_own()
    stated = explained(robot, thin, Reading.stated(robot))
    if len(stated.driven) > 1 and stated.driven.mean() >= 1.0 - LEAVES:
        # the opposite torques of all axes fit as well, with the opposite parameters
        opposite = replace(stated.reading, sign_tau=-stated.reading.sign_tau)
        if stated.instead(opposite).driven.max() < 1.0 - LEAVES:
            message = (
                "torques of all joints have the wrong sign: friction would accelerate the joints "
                f"({100 * stated.driven.mean():.0f} % of the residuals' mean squares act in the "
                "direction of motion), and brakes them with the opposite torques; correct sign of "
                "all torques"
            )
            return [Suspicion("shape", ("joints", 0, "torque", "sign"), message)]
    driven = int(stated.driven.argmax())
    drives = stated.driven[driven] >= 1.0 - LEAVES
    enough = stated.misfit + (TOGETHER if drives else -TOGETHER)
    astray = set(np.flatnonzero(strangers).tolist())
    likely, tried = [], []
    for each in _readings(robot, thin):
        _, axes, _, reading = each
        here = stated.instead_below(reading, enough)
        if here is not None and here.misfit < enough and here.possible:
            likely.append((here.misfit, each))
        if len(axes) == 2 and astray.issuperset(axes):
            tried += [(*each[:3], signed) for signed in _signed(reading, axes)]
    if likely:
        # of equal readings the first: on an arm whose axes are parallel, gravity along them makes
        # the same torques as none, and rounding errors would choose
        tried.append(min(likely, key=lambda each: float(f"{each[0]:.6g}"))[1])
    if not tried:
        return None
    left, cause, axes, words = min(
        (_left(robot, excerpts, reading, solver, of_torques), cause, axes, words)
        for cause, axes, words, reading in tried
        for of_torques in [axes if "torque" in cause else ()]
    )
    # torques unrelated to the motion of their axes contradict the map, like impossible mechanics
    contradicted = not stated.possible or (len(axes) == 2 and astray.issuperset(axes))
    # against a possible map, a reading must leave at most a ninth of the mean squares: on
    # recordings of an arm without a valid model other readings leave 0.22, the correct readings of
    # the maps in `benchmarks/wrong_maps.py` at most 0.07
    if left <= (LEAVES if contradicted else 1.0 / 9.0):
        place = ("joints", axes[0], *PLACES.get(cause, ())) if axes else (MAP_KEYS[cause],)
        message = (
            f"{located([axis + 1 for axis in axes], words)}: this correction leaves only "
            f"{100 * left:.2g} % of the model's mean square residual; "
            f"{CAUSES[cause].remedy}"
        )
        return [Suspicion("shape", place, message)]
    if drives and likely:
        message = (
            f"friction would accelerate joint {driven + 1}: {100 * stated.driven[driven]:.0f} % "
            "of the residual's mean square acts in the direction of motion; correct the sign of "
            "its torque or of its position"
        )
        return [Suspicion("shape", ("joints", driven, "torque", "sign"), message)]
    return []


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
    axes: tuple[int, ...] = (),
) -> float:
    """Return the share of the mean squares left by a reading after a full fit.

    The share is the geometric mean over `axes`, by default over all axes with a motor: another
    reading of an axis's torques does not change the equations of the other axes.
    """
    turned = robot.changed(gravity=tuple(reading.gravity.tolist()))
    read = [_motion(number, _read(each, reading)) for number, each in enumerate(excerpts)]
    shares = np.log(solver.weight / SimultaneousFit(turned, read).weight)
    driven = np.flatnonzero(np.any([each.tau.any(axis=0) for each in excerpts], axis=0))
    return float(np.exp(shares[list(axes) if axes else driven].mean()))


def _read(excerpt: Excerpt, reading: Reading) -> Excerpt:
    """Return the excerpt under a reading, without the direction of gravity."""
    q = reading.sign_q * reading.scale * excerpt.q[:, reading.order] + reading.zero
    return replace(excerpt, q=q, tau=reading.sign_tau * excerpt.tau[:, reading.torques])


def _late(
    robot: Robot, prepared: Prepared, solver: SimultaneousFit, shown: Mask, lags: Sequence[float]
) -> Iterator[Suspicion]:
    """Yield a suspicion for torques delayed or early beyond the lags fitted by estimates.

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

    left, lag = min(left_at(sign * lag) for lag in lags for sign in (1, -1))
    if left <= LEAVES:
        for step in (0.25, 0.12) if abs(lag) >= max(LAGS) else ():  # to 6 %
            left, lag = min((left, lag), *(left_at(lag * (1 + k * step)) for k in (-1, 1)))
        yield Suspicion(
            "shape",
            ("joints", 0, "torque"),
            f"torques of all joints have a {'delay' if lag > 0 else 'lead'} of some "
            f"{float(f'{1e3 * abs(lag):.2g}'):.0f} ms; {CAUSES['torque delay'].remedy}",
            certain=False,
        )


def _readings(robot: Robot, thin: Evidence) -> Iterator[tuple[str, tuple[int, ...], str, Reading]]:
    """Yield cause, axes from 0, words, and reading of alternative interpretations."""
    for cause, axes, reading in discrete(robot, thin):
        yield cause, axes, CAUSES[cause].words, reading
    stated, turning = Reading.stated(robot), np.flatnonzero(robot.revolute).tolist()
    ranges = np.ptp(thin.motion[1, 0], axis=0)
    for factor, words, unusual in (
        (DEGREE, "in degrees, stated as rad", ranges > ORDINARY[1]),
        (1 / DEGREE, "in rad", ranges < ORDINARY[0]),
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
            towards = ", ".join(f"{each:.3g}" for each in reading.gravity)
            yield "gravity", (), f"gravity points along [{towards}]", reading


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
