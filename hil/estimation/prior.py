r"""What a CAD or a URDF says of bodies, for what recordings leave open.

A link's figures are stated as pseudo-inertia J_0 = B B' (`hil.model.frames.pseudo_inertia`), and
the true one is

    J = B (1 + r E) B',

E symmetric with independent normal entries of variance 1 on its diagonal and 1/2 beside it: the
one law that is the same in every frame and unit and for every root B, in which |E|^2 is the second
order of the divergence by which `hil.estimation.consistent` measures bodies (Lee, Wensing and Park,
IEEE Transactions on Robotics 36 (2020) 168-182). In a frame at the centre of mass, along principal
axes with radii of gyration g_x, g_y, g_z, it says of standard deviations

    mass m: r m,   centre: r g_i / sqrt(2),   second moments m g_i^2: r m g_i^2,
    products of them: r m g_i g_j / sqrt(2),

so r is that of a link's mass and moments as a share of them, and the centre of mass is known as a
share of the size of the link, wherever its frame is. Base parameters p are linear in all of them:
p = p_0 + R u, u standard normal.

Recordings say A p = b: A is the inverse of the covariance, in the directions that they determine
(`IDENTIFIABLE`). With R'A R = V diag(lambda) V', the unknowns V'u fall apart, each of variance
1 / lambda by the data and 1 by the prior. Where data leave one less uncertain than CAD's figure is
large, 1 / lambda < 1 / r^2, it is theirs, unchanged; else it is the prior's, 0 +- 1. So only that
part of a base parameter's error is replaced which comes from the latter. Let it be the share f of
its variance by the data. Then it moves by their own error there and, where CAD is wrong by its
whole size, |u| = 1 / r, by the root of f standard errors at most. What data determine has no such
part, and stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from checked_files.yaml_file import FileModel
from hil.errors import InvalidValue
from hil.least_squares.solving import IDENTIFIABLE, inverse_root, nuisance_elimination
from hil.model.base_parameters import base_parameters
from hil.model.frames import body_parameters, pseudo_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.model.robot import Robot


class FromPrior(FileModel):
    """What a model has from a prior.

    Attributes
    ----------
    source : str
    relative : float
        As of `Prior`.
    replaced : dict of str to float
        Parameters that recordings alone leave open: what of their variance by the data is replaced.
    """

    source: str
    relative: float
    replaced: dict[str, float]

    def __str__(self) -> str:
        return (
            f"(prior): left open by the recordings, from {self.source}, masses and moments known"
            f" within {self.relative:.0%} (1 sigma)"
        )


class Completed(NamedTuple):
    """Base parameters with what a prior says of them.

    Attributes
    ----------
    p : ndarray, shape (n_base,)
    covariance : ndarray, shape (n_base, n_base)
    share : ndarray, shape (n_base,)
        f: what of each variance by the data comes from directions that are the prior's.
    """

    p: Array
    covariance: Array
    share: Array


@dataclass(frozen=True, eq=False)
class Prior:
    """Bodies of links as somebody else states them.

    Attributes
    ----------
    bodies : ndarray, shape (n_joints, 10)
        Standard parameters in the frames of the robot file [kg m^2, kg m, kg].
    relative : float
        Standard deviation of a link's mass and moments, as a share of them.
    source : str
        Where the bodies come from.

    Raises
    ------
    InvalidValue
        No share above 0, or standard parameters that no body has.
    """

    bodies: Array
    relative: float
    source: str = "CAD"

    def __post_init__(self) -> None:
        if not 0.0 < self.relative <= 1.0:
            raise InvalidValue(f"prior: {self.relative:g} must be a share above 0, at most 1")
        for link, body in enumerate(self.bodies, start=1):
            if np.linalg.eigvalsh(pseudo_inertia(body))[0] <= 0.0:
                raise InvalidValue(f"prior: link {link} must have a mass that spreads in space")

    def stated(self, names: Sequence[str], share: Array) -> FromPrior:
        """What parameters of some names have from it, by their f."""
        each = zip(names, share.tolist(), strict=True)
        # share f beyond which recordings alone leave a parameter open
        replaced = {name: f for name, f in each if f > 0.5}
        return FromPrior(source=self.source, relative=self.relative, replaced=replaced)

    @property
    def roots(self) -> Array:
        """Root of the covariance of all standard parameters, shape (10 n_joints, 10 n_joints)."""
        n = self.bodies.size
        found = np.zeros((n, n))
        for link, body in enumerate(self.bodies):
            B, own = np.linalg.cholesky(pseudo_inertia(body)), slice(10 * link, 10 * link + 10)
            for k, (i, j) in enumerate(zip(*np.triu_indices(4), strict=True)):
                E = np.zeros((4, 4))
                E[i, j] = E[j, i] = 1.0 if i == j else np.sqrt(0.5)
                found[own, 10 * link + k] = self.relative * np.array(body_parameters(B @ E @ B.T))
        return found

    def of(self, robot: Robot) -> tuple[Array, Array]:
        """Base parameters p_0, shape (n_base,), and a root of their covariance, (n_base, k)."""
        K, n = base_parameters(robot).matrix, self.bodies.size
        present = np.array([name in robot.present for name in robot.standard_parameters[:n]])
        shown = K[:, :n] * present
        return shown @ self.bodies.ravel(), shown @ self.roots

    def completed(self, robot: Robot, N: Array, p: Array, covariance: Array) -> Completed:
        """Complete an estimate in the directions that data leave open.

        Parameters
        ----------
        N : ndarray, shape (n_base + k, n_base + k)
            Normal equations of the base parameters and of whatever was found with them.
        p, covariance : ndarray, shapes (n_base,), (n_base, n_base)
            The estimate; it is returned as it is where data say all.
        """
        n = len(p)
        left = nuisance_elimination(N, n) @ N[:, :n]
        W = left @ inverse_root(left, IDENTIFIABLE, np.diag(N)[:n])
        A = W @ np.linalg.solve(W.T @ covariance @ W, W.T)
        mean, root = self.of(robot)
        of_none = ~root.any(axis=1)
        mean = np.where(of_none, p, mean)
        # standard deviation, in those of the data, of parameters that no body has: springs, rotors
        R = np.linalg.cholesky(root @ root.T + np.diag(1e6**2 * np.diag(covariance) * of_none))
        values, V = np.linalg.eigh(R.T @ A @ R)
        said = values > self.relative**2
        if said.all():
            return Completed(p, covariance, np.zeros(n))
        u = np.where(said, V.T @ (R.T @ (A @ (p - mean))) / np.where(said, values, 1.0), 0.0)
        rows, variance = R @ V, 1.0 / np.where(said, values, 1.0)
        # information on CAD's whole figure that counts as none: its root is beyond rounding
        alone = rows**2 / np.maximum(values, 1e-6 * self.relative**2)
        share = alone @ ~said / alone.sum(axis=1)
        return Completed(mean + rows @ u, (rows * variance) @ rows.T, share)
