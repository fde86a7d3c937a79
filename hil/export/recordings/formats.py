"""The formats that recordings can be exported to, by the names that the command takes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.errors import NotEnoughData
from hil.export.recordings.job import Job
from hil.export.recordings.mcap_file import write_mcap
from hil.export.recordings.tables import write_csv, write_parquet
from hil.runs.atomic_file import file_errors, whole_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.export.recordings.job import Writer
    from hil.runs.run import Run

RECORDINGS: dict[str, Writer] = {
    "mcap": write_mcap,
    "csv": write_csv,
    "parquet": write_parquet,
}


def export_recordings(
    run: Run,
    name: str,
    output: Path,
    joints: Sequence[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Path, ...]:
    """Write the recordings of a run into a new folder, all of them or nothing.

    Parameters
    ----------
    run : Run
    name : str
        One of `RECORDINGS`.
    output : Path
    joints : sequence of str, optional
        Names of the joints; ``joint1`` and on unless given.
    progress : callable
        Takes the id of each measurement before it is written.

    Returns
    -------
    tuple of Path
        Files beside one another in `output`, and folders in it.

    Raises
    ------
    FileError
        There is something in the folder, a recording is damaged, or a package is not installed.
    NotEnoughData
        There are no recordings.
    """
    if not len(run):
        raise NotEnoughData(f"{run.path}: no recordings to export; measure them with --resume")
    with file_errors(output, "read"):
        if output.is_symlink() or (output.exists() and not _replaceable(output)):
            raise FileError(f"{output}: is there already; choose another folder with -o")
    named = tuple(joints) or tuple(f"joint{k + 1}" for k in range(run.robot.n_joints))
    with whole_folder(output) as folder:
        RECORDINGS[name](Job(run, folder, named, progress))
    return tuple(sorted(output.iterdir()))


def _replaceable(folder: Path) -> bool:
    """Whether a folder is empty, and not the one in which the user stands."""
    empty = folder.is_dir() and not any(folder.iterdir())
    return empty and not folder.samefile(Path.cwd())
