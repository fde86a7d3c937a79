"""Finite alternatives without a derivative: wrong signs, exchanged axes, large zero errors.

Each alternative is another reading of the recordings. Joint i is read from channel `order[i]`, and

    q = sign_q scale q_read + zero,    tau_read = sign_tau gain (A p + H qdd) + friction,

so that a gear ratio N that is stated as N' has scale, gain and gear N' / N, and the rotor inertia H
is the stated one over gear^2. A rate r times that stated makes accelerations r^2 times as large:
the same as inertias times r^2 (gear 1 / r) and gravity over r^2. All base parameters are fitted
anew for each reading. Readings are compared by the likelihood of white noise of unknown variance on
each axis, sum n_a log s_a^2; they have as many unknowns as the stated reading, or one more. Two
results are impossible beyond noise, regardless of the residual: friction that drives its axis, and
motion of negative kinetic energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.excluded.battery import LEVEL
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.columns import across_gravity, instants
from hil.least_squares.normal_equations import Normal
from hil.least_squares.regression import ROUNDS, Regression
from hil.least_squares.solving import inverse, solve_each
from hil.least_squares.standstill import YIELDED
from hil.model.dynamics import mass_matrix, regressor

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.excluded.evidence import Evidence
    from hil.least_squares.blocks import Blocks
    from hil.model.robot import Robot

ROWS = 250
"""Number of rows of a channel; few suffice, since alternatives differ by more than noise."""
ROUGHLY = 3
"""Number of rounds of weights and solution for the comparison of start values."""
HEADINGS = (0.0, 45.0, 90.0, 135.0)
"""Directions in which gravity is tried to turn, from the first axis across it [degrees]."""
CONFIGURATIONS = 60
"""Number of configurations at which the mass matrix is evaluated."""
STARTS = {
    "joint offset": tuple(np.arange(-135.0, 181.0, 45.0)),
    "gear ratio": (-50.0, -20.0, 25.0, 100.0),
    "position scale": (-98.25, -50.0, -10.0, 10.0, 100.0),
    "torque constant": (
        *(-99.9, -99.0, -96.9, -90.0, -75.0, -66.7, -50.0, -29.3),
        *(30.0, 41.4, 100.0, 200.0, 300.0, 900.0, 3060.0, 9900.0, 99900.0),
    ),
    "slip": (-20.0, -5.0, 5.0, 20.0),
    "gravity": (-90.0, -30.0, 30.0, 90.0, 180.0),
    "sampling rate": (
        *(-84.0, -75.0, -60.0, -50.0, -37.5, -20.0),
        *(25.0, 60.0, 100.0, 150.0, 300.0, 525.0),
    ),
    "torque delay": (-30.0, -10.0, 10.0, 30.0),
    "position delay": (-30.0, -10.0, 10.0, 30.0),
}
"""Start values of the searches. Torques are sinusoids of angles; degrees in place of radians are
too large by a factor of 57, peak values in place of rms values by 41 %; up to four phases or
motors may be left out or counted twice, and so may gears of 10 to 100 and prefixes of units. Rates
are preferred numbers in steps of 1.25. Delays of one axis are at most those that an estimate
searches.
"""
FACTOR = 0.25
"""Largest step between the start values of a factor, on a logarithmic scale: the right one leaves
an eighth of the torque at most, less than what the other axes contradict."""
NONE_LEFT = -100.0
"""Change to a factor of zero [%]."""
TORN = 1.0 / 9.0
"""Largest share of an axis's mean square that contradicts the other axes: three standard deviations
of what its own base parameters leave."""
TORQUE = 3
"""Index of the torque among the kinds of signal, after position, velocity and acceleration."""
DELAYS = {"torque delay": TORQUE, "position delay": 0}
"""Kinds of late signals."""


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """Meaning of recordings; vectors are by joint, angles in rad, gravity in the base frame."""

    order: tuple[int, ...]
    torques: tuple[int, ...]
    sign_q: Array
    sign_tau: Array
    scale: Array
    gain: Array
    gear: Array
    zero: Array
    gravity: Array
    slip: tuple[int, float, float] | None = None
    """Axis, instant of the slip [s], and displacement of the link from then on."""
    late: tuple[int, int, float] | None = None
    """Kind of a late signal (`delayed`), axis, and delay [ms]."""

    @classmethod
    def stated(cls, robot: Robot) -> Reading:
        """Return the reading stated by robot file and drives file."""
        n, one = robot.n_joints, np.ones(robot.n_joints)
        order = tuple(range(n))
        return cls(order, order, one, one, one, one, one, np.zeros(n), np.array(robot.gravity))

    def alter(self, axis: int, **values: float) -> Reading:
        """Return a reading with changed values of an axis."""
        changed = {}
        for name, value in values.items():
            changed[name] = getattr(self, name).copy()
            changed[name][axis] = value
        return replace(self, **changed)

    @property
    def key(self) -> tuple[object, ...]:
        """Key of the motion and of gravity: readings of equal keys have equal regressors."""
        values = self.sign_q * self.scale, self.zero, self.gravity
        return self.order, self.slip, self.late, *(x.tobytes() for x in values)

    def motion(self, evidence: Evidence) -> tuple[Array, Array, Array]:
        """Return true q, qd and qdd of the joints, shape (n, n_joints) for each."""
        read = evidence.motion[1]
        if self.late is not None and self.late[0] != TORQUE:
            _, axis, late = self.late
            read = read.copy()
            for kind in range(TORQUE):
                read[kind, :, axis] = delayed(evidence, axis, kind, -late)[1]
        return self.true_motion(read, evidence.time)

    def true_motion(self, read: Array, time: Array) -> tuple[Array, Array, Array]:
        """Convert recorded q, qd, qdd at instants to the true motion, shape (3, n, n_joints)."""
        factor = self.sign_q * self.scale
        q, qd, qdd = (x[:, self.order] * factor for x in read)
        q = q + self.zero
        if self.slip is not None:
            axis, instant, angle = self.slip
            q[:, axis] += angle * (time >= instant)
        return q, qd, qdd

    def rows(
        self, robot: Robot, evidence: Evidence, known: dict[tuple[int, int], Array] | None = None
    ) -> tuple[Array, Array]:
        """Return torque less motor torque, and base-parameter columns, as recorded by the channel.

        `known` are regressor rows of this motion by channel and joint; missing ones are added.
        """
        motion, known = self.motion(evidence), {} if known is None else known
        torque, X = evidence.recorded.copy(), np.empty_like(evidence.X)
        if self.late is not None and self.late[0] == TORQUE:
            _, axis, late = self.late
            early, now = (delayed(evidence, axis, TORQUE, each)[1] for each in (-late, 0.0))
            torque += (evidence.axis == axis) * (early - now)
        for channel, rows in evidence.channels:
            joint = self.torques.index(channel)
            factor = self.sign_tau[joint] * self.gain[joint]
            q, qd, qdd = (x[rows] for x in motion)
            if (at := (channel, joint)) not in known:
                known[at] = regressor(robot, q, qd, qdd, [joint], self.gravity)[:, 0]
            np.multiply(factor, known[at], out=X[rows])
            inertia = robot.reflected_inertia[joint] / self.gear[joint] ** 2
            torque[rows] -= factor * inertia * qdd[:, joint]
        return torque, X


@dataclass(frozen=True, eq=False)
class Explained:
    """Fit of the evidence under a reading.

    Attributes
    ----------
    robot, evidence, reading
        Inputs; channels' own columns are projected out of the evidence.
    more : ndarray, shape (n, k), optional
        Further free columns.
    misfit : float
        sum n_a log s_a^2; differences are chi squares.
    left : ndarray, shape (n_channels,)
        s_a^2, the residual mean squares.
    p : ndarray, shape (n_base,)
    information : ndarray, shape (n_base + k, n_base + k)
        Information of all shared columns.
    counts : ndarray, shape (n_channels,)
        Number of samples, less coefficients of friction.
    residual : ndarray, shape (n,)
        Torque less the part explained by the shared columns.
    dispersion : float
        Factor by which noise may exceed white noise.
    """

    robot: Robot
    evidence: Evidence
    reading: Reading
    more: Array | None
    misfit: float
    left: Array
    p: Array
    information: Array
    counts: Array
    residual: Array
    dispersion: float

    def instead(
        self, reading: Reading, rounds: int = ROUNDS, columns: _Columns | None = None
    ) -> Explained:
        """Fit another reading of the evidence."""
        of = self.robot, self.evidence, reading, self.more
        if columns is None and reading.key == self.reading.key:  # of the same motion
            columns = _columns(*of, self._regressors[reading.key])
        return explained(*of, rounds, self.dispersion, columns)

    def instead_below(self, reading: Reading, most: float) -> Explained | None:
        """Fit another reading; return None if the misfit is at least `most`.

        Separate base parameters for each channel give a lower bound of the misfit, without iterated
        weights. Few wrong readings have a bound below `most`.
        """
        if reading.key not in self._regressors and len(self._regressors) > 1:
            self._regressors.popitem()
        known = self._regressors.setdefault(reading.key, {})
        columns = _columns(self.robot, self.evidence, reading, self.more, known)
        counts = columns.blocks.counts[0]
        misfit = counts @ np.log(_left_apart(columns.blocks, self.evidence.least))
        return self.instead(reading, columns=columns) if misfit < most else None

    @cached_property
    def torn(self) -> bool:
        """True if base parameters of its own leave at most the share `TORN` of an axis's residual.

        The axes share parameters of the outer links, so they contradict each other then, as with
        another gain of one torque, which changes nothing of an axis alone.
        """
        blocks = _columns(self.robot, self.evidence, self.reading, self.more).blocks
        counts, n, evidence = self.counts, self.p.size, self.evidence
        driven = np.bincount(evidence.axis, evidence.recorded != 0, minlength=len(counts)) > 0
        shown = driven & (counts > n)  # zeros in place of a torque have no gain
        left = _left_apart(blocks, self.evidence.least)[shown] / self.left[shown]
        return bool((left * counts[shown] <= TORN * (counts[shown] - n)).any())

    @cached_property
    def _regressors(self) -> dict[tuple[object, ...], dict[tuple[int, int], Array]]:
        """Regressor rows of the stated motion and of the motion last tried by `instead_below`."""
        return {self.reading.key: {}}

    @cached_property
    def driven(self) -> Array:
        """Share of residual mean squares along friction that drives an axis, shape (n_channels,).

        If a change is tested, the share is that of the later recordings.
        """
        found, evidence, reading = np.zeros(len(self.left)), self.evidence, self.reading
        for channel in np.unique(evidence.axis):
            rows, joint = evidence.axis == channel, reading.torques.index(int(channel))
            if evidence.later is not None:
                rows &= evidence.later
            if not rows.any():
                continue  # an axis at rest after the slip carries no evidence
            turned = reading.sign_q[joint] * reading.sign_tau[joint]
            direction = np.sign(evidence.motion[1, 1, rows, reading.order[joint]])
            rest = self.residual[rows] - self.residual[rows].mean()
            along = turned * rest @ direction
            if np.ptp(direction) > 0 and along < 0:
                found[channel] = along**2 / (direction @ direction * (rest @ rest))
        return found

    @cached_property
    def possible(self) -> bool:
        """True if friction dissipates power and all motion has positive energy, within noise."""
        # noise of n samples has a share r^2 along a given direction, with n r^2 / (1 - r^2) about 1
        most = self.dispersion * _beyond(len(self.driven)) * (1.0 - self.driven)
        return not (
            (self.counts * self.driven > most).any()
            or self.negative > self.dispersion * _beyond(self._some.size)
        )

    @property
    def _some(self) -> Array:
        """Configurations for the mass matrix, shape (n, n_joints)."""
        q = self.reading.motion(self.evidence)[0]
        return q[:: max(1, len(q) // CONFIGURATIONS)]

    @cached_property
    def negative(self) -> float:
        """Chi square lost by the nearest parameters without motions of negative kinetic energy.

        The energy of a motion v is E = v'(M(q) + rotors) v, linear in p. For a positive E the
        misfit must increase by E^2 over its variance, if the noise is white. Axes that only give
        way to others are no part of v: friction before sliding holds such an axis like a spring,
        which resembles a negative inertia.
        """
        robot, some = self.robot, self._some
        rotors = np.diag(robot.reflected_inertia / self.reading.gear**2)
        reach = np.ptp(self.evidence.motion[1, 0], axis=0)
        moving = np.flatnonzero(reach > YIELDED * reach.max(initial=0.0))
        inertia = mass_matrix(robot, self.p, some) + rotors
        energies, motions = np.linalg.eigh(inertia[:, moving[:, None], moving])
        if not (energies < 0).any():
            return 0.0
        at, which = np.nonzero(energies < 0)
        v, n = np.zeros((len(at), robot.n_joints)), len(self.p)
        v[:, moving] = motions[at, :, which]
        A = regressor(robot, some[at], np.zeros_like(v), v, gravity=np.zeros(3))
        a = np.einsum("ij,ijk->ik", v, A)
        variance = np.einsum("ij,jk,ik->i", a, inverse(self.information)[:n, :n], a)
        return float(np.max(energies[at, which] ** 2 / np.maximum(variance, np.finfo(float).tiny)))


class Alternative(NamedTuple):
    """Another reading: cause, axes from 0, size and standard error, NaN without a size.

    A slip also has an instant [s].
    """

    cause: str
    axes: tuple[int, ...]
    size: float
    error: float
    explained: Explained
    instant: float = 0.0

    @property
    def chi_square(self) -> float:
        """Squared ratio of size and error; below a factor of 1, on a logarithmic scale."""
        size, factor = self.size, 1.0 + self.size / 100.0
        if CAUSES[self.cause].unit == "%" and 0.0 < factor < 1.0:
            size = 100.0 * factor * float(np.log(factor))
        return (size / max(self.error, np.finfo(float).tiny)) ** 2


def explained(
    robot: Robot,
    evidence: Evidence,
    reading: Reading,
    more: Array | None = None,
    rounds: int = ROUNDS,
    dispersion: float = 1.0,
    columns: _Columns | None = None,
) -> Explained:
    """Fit base parameters and `more` columns, shape (n, k), under a reading.

    A reading is impossible only beyond noise of this `dispersion`. `columns` are the reading's
    columns, if known already.
    """
    torque, X, blocks = columns or _columns(robot, evidence, reading, more)
    n_base = X.shape[1] - (0 if more is None else more.shape[1])
    regression = Regression.weighed(blocks, rounds=rounds)
    x = regression.solution
    left, counts = np.maximum(blocks.mean_squares(x), evidence.least), blocks.counts[0]
    return Explained(
        robot=robot,
        evidence=evidence,
        reading=reading,
        more=more,
        misfit=float(counts @ np.log(left)),
        left=left,
        p=x[:n_base],
        information=regression.normal.information,
        counts=counts,
        residual=torque - X @ x,
        dispersion=dispersion,
    )


class _Columns(NamedTuple):
    """Torque (n,) and columns (n, n_base + k) of a reading, and blocks without friction."""

    torque: Array
    X: Array
    blocks: Blocks


def _columns(
    robot: Robot,
    evidence: Evidence,
    reading: Reading,
    more: Array | None,
    known: dict[tuple[int, int], Array] | None = None,
) -> _Columns:
    torque, X = reading.rows(robot, evidence, known)
    if evidence.later is not None:  # the earlier recordings have the stated reading
        stated_torque, stated_X = Reading.stated(robot).rows(robot, evidence)
        torque = np.where(evidence.later, torque, stated_torque)
        X = np.where(evidence.later[:, None], X, stated_X)
    if more is not None:
        X = np.hstack([X, more])
    rows = evidence.project_out_friction(np.hstack([torque[:, None], X]))
    return _Columns(torque, X, evidence.blocks(rows, X.shape[1]))


def _left_apart(blocks: Blocks, least: Array) -> Array:
    """Return the mean squares left by separate base parameters for each channel, (n_channels,)."""
    apart, counts = Normal.split(blocks.products[0]), blocks.counts[0]
    left = apart.square - np.sum(apart.v * solve_each(apart.N, apart.v), axis=1)
    return np.asarray(np.maximum(left / np.maximum(counts, 1.0), least))


def _beyond(n: int) -> float:
    """Return the square of a one-sided 5 % bound on the greatest of `n` standard normals."""
    return float(special.ndtri(LEVEL / n)) ** 2


def sized(
    robot: Robot, cause: str, axis: int, instant: float = 0.0, heading: float = 0.0
) -> Callable[[float], Reading]:
    """Return the readings of a cause as a function of size, in the unit of the table of causes.

    Parameters
    ----------
    instant : float
        Instant of a slip [s].
    heading : float
        Direction in which gravity turns, from the first axis across it [degrees].
    """
    stated = Reading.stated(robot)
    unit = np.pi / 180 if axis < 0 or robot.revolute[axis] else 1e-3

    if cause == "sampling rate":
        return lambda size: replace(
            stated,
            gear=stated.gear / (1.0 + size / 100.0),
            gravity=stated.gravity / (1.0 + size / 100.0) ** 2,
        )

    if cause in DELAYS:
        return lambda size: replace(stated, late=(DELAYS[cause], axis, size))

    def read(size: float) -> Reading:
        share = 1.0 + size / 100.0
        if cause == "joint offset":
            return stated.alter(axis, zero=unit * size)
        if cause == "slip":
            return replace(stated, slip=(axis, instant, unit * size))
        if cause == "position scale":
            return stated.alter(axis, scale=share)
        if cause == "torque constant":
            return stated.alter(axis, gain=1.0 / share)
        if cause == "gear ratio":
            return stated.alter(axis, scale=1.0 / share, gain=1.0 / share, gear=1.0 / share)
        down, (angle, turn) = stated.gravity, np.pi / 180 * np.array([size, heading])
        across = np.array([np.cos(turn), np.sin(turn)]) @ across_gravity(robot)
        gravity = np.cos(angle) * down + np.sin(angle) * np.linalg.norm(down) * across
        return replace(stated, gravity=gravity)

    return read


def alternatives(
    stated: Explained, sizes: dict[tuple[str, int], float], slipped: int
) -> list[Alternative]:
    """Return the possible readings in place of the stated reading.

    Parameters
    ----------
    stated : Explained
        Fit of the stated reading, on some `ROWS` of each channel; its dispersion is that of
        misfits, enlarged by noise that is not white.
    sizes : dict
        Sizes of causes to first order, used as further start values. A single-column cause without
        a size is within the span of the estimate: any size would only explain the difference
        between smoothed motions and smoothed regressors.
    slipped : int
        Axis whose slip explains most to first order; slips of other axes are not tried.
    """
    robot = stated.robot
    found = [
        Alternative(cause, axes, np.nan, np.nan, stated.instead(reading))
        for cause, axes, reading in discrete(robot, stated.evidence)
    ]
    turned: tuple[tuple[str, int], ...] = (("gravity", -1),) if np.any(robot.gravity) else ()
    # only owners of imported recordings state rates
    turned = (*turned, ("sampling rate", -1)) if turned and stated.evidence.imported else turned
    # an estimate finds delays itself
    tried = STARTS.keys() - (DELAYS.keys() if stated.evidence.later is None else {})
    of_size = {key: None for key in sizes if key[0] in tried and key[1] >= 0}
    # a torque that is much too small outweighs all others, and spans its own gain
    of_size |= {("torque constant", int(axis)): None for axis in np.unique(stated.evidence.axis)}
    for cause, axis in (("slip", slipped), *turned, *of_size):
        instant = _instant(stated, axis) if cause == "slip" else 0.0
        heading = _heading(stated, STARTS["gravity"]) if cause == "gravity" else 0.0
        read = sized(robot, cause, axis, instant, heading)
        starts = [*STARTS[cause], *([sizes[cause, axis]] if (cause, axis) in sizes else [])]
        least = CAUSES[cause].least if cause in CAUSES else -np.inf
        each = searched(stated, read, [start for start in starts if start > least], least)
        if each is not None and cause == "gravity":  # the best direction depends on the size
            read = sized(robot, cause, axis, 0.0, _heading(stated, [each[0]]))
            each = searched(stated, read, [each[0]], least) or each
        if each is not None:
            size, bend, here = each
            error = float(np.sqrt(2.0 * stated.dispersion / bend))
            axes = (axis,) if axis >= 0 else ()
            found.append(Alternative(cause, axes, size, error, here, instant))
    return [each for each in found if each.explained.possible]


def _heading(stated: Explained, sizes: Sequence[float]) -> float:
    """Return the best direction in which gravity turns by one of `sizes` [degrees]."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - takes long to load

    def misfit(heading: float, size: float) -> float:
        return stated.instead(
            sized(stated.robot, "gravity", -1, 0.0, heading)(size), ROUGHLY
        ).misfit

    pairs = product(HEADINGS, sizes)
    heading, size = min(pairs, key=lambda pair: misfit(*pair))
    apart = HEADINGS[1]
    return float(
        minimize_scalar(
            misfit, args=(size,), bounds=(heading - apart, heading + apart), method="bounded"
        ).x
    )


