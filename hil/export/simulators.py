"""Formats for simulators, which need bodies: by the names that the command takes."""

from __future__ import annotations

from collections.abc import Callable

from hil.export.exported import Exported
from hil.export.given_urdf import Given
from hil.export.mjcf_file import write_mjcf
from hil.export.urdf_file import write_urdf
from hil.results.model import Model

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
