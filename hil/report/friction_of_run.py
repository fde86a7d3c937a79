"""Friction in a run: whether it measures any, or nothing else, and what its recordings show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.planning.measurement import Friction, of_kind, recorded_as
from hil.results.friction import evaluate
from hil.results.friction_file import load_friction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.planning.measurement import Measurement
    from hil.results.friction import FrictionResult
    from hil.runs.recording import Recording
    from hil.runs.run_folder import RunFolder

    Recordings = Sequence[tuple[Measurement, Recording]]


def friction_alone(folder: RunFolder) -> bool:
    """Whether a run measures nothing but friction."""
    planned = folder.plan.measurements
    return len(of_kind(Friction, planned)) == len(planned)


def friction_of_run(folder: RunFolder, recordings: Recordings) -> FrictionResult | None:
    """Evaluate the friction of a run as `hil friction fit` did it last; None where there is none.

    The model of gravity is the same, if it is still there.

    Raises
    ------
    FileError
        No recordings of friction in a run about friction alone.
    """
    if not recorded_as(Friction, recordings) and not friction_alone(folder):
        return None
    try:
        model = load_friction(folder.path).model_folder
        return evaluate(folder, recordings, Path(model) if model else None)
    except FileError:
        return evaluate(folder, recordings)
