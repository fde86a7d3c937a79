"""Define the methods for free motions by name; computing modules are imported on use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from hil.estimation.free_motion.solution import FreeSolver

DEFAULT = "free motion"


@dataclass(frozen=True, slots=True)
class Variant:
    """Variant of the method for free motions.

    Attributes
    ----------
    solver : str
        See `hil.estimation.free_motion.solution`.
    terms : {"chosen", "classical"}
        Chosen friction law and dead zone, or Coulomb and viscous friction at all speeds.
    weighted : bool
        Weight the rows of an axis by its residual variance.
    """

    solver: FreeSolver = "least squares"
    terms: Literal["chosen", "classical"] = "classical"
    weighted: bool = True


VARIANTS: dict[str, Variant] = {
    DEFAULT: Variant(solver="positive", terms="chosen"),
    "least squares": Variant(weighted=False),
    "weighted least squares": Variant(),
    "instrumental variables": Variant(solver="instrumental"),
}
"""Methods for free motions by name."""
