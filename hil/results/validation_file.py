"""`validation.yaml`: how well a model predicted the run in whose folder it lies.

The model's own file keeps the verdict too: what it was worth where.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING

import yaml

from checked_files.yaml_file import FileModel
from hil.results.model import Model
from hil.results.stamp import RunStamp, recordings_in_common
from hil.results.verdict import KeptVerdict, Validation
from hil.runs.atomic_file import write_file
from hil.runs.journal import now

if TYPE_CHECKING:
    from pathlib import Path

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


def of_own_recordings(model: Model, run: Run) -> Validation | None:
    """Refusal of a run that the model was made from; None where it is another one."""
    common, every = recordings_in_common(model.provenance, run), len(run)
    if not common:
        return None
    which = "its recordings are" if common == every else f"{common} of its {every} recordings are"
    return Validation(
        verdict="REFUSE",
        reason=f"{which} those that the model was made from, which cannot show what it is worth on"
        " others; judge it by another recording",
        axes=(),
    )


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
    _keep_verdict(record, model_path, run.path)
    return path


def _keep_verdict(record: ValidationRecord, model_path: Path, run: Path) -> None:
    """Add the verdict to the model's file, in place of an earlier one on the same run."""
    found, where = record.validation, os.path.relpath(run, model_path.parent)
    verdict = KeptVerdict(
        run=where,
        validated=record.validated,
        verdict=found.verdict,
        reason=found.reason,
        relative=found.relative if found.axes else None,
    )
    model = Model.load(model_path)
    others = tuple(each for each in model.validations if each.run != where)
    replace(model, validations=(*others, verdict)).save(model_path)
