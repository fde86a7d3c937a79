"""Formats of models and of recordings, by their names on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.foreign_text import shown
from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError
from hil.errors import NotEnoughData, UnknownName
from hil.export.data_files import write_friction, write_json, write_ranges, write_ros2
from hil.export.languages import write_c, write_python, write_st
from hil.export.mjcf_file import write_mjcf
from hil.export.recordings.mcap_file import write_mcap
from hil.export.recordings.tables import Job, write_csv, write_parquet
from hil.export.urdf_file import write_urdf
from hil.results.consistency import statements
from hil.runs.atomic_file import file_errors, whole_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.export.exported import Exported, Writer
    from hil.export.urdf_file import Given
    from hil.results.model import Model
    from hil.runs.run import Run

FORMATS: dict[str, Writer] = {
    "c": write_c,
    "python": write_python,
    "st": write_st,
    "json": write_json,
    "friction": write_friction,
    "ros2": write_ros2,
}
SIMULATORS: dict[str, Callable[[Model, tuple[str, ...], Given | None], Exported]] = {
    "urdf": write_urdf,
    "mjcf": write_mjcf,
    "ranges": write_ranges,
}
"""Formats with bodies; a given URDF supplies names and frames."""


def export(
    model: Model, name: str, origin: tuple[str, ...], given: Given | None = None
) -> Exported:
    """Return the model in a named format, without writing files.

    Parameters
    ----------
    model : Model
        Model; for `SIMULATORS` one with bodies (`Model.consistent`).
    name : str
        Name in `FORMATS` or `SIMULATORS`.
    origin : tuple of str
        Lines for the head of each file.
    given : Given, optional
        A URDF for `SIMULATORS`.

    Raises
    ------
    UnknownName
        The format does not exist.
    """
    refuse_unknown(name)
    origin = tuple(map(shown, origin))
    if name not in SIMULATORS:
        return FORMATS[name](model, origin)
    costs = statements(model.robot, model.consistent) if model.consistent else ()
    return SIMULATORS[name](model, (*origin, *costs), given)


def refuse_unknown(name: str) -> None:
    """Raise an error for an unknown format of models or recordings.

    Raises
    ------
    UnknownName
        The format does not exist.
    """
    known = (*FORMATS, *SIMULATORS, *RECORDINGS)
    if name not in known:
        near = did_you_mean(name, known)
        models, recordings = ", ".join((*FORMATS, *SIMULATORS)), ", ".join(RECORDINGS)
        raise UnknownName(
            f"{name}: unknown format{near}; available: {models}; of recordings: {recordings}"
        )


RECORDINGS: dict[str, Callable[[Job], None]] = {
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
    """Write the recordings of a run into a new folder; on an error write nothing.

    Parameters
    ----------
    name : str
        One of `RECORDINGS`.
    joints : sequence of str, optional
        Names of the joints; ``joint1`` and on unless given.
    progress : callable
        Function called with the id of each measurement before writing.

    Returns
    -------
    tuple of Path
        Written files and folders in `output`.

    Raises
    ------
    FileError
        The folder is not empty, a recording is damaged, or a package is not installed.
    NotEnoughData
        There are no recordings.
    """
    if not len(run):
        raise NotEnoughData(f"{run.path}: no recordings to export; measure them with --resume")
    with file_errors(output, "read"):
        # the current folder would be gone after its replacement
        unused = output.is_dir() and not any(output.iterdir()) and not output.samefile(Path.cwd())
        if output.is_symlink() or (output.exists() and not unused):
            raise FileError(f"{output}: already exists; choose another folder with -o")
    named = tuple(joints) or tuple(f"joint{k + 1}" for k in range(run.robot.n_joints))
    with whole_folder(output) as folder:
        RECORDINGS[name](Job(run, folder, named, progress))
    return tuple(sorted(output.iterdir()))
