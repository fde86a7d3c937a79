"""Identification result of a robot: base parameters with errors, friction, and judgement.

All methods give the same kind of result. A result consists of data and of values derived by a
formula. Torque calculations, files and tables are in other modules (`hil.results.model`).
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidArray, Mismatch, NotEnoughData
from hil.estimation.estimate import Estimate
from hil.friction.law import friction_torque, friction_variance
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    import pandas as pd

    from hil.arrays import Array
    from hil.estimation.consistent.result import ConsistentRobot
    from hil.estimation.excluded.result import ErrorTerm, Excluded
    from hil.estimation.prior import FromPrior
    from hil.friction.law import FrictionLaw
    from hil.model.robot import Robot
    from hil.results.judgement import Judgement, KeptJudgement
    from hil.results.provenance import Provenance
    from hil.results.refinement import Refinement
    from hil.results.residual import BandResidual


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class IdentifiedRobot(Estimate):
    """Estimate of a robot with its origin and judgement; further data are those of `Estimate`.

    Attributes
    ----------
    provenance : Provenance
        Run, plan, method and version.
    error_budget : tuple of ErrorTerm
        Causes of error, the largest first; empty if only noise matters.
    verdict : Judgement, optional
        Judgement of the identification; None for a model without one.
    validations : tuple of KeptJudgement
        Judgements of the model on other recordings.
    consistent : ConsistentRobot, optional
        Nearest physically consistent robot, and its torque error, if requested.
    excluded : Excluded, optional
        Causes of error found, excluded or invisible in the recordings; None for too few recordings,
        and for files of versions without these tests.
    prior : FromPrior, optional
        Parameters not identified by the recordings, and the prior that completes them; None without
        a prior.
    band_residual : BandResidual, optional
        Residual of `hil.results.model.Model.predict` on the recordings of its identification, over
        the band common to all models; None without known friction, and for a file of an earlier
        version.
    refinement : Refinement, optional
        Held-out position errors of a refinement by simulation; None without one.

    Examples
    --------
    >>> model = hil.Model.load("runs/first")
    >>> low, high = model.interval(0.95).T
    >>> bool((low < model.values).all() and (model.values < high).all())
    True
    """

    provenance: Provenance
    error_budget: tuple[ErrorTerm, ...] = ()
    verdict: Judgement | None = None
    validations: tuple[KeptJudgement, ...] = ()
    consistent: ConsistentRobot | None = None
    excluded: Excluded | None = None
    prior: FromPrior | None = None
    band_residual: BandResidual | None = None
    refinement: Refinement | None = None

    @property
    def failed(self) -> bool:
        """True for a failed identification: the model should not be used."""
        return self.verdict is not None and self.verdict.word == "failed"

    def refuse_other_robot(self, robot: Robot, source: str) -> None:
        """Refuse a robot other than that of the model; `source` names the conflicting file.

        Raises
        ------
        Mismatch
            The digests of both robot files differ.
        """
        if self.robot.digest != robot.digest:
            raise Mismatch(
                f"{source}: the model was identified with another robot file ({self.robot.name}"
                f" {self.robot.digest[:12]}) than that of {robot.name} {robot.digest[:12]}; give"
                " the model of this robot with --model, or use the robot file of the model"
            )

    @property
    def units(self) -> tuple[str, ...]:
        """Units of `values`."""
        return base_parameters(self.robot).units

    @property
    def expressions(self) -> tuple[str, ...]:
        """Expressions of the base parameters in standard parameters and lengths."""
        return base_parameters(self.robot).expressions

    @property
    def torque_effect(self) -> Array | None:
        """Change of `values` per relative change of each axis's torque, shape (n_base, n_joints).

        None if not computed by the method.
        """
        return self.effect[:, : self.robot.n_joints] if self.effect.size else None

    @property
    def axes_without_friction(self) -> tuple[int, ...]:
        """Axes, from 1, without known friction: predictions omit friction, intervals are NaN."""
        return self.friction_law.unknown

    @property
    def digest(self) -> str:
        """SHA-256 of robot, values, standard errors and friction law, in hexadecimal.

        Numbers count with nine digits, because files may state a covariance by its parts.

        Examples
        --------
        >>> hil.Model.load("runs/first").digest == hil.Model.load("runs/head").digest
        False
        """
        pairs = zip(self.values.tolist(), self.standard_errors.tolist(), strict=True)
        numbers = [f"{x:.9g}" for pair in pairs for x in pair]
        content = [self.robot.digest, numbers, self.friction_law.model_dump(mode="json")]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()

    def cov_params(self) -> Array:
        """Return `covariance`, under the name used by statsmodels."""
        return self.covariance

    def dataframe(self, level: float = 0.95) -> pd.DataFrame:
        """Return the parameters as a pandas table, indexed by name.

        Columns are ``value``, ``standard_error``, ``low``, ``high``, ``unit`` and ``expression``.

        Raises
        ------
        ModuleNotFoundError
            There is no pandas.
        """
        import pandas as pd  # noqa: PLC0415 - optional

        low, high = self.interval(level).T
        columns = {
            "value": self.values, "standard_error": self.standard_errors, "low": low, "high": high,
            "unit": self.units, "meaning": base_parameters(self.robot).meanings,
            "expression": self.expressions,
        }  # fmt: skip
        return pd.DataFrame(columns, index=pd.Index(self.names, name="parameter"))

    to_dataframe = dataframe
    """Name of `dataframe` by the convention of pandas."""

    def friction_over_time(self, axis: int) -> tuple[Array, Array]:
        """Return the level of an axis's friction in each measurement of a campaign.

        Parameters
        ----------
        axis : int
            Axis from 1.

        Returns
        -------
        time, level : ndarray, shape (n_measurements,)
            Time since the start of the campaign [s], and mean friction of both directions at the
            reference speed [N m or N].

        Raises
        ------
        NotEnoughData
            No single measurement of the axis is known, as for imports and trajectories.
        """
        own = sorted((each.time, each.friction) for each in self.local if each.axis == axis - 1)
        if not own:
            raise NotEnoughData(
                f"the model of {self.robot.name}: friction over time is unknown for axis {axis}; "
                "measure strokes (hil plan), or identify the run anew"
            )
        time, level = np.array(own).T
        return time, level

    def interval(self, level: float = 0.95) -> Array:
        """Return confidence intervals of `values`, shape (n_base, 2): lower and upper ends.

        Unidentified parameters have NaN.

        Raises
        ------
        InvalidArray
            The level is not between 0 and 1.
        """
        half = np.where(self.identified, self.half_width(checked_level(level)), np.nan)
        return np.stack([self.values - half, self.values + half], axis=-1)


def checked_level(level: float) -> float:
    """Return a confidence level after checking that the value is between 0 and 1."""
    if not 0 < level < 1:
        raise InvalidArray(f"level {level} must be between 0 and 1: 0.95 stands for 95 %")
    return level


PARTS = ("rigid bodies", "motors", "friction")
"""Parts of a drive's torque; gravity alone is `hil.results.model.Model.gravity`.

    Q = A(q, qd, qdd) p + H qdd + F(q, qd, A p)

