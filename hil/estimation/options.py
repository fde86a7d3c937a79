"""Options of a regression: friction law, nuisances, covariance rule and prior."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.errors import InvalidValue, UnknownName

if TYPE_CHECKING:
    from hil.estimation.prior import Prior
    from hil.least_squares.regression import Covariance

NUISANCES = ("lag", "compliance", "presliding", "drift")
"""Effects between torque and rigid bodies in addition to friction: delayed torques, soft gears,
presliding, drift of the friction level."""
ACCURACY = 0.1
"""Largest relative residual of an axis with a good model: the typical error of torque constants,
given in data sheets within 10 %."""
COVARIANCES: tuple[Covariance, ...] = ("jackknife", "clusters", "CR2", "white")


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a regression.

    Attributes
    ----------
    friction : str
        ``auto``: separate friction in each measurement, and for imports the law chosen on held-out
        data; or the name of a law (`hil.friction.terms.LAWS`), for imports.
    nuisance : tuple of str
        Subset of `NUISANCES` to be estimated, each used only if significant in the data. The full
        set selects the nuisances known to the method.
    covariance : str
        One of `COVARIANCES` (`hil.least_squares.regression`); CR2 selects the default of the
        method.
    prior : Prior, optional
        Prior knowledge of the links' bodies, for parameters not determined by the recordings; by
        default none, and recordings that do not determine all parameters are refused.
    accuracy : float
        Largest relative residual of a loaded axis with a *good* model (`hil.results.residual`).

    Raises
    ------
    UnknownName
        Unknown nuisance or covariance.
    InvalidValue
        Accuracy out of the range above 0, at most 1.
    """

    friction: str = "auto"
    nuisance: tuple[str, ...] = NUISANCES
    covariance: Covariance = "CR2"
    prior: Prior | None = None
    accuracy: float = ACCURACY

    def __post_init__(self) -> None:
        if not 0.0 < self.accuracy <= 1.0:
            raise InvalidValue(f"accuracy {self.accuracy:g} must be a share above 0, at most 1")
        for name in self.nuisance:
            if name not in NUISANCES:
                raise UnknownName(f"nuisance {name!r} must be one of: {', '.join(NUISANCES)}")
        if self.covariance not in COVARIANCES:
            raise UnknownName(
                f"covariance {self.covariance!r} must be one of: {', '.join(COVARIANCES)}"
            )


DEFAULTS = Options()
