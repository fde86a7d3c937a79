"""`validation.yaml`: how well a model predicted the run in whose folder it lies."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import yaml

from checked_files.yaml_file import FileModel
from hil.results.stamp import RunStamp
from hil.results.validation import Validation
from hil.runs.atomic_file import write_file
from hil.runs.journal import now

if TYPE_CHECKING:
    from pathlib import Path

    from hil.results.model import Model
    from hil.runs.run import Run

NAME = "validation.yaml"


class ValidationRecord(FileModel):
    """A validation and what it belongs to.

    Attributes
    ----------
    run : RunStamp
    model : str
        Path of the model's file, from the run's folder.
    method, identified : str
        Of the model.
    validated : str
        When.
    """

    run: RunStamp
    model: str
    method: str
    identified: str
    validated: str
    validation: Validation


def write_validation(run: Run, model: Model, model_path: Path, found: Validation) -> Path:
    """Keep a validation in the folder of the run that was predicted; return the file's path."""
    record = ValidationRecord(
        run=RunStamp.of(run),
        model=os.path.relpath(model_path, run.path),
        method=model.method,
        identified=model.provenance.identified,
        validated=now(),
        validation=found,
    )
    path = run.path / NAME
    text = yaml.safe_dump(record.model_dump(mode="json"), sort_keys=False, width=200)
    write_file(path, text.encode())
    return path
