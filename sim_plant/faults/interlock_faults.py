"""Safe torque off of a drive, as after opening a guard door or an emergency stop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.faults.injection import NodeInjection

if TYPE_CHECKING:
    from sim_plant.slave_network import CanFrame


class TorqueOff(NodeInjection):
    """Safe torque off: the motor has no torque and the drive stays in SWITCH ON DISABLED."""

    def begin(self) -> None:
        """Lock the drive."""
        self.node.lock()

    def end(self) -> list[CanFrame]:
        """Release the drive."""
        self.node.unlock()
        return []
