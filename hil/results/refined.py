"""Record of a refinement by simulation (`hil.simulation.refine`), as `model.yaml` keeps it."""

from __future__ import annotations

from checked_files.yaml_file import FileModel
from hil.show.rounding import significant


class Refined(FileModel):
    """Position errors of a model before and after refinement, on held-out recordings.

    Attributes
    ----------
    kept : bool
        The refined parameters were kept; otherwise the model is its start.
    length : float
        Length of the simulated pieces [s].
    before, after : tuple of float
        Root mean square position error of each axis [rad or m].
    """

    kept: bool
    length: float
    before: tuple[float, ...]
    after: tuple[float, ...]

    def __str__(self) -> str:
        ratio = (sum(x**2 for x in self.after) / max(sum(x**2 for x in self.before), 1e-300)) ** 0.5
        word = "refined by simulation" if self.kept else "NOT refined by simulation, start kept"
        return (
            f"{word}: on held-out pieces of up to {self.length:g} s the position error is"
            f" {significant(ratio, 2)} of the regression's"
        )
