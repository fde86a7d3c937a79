"""Joint regression of runs without and with a load.

With s = 0 and 1 for runs without and with the load,

    g_i y_i - Qm_i - s A_i K phi_known = A_i p + s A_i K phi + F_i a_is - d_i (model)_present,

where y is the torque as it was read, Qm the torque of the motors' rotors, K phi the addition of a
load to the base parameters (`hil.model.load`), F friction and d the relative change of an unknown
gain g, linearised about the present solution (Gauss and Newton). All columns are combinations of
the columns of any kind of run (`evidence`), so runs of any kinds and number make one regression.
Each axis of each run is weighted by its residual, and runs of different kinds by the effect on the
torque of leaving out their groups (`hil.least_squares.balance`). No run need identify anything
alone.

A relative error of a gain makes all torques of its axis wrong by that share, and shows in no
residual of a run: the base parameters absorb it. The change due to a known mass is known too, so
with the mass all gains may be found. A gain that the load does not show stays as stated, within
`GAIN_STATED`.

Covariances come from the differences between groups, of which few carry phi: scores are corrected
for the fit of the solution to its own data (CR2). Errors that repeat with the motion do not scatter
over time, but over cells of states (`hil.least_squares.regression`). Errors of torque constants and
rotor inertias are the same in both runs, and enter by their effect on the solution.

Let e be the score of a measurement of an axis about the base parameters, and I its information.
Base parameters from this measurement alone, in the r directions that it determines, would differ
from the common ones by

    T = e'I^+ e.

Noise and wandering friction leave some T in any run. A load that gives way, slides or drags a cable
along leaves a greater T in the run with the load, as does friction that the load changed. So the
mean T / r of an axis with the load is compared with the mean without it. If nothing else differs,
their ratio has about an F distribution, with as many degrees of freedom as there are measurements
of the axis in each run, not directions: anything that increases T in a measurement does so in all
of the measurement's directions.

A load adds up to ten columns. A change dp of all base parameters in place of the load tests whether
anything but a rigid load changed: the part of dp that no load explains should not exceed its
covariance (Hotelling's T^2). The same test of the load itself shows whether the load exceeds its
error. A short run does not determine dp.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import linalg, special

from hil.estimation.condensed import ROTOR
from hil.estimation.free_motion.scaling import CONVERGED, ROUNDS, STRIDE, Scaling, gain_name
from hil.estimation.intervals import MANY
from hil.estimation.loads.figures import AxisMisfit, Chance, Load
from hil.least_squares.balance import Kind, Shares, propagate
from hil.least_squares.blocks import Blocks
from hil.least_squares.layout import embedded
from hil.least_squares.regression import Regression
from hil.least_squares.solving import inverse, inverse_root, undetermined_beside
from hil.model.base_parameters import base_parameters
from hil.model.load import MASS, load_columns
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.estimation.loads.evidence import Evidence
    from hil.least_squares.regression import Covariance
    from hil.model.robot import Robot


GAIN_STATED = 0.5
"""Prior standard deviation of the logarithm of a stated gain: wide enough to leave observable gains
unbiased, and finite, so that every gain is determined.
"""
STEADY = 1e-6
"""Relative change of weights below which they count as constant."""
PASSES = 2
"""Number of passes: friction of the transmitted torque includes the load of the previous pass."""


class Runs(NamedTuple):
    """Evidence of runs without and with a load, at most one run per kind and group."""

    bare: Sequence[Evidence]
    loaded: Sequence[Evidence]

    @property
    def every(self) -> list[Evidence]:
        """Evidence of the runs without the load, followed by the runs with the load."""
        return [*self.bare, *self.loaded]

    @property
    def alike(self) -> bool:
        """True if all runs are of the same kind."""
        return len({run.kind for run in self.every}) == 1


class Terms(NamedTuple):
    """Effect of a load on the base parameters, ``known + columns theta``, and the name of theta."""

    known: Array
    columns: Array
    name: str


class JointRuns:
    """Joint regression of runs without and with a load, and the solution.

    Parameters
    ----------
    axes : tuple of int
        Axes, from 0, with gains to be found.
    start : ndarray, shape (n_runs, n_joints)
        Initial gains of each run.
    """

    def __init__(
        self, robot: Robot, runs: Runs, terms: Terms, axes: Sequence[int], start: Array
    ) -> None:
        self.robot, self.runs, self.terms = robot, runs, terms
        self.axes, self._start, self.gains = list(axes), start, start.copy()
        self._every = runs.every
        self._carry = [0.0] * len(runs.bare) + [1.0] * len(runs.loaded)
        self._open = [[a for a in axes if runs.alike or a in run.unknown] for run in self._every]
        self._names = {
            "base": base_parameters(robot).names,
            terms.name: tuple(f"{terms.name} {k + 1}" for k in range(terms.columns.shape[1])),
            "gain": tuple(gain_name(axis) for axis in axes),
        }
        self._found: dict[str, float] = {}
        self._totals = [run.blocks.total for run in self._every]
        blocks = self._joined(self._totals)
        self.layout = blocks.layout
        self.weights = np.ones((1 + len(self._every), robot.n_joints))
        self._factors = np.ones(len(self._every))
        self._beside: Array | float = 0.0
        self._kept = self.layout.kept([
            list({self._named(s, name) for s, run in enumerate(self._every)
                  for name in run.terms[axis]})
            for axis in range(robot.n_joints)
        ])  # fmt: skip
        self._solve(blocks)
        if terms.name == "load":
            shares, of, doubts = self._shares()
            c = shares.factors()
            beside = shares.extra_covariance(c) + propagate(shares.parts(c), doubts)
            at = np.array([self.layout.index(name) for name in self._shared])
            self._beside = embedded(beside, at, self.layout.size)
            if not runs.alike:
                self._factors = c[of]
                self._solve(self._joined(self._totals))
        self.whole = self._regression(self._joined([run.blocks for run in self._every]))

    def _solve(self, blocks: Blocks) -> None:
        """Iterate gains, weights and solution until convergence."""
        n, own = len(self._every), self.places("gain")
        counts = np.maximum(blocks.counts[:n], 1.0)
        left = blocks.products[:n, :, 0, 0] / counts
        # columns of gains are derivatives at a solution, so the first round has none
        kept = np.setdiff1d(self._kept, own)
        for _ in range(ROUNDS):
            before, square = left, blocks.products[:n, :, 0, 0] / counts
            least = np.maximum(left, np.finfo(float).eps * square)
            least[square == 0] = np.inf
            self.weights[:n] = self._factors[:, np.newaxis] / least
            x = replace(self._regression(blocks), kept=kept).solution
            left = blocks.squares_left(x)[:n] / counts
            change = np.clip(x[own], -STRIDE, STRIDE)
            for gains, is_open in zip(self.gains, self._open, strict=True):
                gains[is_open] *= np.exp(change[np.isin(self.axes, is_open)])
            x[own] = 0.0
            self.x, self._found = x, dict(zip(self.layout.names, x.tolist(), strict=True))
            steady = np.allclose(before, left, rtol=STEADY) and len(kept) == len(self._kept)
            if steady and np.all(np.abs(change) < CONVERGED):
                break
            kept, blocks = self._kept, self._joined(self._totals)

    def _shares(self) -> tuple[Shares, list[int], list[Array]]:
        """Return shares of the kinds of run, each run's kind, and each kind's extra covariance."""
        kinds = list(dict.fromkeys(run.kind for run in self._every))
        of = [kinds.index(run.kind) for run in self._every]
        found, doubts = [], []
        for number in range(len(kinds)):
            own = [(run, k == number) for run, k in zip(self._every, of, strict=True)]
            blocks = self._joined([run.blocks if mine else None for run, mine in own])
            cells = [run.cells if mine else None for run, mine in own]
            of_states = self._regression(self._joined(cells)).blocks if any(cells) else None
            first = next(run for run, mine in own if mine)
            found.append(Kind(self._regression(blocks), of_states, first.beside))
            doubts.append(first.doubt)
        return Shares(found, self._shared), of, doubts

    @property
    def _shared(self) -> list[str]:
        return [name for names in self._names.values() for name in names]

    def places(self, kind: str) -> Indices:
        """Return indices of unknowns of a kind: "base", "load" or "change", "gain"."""
        return np.array([self.layout.index(name) for name in self._names[kind]], dtype=np.intp)

    def values(self, kind: str) -> Array:
        """Return the solution for the unknowns of a kind."""
        return self.x[self.places(kind)]

    def undetermined(self, kind: str) -> Mask:
        """Return a mask of the unknowns of a kind that the runs do not determine."""
        own = self.places(kind)
        order = np.concatenate([own, np.setdiff1d(self._kept, own)])
        N = embedded(self.whole.normal.information, self._kept, self.layout.size)
        return undetermined_beside(N[np.ix_(order, order)], len(own))

    def uncertainty(self, covariance: Covariance) -> tuple[Array, Array]:
        """Compute the covariance of the unknowns and the degrees of freedom."""
        n, cells = self.layout.size, [run.cells for run in self._every]
        of_states = self._regression(self._joined(cells)).blocks if any(cells) else None
        found = self.whole.uncertainty(covariance, of_states)
        V = found.covariance
        scattered = embedded(np.diag(V), self._kept, n)
        # stated errors of torque constants and rotor inertias show in no scatter
        stated = self.robot.stated_uncertainty.copy()
        stated[self.axes] = 0.0
        torques = (self._regression(self._joined(self._totals, each)) for each in ("", ROTOR))
        effect = stated * np.hstack([self.whole.moved(each.blocks) for each in torques])
        V = embedded(V, self._kept, n) + effect @ effect.T + self._beside
        # stated errors have infinite degrees of freedom, scatter has few
        ratio = np.divide(np.diag(V), scattered, out=np.ones(n), where=scattered > 0)
        return V, embedded(found.degrees_of_freedom, self._kept, n) * ratio**2

    @property
    def n_groups(self) -> int:
        """Number of groups that scatter: pieces of time and cells of states."""
        return sum(len(run.blocks) + (len(run.cells) if run.cells else 0) for run in self._every)

    def misfit(self) -> tuple[AxisMisfit, ...]:
        """Compare strokes with and without the load, if all runs consist of strokes."""
        if any(run.kind != "strokes" for run in self._every):
            return ()
        blocks = self._joined([run.blocks for run in self._every])
        without, with_load = (blocks.where(blocks.labels["run"] == s) for s in (0, 1))
        # compare both runs by axis, without axes that hardly move in the run with the load
        n_base = len(self._names["base"])
        found = []
        for axis in range(with_load.n_channels):
            before, after = (_left(blocks, axis, self.x, n_base) for blocks in (without, with_load))
            # minimum number of measurements of an axis in a run
            if min(len(before), len(after)) >= 2:
                (square, r), (square_with, s) = before.sum(axis=0), after.sum(axis=0)
                ratio = float(square_with / s / (square / r)) if square > 0 else 1.0
                chance = special.fdtrc(len(after), len(before), ratio)
                found.append(AxisMisfit(axis=axis + 1, ratio=ratio, p_value=float(chance)))
        return tuple(found)

    def _regression(self, blocks: Blocks) -> Regression:
        """Return the regression of blocks, weighted by axis and run."""
        # cells of a single run lack columns of the others
        layout = self.layout
        whole = blocks.expanded(layout.shared, layout.own, layout.channels)
        weights = self.weights[blocks.labels["run"], :, np.newaxis, np.newaxis]
        weighted = replace(whole, products=weights * whole.products)
        return Regression(weighted, np.ones(blocks.n_channels), self._kept)

    def _joined(self, parts: Sequence[Blocks | None], torque: str | None = None) -> Blocks:
        """Join the blocks of runs and the prior of stated gains; `torque` as in `_run_blocks`."""
        made = [
            self._run_blocks(s, part, torque) for s, part in enumerate(parts) if part is not None
        ]
        n, k = self.robot.n_joints, len(self.axes)
        products = np.zeros((1, n, 1 + k, 1 + k))
        unknown = {axis for run in self._every for axis in run.unknown}
        is_open = any(run.scale_open for run in self._every)
        for at, axis in enumerate(self.axes, start=1):
            if axis not in unknown and not is_open and torque is None:
                row = np.zeros(1 + k)
                row[0] = -np.log(self.gains[-1, axis] / self._start[-1, axis]) / GAIN_STATED
                row[at] = 1.0 / GAIN_STATED
                products[0, axis] = np.outer(row, row)
        label = _label(1, len(self._every))
        known = Blocks(self._names["gain"], (), products, np.zeros((1, n)), labels=label)
        return made[0].joined(*made[1:], known)

    def _run_blocks(self, s: int, recorded: Blocks, torque: str | None) -> Blocks:
        """Return the blocks of a run with the columns of gains and load.

        The column `torque` replaces the torque less its known part; an empty name leaves the
        torque.
        """
        (known, columns, kind), carried = self.terms, self._carry[s]
        scaling = Scaling(self.gains[s], tuple(self._open[s]), self._solution(s))
        if torque is None:
            blocks = scaling.applied(recorded)
        else:
            alone = scaling.signal(recorded.layout)
            if torque:
                alone = np.eye(1, alone.shape[1], recorded.place(torque)[0])
            added = scaling.columns(recorded.layout)
            blocks = recorded.recast(alone, added, (ROTOR,))
        base = blocks.place(*self._names["base"])
        left = np.eye(1, blocks.products.shape[-1])
        load = np.zeros((len(self._names[kind]), *left.shape))
        load[:, 0, base] = carried * columns.T
        if torque is None:
            left[:, base] = -carried * known
        blocks = blocks.recast(left, dict(zip(self._names[kind], load, strict=True)))
        shared, own = self._columns(s, blocks.shared), self._columns(s, blocks.own)
        return replace(blocks, shared=shared, own=own, labels=_label(len(blocks), s))

    def _solution(self, s: int) -> Array:
        """Return the solution for a run, with the load included in the base parameters."""
        layout, base = self._every[s].blocks.layout, self._names["base"]
        names = replace(
            layout, shared=self._columns(s, layout.shared), own=self._columns(s, layout.own)
        ).names
        found = {name: self._found.get(name, 0.0) for name in names if name != ROTOR}
        if self._found:
            added = self._carry[s] * (
                self.terms.known + self.terms.columns @ self.values(self.terms.name)
            )
            for name, more in zip(base, added.tolist(), strict=True):
                found[name] += more
        return np.array(list(found.values()))

    def _columns(self, s: int, names: Sequence[str]) -> tuple[str, ...]:
        return tuple(self._named(s, name) for name in names)

    def _named(self, s: int, name: str) -> str:
        """Return the name of a run's column in the joint regression."""
        run, first = self._every[s], self._every[0]
        if s and name in run.apart:
            return f"{name} of run {s}"
        other = run.kind != first.kind and name in run.blocks.own
        return f"{name} of {run.kind}" if other else name