def _instant(stated: Explained, axis: int) -> float:
    """Return the best instant of a slip of an axis, by a coarse and a fine search."""
    time = stated.evidence.time

    def best(tried: Sequence[float]) -> float:
        return min(
            (stated.instead(read(size), ROUGHLY).misfit, each)
            for each in tried
            for read in [sized(stated.robot, "slip", axis, each)]
            for size in STARTS["slip"]
        )[1]

    rough = [float(time.min()), *instants(stated.evidence), float(time.max())]
    place = rough.index(best(rough[1:-1]))
    return best(np.linspace(rough[place - 1], rough[place + 1], len(rough)).tolist()[1:-1])


def discrete(robot: Robot, evidence: Evidence) -> Iterator[tuple[str, tuple[int, ...], Reading]]:
    """Yield wrong signs, exchanged pairs of axes, no gravity: causes, axes from 0, readings.

    Readings of the torque omit axes with a torque of 0 throughout: without motor there is no sign,
    and zeros in place of the torque of another axis are explained by any model of zeros.
    """
    stated, measured = Reading.stated(robot), set(evidence.axis.tolist())
    driven = set(evidence.axis[evidence.recorded != 0].tolist())
    for axis in sorted(measured):
        if axis in driven:
            reading = stated.alter(axis, sign_q=-1.0, sign_tau=-1.0)
            yield "wrong direction of an axis", (axis,), reading
            yield "wrong sign of a torque", (axis,), stated.alter(axis, sign_tau=-1.0)
        yield "wrong sign of a position", (axis,), stated.alter(axis, sign_q=-1.0)
    for i, j in combinations(sorted(measured), 2):
        if robot.revolute[i] == robot.revolute[j]:
            order = list(stated.order)
            order[i], order[j] = j, i
            both = tuple(order)
            yield "two positions exchanged", (i, j), replace(stated, order=both)
            if {i, j} <= driven:
                yield "two axes exchanged", (i, j), replace(stated, order=both, torques=both)
                yield "two torques exchanged", (i, j), replace(stated, torques=both)
    if len(driven) > 1:
        signs = np.where(np.isin(range(robot.n_joints), list(driven)), -1.0, 1.0)
        yield "wrong sign of all torques", (), replace(stated, sign_tau=signs)
    if np.any(robot.gravity):  # first moments of links remain in the torques of inertia
        yield "no gravity", (), replace(stated, gravity=np.zeros(3))


