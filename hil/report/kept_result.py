"""Results that other commands keep in a run's folder, held against the run as it is now.

A model (`model.yaml`) holds what commands add to it: verdicts of validations, bodies. A load
(`load.yaml`) and a diagnosis (`diagnosis.yaml`) take as long as the report itself, and a load
needs a second run, so reports do not compute them again. One that no longer belongs to the run is
not shown, and the report states why and how to make it anew.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

from hil.errors import FileError, HilError
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.stamp import same_parameters

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from hil.report.reported_run import ForeignRun, IdentifiedRun
    from hil.runs.run import Run

    Array = NDArray[np.float64]


class _Kept(Protocol):
    def stale(self, folder: Run, p: Array) -> str:
        """Why it is stale beside base parameters p; empty if it is not."""


K = TypeVar("K", bound=_Kept)


def current(
    read: Callable[[Run], K | None], run: IdentifiedRun | ForeignRun, name: str, command: str
) -> tuple[K | None, str]:
    """Read a result of the run, or why it is not shown.

    Parameters
    ----------
    read : callable
        Returns what is kept in a folder, or None.
    name : str
        Of its file.
    command : str
        Which makes it anew.

    Returns
    -------
    kept : K or None
    note : str
        Empty where there is nothing, or nothing wrong with it.
    """
    try:
        kept = read(run.source)
        stale = kept.stale(run.source, run.model.values) if kept else ""
    except FileError as error:
        return None, f"{name} cannot be used: {error}. Make it anew with: {command}"
    if stale:
        return None, f"{name} is stale and not shown: {stale}. Make it anew with: {command}"
    return kept, ""


def kept_model(run: IdentifiedRun | ForeignRun) -> Model | None:
    """Read the model that is kept in the run's folder; None where it is not that of this report."""
    path = run.source.path / NAME
    if not path.exists():
        return None
    try:
        kept = Model.load(path)
    except HilError:
        return None
    return None if same_parameters(kept.values.tolist(), run.model.values) else kept
