"""Which virtual plant a run was measured on, as its journal names it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_file import load_yaml
from hil.errors import Mismatch
from hil.ground_truth.plant_file import Plant, find_plant
from hil.runs.journal import BusName

if TYPE_CHECKING:
    from pathlib import Path

    from hil.runs.run import Run


def refuse_other_plant(run: Run, truth: Path | str) -> None:
    """Refuse a run that was not measured on the plant of `truth`.

    A plant whose file is no longer where the journal names it is taken at the user's word.

    Raises
    ------
    FileError
        A plant file that cannot be used.
    Mismatch
        The run was measured on a real machine, or on a plant with other bodies or drives.
    """
    sessions = run.journal.sessions
    if not run.journal.simulated:
        bus = sessions[-1].bus if sessions else "nothing"
        raise Mismatch(
            f"{run.path}: was measured on {bus}; only on the virtual plant is the truth known."
            " Judge this run by its report's intervals and residuals"
        )
    given = load_yaml(find_plant(truth), Plant)
    for channel in sorted({BusName.read(session.bus).channel for session in sessions}):
        measured = find_plant(channel)
        if measured.is_file() and load_yaml(measured, Plant) != given:
            raise Mismatch(
                f"{run.path}: was measured on the plant {channel}, which has other bodies or drives"
                f" than {truth}; compare with --truth {channel}"
            )