def delayed(evidence: Evidence, axis: int, kind: int, delay: float) -> Array:
    """Return a signal with a delay [ms] at the samples before, of and after each row, (3, n).

    `kind` is 0 to 2 for position, velocity and acceleration, or `TORQUE`.
    """
    found = np.empty((3, len(evidence.axis)))
    for source, s in enumerate(evidence.signals):
        rows, signal = evidence.source == source, (*s.link, s.tau)[kind][:, axis]
        time = s.time[evidence.sample[rows]] - 1e-3 * delay
        smooth = s.smoothed(signal)[s.valid]  # derivatives at the ends are none of the motion
        found[:, rows] = [
            np.interp(time + n * s.period, s.time[s.valid], smooth) for n in (-1, 0, 1)
        ]
    return found


def likeliest_signs(stated: Explained, alike: float) -> Reading:
    """Return the reading with those signs of torques that leave the least misfit.

    Weights are those of separate base parameters for each axis, on which no sign has an effect. Of
    signs within a misfit of `alike`, the fewest changed ones are returned, or their opposites, if
    these have less negative energies.
    """
    reading, of = Reading.stated(stated.robot), (stated.robot, stated.evidence)
    as_is, turned = (
        Normal.split(_columns(*of, replace(reading, sign_tau=sign), stated.more).blocks.products[0])
        for sign in (reading.sign_tau, -reading.sign_tau)
    )
    # 4096 patterns at most
    axes, counts = np.flatnonzero(stated.counts > 0)[:12], np.maximum(stated.counts, 1.0)
    left = as_is.square - np.sum(as_is.v * solve_each(as_is.N, as_is.v), axis=1)
    weight = counts / np.maximum(left, counts * stated.evidence.least)
    signs = np.array(list(product((False, True), repeat=len(axes))))
    v, square = (
        weight @ own + signs @ (weight[:, None] * (other - own))[axes]
        for own, other in ((as_is.v, turned.v), (as_is.square[:, None], turned.square[:, None]))
    )
    N = np.tensordot(weight, as_is.N, axes=1)
    misfit = square[:, 0] - np.sum(v * solve_each(N[None], v), axis=1)
    signs = signs[misfit - misfit.min() <= alike]
    wrong = signs[np.argmin(signs.sum(axis=1))]
    found = []
    for each in (wrong, ~wrong):
        sign = reading.sign_tau.copy()
        sign[axes] = np.where(each, -1.0, 1.0)
        found.append(replace(reading, sign_tau=sign))
    return min(found, key=lambda each: stated.instead(each).negative)


