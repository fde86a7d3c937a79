"""Record of a refinement by simulation (`hil.simulation.refine`), as `model.yaml` keeps it."""

from __future__ import annotations

from typing import Literal

from checked_files.yaml_file import FileModel
from hil.show.rounding import significant


class Refined(FileModel):
    """Position errors of a model before and after refinement, on held-out pieces of recordings.

    Attributes
    ----------
    kept : bool
        The refined parameters were kept; otherwise the model is its start.
    friction : {"law", "plain"}
        The better of the refined laws: that of the start, or offset, Coulomb and viscous friction.
    length : float
        Length of the simulated pieces [s].
    ratio : float
        Error after refinement relative to before, root mean square over all axes, each weighed by
        its error at the start.
    before, after : tuple of float
        Root mean square error of each axis [rad or m].
    """

    kept: bool
    friction: Literal["law", "plain"]
    length: float
    ratio: float
    before: tuple[float, ...]
    after: tuple[float, ...]

    def __str__(self) -> str:
        word = "refined by simulation" if self.kept else "NOT refined by simulation, start kept"
        return (
            f"{word}: on held-out pieces of up to {self.length:.3g} s the position error is"
            f" {significant(self.ratio, 2)} of the regression's (friction: {self.friction})"
        )
