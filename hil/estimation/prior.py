r"""Complete undetermined parameters by a prior from CAD or URDF.

A link's figures are given as pseudo-inertia J_0 = B B' (`hil.model.frames.pseudo_inertia`). The
true pseudo-inertia is

    J = B (1 + r E) B',

E symmetric with independent normal entries of variance 1 on its diagonal and 1/2 off the diagonal:
the only law independent of frame, unit and root B, in which |E|^2 is the second order of the
divergence between bodies in `hil.estimation.consistent` (Lee, Wensing and Park, IEEE Transactions
on Robotics 36 (2020) 168-182). In a frame at the centre of mass, along principal axes with radii of
gyration g_x, g_y, g_z, the standard deviations are

    mass m: r m,   centre: r g_i / sqrt(2),   second moments m g_i^2: r m g_i^2,
    products of them: r m g_i g_j / sqrt(2),

so r is the relative standard deviation of a link's mass and moments, and the centre of mass is
known as a share of the size of the link, for any frame. Base parameters p are linear in all of
these: p = p_0 + R u, u standard normal.

Recordings give A p = b: A is the inverse of the covariance, in the determined directions
(`IDENTIFIABLE`). With R'A R = V diag(lambda) V', the unknowns V'u are independent, each of variance
1 / lambda by the data and 1 by the prior. If the data uncertainty is below the whole size of CAD's
figure, 1 / lambda < 1 / r^2, the data value is kept unchanged; else the prior's value, 0 +- 1, is
used. So only the part of a base parameter's error from the latter directions is replaced. Let f be
the share of this part in the parameter's variance by the data. Then the parameter changes by the
data's own error in these directions and, if CAD is wrong by its whole size, |u| = 1 / r, by at most
the root of f standard errors. Parameters determined by data do not change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from checked_files.yaml_file import FileModel
from hil.errors import InvalidValue
from hil.least_squares.solving import (
    IDENTIFIABLE,
    inverse_root,
    nuisance_elimination,
    null_space,
    undetermined,
)
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import mass_matrix, regressor
from hil.model.frames import body_parameters, pseudo_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot


class FromPrior(FileModel):
    """Contribution of a prior to a model.

    Attributes
    ----------
    relative : float
        See `Prior`.
    replaced : dict of str to float
        Parameters not determined by the recordings alone: replaced share of the variance by the
        data.
    """

    source: str
    relative: float
    replaced: dict[str, float]

    def __str__(self) -> str:
        return (
            f"(prior): not identified by the recordings, taken from {self.source}, masses and"
            f" moments known within {self.relative:.0%} (1 sigma)"
        )


class Completed(NamedTuple):
    """Base parameters completed by a prior.

    Attributes
    ----------
    p : ndarray, shape (n_base,)
    covariance : ndarray, shape (n_base, n_base)
    share : ndarray, shape (n_base,)
        f: share of each variance, as the data alone give it, from directions that the prior
        decides.
    """

    p: Array
    covariance: Array
    share: Array


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior bodies of the links, with relative uncertainty.

    Attributes
    ----------
    bodies : ndarray, shape (n_joints, 10)
        Standard parameters in the frames of the robot file [kg m^2, kg m, kg].
    relative : float
        Relative standard deviation of a link's mass and moments.
    source : str
        Source of the bodies.

    Raises
    ------
    InvalidValue
        The share is out of range, or standard parameters are physically impossible.
    """

    bodies: Array
    relative: float
    source: str = "CAD"

    def __post_init__(self) -> None:
        if not 0.0 < self.relative <= 1.0:
            raise InvalidValue(f"prior: {self.relative:g} must be a share above 0, at most 1")
        for link, body in enumerate(self.bodies, start=1):
            if np.linalg.eigvalsh(pseudo_inertia(body))[0] <= 0.0:
                raise InvalidValue(
                    f"prior: link {link} must have a positive mass and an extension along all axes"
                )

    def stated(self, names: Sequence[str], share: Array) -> FromPrior:
        """Describe the prior's contribution to named parameters, by the share f."""
        each = zip(names, share.tolist(), strict=True)
        # smallest share f of a parameter not determined by the recordings alone
        replaced = {name: f for name, f in each if f > 0.5}
        return FromPrior(source=self.source, relative=self.relative, replaced=replaced)

    @property
    def roots(self) -> Array:
        """Root of the covariance of standard parameters, shape (10 n_joints, 10 n_joints)."""
        n = self.bodies.size
        found = np.zeros((n, n))
        for link, body in enumerate(self.bodies):
            B, own = np.linalg.cholesky(pseudo_inertia(body)), slice(10 * link, 10 * link + 10)
            for k, (i, j) in enumerate(zip(*np.triu_indices(4), strict=True)):
                E = np.zeros((4, 4))
                E[i, j] = E[j, i] = 1.0 if i == j else np.sqrt(0.5)
                found[own, 10 * link + k] = self.relative * np.array(body_parameters(B @ E @ B.T))
        return found

    def predict(self, robot: Robot) -> tuple[Array, Array]:
        """Return base parameters p_0, shape (n_base,), and a covariance root, (n_base, k)."""
        K, n = base_parameters(robot).matrix, self.bodies.size
        present = np.array([name in robot.present for name in robot.standard_parameters[:n]])
        shown = K[:, :n] * present
        return shown @ self.bodies.ravel(), shown @ self.roots

    def completed(self, robot: Robot, N: Array, p: Array, covariance: Array) -> Completed:
        """Complete an estimate in the directions not determined by data.

        Parameters
        ----------
        N : ndarray, shape (n_base + k, n_base + k)
            Normal equations of the base parameters and of the jointly estimated unknowns.
        p, covariance : ndarray, shapes (n_base,), (n_base, n_base)
            The estimate, returned unchanged if the data determine all directions.
        """
        n = len(p)
        left = nuisance_elimination(N, n) @ N[:, :n]
        W = left @ inverse_root(left, IDENTIFIABLE, np.diag(N)[:n])
        # few groups leave directions without scatter: no variance is below that of white residuals,
        # which is W'N^+ W = 1
        scatter, turned = np.linalg.eigh(W.T @ covariance @ W)
        root = W @ turned / np.sqrt(np.maximum(scatter, 1.0))
        A = root @ root.T
        mean, root = self.predict(robot)
        of_none = ~root.any(axis=1)
        mean = np.where(of_none, p, mean)
        # prior standard deviation, relative to the data, of parameters of no body: springs, rotors
        none = 1e6**2 * np.diag(covariance) + np.diag(open_covariance(robot, N))[:n]
        R = np.linalg.cholesky(root @ root.T + np.diag(none * of_none))
        values, V = np.linalg.eigh(R.T @ A @ R)
        said = values > self.relative**2
        if said.all():
            return Completed(p, covariance, np.zeros(n))
        u = np.where(said, V.T @ (R.T @ (A @ (p - mean))) / np.where(said, values, 1.0), 0.0)
        rows, variance = R @ V, 1.0 / np.where(said, values, 1.0)
        # lower bound of the information relative to CAD's whole figure: its root is above rounding
        alone = rows**2 / np.maximum(values, 1e-6 * self.relative**2)
        share = alone @ ~said / alone.sum(axis=1)
        return Completed(mean + rows @ u, (rows * variance) @ rows.T, share)