def searched(
    stated: Explained, read: Callable[[float], Reading], starts: Sequence[float], least: float
) -> tuple[float, float, Explained] | None:
    """Search the best size near the best start; return size, curvature and fit.

    None if the best start explains no more than the stated reading, or if the search ends where
    the misfit has no minimum. Curvature is the second derivative of the misfit. Where axes
    contradict each other, sizes above -100 % are searched by the logarithm of the factor: a gain of
    1000 has as wide a minimum as one of 2.
    """
    factor = stated.torn and least == NONE_LEFT

    def change(x: float) -> float:
        return 100.0 * float(np.expm1(x)) if factor else x

    def misfit(x: float, rounds: int = ROUNDS) -> float:
        return stated.instead(read(change(x)), rounds).misfit

    tried, rounds = starts, ROUGHLY
    if factor:  # weights of a torque that is much too large converge late
        few = np.log1p(np.array(starts) / 100.0)
        tried = [*few.tolist(), *np.arange(few.min(), few.max(), FACTOR).tolist()]
        rounds = ROUNDS
    start = min(tried, key=lambda x: misfit(x, rounds))
    if misfit(start) >= stated.misfit:
        return None
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - takes long to load

    every = sorted({*tried, 0.0})
    place = every.index(start)
    below = every[place - 1] if place else max(2.0 * start, -np.inf if factor else least)
    above = every[place + 1] if place + 1 < len(every) else 2.0 * start
    bounds = ((start + below) / 2, (start + above) / 2)
    reach = bounds[1] - bounds[0]
    how: dict[str, Any] = {"bounds": bounds, "method": "bounded"}
    how["options"] = {"xatol": 1e-3 * reach, "maxiter": 25}
    if factor and misfit(start) < min(misfit(below), misfit(above)):
        how = {"bracket": (below, start, above), "options": {"xtol": 1e-4}}
    size = change(float(minimize_scalar(misfit, **how).x))
    here, step = stated.instead(read(size)), 0.01 * reach * (100.0 + size if factor else 1.0)
    beside = [stated.instead(read(size + side * step)).misfit for side in (-1.0, 1.0)]
    bend = (sum(beside) - 2.0 * here.misfit) / step**2
    return (size, bend, here) if min(beside) > here.misfit else None
