"""The formats that a model can be exported to, by the names that the command takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.near import did_you_mean
from hil.errors import UnknownName
from hil.export.c_code import write_c
from hil.export.data_files import write_friction, write_json, write_ros2
from hil.export.mjcf_file import write_mjcf
from hil.export.python_code import write_python
from hil.export.recordings.formats import RECORDINGS
from hil.export.urdf_file import write_urdf
from hil.results.consistency import statements

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.export.exported import Exported, Writer
    from hil.export.given_urdf import Given
    from hil.results.model import Model

FORMATS: dict[str, Writer] = {
    "c": write_c,
    "python": write_python,
    "json": write_json,
    "friction": write_friction,
    "ros2": write_ros2,
}
SIMULATORS: dict[str, Callable[[Model, tuple[str, ...], Given | None], Exported]] = {
    "urdf": write_urdf,
    "mjcf": write_mjcf,
}
"""Formats that need bodies, and take the names and frames of a URDF where one is given."""


def export(
    model: Model, name: str, origin: tuple[str, ...], given: Given | None = None
) -> Exported:
    """Return the model in a format by its name; nothing is written.

    Parameters
    ----------
    model : Model
        With bodies for `SIMULATORS`; what they cost is stated with the origin.
    name : str
        Of `FORMATS` or `SIMULATORS`.
    origin : tuple of str
        Lines that the files state at their head.
    given : Given, optional
        A URDF for `SIMULATORS`.

    Raises
    ------
    UnknownName
        There is no such format.
    """
    refuse_unknown(name)
    if name not in SIMULATORS:
        return FORMATS[name](model, origin)
    costs = statements(model.robot, model.consistent) if model.consistent else ()
    return SIMULATORS[name](model, (*origin, *costs), given)


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
