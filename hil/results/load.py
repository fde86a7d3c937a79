"""Identification of a load from runs without and with the load, of any kinds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.errors import InvalidValue, Mismatch, NoLoad, NotIdentifiable
from hil.estimation.drive_train import find_drive_train
from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.scaling import Scaling
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.identify import restrict
from hil.estimation.import_methods import estimate_from
from hil.estimation.loads.evidence import condensed_like, free_motion_evidence, stroke_evidence
from hil.estimation.loads.joint import fit_load
from hil.estimation.noise_levels import noise_levels
from hil.estimation.options import DEFAULTS
from hil.estimation.simultaneous import SimultaneousFit
from hil.estimation.two_step_methods import doubt, prepare, prepared_for, restrict_drive_train
from hil.friction.law import friction_torque
from hil.least_squares.regression import ByName
from hil.model.base_parameters import base_parameters
from hil.model.load import FIRST_MOMENTS, load_columns
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.design.candidates import weigh
from hil.planning.design.load import WithoutLoad
from hil.planning.measurement import shows_element
from hil.results.findings import found_in
from hil.results.identification import identified, method_for
from hil.results.provenance import named, same_recordings
from hil.runs.pooling import Pooled, pooled, recorded, refuse_mixed
from hil.show.outcome import Outcome
from hil.show.rounding import uncertain, unit
from hil.show.table import Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from hil.arrays import Array
    from hil.estimation.drive_train import DriveTrain
    from hil.estimation.estimate import Estimate
    from hil.estimation.free_motion.gathering import Gathered
    from hil.estimation.loads.evidence import Evidence
    from hil.estimation.loads.figures import Figure, Load
    from hil.estimation.options import Options
    from hil.model.robot import Robot
    from hil.runs.run import Run
    from hil.show.table import Row

    Fit = Callable[..., Load]

SURE = 4.0
"""Threshold for a mass below zero or contrary to the stated mass [standard errors]; by chance
6e-5."""


class BareRun:
    """Reference runs without a load, evaluated on demand.

    Attributes
    ----------
    run : Run
        First run.
    """

    def __init__(self, *runs: Run, options: Options = DEFAULTS) -> None:
        self.run, self.runs, self.options = runs[0], runs, options

    @cached_property
    def estimate(self) -> Estimate:
        """Estimate from all runs together."""
        return estimated(*self.runs, options=self.options)

    @cached_property
    def known(self) -> WithoutLoad:
        """Base parameters and friction, for choosing measurements with a load.

        Raises
        ------
        Mismatch
            Imported recordings.
        FileError, NotIdentifiable, NoLoad
            A damaged recording, recordings that do not determine the base parameters, or a robot
            file without parameters of the last link.
        """
        run, robot = self.run, self.run.robot
        if run.imported:
            raise Mismatch(
                f"{run.path}: is an imported run; measurements with a load can be chosen only "
                "for a run of hil run; import a recording with the load and use: hil payload "
                "WITHOUT LOADED"
            )
        load_columns(robot)
        found = self.estimate
        with named(run):
            prepared = prepared_for(robot, found, recorded(run))
            noise, information, _ = noise_levels(
                robot, [(m, s) for m, s in prepared if shows_element(m)]
            )
        weight = weigh(information.matrix, information.scatter)
        # highest friction of each axis, slow or fast; without a law a tenth of the torque limit
        qd = np.outer((0.1, 0.5, 1.0, -0.1, -0.5, -1.0), robot.velocity_limit)
        still = np.zeros_like(qd)
        torque = friction_torque(robot, found.friction_law, still, qd, still)
        highest = np.abs(torque).max(axis=0)
        friction = np.where(highest > 0, highest, 0.1 * robot.torque_limit)
        return WithoutLoad(robot, run.planned, found.values, friction, noise, weight)


@dataclass(frozen=True, eq=False)
class LoadFit(ByName):
    """Identified load, with values by name.

    Base parameters are those without the load; the load's own are named as in ``load.yaml``, such
    as ``mass``, ``sx``, ``centre x``, ``Ixx``, in SI; identified gains are ``axis 2 gain``.

    Attributes
    ----------
    robot : Robot
    load : Load
    before, after : Estimate or None
        Separate estimates of the runs without and with the load, with the identified gains; None
        for runs that do not identify the robot, and for a load that was measured in minutes.
    own : Estimate or None
        Separate estimate of the loaded runs with the gains of the maps; None for an unknown scale.
    by_mass : Load or None
        Load from a fit that identifies the gains of all axes by a stated mass.
    assumed : ndarray, shape (n_joints,)
        Reference values of the gains: torque constants [N m/A], or 1 for imported runs, NaN for a
        gain that the map leaves unknown.

    Examples
    --------
    >>> bare, loaded = hil.Run.open("runs/head"), hil.Run.open("runs/loaded")
    >>> fit = hil.regression(bare, loaded=[loaded], mass=1.0).fit()
    >>> round(fit.params["centre y"], 3)  # [m]
    0.1
    """

    robot: Robot
    load: Load
    before: Estimate | None = None
    after: Estimate | None = None
    own: Estimate | None = None
    by_mass: Load | None = None
    assumed: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def _found(self) -> dict[str, tuple[float, float]]:
        load, by_mass = self.load, self.by_mass or self.load
        rows = zip(base_parameters(self.robot).names, load.p, self._base_errors, strict=True)
        found = {name: (float(value), float(error)) for name, value, error in rows}
        found |= {each.name: (each.value, each.standard_error) for each in load.quantities()}
        gains = zip(by_mass.gains.tolist(), by_mass.gain_errors.tolist(), strict=True)
        for axis, (gain, error) in enumerate(gains, start=1):
            if 0.0 < error < np.inf:
                found[f"axis {axis} gain"] = gain, gain * error
        return found

    @property
    def _base_errors(self) -> Array:
        return np.sqrt(np.diag(self.load.p_covariance))

    def _half_widths(self, level: float) -> dict[str, float]:
        t = special.stdtrit(self.load.p_degrees, 0.5 + level / 2)
        base = zip(base_parameters(self.robot).names, t * self._base_errors, strict=True)
        of_load = {each.name: each.half_width for each in self.load.quantities(level)}
        return {name: float(half) for name, half in base} | of_load

    def summary(self) -> Outcome:
        """Return the load as a table, for a terminal or a notebook."""
        return Outcome((quantities(self.load.quantities()),))


def quantities(load: Iterable[Figure]) -> Table:
    """Return mass, first moments, centre of mass and inertia of a load as a table."""
    return table(
        "The load, in the last link's frame",
        ("", *figures("value", "std. error", "95 %, ±"), "unit"),
        map(_row, load),
    )


def _row(q: Figure) -> Row:
    value, error = uncertain(q.value, q.standard_error)
    half = uncertain(q.half_width, q.standard_error)[0] if q.half_width else ""
    stated = not q.standard_error
    return q.name, value, "stated" if stated else error, "" if stated else half, unit(q.unit)


@dataclass(frozen=True, eq=False)
class LoadProblem:
    """Load identification from runs without and with a load.

    Attributes
    ----------
    bare : BareRun
    loaded : tuple of Run
    mass : float, optional
        Known mass of the load [kg], fixed in the fit. For measured strokes, the mass also serves to
        identify the torque constants.
    gains : bool
        True to identify the gains of imported runs by the mass.

    Examples
    --------
    >>> bare, loaded = hil.Run.open("runs/head"), hil.Run.open("runs/loaded")
    >>> problem = hil.regression(bare, loaded=[loaded], mass=1.0)
    >>> problem.mass, problem.gains
    (1.0, False)
    """

    bare: BareRun
    loaded: tuple[Run, ...]
    mass: float | None = None
    gains: bool = False

    def fit(self) -> LoadFit:
        """Identify the load, and estimate each side separately.

        Raises
        ------
        FileError
            A damaged recording.
        Mismatch
            Runs of different robots, the same run twice, gains of runs of two kinds, different
            unknown gains, or a mass that contradicts the runs.
        InvalidValue
            Gains without a mass.
        NotIdentifiable, NotEnoughData, NoLoad
            Insufficient measurements, an insignificant load, or a robot file without parameters
            affected by a load.
        """
        robot, mass, gains = self.bare.run.robot, self.mass, self.gains
        runs = _Runs(self.bare, self.loaded, gains=gains)
        strokes = not any(run.imported for run in (*self.bare.runs, *self.loaded))
        found, fit = _found(runs, mass, gains=gains)
        by_mass = (
            found if gains else fit(mass, gains=True) if strokes and mass is not None else None
        )
        assumed = np.array(robot.torque_constant)
        if self.loaded[-1].imported:
            assumed = np.ones(robot.n_joints)
            assumed[list(runs.unknown)] = np.nan
        given = found if gains or runs.is_open else None
        before, after = (runs.estimated(s, given) for s in (0, 1))
        own = None if runs.is_open else runs.estimated(1, None) if gains else after
        return LoadFit(robot, found, before, after, own, by_mass, assumed)


def find_load(bare: BareRun, loaded: Sequence[Run], mass: float | None = None) -> Load:
    """Identify the load of the runs `loaded`, with gains as stated.

    Errors are those of `LoadProblem.fit`.
    """
    return _found(_Runs(bare, loaded), mass)[0]


def estimate_load(bare: BareRun, loaded: Sequence[Run]) -> Load:
    """Estimate the load without testing its significance."""
    with named(loaded[-1]):
        return _Runs(bare, loaded).fit()()


def estimated(*runs: Run, options: Options = DEFAULTS) -> Estimate:
    """Return the estimate of runs, saved or computed as by `hil identify`."""
    first, *others = runs
    method = method_for(first, others)[0]
    if others or options != DEFAULTS:
        # options of a load may concern the runs of the other kind alone
        return identified(first, method, others, options=restrict(method, options)).model
    return found_in(first, method).model


def require_load(found: Load) -> None:
    """Raise an error for an insignificant load or a negative mass.

    Raises
    ------
    NoLoad
    """
    mass, error = found.mass.value, found.mass.standard_error
    if error and mass < -SURE * error:
        raise NoLoad(
            f"the mass of the load would be {mass:.4g} ± {error:.2g} kg: these runs are swapped, or"
            " the run without the load carried a load; name the run without the load first"
        )
    # largest p-value of a significant load, under the hypothesis of no load
    if found.present.p_value > 0.01:
        figure = f"its mass would be {mass:.3g} ± {error:.2g} kg" if error else "nothing changed"
        raise NoLoad(
            f"load not significant: {figure} (p = {found.present.p_value:.2g}); check that this "
            "run carries it, or record longer with a heavier one"
        )


def _found(runs: _Runs, mass: float | None, *, gains: bool = False) -> tuple[Load, Fit]:
    """Identify the load, check significance and stated mass, and return the load with its fit."""
    if gains and mass is None:
        raise InvalidValue("gains need the mass of the load; state the mass too")
    with named(runs.loaded[-1]):
        fit = runs.fit()
        if runs.is_open:
            return fit(mass, gains=gains), fit
        fit, found = _free_moments(runs, fit, fit())
        require_load(found)
        if mass is None:
            return found, fit
        if not gains:
            _refuse_contradiction(runs, fit, found, mass)
        return fit(mass, gains=gains), fit


def _free_moments(
    runs: _Runs, fit: Fit, found: Load, chance_on_it: float = 0.001
) -> tuple[Fit, Load]:
    """Free the first moments of the last link missing in the robot file, if significant.

    If the model omits the first moments across the last axis, a load off the axis looks like a
    loose load. Therefore these moments are freed before a contradiction is reported. They stay free
    if a moment is significant at the level `chance_on_it` and the load is then rigid.
    """
    newly = [k for k in FIRST_MOMENTS if LINK_PARAMETERS[k] in found.unseen]
    if not newly or runs.unknown:
        return fit, found
    wider = runs.robot.free_links([runs.robot.n_joints - 1])
    fit_wider = runs.fit(wider)
    beside = fit_wider()
    error = np.sqrt(np.diag(beside.covariance))[newly]
    if not np.all(error > 0) or beside.is_loose:
        return fit, found
    chance = 2 * special.stdtr(beside.degrees[newly], -np.abs(beside.phi[newly]) / error)
    return (fit_wider, beside) if len(newly) * chance.min() <= chance_on_it else (fit, found)


def _refuse_contradiction(
    runs: _Runs, fit: Fit, found: Load, mass: float, notable: float = 2.0
) -> None:
    """Refuse a mass that contradicts the runs; name gains beyond `notable` standard errors."""
    m, error = found.mass.value, found.mass.standard_error
    if not error or abs(m - mass) <= SURE * error:
        return
    explained = f"{mass / m:.3g} times as large on all axes"
    if runs.alike:
        by_mass = fit(mass, gains=True)
        factors = by_mass.gains / found.gains
        moved = np.flatnonzero(np.abs(np.log(factors)) > notable * by_mass.gain_errors)
        explained = (
            ", ".join(f"{factors[k]:.3g} times as large on axis {k + 1}" for k in moved)
            or explained
        )
    raise Mismatch(
        f"a mass of {mass:g} kg contradicts {m:.4g} ± {error:.2g} kg by these runs; torque"
        f" gains {explained} would explain the difference: correct the mass, or use it to find"
        " the gains, from two whole runs of one kind: hil payload WITHOUT LOADED --mass --gains"
    )


class _Runs:
    """Evidence of runs without and with a load."""

    def __init__(self, bare: BareRun, loaded: Sequence[Run], *, gains: bool = False) -> None:
        self.bare, self.loaded, self.robot = bare, loaded, bare.run.robot
        self._open_scale = gains
        for run in loaded:
            _refuse_unfit(bare.runs, run)
        refuse_mixed((*bare.runs, *loaded))
        self.alike = len({run.imported for run in (*bare.runs, *loaded)}) == 1
        if gains and not self.alike:
            raise Mismatch(
                f"{loaded[-1].path}: gains cannot be found from a measured and an imported run "
                "together: give two runs of one kind, or omit --gains"
            )
        self._gathered = self._gather(self.robot)
        every = [run.found.unknown_gains for run in self._gathered if run]
        self.unknown = every[-1] if every else ()
        self.is_open = any(run and run.scaling.unknown != self.unknown for run in self._gathered)
        if len(set(every)) > 1:
            raise Mismatch(
                f"{loaded[-1].path}: axes of unknown gain differ from those in {bare.run.path}; "
                "state the gain of an axis in the maps of both runs, or of neither"
            )

    def fit(self, robot: Robot | None = None) -> Fit:
        """Return the fit of the load; `robot` may have additional parameters of the last link."""
        gathered = self._gathered if robot is None else self._gather(robot)
        robot, strokes = robot or self.robot, None
        free = iter(free_motion_evidence(robot, [run for run in gathered if run]))
        bare, loaded = [[next(free)] if run else [] for run in gathered]
        if measured := _measured(self.bare.runs):
            prepared = prepared_for(self.robot, self.bare.estimate, pooled(measured))
            strokes = SimultaneousFit(robot, prepared)
            own = self._doubt(robot, measured, strokes, self.bare.estimate.drive_train)
            bare.insert(0, stroke_evidence(strokes.recorded, strokes.loaded, own))
        of = self._strokes(robot, strokes) if _measured(self.loaded) else None
        with_load = (lambda change: [of(change), *loaded]) if of else (lambda _: loaded)
        return partial(fit_load, robot, bare, with_load, covariance=self.bare.options.covariance)

    def _strokes(self, robot: Robot, bare: SimultaneousFit | None) -> Callable[[Array], Evidence]:
        """Return the evidence of measurements with the load, by the gears of `bare` if known."""
        raw, _ = prepare(pooled(_measured(self.loaded)))
        train = None if bare is None else self.bare.estimate.drive_train
        if bare is None:
            train = restrict_drive_train(find_drive_train(robot, raw), self.bare.options.nuisance)
        applied = raw if train is None else [(m, train.applied(self.robot, s)) for m, s in raw]
        if bare is None:
            fit = SimultaneousFit(robot, applied)
            own = self._doubt(robot, _measured(self.loaded), fit, train)
            alone = stroke_evidence(fit.recorded, fit.loaded, own)
            return lambda _: alone
        p = bare.solve()
        return lambda change: stroke_evidence(
            condensed_like(robot, bare, applied, p + change), bare.loaded
        )

    def _doubt(
        self, robot: Robot, runs: Sequence[Run], fit: SimultaneousFit, train: DriveTrain | None
    ) -> Array:
        """Return the covariance of base parameters due to drive trains and encoders."""
        raw, _ = prepare(pooled(runs))
        if train is None or robot is not self.robot:
            train = restrict_drive_train(find_drive_train(robot, raw), self.bare.options.nuisance)
        change, covariance = doubt(robot, raw, train, fit)
        return covariance + np.outer(change, change)

    def _gather(self, robot: Robot) -> list[Gathered | None]:
        """Return imported free motions without and with the load, None for the side without any."""
        found: list[Gathered | None] = []
        for runs in (self.bare.runs, self.loaded):
            imported, how = [run for run in runs if run.imported], self.bare.options
            with named(runs[-1]):
                found.append(
                    gather(robot, Pooled(imported), VARIANTS[DEFAULT], how,
                           open_scale=self._open_scale)
                    if imported else None
                )  # fmt: skip
        return found

    def estimated(self, s: int, found: Load | None) -> Estimate | None:
        """Return the estimate without (s = 0) or with the load (s = 1); None if unidentifiable."""
        gathered, options = self._gathered[s], self.bare.options
        try:
            if gathered is None or _measured((self.bare.runs, self.loaded)[s]):
                return self.bare.estimate if s == 0 else estimated(*self.loaded, options=options)
            if found is not None:
                gathered = replace(gathered, scaling=Scaling.known(found.gains))
            return estimate_from(self.robot, DEFAULT, VARIANTS[DEFAULT].solver, gathered)
        except NotIdentifiable:
            return None


def _measured(runs: Sequence[Run]) -> list[Run]:
    return [run for run in runs if not run.imported]


def _refuse_unfit(without: Sequence[Run], loaded: Run) -> None:
    for bare in without:
        if bare.robot != loaded.robot:
            raise Mismatch(
                f"{loaded.path}: was measured with another robot file than {bare.path}; name the"
                " run without the load of this robot"
            )
        if same_recordings(bare, loaded):
            raise Mismatch(
                f"{loaded.path}: has the same recordings as {bare.path}; name the run without the"
                " load, then the run with the load, measured into a folder of its own"
            )
