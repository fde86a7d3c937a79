"""Friction in a run: whether it measures any, or nothing else, and what its recordings show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import FileError, Mismatch
from hil.planning.measurement import Friction, recorded_as

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.planning.measurement import RecordedMotion
    from hil.results.friction_file import FrictionResult
    from hil.runs.recording import Recording
    from hil.runs.run import Run

    Recordings = Sequence[tuple[RecordedMotion, Recording]]


def friction_alone(run: Run) -> bool:
    """Whether a run measures nothing but friction."""
    return all(isinstance(each, Friction) for each in run.plan.measurements)


def friction_of_run(run: Run, recordings: Recordings) -> FrictionResult | None:
    """Evaluate the friction of a run as `hil friction fit` did it last; None where there is none.

    The model of gravity, if it is still there, and the bound of asymmetry are the same.

    Raises
    ------
    NotEnoughData
        No recordings of friction in a run about friction alone.
    """
    if not recorded_as(Friction, recordings) and not friction_alone(run):
        return None
    # of runs that measure friction: other reports need none of this
    from hil.estimation.friction.symmetry import BOUND  # noqa: PLC0415
    from hil.results.friction import evaluate  # noqa: PLC0415
    from hil.results.friction_file import load_friction  # noqa: PLC0415

    try:
        kept = load_friction(run)
        model = Path(kept.model_folder) if kept.model_folder else None
        return evaluate(run, recordings, model, BOUND if kept.bound is None else kept.bound)
    except (FileError, Mismatch):  # nothing was fitted, or its model is gone
        return evaluate(run, recordings)
