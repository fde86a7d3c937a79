"""One element of g(q) or M(q) as one measurement shows it (`hil.estimation.local_fits`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.planning.measurement import ELEMENT_KINDS

if TYPE_CHECKING:
    from hil.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class LocalValue:
    """One element of g(q) or M(q) as measured.

    Attributes
    ----------
    id, kind : str
    axis, partner : int
        Joint whose torque was read, joint that was accelerated; indices from 0.
    q : ndarray, shape (n_joints,)
        Mean configuration [rad].
    time : float
        Middle of the recording since the bus was entered [s].
    value, model : float
        Measured, and what the base parameters say: g_i [N m], M_ii or M_ji [kg m^2].
    standard_error : float
        Of `value`, from the scatter inside the measurement; NaN where there is none.
    friction : float
        Level at `hil.estimation.local_fits.REFERENCE_SPEED`, or at creep speed where the axis
        creeps, mean of both directions [N m].
    residual : float
        Root mean square of what the local model leaves [N m].
    believed, believed_error : float
        Value and standard error when all is taken off that the estimator finds beside the element
        (`hil.estimation.local_fits.believed_fit`); NaN by a method that finds nothing beside it.
    """

    id: str
    kind: str
    axis: int
    partner: int
    q: Array
    time: float
    value: float
    model: float
    standard_error: float
    friction: float
    residual: float
    believed: float = np.nan
    believed_error: float = np.nan

    @property
    def shown(self) -> tuple[float, float]:
        """Value and standard error as they are set beside the model's."""
        if np.isnan(self.believed):
            return self.value, self.standard_error
        return self.believed, self.believed_error

    @property
    def symbol(self) -> Literal["g", "M"]:
        """Vector or matrix that the element stands in."""
        return ELEMENT_KINDS[self.kind].symbol


@dataclass(frozen=True, slots=True, eq=False)
class LocalFit:
    """A measurement evaluated as far as it goes without knowing p_g.

    A fit is linear in its right-hand side, which has several columns here: the measured torque, the
    motors' part of it, and the gravity torque of one unit of each base parameter.

    Attributes
    ----------
    id, kind, axis, partner, q, time
        See `LocalValue`.
    sides : ndarray, shape (2 + n_base,)
        The element that each column amounts to. The gravity columns of a gravity measurement are
        zero, since they are what it measures.
    friction : ndarray, shape (2 + n_base,)
        The friction level that each column amounts to.
    gram : ndarray, shape (2 + n_base, 2 + n_base)
        Mean products of the columns' residuals.
    leverage : float
        Standard error of the element per residual.
    row : ndarray, shape (n_base,)
        The element as the model has it: ``row @ p``.
    """

    id: str
    kind: str
    axis: int
    partner: int
    q: Array
    time: float
    sides: Array
    friction: Array
    gram: Array
    leverage: float
    row: Array

    def at(self, p: Array) -> LocalValue:
        """Values with gravity compensated by base parameters `p`."""
        weights = np.concatenate([[1.0, -1.0], -p])
        residual = float(np.sqrt(max(weights @ self.gram @ weights, 0.0)))
        return LocalValue(
            id=self.id,
            kind=self.kind,
            axis=self.axis,
            partner=self.partner,
            q=self.q,
            time=self.time,
            value=float(self.sides @ weights),
            model=float(self.row @ p),
            standard_error=self.leverage * residual,
            friction=float(self.friction @ weights),
            residual=residual,
        )
