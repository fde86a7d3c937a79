"""Servo drive as a CANopen slave."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.canopen.canopen_node import CanopenNode
from sim_plant.canopen.nmt import NmtCommand
from sim_plant.drive.cia402_drive import Cia402Drive
from sim_plant.drive.cia402_states import State

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.emcy import ErrorCode
    from sim_plant.canopen.timers import Timers
    from sim_plant.drive.process_image import AxisImage
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.machine_protocol import Axis


class Cia402Node(CanopenNode, Cia402Drive):
    """Drive of the plant on CAN.

    Parameters
    ----------
    settings, axis, image
        As in `Cia402Drive`.
    timers, emit, rewired
        As in `CanopenNode`.
    """

    def __init__(
        self,
        settings: DriveSettings,
        axis: Axis,
        image: AxisImage,
        timers: Timers,
        emit: Callable[[int, bytes], None],
        rewired: Callable[[], None],
    ) -> None:
        CanopenNode.__init__(
            self, settings.node_id, timers, emit, rewired, settings.personality, settings.axis
        )
        Cia402Drive.__init__(
            self,
            settings,
            axis,
            image,
            timers,
            self.dictionary,
            self.emergencies,
            lambda: self._watched,
        )

    def restart(self) -> None:
        """Restart as after power-on."""
        for node in self._axes:
            node.nmt.receive(bytes([NmtCommand.RESET_NODE, self.node_id]))

    def _abort_connection(self, code: ErrorCode) -> None:
        self.lose_connection(code)

    def _regain_heartbeat(self) -> None:
        if self.state not in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            super()._regain_heartbeat()

    def _reset_profile(self) -> None:
        self.reset()