def _left(blocks: Blocks, axis: int, x: Array, n_base: int) -> Array:
    """Return T and r of the measurements of an axis, shape (n, 2)."""
    around, base = np.concatenate([[1.0], -x[blocks.layout.place(axis)]]), slice(1, 1 + n_base)
    found = []
    for product in blocks.products[blocks.counts[:, axis] > 0, axis]:
        # minimum share of the information's largest eigenvalue for a determined direction
        t = inverse_root(product[base, base], 1e-4).T @ (product[base] @ around)
        if len(t):
            found.append((t @ t, len(t)))
    return np.array(found).reshape(-1, 2)


def _label(n: int, run: int) -> dict[str, Indices]:
    return {"run": np.full(n, run, dtype=np.intp)}


def fit_load(
    robot: Robot,
    bare: Sequence[Evidence],
    with_load: Callable[[Array], Sequence[Evidence]],
    mass: float | None = None,
    *,
    gains: bool = False,
    covariance: Covariance = "CR2",
) -> Load:
    """Fit a load to runs without and with the load.

    Parameters
    ----------
    bare : sequence of Evidence
        Evidence of runs without the load, one of each kind.
    with_load : callable
        Function of the load's change of the base parameters: evidence of runs with the load;
        friction may depend on this change.
    mass : float, optional
        Known mass of the load, fixed in the fit [kg].
    gains : bool
        True to estimate the gains of all axes too, for a known mass.
    covariance : str
        Kind of covariance (`hil.least_squares.regression`).

    Raises
    ------
    NoLoad
        The robot file states no parameter of the last link affected by a load.
    """
    load = load_columns(robot)
    known, free = np.zeros(10), load.free
    if mass is not None:
        known[MASS], free = mass, load.free[:, load.free[MASS] == 0]
    terms = Terms(load.K @ known, load.K @ free, "load")
    change = terms.known
    before: list[Evidence] = []
    for _ in range(PASSES):
        runs = Runs(bare, with_load(change))
        if list(map(id, runs.loaded)) != list(map(id, before)):
            before = list(runs.loaded)
            unknown = {axis for run in runs.every for axis in run.unknown}
            wanted = list(range(robot.n_joints)) if gains else sorted(unknown)
            joint = _determined(robot, runs, terms, mass, wanted)
            change = terms.known + terms.columns @ joint.values("load")
    base, at, scale = (joint.places(kind) for kind in ("base", "load", "gain"))
    V, degrees = joint.uncertainty(covariance)
    errors = np.zeros(robot.n_joints)
    errors[wanted] = np.inf
    errors[joint.axes] = np.sqrt(np.diag(V)[scale])
    lost = joint.undetermined("load")
    seen = np.where(lost, 0.0, 1.0)
    of_base = V[np.ix_(base, base)]
    V = V[np.ix_(at, at)] * np.outer(seen, seen)
    is_open = zip(LINK_PARAMETERS, np.abs(free) @ lost > 0, strict=True)
    return Load(
        p=joint.values("base"),
        p_covariance=of_base,
        p_degrees=np.maximum(degrees[base], 1.0),
        phi=known + free @ (seen * joint.values("load")),
        covariance=free @ V @ free.T,
        degrees=np.where(free.any(axis=1), np.maximum(np.abs(free) @ degrees[at], 1.0), MANY),
        stated_mass=mass,
        unseen=load.absent,
        unidentifiable=tuple(name for name, each in is_open if each or name in load.dark),
        gains=joint.gains[-1],
        gain_errors=errors,
        present=_test(joint.values("load"), V, joint.n_groups),
        rigid=_rigid(joint, covariance),
        misfit=joint.misfit(),
    )