Rigid bodies, motors, eq. (6) and (7), and friction (`hil.results.model.Model.predict`).
"""


def known_friction(model: IdentifiedRobot, *, of_all: bool = False) -> FrictionLaw:
    """Return the law of friction of a model.

    Raises
    ------
    NotEnoughData
        Friction of all axes is unknown; with `of_all`, friction of some axis.
    """
    law = model.friction_law
    if not law.known:
        raise NotEnoughData(
            f"the model of {model.robot.name} has no law of friction: use parts={PARTS[:2]},"
            f" measure each axis {FOR_A_LAW} times or more (hil plan --refine RUN), or identify the"
            " run anew with: hil identify"
        )
    if of_all and law.unknown:
        raise NotEnoughData(f"the model of {model.robot.name}: {lacking(model)}")
    return law


def friction_alone(
    model: IdentifiedRobot, axis: int, speed: Array, warmth: float | None = None
) -> tuple[Array, Array]:
    """Return friction in single-axis motion at no load, with standard error; `axis` from 0.

    Both have shape (n,) [N m or N], for speeds [rad/s or m/s] and a warmth of the gears, by default
    the mean.
    """
    robot, law = model.robot, known_friction(model)
    qd = np.zeros((len(speed), robot.n_joints))
    qd[:, axis] = speed
    still = np.zeros_like(qd)
    state = None if warmth is None else np.full_like(qd, warmth)
    torque = friction_torque(robot, law, still, qd, still, warmth=state)
    variance = friction_variance(robot, law, still, qd, still, state)
    return torque[:, axis], np.sqrt(variance[:, axis])


def lacking(model: IdentifiedRobot) -> str:
    """Name axes without a law of friction, with reason and remedy; empty if all laws are known."""
    axes = model.axes_without_friction
    if not axes:
        return ""
    return (
        f"no law of friction of axis {', '.join(map(str, axes))} (fewer than {FOR_A_LAW}"
        " measurements of the axis, or a model of an earlier version): measure the axis more often"
        " (hil plan --refine RUN) and identify both runs together (hil identify RUN --with MORE)"
    )
