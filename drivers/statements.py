"""What the drives file states, compared with what the drive itself says, where it says anything.

Ratings, encoder and units scale every torque and every set-point. A drive that contradicts the file
is refused; where it is silent, the file is trusted and that is noted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers import objects
from drivers.drive_bus import DriveRefused
from drivers.drives_file import VelocityUnit

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive
    from drivers.sdo import SdoServer

VELOCITY_UNITS = {
    0x00B44700: VelocityUnit.RPM,
    0xFFB44700: VelocityUnit.TENTH_RPM,
    0x00B50300: VelocityUnit.INCREMENTS,
}
"""SI unit velocity (60A9) as CiA 303-2 codes it: prefix, numerator, denominator."""


def compare_statements(server: SdoServer, axis: AxisDrive) -> None:
    """Compare ratings (6075, 6076), encoder (608F) and velocity unit (60A9).

    Raises
    ------
    DriveRefused
        The drive says something else than the drives file.
    """
    _compare_ratings(server, axis)
    _compare_encoder(server, axis)
    _compare_velocity_unit(server, axis)


def _compare_ratings(server: SdoServer, axis: AxisDrive) -> None:
    for entry, value, key, unit in (
        (objects.RATED_CURRENT, axis.rated_current, "rated_current", "A"),
        (objects.RATED_TORQUE, axis.rated_torque, "rated_torque", "N m"),
    ):
        present = server.find(entry)
        if present is None:
            server.notes.append(f"{server.label}: no object {entry}: {key} is taken on trust")
        elif abs(present - 1000 * value) > 1:
            raise DriveRefused(
                f"{server.label}: {entry} is {present / 1000:g} {unit}, the drives file states "
                f"{key}: {value:g}; correct whichever is wrong, torques scale with it"
            )


def _compare_encoder(server: SdoServer, axis: AxisDrive) -> None:
    increments = server.find(objects.ENCODER_INCREMENTS)
    revolutions = server.find(objects.ENCODER_REVOLUTIONS)
    if increments is None or not revolutions:
        server.notes.append(
            f"{server.label}: no encoder resolution (608F): increments_per_revolution on trust"
        )
    elif increments != axis.increments_per_revolution * revolutions:
        raise DriveRefused(
            f"{server.label}: encoder resolution (608F) is {increments}/{revolutions}, the drives "
            f"file states increments_per_revolution: {axis.increments_per_revolution}; "
            "correct whichever is wrong"
        )


def _compare_velocity_unit(server: SdoServer, axis: AxisDrive) -> None:
    said = VELOCITY_UNITS.get(server.find(objects.VELOCITY_UNIT) or 0)
    if said is not None and said is not axis.velocity_unit:
        raise DriveRefused(
            f"{server.label}: {objects.VELOCITY_UNIT} says {said.value}, the drives file states "
            f"velocity_unit: {axis.velocity_unit.value}; correct whichever is wrong, every "
            "velocity scales with it"
        )
