"""Define measured elements of g(q) and M(q) (`hil.estimation.local_fits`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.planning.measurement import ELEMENT_KINDS

if TYPE_CHECKING:
    from hil.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class LocalValue:
    """Measured element of g(q) or M(q).

    Attributes
    ----------
    id, kind : str
    axis, partner : int
        Measured joint, accelerated joint; indices from 0.
    q : ndarray, shape (n_joints,)
        Mean configuration [rad].
    time : float
        Middle of the recording, since the start of the bus [s].
    value, model : float
        Measured value, and value by the base parameters: g_i [N m], M_ii or M_ji [kg m^2].
    standard_error : float
        Standard error of `value`, from the scatter inside the measurement; NaN without scatter.
    friction : float
        Friction level at `hil.estimation.local_fits.REFERENCE_SPEED`, or at creep speed for a
        creeping axis, mean of both directions [N m].
    residual : float
        Root mean square residual of the local model [N m].
    believed, believed_error : float
        Value and standard error after subtraction of further estimated effects
        (`hil.estimation.local_fits.believed_fit`); NaN for methods without such effects.
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
        """Value and standard error for comparison with the model."""
        if np.isnan(self.believed):
            return self.value, self.standard_error
        return self.believed, self.believed_error

    @property
    def symbol(self) -> Literal["g", "M"]:
        """Symbol of the vector or matrix of the element."""
        return ELEMENT_KINDS[self.kind].symbol


@dataclass(frozen=True, slots=True, eq=False)
class LocalFit:
    """Evaluated measurement, linear in the unknown base parameters of gravity.

    The right-hand side of the fit has several columns: the measured torque, the motors' part of the
    torque, and the gravity torque of one unit of each base parameter.

    Attributes
    ----------
    id, kind, axis, partner, q, time
        See `LocalValue`.
    sides : ndarray, shape (2 + n_base,)
        Value of the element for each column. The gravity columns of a gravity measurement are zero,
        since gravity is the measured quantity.
    friction : ndarray, shape (2 + n_base,)
        Friction level for each column.
    gram : ndarray, shape (2 + n_base, 2 + n_base)
        Mean products of the columns' residuals.
    leverage : float
        Ratio of the element's standard error to the residual.
    row : ndarray, shape (n_base,)
        Row of the element in the model: ``row @ p``.
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

    def evaluate(self, p: Array) -> LocalValue:
        """Return values with gravity compensated by base parameters `p`."""
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
