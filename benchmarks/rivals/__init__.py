"""Methods of the literature for comparison with `hil`: entries for ``hil identify``, by name.

``python -m benchmarks.rivals RUN --method NAME`` is ``hil identify`` with these methods added.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .free_motions import SOLVERS, fit_free_motions
from .variants import VARIANTS, fit_trajectories, trajectories

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.estimation.identify import Identify
    from hil.estimation.options import Options
    from hil.model.robot import Robot
    from hil.runs.recording import Recorded


def _conventional(name: str) -> Identify:
    def identify(robot: Robot, recorded: Recorded, _: Options) -> Estimate:
        return fit_trajectories(robot, trajectories(recorded), VARIANTS[name], name=name)

    return identify


def _free_motion(name: str) -> Identify:
    def identify(robot: Robot, recorded: Recorded, _: Options) -> Estimate:
        return fit_free_motions(robot, recorded, name)

    return identify


RIVALS: dict[str, Identify] = {
    **{name: _conventional(name) for name in VARIANTS},
    **{name: _free_motion(name) for name in SOLVERS},
}
"""All rivals by name, in the form of `hil.estimation.identify.METHODS`."""
