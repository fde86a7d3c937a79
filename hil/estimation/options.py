"""What a regression is asked to find beside the base parameters, and how it states its errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.errors import InvalidValue, UnknownName

if TYPE_CHECKING:
    from hil.estimation.prior import Prior
    from hil.least_squares.regression import Covariance

NUISANCES = ("lag", "compliance", "presliding", "drift")
"""What may lie between torque and rigid bodies beside friction: torques read late, gears that give
way, friction that turns round over a distance, its level that changes while one measures."""
ACCURACY = 0.1
"""Residual of an axis over its torque up to which a model is good: as much as its torque constant
by itself leaves open, which data sheets state within 10 %."""
COVARIANCES: tuple[Covariance, ...] = ("jackknife", "clusters", "CR2", "white")


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a regression.

    Attributes
    ----------
    friction : str
        ``auto``: found anew in each measurement where the robot was measured here, by the law that
        held-out data call for where it was imported; or the name of a law
        (`hil.friction.terms.LAWS`), for imports.
    nuisance : tuple of str
        Which of `NUISANCES` are looked for; each is taken only where the data show it. All of them
        stand for those that the method knows.
    covariance : str
        One of `COVARIANCES` (`hil.least_squares.regression`); CR2 stands for the method's own.
    prior : Prior, optional
        What is known of the links' bodies, for what recordings leave open; by default nothing, and
        recordings that leave anything open are refused.
    accuracy : float
        Residual of an axis that carries load, over its torque, up to which a model is *good*
        (`hil.results.residual`).

    Raises
    ------
    UnknownName
        A nuisance or a covariance that there is not.
    InvalidValue
        An accuracy that is not between 0 and 1.
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
