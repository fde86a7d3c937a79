"""The methods for free motions by name; what they compute with is imported when one is called."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from hil.estimation.free_motion.solution import FreeSolver

DEFAULT = "free motion"


@dataclass(frozen=True, slots=True)
class Variant:
    """One method.

    Attributes
    ----------
    solver : str
        See `hil.estimation.free_motion.solution`.
    terms : {"chosen", "classical"}
        Whether law of friction and dead zone are chosen, or friction is Coulomb's and viscous at
        all speeds.
    weighted : bool
        Rows of an axis by its residual variance.
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
"""All methods for free motions."""
