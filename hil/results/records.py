"""Findings as JSON: records by their names and fields, arrays with all their digits."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from checked_files.yaml_file import FileModel
from hil.estimation.causes import Cause, CauseName
from hil.estimation.drive_train import DriveTrain, LoadFriction
from hil.estimation.estimate import Estimate, LeftOut
from hil.estimation.friction.drift import Drift, Level, TimeConstant
from hil.estimation.friction_law import FrictionLaw
from hil.estimation.local_values import LocalValue
from hil.results.judgement import ErrorTerm, Judgement, Reservation
from hil.results.model import Model
from hil.results.prediction import Prediction
from hil.results.provenance import Provenance

if TYPE_CHECKING:
    from hil.model.robot import Robot

ROBOT = "robot"
"""Field that is not written: the robot has a file of its own."""
RECORDS: dict[str, type[Any]] = {
    each.__name__: each
    for each in (
        *(Estimate, LocalValue, Cause, DriveTrain, LoadFriction, LeftOut),
        *(Model, Prediction, Drift, Level, TimeConstant),
    )
}
MODELS: dict[str, type[FileModel]] = {
    each.__name__: each for each in (FrictionLaw, ErrorTerm, Judgement, Reservation, Provenance)
}


def plain(value: Any) -> Any:
    """Return what JSON can hold of a record."""
    name = type(value).__name__
    found = value
    if isinstance(value, np.ndarray):
        found = {"array": value.tolist(), "kind": value.dtype.str}
    elif isinstance(value, FileModel):
        found = {"model": name, "fields": value.model_dump(mode="json")}
    elif isinstance(value, CauseName):
        found = {"cause": value.value}
    elif is_dataclass(value) or hasattr(value, "_asdict"):
        found = {"record": name, "fields": _fields(value, name)}
    elif isinstance(value, tuple):
        found = [plain(each) for each in value]
    elif isinstance(value, dict):
        found = {"mapping": {key: plain(each) for key, each in value.items()}}
    elif isinstance(value, np.generic):
        found = value.item()
    return found


def _fields(record: Any, name: str) -> dict[str, Any]:
    if name not in RECORDS:
        raise TypeError(f"{name} must be listed in RECORDS to be kept")
    names = [each.name for each in fields(record)] if is_dataclass(record) else record._fields
    return {each: plain(getattr(record, each)) for each in names if each != ROBOT}


def restored(found: Any, robot: Robot) -> Any:
    """Return what `plain` has made JSON of; `robot` is that of models."""
    value = found
    if isinstance(found, list):
        value = tuple(restored(each, robot) for each in found)
    elif isinstance(found, dict) and "array" in found:
        value = np.array(found["array"], dtype=found["kind"])
    elif isinstance(found, dict) and "model" in found:
        value = MODELS[found["model"]].model_validate(found["fields"])
    elif isinstance(found, dict) and "cause" in found:
        value = CauseName(found["cause"])
    elif isinstance(found, dict) and "mapping" in found:
        value = {key: restored(each, robot) for key, each in found["mapping"].items()}
    elif isinstance(found, dict):
        kind = RECORDS[found["record"]]
        own = {key: restored(each, robot) for key, each in found["fields"].items()}
        value = kind(robot=robot, **own) if kind is Model else kind(**own)
    return value
