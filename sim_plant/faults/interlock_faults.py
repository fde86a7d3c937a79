"""Safe torque off of a drive, as a guard door or an emergency stop leaves it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.faults.injection import NodeInjection

if TYPE_CHECKING:
    from sim_plant.slave_network import CanFrame


class TorqueOff(NodeInjection):
    """Nothing energises the motor, and the drive does not leave SWITCH ON DISABLED."""

    def begin(self) -> None:
        """Lock the drive."""
        self.node.lock()

    def end(self) -> list[CanFrame]:
        """Release it."""
        self.node.unlock()
        return []
