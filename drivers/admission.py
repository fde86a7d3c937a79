"""All or nothing: every drive must pass before any is energised.

Each drive is switched off, checked and configured in turn (`commissioning`). One that fails does
not keep the others from being looked at, so that the operator learns at once what to mend.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning import commission
from drivers.communication import find_collisions
from drivers.drive_bus import AxisInfo, DriveError, DriveFault, DriveRefused, NodeSilent
from drivers.scaling import AxisScale

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.communication import Communication
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.power import Power
    from drivers.sdo import SdoServer


def admit(
    servers: Sequence[SdoServer],
    drives: DrivesFile,
    period: float,
    power: Power,
    commissioned: list[SdoServer],
    communications: Sequence[Communication],
    *,
    reset_faults: bool,
) -> tuple[AxisInfo, ...]:
    """Check and configure all drives, leaving them off and pre-operational.

    Parameters
    ----------
    servers : sequence of SdoServer
        The drives in joint order.
    drives : DrivesFile
        What is stated of them.
    period : float
        Time between two SYNCs [s].
    power : Power
        Switches them off first.
    commissioned : list of SdoServer
        Extended by each drive as soon as something may have been written to it.
    communications : sequence of Communication
        By drive; what is found is put in.
    reset_faults : bool
        Reset drives that are found in a fault.

    Raises
    ------
    DriveRefused, NodeSilent, DriveFault
        Why drives cannot serve, a line each.
    """
    problems: list[DriveError] = []
    infos = []
    for server, axis, communication in zip(servers, drives.axes, communications, strict=True):
        try:
            server.enter_pre_operational()
            power.make_safe(server, reset_fault=reset_faults)
            commissioned.append(server)
            identity = commission(server, axis, drives, period, power.wait, communication)
            infos.append(_described(axis, identity))
        except (DriveRefused, NodeSilent, DriveFault) as error:
            problems.append(error)
    problems = problems or [*find_collisions(communications, drives.master_node)]
    if problems:
        raise _joined(problems)
    return tuple(infos)


def _described(axis: AxisDrive, identity: str) -> AxisInfo:
    scale = AxisScale.of(axis)
    return AxisInfo(
        name=axis.name,
        identity=identity,
        q_min=axis.limits.q_min,
        q_max=axis.limits.q_max,
        velocity_max=axis.limits.velocity,
        acceleration_max=axis.limits.acceleration,
        torque_resolution=abs(scale.torque),
        position_resolution=abs(scale.position),
    )


def _joined(problems: Sequence[DriveError]) -> DriveError:
    if len(problems) == 1:
        return problems[0]
    silent = all(isinstance(problem, NodeSilent) for problem in problems)
    return (NodeSilent if silent else DriveRefused)("\n".join(map(str, problems)))
