"""Methods of the literature that `hil` is compared with: what ``hil identify`` takes, by name.

``python -m benchmarks.rivals RUN --method NAME`` is ``hil identify`` with these methods besides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .free_motions import SOLVERS, fit_free_motions
from .variants import VARIANTS, fit_trajectories, trajectories

if TYPE_CHECKING:
    from hil.estimation.identify import Identify


def _conventional(name: str) -> Identify:
    return lambda robot, recorded: fit_trajectories(
        robot, trajectories(recorded), VARIANTS[name], name=name
    )


def _free_motion(name: str) -> Identify:
    return lambda robot, recorded: fit_free_motions(robot, recorded, name)


RIVALS: dict[str, Identify] = {
    **{name: _conventional(name) for name in VARIANTS},
    **{name: _free_motion(name) for name in SOLVERS},
}
"""All rivals by name, as `hil.estimation.identify.METHODS` has methods."""