OPEN = 1e3
"""Standard deviation of a parameter without an estimate, in those of the file: a weight of 1e-6."""

OF_FILE = 0.01
"""Least share of the variance of a sum of parameters with which a file moves it."""


class Stated(NamedTuple):
    """Standard parameters in a file, known within their whole sizes.

    Combined with an estimate by Bayes' rule: parameters determined better by the recordings stay
    as estimated, all others as in the file.

    Attributes
    ----------
    values : ndarray, shape (n_standard,)
        Standard parameters phi_0: of the links, then the added ones of the robot.
    root : ndarray, shape (n_standard, n_standard)
        R, root of their covariance.
    shown : ndarray, shape (n_base, n_standard)
        K R, with the base parameters K phi.
    matrix : ndarray, shape (n_base, n_standard)
        K.
    """

    values: Array
    root: Array
    shown: Array
    matrix: Array

    @classmethod
    def create(cls, robot: Robot, bodies: Array, added: Array) -> Stated:
        """Create it from bodies, shape (n_joints, 10), and values of `robot.added_parameters`.

        Few files state rotors: a rotor is known within the inertia of what its axis moves, too.
        """
        n, K = bodies.size, base_parameters(robot).matrix.copy()
        K[
            :, [k for k, name in enumerate(robot.standard_parameters) if name not in robot.present]
        ] = 0
        values = np.concatenate([bodies.ravel(), added])
        inertia = np.diag(mass_matrix(robot, K @ values, np.zeros(robot.n_joints)))
        size = np.abs(added)
        for k, name in enumerate(robot.added_parameters):
            if name.startswith("Ia"):
                size[k] = max(size[k], inertia[int(name[2:]) - 1])
        root = np.zeros((len(values),) * 2)
        root[:n, :n], root[n:, n:] = Prior(bodies, 1.0).roots, np.diag(size)
        return cls(values, root, K @ root, K)

    def widened(self, covariance: Array, combination: Array | None) -> Array:
        """Return the covariance of an estimate, with open directions beside sums of parameters.

        With the sums C p estimated by strokes of single axes (`Estimate`), and 0 in place of the
        lost parameters, the directions without a sum are the columns of 1 - C at those.
        """
        if combination is None:
            return covariance
        lost = ~combination.any(axis=1)
        free = (np.eye(len(combination)) - combination)[:, lost]
        size = OPEN * np.sqrt(np.sum(self.shown[lost] ** 2, axis=1))
        return np.asarray(covariance + free @ np.diag(size**2) @ free.T)

    def gain(self, covariance: Array) -> Array:
        """Return R' K' (K R R' K' + V)^-1 for the covariance V of an estimate."""
        V = covariance + self.shown @ self.shown.T
        exact = np.flatnonzero(np.diag(V) == 0)  # springs of no file, known without error
        V[exact, exact] = 1.0
        scale = 1.0 / np.sqrt(np.diag(V))
        turned = np.linalg.solve(V * np.outer(scale, scale), scale[:, np.newaxis] * self.shown)
        return np.asarray(turned.T * scale)

    def completed(self, p: Array, covariance: Array) -> tuple[Array, Array]:
        """Return an estimate of the base parameters completed by the file, with its covariance.

        Bayes' rule moves a sum of parameters by at most (share * its size in the file), and those
        known within a tenth of this size, a share of `OF_FILE`, by less than a tenth of a standard
        error. These stay exactly: an exported file has the torques of the model.
        """
        # the file says nothing of other parameters, such as springs: they follow by correlation
        named = self.shown.any(axis=1)
        shown, V = self.shown[named], covariance[:, named]
        total = V[named] + shown @ shown.T
        scale = 1.0 / np.sqrt(np.diag(total))
        values, U = np.linalg.eigh(total * np.outer(scale, scale))
        white = scale[:, np.newaxis] * U / np.sqrt(np.maximum(values, np.finfo(float).eps))
        shares, U = np.linalg.eigh(white.T @ V[named] @ white)
        white = white @ U[:, shares > OF_FILE]
        moved = V @ white
        file = (self.matrix @ self.values - p)[named]
        return p + moved @ (white.T @ file), covariance - moved @ moved.T


