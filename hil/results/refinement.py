"""Record of a refinement by simulation: held-out errors, and the kept model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.show.rounding import significant
from hil.show.table import figures, table

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.show.table import Table


class Refinement(FileModel):
    """Result of `hil.simulation.refine`.

    Attributes
    ----------
    start_digest : str
        Digest of the regression's model.
    kept : bool
        True if the refined parameters replaced those of the regression.
    friction : str
        Friction of the simulations: the chosen law, or plain terms in its place.
    start, refined : tuple of float
        Root mean square position error of each axis in the held-out stretches, simulated with the
        parameters of the regression and with the refined ones [rad or m].
    stretches, held_out : int
        Number of stretches, and of the last ones among them, which were held out.
    length : float
        Length of a stretch [s].
    directions : tuple of two int
        Number of combinations of parameters determined by the simulation, and of parameters.
    """

    start_digest: str
    kept: bool
    friction: str
    start: tuple[float, ...]
    refined: tuple[float, ...]
    stretches: int
    held_out: int
    length: float
    directions: tuple[int, int]

    @property
    def ratio(self) -> float:
        """Refined over initial held-out error, root mean square over the axes."""
        moved = np.array(self.start) > 0
        ratio = np.array(self.refined)[moved] / np.array(self.start)[moved]
        return float(np.sqrt(np.mean(ratio**2)))

    def __str__(self) -> str:
        where = (
            f"in the last {self.held_out} of {self.stretches} stretches of"
            f" {significant(self.length, 2)} s"
        )
        if not self.kept:
            return (
                f"simulation did not improve the model beyond chance: {self.ratio:.2f} times the"
                f" position error {where}; the regression's parameters are kept ({self.friction})"
            )
        return (
            f"refined by simulation: {self.ratio:.2f} times the regression's position error"
            f" {where}; {self.directions[0]} of {self.directions[1]} combinations of parameters"
            f" moved ({self.friction})"
        )

    def table(self, robot: Robot) -> Table:
        """Return the table of held-out position errors."""
        rows = []
        for axis, pair in enumerate(zip(self.start, self.refined, strict=True)):
            unit, factor = ("deg", 180 / np.pi) if robot.revolute[axis] else ("mm", 1e3)
            rows.append((str(axis + 1), *(f"{significant(factor * x, 3)} {unit}" for x in pair)))
        return table(
            "Simulated positions, held out",
            ("axis", *figures("regression, rms", "refined, rms")),
            rows,
            "Position errors of simulated stretches without a part in the fit.",
            (str(self),),
        )