def _determined(
    robot: Robot, runs: Runs, terms: Terms, mass: float | None, wanted: Sequence[int]
) -> JointRuns:
    """Solve the regression with the determined gains among the wanted gains."""
    start, kinds = np.array([run.gains for run in runs.every]), [run.kind for run in runs.every]
    for kind in dict.fromkeys(kinds):
        alike = np.array([each == kind for each in kinds])
        start[alike] = np.exp(np.mean(np.log(start[alike]), axis=0))
    if mass is not None and wanted and any(run.scale_open for run in runs.every):
        # one gain was fixed at an arbitrary value and is now scaled by the known mass
        load = load_columns(robot)
        whole = Terms(np.zeros(len(load.K)), load.shown, "load")
        found = float((load.free @ JointRuns(robot, runs, whole, (), start).values("load"))[MASS])
        start *= mass / found if found > 0 else 1.0
    joint = JointRuns(robot, runs, terms, wanted, start)
    lost = joint.undetermined("gain")
    if not lost.any():
        return joint
    return JointRuns(robot, runs, terms, np.array(wanted)[~lost].tolist(), start)


def _rigid(joint: JointRuns, covariance: Covariance) -> Chance:
    """Test a free change of the base parameters against the changes by a rigid load."""
    known, columns, _ = joint.terms
    any_change = Terms(known, np.eye(len(known)), "change")
    free = JointRuns(joint.robot, joint.runs, any_change, (), joint.gains)
    if free.undetermined("change").any():
        return Chance(0.0, 0, 1.0)
    at, other = free.places("change"), linalg.null_space(columns.T)
    V = free.uncertainty(covariance)[0][np.ix_(at, at)]
    return _test(other.T @ free.values("change"), other.T @ V @ other, free.n_groups)


def _test(x: Array, V: Array, groups: int) -> Chance:
    """Test x = 0, with the covariance V estimated from a number of groups of samples."""
    shown = np.diag(V) > 0
    x, V, k = x[shown], V[np.ix_(shown, shown)], int(shown.sum())
    if not k:
        return Chance(0.0, 0, 1.0)
    square = float(x @ inverse(V) @ x)
    rest = max(groups - k, 1)
    p_value = float(special.fdtrc(k, rest, square * rest / (k * max(groups - 1, 1))))
    return Chance(square, k, p_value)
