"""The formats that a model can be exported to, by the names that the command takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from checked_files.near import did_you_mean
from hil.errors import UnknownName
from hil.export.c_code import write_c
from hil.export.exported import Exported
from hil.export.friction_file import write_friction
from hil.export.given_urdf import Given
from hil.export.json_file import write_json
from hil.export.mjcf_file import write_mjcf
from hil.export.python_code import write_python
from hil.export.recordings.formats import RECORDINGS
from hil.export.ros2_file import write_ros2
from hil.export.urdf_file import write_urdf
from hil.results.model import Model

if TYPE_CHECKING:
    from hil.export.exported import Writer

FORMATS: dict[str, Writer] = {
    "c": write_c,
    "python": write_python,
    "json": write_json,
    "friction": write_friction,
    "ros2": write_ros2,
}


def export(model: Model, name: str, origin: tuple[str, ...]) -> Exported:
    """Return the model in a format of `FORMATS` by its name; nothing is written.

    Raises
    ------
    UnknownName
        There is no such format.
    """
    refuse_unknown(name)
    return FORMATS[name](model, origin)


def refuse_unknown(name: str) -> None:
    """Refuse the name of no format, be it of models or of recordings.

    Raises
    ------
    UnknownName
        There is no such format.
    """
    known = (*FORMATS, *SIMULATORS, *RECORDINGS)
    if name not in known:
        near = did_you_mean(name, known)
        models, recordings = ", ".join((*FORMATS, *SIMULATORS)), ", ".join(RECORDINGS)
        raise UnknownName(
            f"{name}: unknown format{near}; available: {models}; of recordings: {recordings}"
        )


SimulatorWriter = Callable[[Model, tuple[str, ...], Given | None], Exported]
"""From a model that has bodies, the lines of its origin, and a URDF whose names and frames to take.

The URDF may be left out."""

SIMULATORS: dict[str, SimulatorWriter] = {
    "urdf": write_urdf,
    "mjcf": write_mjcf,
}


def export_to_simulator(
    model: Model, name: str, origin: tuple[str, ...], given: Given | None = None
) -> Exported:
    """Return a model that has bodies in a format of `SIMULATORS`; nothing is written.

    What the bodies cost is stated with the origin.
    """
    costs = model.consistent.statements(model.robot) if model.consistent else ()
    return SIMULATORS[name](model, (*origin, *costs), given)