def open_covariance(robot: Robot, N: Array, torque: Array | None = None) -> Array:
    """Compute the covariance of the unknowns in directions without data, shape of N.

    Along these directions, unknowns have the standard deviations `_sizes`. Zero if data determine
    all.

    Parameters
    ----------
    N : ndarray, shape (n_base + k, n_base + k)
        Normal equations: sums of squares as shares of each axis's sum of squared torques. Without
        `torque` any weights of the axes, and the largest share of a parameter counts as 1.
    torque : ndarray, shape (n_joints,), optional
        Torque of each axis in the recordings, rms [N m or N]; NaN for axes at rest. By default
        the torque limits.
    """
    n, lost = len(base_parameters(robot)), undetermined(N) | (np.diag(N) == 0)
    if not lost[:n].any():
        return np.zeros_like(N)
    known = robot.torque_limit if torque is None else torque
    size = _sizes(robot, np.where(np.isnan(robot.torque_limit), known, robot.torque_limit))
    squares = _squares(robot, N, torque)
    lost |= undetermined(N, IDENTIFIABLE, squares)
    free = null_space(N, IDENTIFIABLE, squares) * lost[:, np.newaxis]
    _, values, V = np.linalg.svd(free[:n] / size[:, np.newaxis], full_matrices=False)
    kept = values > 1e-6 * values[0]
    free = free @ V[kept].T / values[kept]
    covariance: Array = free @ free.T
    return covariance


def least_unknowns(robot: Robot, N: Array, torque: Array | None = None) -> Array:
    """Return the matrix T, shape of N: T x are the least unknowns, by size, with the torques N x.

    Noise of positions excites directions beyond `IDENTIFIABLE`, which are left out. Parameters as
    in `open_covariance`.
    """
    root = inverse_root(N, IDENTIFIABLE, _squares(robot, N, torque))
    return np.asarray(root @ root.T @ N)


def _squares(robot: Robot, N: Array, torque: Array | None) -> Array:
    """Return squares of columns, for the choice of the determined directions of N.

    A column of a base parameter is as long as in N, but at least as long as a torque of the
    parameter's size by the recorded torques, else by the torque limits: a column that is hardly
    there counts as short. Those of unknowns beside the base parameters are as in N.
    """
    known = robot.torque_limit if torque is None else torque
    size = _sizes(robot, np.where(np.isnan(known), robot.torque_limit, known))
    found, n = np.diag(N).copy(), len(size)
    one = 1.0 if torque is not None else np.max(found[:n] * size**2)
    found[:n] = np.maximum(found[:n], one / size**2)
    return found


def _sizes(robot: Robot, most: Array) -> Array:
    """Return sizes of the base parameters by the largest torques of the axes, shape (n_base,).

    No rigid-body torque exceeds the torque limits by far. So the size of a base parameter is the
    value with which it alone needs the torque `most` of an axis, shape (n_joints,), the least of
    all axes, as rms over positions, speeds and accelerations of up to 1 in SI. NaN stands for the
    largest torque of the others.
    """
    motion = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 100, robot.n_joints))
    torque = np.sqrt(np.mean(regressor(robot, *motion) ** 2, axis=0))
    most = np.nan_to_num(most, nan=np.nanmax(most) if np.isfinite(most).any() else 1.0)
    alone = most[:, np.newaxis] / np.maximum(torque, np.finfo(float).eps)
    return np.asarray(alone.min(axis=0))
