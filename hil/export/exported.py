"""What a format makes of a model, and how it gets into a folder.

A writer of a format is a function from the model and the lines that state its origin to the files
it consists of. It touches no disk: what a format refuses is refused before anything is written.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from checked_files.yaml_file import FileError
from hil.results.model import Model
from hil.runs.atomic_file import file_errors, write_file

if TYPE_CHECKING:
    from pathlib import Path


class Exported(NamedTuple):
    """A model in one format.

    Attributes
    ----------
    files : dict of str to str
        Content by name, of files beside one another.
    remarks : tuple of str
        Sentences on what the format leaves out or changes, for the terminal; the files state them
        too.
    """

    files: dict[str, str]
    remarks: tuple[str, ...] = ()


Writer = Callable[[Model, tuple[str, ...]], Exported]
"""From a model and the lines of its origin, which each file states, to the model in one format."""


def write_exported(exported: Exported, folder: Path) -> tuple[Path, ...]:
    """Write an exported model into a folder, which is made if need be; return the files' paths.

    Raises
    ------
    FileError
        One of the files is there already, or cannot be written.
    """
    paths = {folder / name: text for name, text in exported.files.items()}
    for path in paths:
        if path.exists():
            raise FileError(f"{path}: is there already; remove it or choose another folder with -o")
    with file_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    for path, text in paths.items():
        write_file(path, text.encode())
    return tuple(paths)
