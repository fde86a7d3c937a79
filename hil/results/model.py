"""A model of a robot as it was identified: base parameters to calculate with, and to be judged.

Every method gives the same kind of model. It is found from a run (`identify`), kept as
`model.yaml` (`Model.save`) and read back (`Model.load`). Its torques are those that the drives have
to give: of rigid bodies, motors and friction, together or by parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError
from hil.errors import InvalidArray
from hil.estimation.intervals import half_width
from hil.model import dynamics
from hil.model.base_parameters import base_parameters
from hil.regression.uncertainty import correlation_of
from hil.results.model_file import ModelFile, file_of, read_model_file
from hil.results.ripple import ripple_left_out
from hil.results.samples import samples
from hil.results.tables import back_and_forth
from hil.results.tables.campaign_friction import campaign_friction
from hil.results.tables.free_motion import friction, left_by_free_motions, statements
from hil.results.tables.parameters import parameters
from hil.results.tables.summary import Summary
from hil.results.tables.torques import residuals
from hil.results.torque_parts import PARTS, interval_of, lacking, torque_of
from hil.results.warmth import warmth_along, warmth_of
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import ArrayLike, NDArray

    from hil.estimation.back_and_forth.result import BackAndForthFit
    from hil.estimation.free_motion.result import FreeMotionFit
    from hil.estimation.friction_law import FrictionLaw
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.results.consistent_robot import ConsistentRobot
    from hil.results.error_budget import ErrorTerm
    from hil.results.model_file import Provenance
    from hil.results.outcome import Outcome
    from hil.results.verdict import KeptVerdict

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A robot's identified base parameters.

    Attributes
    ----------
    robot : Robot
    values : ndarray, shape (n_base,)
        Base parameters [kg m^2, kg m or kg, as in `units`].
    scatter_covariance, drive_covariance : ndarray, shape (n_base, n_base)
        Of errors that show in the data, and of those of torque constants and rotor inertias as the
        robot file states their uncertainty.
    degrees_of_freedom : ndarray, shape (n_base,)
        Effective ones of the errors that show in the data.
    residual : ndarray, shape (n_joints,)
        Root mean square of what the method's models leave of each axis's torque [N m]; NaN where
        an axis was not measured.
    condition : dict
        Condition number of each group's observation matrix, or of all parameters' (``"all"``).
    provenance : Provenance
        Run, plan, method and version behind it.
    local : tuple of LocalValue
        Each measurement by itself, as the two-step methods take it; empty for a conventional
        method and for a model that was read from a file.
    error_budget : tuple of ErrorTerm
        Causes of error, the largest first; empty where nothing but noise matters.
    friction : FreeMotionFit, optional
        Friction of each axis and what was chosen, where free motions were identified.
    back_and_forth : BackAndForthFit, optional
        Friction of each axis as a curve over its speed, and which parameters were not identified,
        where axes moved back and forth by themselves.
    outcome : Outcome, optional
        What the identification is worth; None of a model that no version of this has judged.
    friction_law : FrictionLaw, optional
        Friction that the drives have to overcome, whatever the method; None where the model was
        read from a file of a version that found none.
    validations : tuple of KeptVerdict
        What the model was worth on other recordings.
    consistent : ConsistentRobot, optional
        The nearest robot that consists of bodies, and what it costs, where it was asked for.
    torque_effect : ndarray, shape (n_base, n_joints), optional
        Change of `values` per relative change of each axis's torque, as another torque constant
        makes it; None where the method states none.
    """

    robot: Robot
    values: Array
    scatter_covariance: Array
    drive_covariance: Array
    degrees_of_freedom: Array
    residual: Array
    condition: dict[str, float]
    provenance: Provenance
    local: tuple[LocalValue, ...] = ()
    error_budget: tuple[ErrorTerm, ...] = ()
    friction: FreeMotionFit | None = None
    back_and_forth: BackAndForthFit | None = None
    outcome: Outcome | None = None
    friction_law: FrictionLaw | None = None
    validations: tuple[KeptVerdict, ...] = ()
    consistent: ConsistentRobot | None = None
    torque_effect: Array | None = None

    @classmethod
    def load(cls, path: Path | str) -> Model:
        """Read a model from its file, or from the folder of an identified run.

        Raises
        ------
        FileError
            There is none, it was cut off or edited, or it belongs to another robot than the one
            beside it.
        """
        path = file_of(Path(path))
        if not path.exists():
            raise FileError(f"{path}: not there yet; make it with: hil identify {path.parent}")
        kept = read_model_file(path)
        scatter, drives = kept.covariances()
        return cls(
            robot=kept.robot(path),
            values=np.array([parameter.value for parameter in kept.parameters]),
            scatter_covariance=scatter,
            drive_covariance=drives,
            degrees_of_freedom=kept.degrees(),
            residual=np.array([np.nan if r is None else r for r in kept.residual]),
            condition=kept.condition,
            provenance=kept.provenance,
            error_budget=kept.error_budget,
            friction=kept.friction,
            back_and_forth=kept.back_and_forth,
            outcome=kept.outcome,
            friction_law=kept.law(),
            validations=kept.validations,
            consistent=kept.consistent,
            torque_effect=None if kept.torque_effect is None else np.array(kept.torque_effect),
        )

    def save(self, path: Path | str) -> None:
        """Write the model as a file, whole or not at all; see `hil.results.model_file`."""
        write_file(Path(path), ModelFile.of(self).text().encode())

    @property
    def failed(self) -> bool:
        """Whether its identification failed: it should not be used."""
        return self.outcome is not None and self.outcome.word == "failed"

    @property
    def method(self) -> str:
        """Method by which it was identified."""
        return self.provenance.method

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters, ``p1`` and on."""
        return base_parameters(self.robot).names

    @property
    def units(self) -> tuple[str, ...]:
        """Units of `values`."""
        return base_parameters(self.robot).units

    @property
    def expressions(self) -> tuple[str, ...]:
        """What each base parameter is made up of, in standard parameters and lengths."""
        return base_parameters(self.robot).expressions

    @property
    def covariance(self) -> Array:
        """Covariance of `values` from both kinds of error, shape (n_base, n_base)."""
        return self.scatter_covariance + self.drive_covariance

    @property
    def identified(self) -> NDArray[np.bool_]:
        """Which of `values` were identified, shape (n_base,); the others are zero."""
        lost = () if self.back_and_forth is None else self.back_and_forth.not_identified
        return np.array([name not in lost for name in self.names])

    @property
    def axes_without_friction(self) -> tuple[int, ...]:
        """Axes, from 1, whose friction is unknown: `torque` lacks it there, intervals are NaN."""
        law = self.friction_law
        return tuple(range(1, self.robot.n_joints + 1)) if law is None else law.unknown

    @property
    def standard_errors(self) -> Array:
        """Standard errors of `values`, shape (n_base,); NaN for those that were not identified."""
        errors: Array = np.where(self.identified, np.sqrt(np.diag(self.covariance)), np.nan)
        return errors

    @property
    def correlation(self) -> Array:
        """Correlations of the errors of `values`, shape (n_base, n_base)."""
        return correlation_of(self.covariance)

    def interval(self, level: float = 0.95) -> Array:
        """Confidence intervals of `values`, shape (n_base, 2): lower and upper ends.

        NaN for those that were not identified.

        Raises
        ------
        InvalidArray
            A level that is not between 0 and 1.
        """
        scatter, drives = np.diag(self.scatter_covariance), np.diag(self.drive_covariance)
        half = half_width(scatter, drives, self.degrees_of_freedom, _level(level))
        half = np.where(self.identified, half, np.nan)
        return np.stack([self.values - half, self.values + half], axis=-1)

    def torque(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        parts: Collection[str] = PARTS,
        *,
        warmth: ArrayLike | None = None,
    ) -> Array:
        """Torques that the drives have to give at positions, velocities and accelerations.

        Parameters
        ----------
        q, qd, qdd : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
            [rad, rad/s, rad/s^2]; m for prismatic joints.
        parts : collection of str
            What is added up, all of `hil.results.torque_parts.PARTS` by default:

            rigid bodies
                A(q, qd, qdd) p of eq. (6): inertia, Coriolis and centrifugal forces, gravity, with
                all that was identified as a base parameter: springs, and rotors whose inertia the
                robot file leaves unknown.
            motors
                Reflected inertia of the rotors that the robot file states, eq. (7).
            friction
                The law of friction (`friction_law`); at rest its offset alone, since what holds a
                resting axis is no function of velocity. Where rows are successive samples of a
                motion, positions changing as velocities say, it turns round after a reversal over
                the presliding distance that imported recordings showed.
        warmth : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints), optional
            Of the gears, from 0 cold to 1 as warm as motion makes them (`warmth`). By default
            friction is that at the mean warmth of what the model was found from. Without effect on
            axes whose warmth is not identified; beyond what was seen it counts as the nearest
            that was.

        Returns
        -------
        ndarray, shape (n_joints,) or (n_samples, n_joints)
            Joint side [N m, or N].

        Raises
        ------
        InvalidArray
            Another shape, or NaN.
        UnknownName
            There is no such part.
        NotEnoughData
            Friction, of which the model knows nothing, or warmth, which no axis's friction is
            known to depend on.

        Warns
        -----
        FrictionUnknown
            Friction is unknown of some axes (`axes_without_friction`), whose torque is without it.
        """
        q, qd, qdd = samples(self.robot.n_joints, q=q, qd=qd, qdd=qdd)
        return torque_of(self, parts, q, qd, qdd, warmth_of(self, warmth, q))

    def warmth(self, time: ArrayLike, qd: ArrayLike, start: ArrayLike = 0.0) -> Array:
        """Warmth of the gears along a motion, from 0 cold to 1 as warm as motion makes them.

        Parameters
        ----------
        time : array_like, shape (n_samples,)
            Ascending [s].
        qd : array_like, shape (n_samples, n_joints)
            [rad/s or m/s].
        start : scalar, or array_like of shape (n_joints,)
            Warmth at the first sample; cold by default.

        Returns
        -------
        ndarray, shape (n_samples, n_joints)
            As `torque` takes it; NaN for axes whose warmth is not identified.

        Raises
        ------
        InvalidArray
            Another shape, NaN, times that do not ascend, or a start outside 0 to 1.
        """
        return warmth_along(self, time, qd, start)

    def gravity(self, q: ArrayLike) -> Array:
        """Gravity torques g(q); shapes, units and errors as of `torque`."""
        (q,) = samples(self.robot.n_joints, q=q)
        return dynamics.gravity_torque(self.robot, self.values, q)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Mass matrix M(q) of the rigid bodies, shape (n_joints, n_joints) for each sample.

        [kg m^2, kg m or kg]; shapes of `q` and errors as of `torque`.
        """
        (q,) = samples(self.robot.n_joints, q=q)
        return dynamics.mass_matrix(self.robot, self.values, q)

    def torque_interval(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        level: float = 0.95,
        *,
        parts: Collection[str] = PARTS,
        of_samples: bool = False,
        warmth: ArrayLike | None = None,
    ) -> Array:
        """Intervals of `torque`.

        They hold what is uncertain of the base parameters and of the law of friction, with its
        wandering over the campaign, or what is left of that at a stated warmth. Base parameters and
        friction count as independent.

        Parameters
        ----------
        q, qd, qdd, parts, warmth
            As of `torque`.
        level : float
            Share of the intervals that hold the torque.
        of_samples : bool
            Of torques as a drive measures them, sample by sample, rather than of their mean: what
            the method's models left of the recordings (`residual`) counts too.

        Returns
        -------
        ndarray, shape of `torque` and one axis more of length 2
            Lower and upper ends [N m, or N].

        Raises
        ------
        InvalidArray
            Another shape, NaN, or a level that is not between 0 and 1.
        UnknownName, NotEnoughData
            As of `torque`.
        """
        q, qd, qdd = samples(self.robot.n_joints, q=q, qd=qd, qdd=qdd)
        state = warmth_of(self, warmth, q)
        tau = torque_of(self, parts, q, qd, qdd, state)
        half = interval_of(
            self, parts, q, qd, qdd, _level(level), of_samples=of_samples, warmth=state
        )
        return np.stack([tau - half, tau + half], axis=-1)

    def summary(self) -> Summary:
        """Parameters with their uncertainty, residuals and what could not be used, as tables."""
        remarks = tuple(f"left out: {left}" for left in self.provenance.left_out)
        if self.friction is not None:
            tables = parameters(self), friction(self), left_by_free_motions(self)
            return Summary(tables, (*statements(self.friction), *remarks))
        if (strokes := self.back_and_forth) is not None:
            found = back_and_forth.tables(self)
            return Summary(found, (*back_and_forth.statements(strokes), *remarks))
        if lack := lacking(self):
            remarks = (*remarks, lack)
        if self.method == "improved" and (ripple := ripple_left_out(self.robot)):
            remarks = (*remarks, ripple)
        tables = parameters(self), residuals(self), campaign_friction(self)
        return Summary(tuple(table for table in tables if table.parts), remarks)

    def __repr__(self) -> str:
        return (
            f"<Model of {self.robot.name}: {len(self.values)} base parameters, {self.method}"
            f" method, {self.provenance.measurements} measurements>"
        )

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


def _level(level: float) -> float:
    if not 0 < level < 1:
        raise InvalidArray(f"level {level} must be between 0 and 1: 0.95 stands for 95 %")
    return level
