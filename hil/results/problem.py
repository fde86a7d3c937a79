"""Regression of the recordings of a robot, for notebooks.

::

    problem = hil.regression(run, other_run, nuisance=("lag", "drift"), covariance="CR2")
    fit = problem.fit()
    fit.params["p3"], fit.conf_int()["p3"]
    fit.torque_parts(recording)["friction"]

    fit = hil.regression(bare, loaded=[with_load], mass=None).fit()
    fit.params["mass"], fit.conf_int()["centre x"]

Runs may be of any kind, measured here or imported, in any mixture; `RegressionProblem.method` is
the method of estimation for these runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

from hil.errors import Mismatch, NotEnoughData, UnknownName
from hil.estimation.free_motion.variants import DEFAULT
from hil.estimation.identify import JOINT, refuse_without_effect
from hil.estimation.options import DEFAULTS, Options
from hil.friction.terms import LAWS
from hil.results.identification import identified, method_for
from hil.results.load import BareRun, LoadProblem
from hil.runs.pooling import refuse_mixed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.prior import Prior
    from hil.least_squares.regression import Covariance
    from hil.results.identification import ModelFit
    from hil.runs.run import Run


@dataclass(frozen=True, eq=False)
class RegressionProblem:
    """Recordings of a robot with the options of their evaluation.

    Attributes
    ----------
    runs : tuple of Run
    options : Options
    recipe : str, optional
        One of `hil.estimation.identify.METHODS`; by default chosen by the kind of the recordings.

    Examples
    --------
    >>> problem = hil.regression(hil.Run.open("runs/head"))
    >>> problem.method, problem.options.covariance
    ('free motion', 'CR2')
    """

    runs: tuple[Run, ...]
    options: Options = DEFAULTS
    recipe: str | None = None

    @property
    def method(self) -> str:
        """Name of the method of estimation."""
        return self.recipe or method_for(self.runs[0], self.runs[1:])[0]

    def fit(self) -> ModelFit:
        """Fit all unknowns together.

        Raises
        ------
        NotIdentifiable, NotEnoughData
            The recordings do not suffice.
        """
        first, *others = self.runs
        return identified(first, self.method, others, options=self.options)


@overload
def regression(
    *runs: Run,
    friction: str = ...,
    nuisance: Sequence[str] = ...,
    covariance: Covariance = ...,
    method: str | None = None,
    prior: Prior | None = None,
) -> RegressionProblem: ...
@overload
def regression(
    *runs: Run, friction: str = ..., nuisance: Sequence[str] = ..., covariance: Covariance = ...,
    loaded: Sequence[Run], mass: float | None = None, gains: bool = False,
) -> LoadProblem: ...  # fmt: skip
def regression(
    *runs: Run,
    friction: str = DEFAULTS.friction,
    nuisance: Sequence[str] = DEFAULTS.nuisance,
    covariance: Covariance = DEFAULTS.covariance,
    method: str | None = None,
    loaded: Sequence[Run] = (),
    mass: float | None = None,
    gains: bool = False,
    prior: Prior | None = None,
) -> RegressionProblem | LoadProblem:
    """Create a regression problem from runs of a robot.

    Parameters
    ----------
    *runs : Run
        Runs of any kind: campaigns, trajectories, strokes of one axis, imports.
    friction : str
        ``auto``, or the name of a law for imports.
    nuisance : str or sequence of str
        Unknowns beside friction, of ``lag``, ``compliance``, ``presliding`` and ``drift``; by
        default all those of the method.
    covariance : {"jackknife", "clusters", "CR2", "white"}
        Estimator of the covariance. For imports, cells of states count, too, except for
        white noise. Conventional methods for imports use the jackknife.
    method : str, optional
        Method of estimation, as in ``hil identify --method``; by default chosen by the recordings.
    loaded : sequence of Run
        Runs of any kind with a load at the last link, identified with the robot.
    mass : float, optional
        Known mass of the load [kg], fixed in the fit.
    gains : bool
        True to identify the gains of all axes by the mass.
    prior : Prior, optional
        Bodies of the links from CAD or a URDF, for unexcited parameters (`hil.estimation.prior`).

    Raises
    ------
    NotEnoughData
        No run, or an option for a load without a loaded run.
    Mismatch
        Runs of different robots, the same run twice, an option without effect on the method, or a
        method for a load.
    UnknownName
        Unknown value of an option.

    Examples
    --------
    >>> head = hil.Run.open("runs/head")
    >>> fit = hil.regression(head, friction="Coulomb and viscous").fit()
    >>> round(fit.params["p8"], 2), fit.model.units[7]
    (0.31, 'kg m')
    """
    if not runs:
        raise NotEnoughData("0 runs: give one or more, such as hil.Run.open('runs/first')")
    refuse_mixed(runs)
    if friction not in ("auto", *LAWS):
        raise UnknownName(f"friction {friction!r} must be auto, or a law: {'; '.join(LAWS)}")
    named = (nuisance,) if isinstance(nuisance, str) else tuple(nuisance)
    options = Options(friction, named, covariance, prior)
    if loaded and method is not None:
        raise Mismatch(f"method {method!r}: not applicable to a load; omit method")
    if loaded and prior is not None:
        raise Mismatch("prior: applies to links of the robot, not to a load; omit prior")
    if not loaded and (mass is not None or gains):
        raise NotEnoughData("0 runs with a load, needed for mass or gains; give loaded=[run]")
    if loaded:
        # strokes of imports are evaluated as free motions here
        imported = {run.imported for run in (*runs, *loaded)}
        measured_or_free = DEFAULT if True in imported else "improved"
        refuse_without_effect(JOINT if len(imported) > 1 else measured_or_free, options)
        return LoadProblem(BareRun(*runs, options=options), tuple(loaded), mass, gains)
    problem = RegressionProblem(runs, options, method)
    refuse_without_effect(problem.method, options)
    return problem
