"""Result of an export, and its writing into a folder.

A writer of a format is a function from the model and its origin lines to the contents of the files.
It does not touch the disk, so errors are raised before anything is written.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from checked_files.foreign_text import one_line
from checked_files.yaml_file import FileError
from hil.results.model import Model
from hil.runs.atomic_file import file_errors, write_file
from hil.runs.journal import NO_REAL_MACHINE
from hil.show.rounding import count

if TYPE_CHECKING:
    from pathlib import Path


class Exported(NamedTuple):
    """A model in one format.

    Attributes
    ----------
    files : dict of str to str
        Contents of files in one folder, by name.
    remarks : tuple of str
        Sentences on omissions and changes by the format, for the terminal; the files contain them
        too.
    """

    files: dict[str, str]
    remarks: tuple[str, ...] = ()


Writer = Callable[[Model, tuple[str, ...]], Exported]
"""Function from a model and its origin lines, repeated in each file, to the exported model."""


def write_exported(exported: Exported, folder: Path) -> tuple[Path, ...]:
    """Write an exported model into a folder, created if absent; return the paths of the files.

    Raises
    ------
    FileError
        One of the files already exists, or cannot be written.
    """
    paths = {folder / name: text for name, text in exported.files.items()}
    for path in paths:
        if path.exists():
            raise FileError(f"{path}: already exists; remove it or choose another folder with -o")
    for path, text in paths.items():
        with file_errors(path.parent, "made"):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, text.encode())
    return tuple(paths)


def cautions(model: Model) -> tuple[str, ...]:
    """Return warnings for the head of an exported file: failed model, simulated data."""
    simulated = (NO_REAL_MACHINE,) if model.provenance.any_simulated else ()
    if model.verdict is None or not model.failed:
        return simulated
    return (f"FAILED: {one_line(model.verdict.clause, 1000)}", *simulated)


def passed(model: Model) -> bool:
    """Return True if the model passed a validation on another recording."""
    return any(each.word == "good" for each in model.validations)


def origin(model: Model, source: Path) -> tuple[str, ...]:
    """Return lines on robot, run, method, date and validation of a model, preceded by `cautions`.

    Parameters
    ----------
    source : Path
        File of the model, or the folder of its run, as named by the user.
    """
    made = model.provenance
    also = f" with {', '.join(made.together_with)}" if made.together_with else ""
    return (
        *cautions(model),
        f"robot {model.robot.name} (robot file {model.robot.digest[:12]})",
        f"model of {source}{also}: {count(made.measurements, 'measurement')}, {made.method} method",
        f"identified {made.identified} by version {made.version}",
        *validations(model, source),
    )


def validations(model: Model, source: Path) -> tuple[str, ...]:
    """Return lines on the validations of the model on other recordings."""
    found = tuple(
        f"validation on {each.run} ({each.validated}): {each}" for each in model.validations
    )
    if passed(model):
        return found
    none = "no validation passed; judge the model by another recording with: hil validate RUN"
    return (*found, f"{none} --model {source}")
