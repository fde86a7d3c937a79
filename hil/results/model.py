"""Identified model of a robot: base parameters for calculations, with their judgement.

Every method gives the same kind of model. A model is identified from a run (`identify`), saved as
`model.yaml` (`Model.save`) and loaded (`Model.load`). Its torques are those of the drives, for
rigid bodies, motors and friction, together or by parts.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError
from hil.errors import FrictionUnknown, NotEnoughData, UnknownName
from hil.estimation.intervals import combined_degrees, half_width
from hil.friction.law import friction_torque, friction_variance, level_anywhere
from hil.model import dynamics
from hil.model.motors import motor_inertia, motor_torque
from hil.results.identified_robot import (
    PARTS,
    IdentifiedRobot,
    checked_level,
    known_friction,
    lacking,
)
from hil.results.model_file import ModelFile, file_of, read_model_file
from hil.results.samples import samples, warmth_along, warmth_of
from hil.results.tables.model import summary
from hil.runs.atomic_file import write_file
from hil.show.rounding import count

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.show.outcome import Outcome


ROUNDS = 200
"""Maximum number of iterations for the accelerations under load-dependent friction."""
SETTLED = 1e-9
"""Tolerated torque error of accelerations, as a share of the given torque and 1 N m or N."""


class Model(IdentifiedRobot):
    """Identified base parameters of a robot, with methods for calculations.

    Data attributes are those of `hil.results.identified_robot.IdentifiedRobot`.

    Examples
    --------
    >>> model = hil.Model.load("runs/first")
    >>> model, model.residual.shape
    (<Model of manutec-r15: 14 base parameters, improved method, 39 measurements>, (6,))
    """

    @classmethod
    def load(cls, path: Path | str) -> Model:
        """Read a model from its file, or from the folder of an identified run.

        Raises
        ------
        FileError
            The file is missing, truncated or edited, or belongs to another robot than the robot
            file in its folder.
        """
        path = file_of(Path(path))
        if not path.exists():
            raise FileError(f"{path}: does not exist yet; make it with: hil identify {path.parent}")
        return cls(**read_model_file(path).identified(path))

    def save(self, path: Path | str) -> None:
        """Write the model to a file, whole or not at all; see `hil.results.model_file`.

        Examples
        --------
        >>> hil.Model.load("runs/head").save("copy.yaml")
        >>> hil.Model.load("copy.yaml").names[-1]
        'p8'
        """
        write_file(Path(path), ModelFile.create(self).text().encode())

    def predict(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        parts: Collection[str] = PARTS,
        *,
        warmth: ArrayLike | None = None,
    ) -> Array:
        """Predict the torques of the drives at positions, velocities and accelerations.

        Parameters
        ----------
        q, qd, qdd : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
            Positions, velocities and accelerations [rad, rad/s, rad/s^2]; m for prismatic joints.
        parts : collection of str
            Parts of the torque, all of `hil.results.identified_robot.PARTS` by default:

            rigid bodies
                A(q, qd, qdd) p of eq. (6): inertia, Coriolis and centrifugal forces, gravity,
                including springs, and rotors with unknown inertia in the robot file.
            motors
                Reflected inertia of the rotors stated in the robot file, eq. (7).
            friction
                The law of friction (`friction_law`); at rest only its offset, since static friction
                is not a function of velocity. If the rows are successive samples of a motion,
                friction changes its sign after a reversal over the presliding distance found in
                imported recordings.
        warmth : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints), optional
            Warmth of the gears, from 0 (cold) to 1 (warmest by motion), see `warmth`. By default
            friction is that at the mean warmth of the identified recordings. Warmth has no effect
            on axes without an identified warmth; values outside the recorded range are replaced by
            the nearest recorded value.

        Returns
        -------
        ndarray, shape (n_joints,) or (n_samples, n_joints)
            Torques at the joints [N m or N].

        Raises
        ------
        InvalidArray
            Wrong shape, or NaN.
        UnknownName
            Unknown part.
        NotEnoughData
            The model knows no friction, or a warmth was given although no axis's friction is known
            to depend on warmth.

        Warns
        -----
        FrictionUnknown
            Friction of some axes is unknown (`axes_without_friction`) and not in their torque.

        Examples
        --------
        >>> model = hil.Model.load("runs/first")
        >>> model.predict(np.zeros((100, 6)), 0.5, 0.0).shape
        (100, 6)
        """
        q, qd, qdd = samples(self.robot.n_joints, q=q, qd=qd, qdd=qdd)
        return self._torque(parts, q, qd, qdd, warmth_of(self, warmth, q))

    torque = predict
    """Name of `predict` until version 0.2."""

    def friction_torque(
        self,
        qd: ArrayLike,
        q: ArrayLike | None = None,
        qdd: ArrayLike = 0.0,
        *,
        warmth: ArrayLike | None = None,
    ) -> Array:
        """Predict the torques of friction at no load, or with the load at stated positions.

        Parameters
        ----------
        qd : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
            Velocities [rad/s or m/s].
        q, qdd : optional
            As in `predict`; without positions the gears transmit no load.
        warmth : optional
            As in `predict`.

        Returns
        -------
        ndarray, shape (n_joints,) or (n_samples, n_joints)
            Joint side [N m, or N]; errors and warnings as in `predict`.

        Examples
        --------
        >>> hil.Model.load("runs/first").friction_torque(0.5).shape
        (6,)
        """
        at, qd, qdd = samples(self.robot.n_joints, q=0.0 if q is None else q, qd=qd, qdd=qdd)
        state = warmth_of(self, warmth, at)
        return self._torque(["friction"], at, qd, qdd, state, loaded=q is not None)

    def _torque(
        self,
        parts: Collection[str],
        q: Array,
        qd: Array,
        qdd: Array,
        warmth: Array | None,
        *,
        loaded: bool = True,
    ) -> Array:
        _refuse_unknown(parts)
        law = known_friction(self) if "friction" in parts else None
        if law is not None and (lack := lacking(self)):
            # one warning per line of the caller, as Python does by default
            text = f"torques of {self.robot.name} lack friction: {lack}"
            warnings.warn(text, FrictionUnknown, stacklevel=3)
        rigid = (
            dynamics.inverse_dynamics(self.robot, self.values, q, qd, qdd)
            if loaded
            else np.zeros(q.shape)
        )
        total = rigid if "rigid bodies" in parts else np.zeros_like(rigid)
        if "motors" in parts:
            total = total + motor_torque(self.robot, q, qd, qdd)
        if law is None:
            return total
        return total + friction_torque(self.robot, law, q, qd, rigid, warmth=warmth)

    def drive_torque(self, q: Array, qd: Array, qdd: Array, reversal: float = 0.005) -> Array:
        """Return feed-forward torques for a planned motion, shape of `q` [N m or N].

        The torques are those of `predict`, with continuous friction at reversals, since a drive
        with a jump in the feed-forward performs worse than a drive without feed-forward. Friction
        is linear in the velocity between a small speed in one direction and the same speed in the
        other. The planned velocity is used, since a measured velocity would chatter.

        Parameters
        ----------
        q, qd, qdd : ndarray, shape (n, n_joints)
            Planned motion [rad, rad/s, rad/s^2; m for prismatic joints].
        reversal : float
            Share of the velocity limit below which friction changes its direction.

        Raises
        ------
        NotEnoughData
            The model has no friction law.
        """
        width = reversal * self.robot.velocity_limit
        speed = np.maximum(np.abs(qd), width)
        back, forth = (self.predict(q, side * speed, qdd, ("friction",)) for side in (-1.0, 1.0))
        share = np.clip(0.5 + qd / (2 * width), 0.0, 1.0)
        friction: Array = back + share * (forth - back)
        return self.predict(q, qd, qdd, ("rigid bodies", "motors")) + friction

    def warmth(self, time: ArrayLike, qd: ArrayLike, start: ArrayLike = 0.0) -> Array:
        """Return the warmth of the gears along a motion, from 0 (cold) to 1 (warmest by motion).

        Parameters
        ----------
        time : array_like, shape (n_samples,)
            Ascending time [s].
        qd : array_like, shape (n_samples, n_joints)
            Velocities [rad/s or m/s].
        start : scalar, or array_like of shape (n_joints,)
            Warmth at the first sample; cold by default.

        Returns
        -------
        ndarray, shape (n_samples, n_joints)
            Argument `warmth` of `predict`; NaN for axes whose warmth is not identified.

        Raises
        ------
        InvalidArray
            Wrong shape, NaN, times not ascending, or a start outside 0 to 1.
        """
        return warmth_along(self, time, qd, start)

    def gravity(self, q: ArrayLike) -> Array:
        """Return gravity torques g(q); shapes, units and errors as in `predict`.

        Examples
        --------
        >>> hil.Model.load("runs/first").gravity(np.zeros((100, 6))).shape
        (100, 6)
        """
        (q,) = samples(self.robot.n_joints, q=q)
        return dynamics.gravity_torque(self.robot, self.values, q)

    def mass_matrix(self, q: ArrayLike, parts: Collection[str] = PARTS) -> Array:
        """Compute the mass matrix M(q) of rigid bodies and motors, or of a single part.

        Parameters
        ----------
        q : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
            Positions [rad or m].
        parts : collection of str
            As in `predict`; friction has no mass.

        Returns
        -------
        ndarray, shape (n_joints, n_joints) or (n_samples, n_joints, n_joints)
            [kg m^2, kg m or kg]; errors as in `predict`.

        Examples
        --------
        >>> hil.Model.load("runs/first").mass_matrix(np.zeros(6)).shape
        (6, 6)
        """
        (q,) = samples(self.robot.n_joints, q=q)
        _refuse_unknown(parts)
        bodies = dynamics.mass_matrix(self.robot, self.values, q)
        M = bodies if "rigid bodies" in parts else np.zeros_like(bodies)
        return M + motor_inertia(self.robot, q) if "motors" in parts else M

    def coriolis(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Compute the Coriolis matrix C(q, qd) by Christoffel symbols.

        C qd are the Coriolis and centrifugal torques, and dM/dt - 2 C is skew-symmetric.

        Parameters
        ----------
        q, qd : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
            Positions and velocities [rad or m, and per s].

        Returns
        -------
        ndarray, shape (n_joints, n_joints) or (n_samples, n_joints, n_joints)
            [N m s/rad, N s/rad or N s/m]; errors as in `predict`.

        Examples
        --------
        >>> hil.Model.load("runs/first").coriolis(np.zeros(6), 0.5).shape
        (6, 6)
        """
        q, qd = samples(self.robot.n_joints, q=q, qd=qd)
        return dynamics.coriolis_matrix(self.robot, self.values, q, qd)

    def forward_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike,
        parts: Collection[str] = PARTS,
        *,
        warmth: ArrayLike | None = None,
    ) -> Array:
        """Compute the accelerations under torques, the inverse of `predict`.

        Friction of an axis at rest is its offset alone, so any torque sets the axis in motion.

        Parameters
        ----------
        q, qd, tau : scalar, or array_like of shape (n_joints,) or (n_samples, n_joints)
            Positions, velocities and torques [rad, rad/s, N m; m, m/s, N].
        parts : collection of str
            As in `predict`, including rigid bodies or motors.
        warmth : optional
            As in `predict`.

        Returns
        -------
        ndarray, shape (n_joints,) or (n_samples, n_joints)
            Accelerations [rad/s^2 or m/s^2].

        Raises
        ------
        NotEnoughData
            The mass matrix is not positive definite, or friction grows with the load as fast as the
            load itself; otherwise as in `predict`.

        Examples
        --------
        >>> hil.Model.load("runs/first").forward_dynamics(np.zeros(6), 0.5, 0.0).shape
        (6,)
        """
        q, qd, tau = samples(self.robot.n_joints, q=q, qd=qd, tau=tau)
        M, state = self.mass_matrix(q, parts), warmth_of(self, warmth, q)
        if not (np.linalg.eigvalsh(M) > 0).all():
            raise NotEnoughData(
                f"the model of {self.robot.name}: the mass matrix of {', '.join(parts)} is not "
                "positive definite at q; use all parts, or see hil.Model.verdict"
            )
        qdd = np.zeros_like(tau)
        # load-dependent friction depends on the accelerations: iterate, beginning with qdd = 0
        for _ in range(ROUNDS):
            left = tau - self._torque(parts, q, qd, qdd, state)
            if (np.abs(left) <= SETTLED * (1.0 + np.abs(tau))).all():
                return qdd
            qdd = qdd + np.linalg.solve(M, left[..., None])[..., 0]
        raise NotEnoughData(
            f"the model of {self.robot.name}: load-dependent friction is as large as the load:"
            ' accelerations do not converge; use parts=("rigid bodies", "motors")'
        )

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
        """Return confidence intervals of `predict`.

        The intervals contain the uncertainty of the base parameters and of the law of friction.
        Without a stated warmth, an axis may be anywhere between cold and as warm as steady motion
        makes it; this contribution grows with the part of the range missing in the recordings of
        the model. At speeds outside the recordings, friction has an additional uncertainty. Errors
        of base parameters and friction are taken as independent.

        Parameters
        ----------
        q, qd, qdd, parts, warmth
            As in `predict`.
        level : float
            Share of the intervals that contain the torque.
        of_samples : bool
            True for intervals of single measured samples instead of their mean, including the
            residual of the identification (`residual`).

        Returns
        -------
        ndarray, shape of `predict` and one axis more of length 2
            Lower and upper ends [N m, or N].

        Raises
        ------
        InvalidArray
            Wrong shape, NaN, or a level outside 0 to 1.
        UnknownName, NotEnoughData
            As in `predict`.

        Examples
        --------
        >>> model = hil.Model.load("runs/first")
        >>> model.torque_interval(np.zeros((100, 6)), 0.5, 0.0, level=0.9).shape
        (100, 6, 2)
        """
        q, qd, qdd = samples(self.robot.n_joints, q=q, qd=qd, qdd=qdd)
        state, level = warmth_of(self, warmth, q), checked_level(level)
        tau = self._torque(parts, q, qd, qdd, state)
        A = dynamics.regressor(self.robot, q, qd, qdd)
        # motors add no variance: base parameters compensate an error of a stated rotor inertia, and
        # their covariance contains this error
        rows = A if "rigid bodies" in parts else np.zeros_like(A)
        scatter, stated = (
            np.einsum("...k,kl,...l->...", rows, V, rows, optimize=True).clip(0.0)
            for V in (self.scatter_covariance, self.drive_covariance)
        )
        variances = np.diag(self.scatter_covariance)
        degrees = combined_degrees(rows, variances, self.degrees_of_freedom)
        if "friction" in parts:
            load, law = A @ self.values, known_friction(self)
            wander = level_anywhere(law, warmth_stated=state is not None)
            stated = stated + friction_variance(self.robot, law, q, qd, load, state, wander)
        if of_samples:
            stated = stated + np.nan_to_num(self.residual) ** 2
        half = half_width(scatter, stated, degrees, level)
        if "friction" in parts:
            half[..., [axis - 1 for axis in self.axes_without_friction]] = np.nan
        return np.stack([tau - half, tau + half], axis=-1)

    def summary(self) -> Outcome:
        """Return tables of parameters with uncertainties, residuals and unused measurements."""
        return summary(self)

    def __repr__(self) -> str:
        return (
            f"<Model of {self.robot.name}: {len(self.values)} base parameters, {self.method}"
            f" method, {count(self.provenance.measurements, 'measurement')}>"
        )

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


def _refuse_unknown(parts: Collection[str]) -> None:
    if unknown := [part for part in parts if part not in PARTS]:
        raise UnknownName(f"{unknown[0]!r}: parts of the torque are {', '.join(PARTS)}")


def loaded(model: Model | Path | str, robot: Robot | None = None) -> Model:
    """Load a model from a file or a run's folder; refuse a model of another `robot`."""
    found = model if isinstance(model, Model) else Model.load(model)
    if robot is not None:
        found.refuse_other_robot(robot, str(model))
    return found
