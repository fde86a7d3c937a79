"""Faults of a drive: firmware, supply, sensors and motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.drive.cia402_states import Command
from sim_plant.drive.disobedience import OBEDIENT, Disobedience
from sim_plant.faults.injection import NodeInjection
from sim_plant.faults.machine_faults import CURRENTS, POSITIONS

if TYPE_CHECKING:
    from sim_plant.slave_network import CanFrame

_NODE = 0x7F


class Warned(NodeInjection):
    """Emergency of a drive that continues to work."""

    def begin(self) -> None:
        """Send the emergency."""
        self.node.emergencies.report(self.fault.code or 0)


class Failed(NodeInjection):
    """Fault of the drive."""

    def begin(self) -> None:
        """Enter the fault."""
        self.node.fail(self.fault.code or 0)


class Reset(NodeInjection):
    """Restart of the node, as by its watchdog."""

    def begin(self) -> None:
        """Restart the node."""
        self.node.restart()


class NodeBusOff(NodeInjection):
    """Bus-off of a node that continues to work."""

    def begin(self) -> None:
        """Leave the bus."""
        self.node.connect(False)

    def end(self) -> list[CanFrame]:
        """Rejoin the bus."""
        self.node.connect(True)
        return []

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Drop the frames of this node."""
        return [frame for frame in frames if frame[1] & _NODE != self.node.node_id]


class VoltageLost(NodeInjection):
    """Loss of the DC link; the drive's controller continues to work."""

    def begin(self) -> None:
        """Remove the voltage."""
        self.node.lose_voltage()

    def end(self) -> list[CanFrame]:
        """Restore the voltage."""
        self.node.regain_voltage()
        return []


class SupplyLost(NodeBusOff):
    """Loss of all supply of the node."""

    def begin(self) -> None:
        """Disconnect the node and remove the voltage."""
        super().begin()
        self.node.lose_voltage()

    def end(self) -> list[CanFrame]:
        """Boot the node."""
        super().end()
        self.node.regain_voltage()
        self.node.restart()
        return []


class EncoderJump(NodeInjection):
    """Jump of the encoder to another angle."""

    def begin(self) -> None:
        """Add the jump."""
        self.machine.jump(self.axis, round(self.fault.size or 0))

    def end(self) -> list[CanFrame]:
        """Remove the jump."""
        self.machine.jump(self.axis, -round(self.fault.size or 0))
        return []


class CurrentOffset(NodeInjection):
    """Offset of the current sensor."""

    def begin(self) -> None:
        """Add the offset."""
        self.machine.offsets[self.axis] = round(self.fault.size or 0)

    def end(self) -> list[CanFrame]:
        """Remove the offset."""
        del self.machine.offsets[self.axis]
        return []


class CurrentClipped(NodeInjection):
    """Reduced range of the current sensor."""

    def begin(self) -> None:
        """Clip the readings."""
        self.machine.clips[self.axis] = round(self.fault.size or 0)

    def end(self) -> list[CanFrame]:
        """Restore the range."""
        del self.machine.clips[self.axis]
        return []


class CurrentStuck(NodeInjection):
    """Constant reading of the current sensor."""

    def begin(self) -> None:
        """Freeze the reading."""
        self.machine.freeze_current(self.axis)

    def end(self) -> list[CanFrame]:
        """Release the reading."""
        del self.machine.frozen[self.axis]
        return []


class PositionSlow(NodeInjection):
    """Slow refresh of the position, less often than its transmission."""

    places: tuple[int, ...] = POSITIONS

    def begin(self) -> None:
        """Reduce the refresh rate."""
        self.machine.renew(self.axis, self.places, (self.fault.size or 0.0) / 1000.0)

    def end(self) -> list[CanFrame]:
        """Restore the refresh rate."""
        self.machine.renew(self.axis, self.places, None)
        return []


class CurrentSlow(PositionSlow):
    """Slow refresh of the current, less often than its transmission."""

    places = CURRENTS


class BrakeClosed(NodeInjection):
    """Brake closed on an energised axis."""

    def begin(self) -> None:
        """Close the brake."""
        self.machine.press_brake(self.axis, 1)

    def end(self) -> list[CanFrame]:
        """Open the brake."""
        self.machine.press_brake(self.axis, -1)
        return []


class AxisWeak(NodeInjection):
    """Reduced torque of the motor."""

    def begin(self) -> None:
        """Reduce the torque."""
        self.machine.axes[self.axis].weaken(round(self.fault.size or 0))

    def end(self) -> list[CanFrame]:
        """Restore the torque."""
        self.machine.axes[self.axis].weaken(None)
        return []


class Pushed(NodeInjection):
    """External torque on the axis."""

    def begin(self) -> None:
        """Apply the torque."""
        self.machine.push(self.axis, self.fault.size or 0.0)

    def end(self) -> list[CanFrame]:
        """Remove the torque."""
        self.machine.push(self.axis, 0.0)
        return []


class _Disobedient(NodeInjection):
    """Disobedience of the drive to commands of the controlword.

    The reaction to the loss of a heartbeat is not affected (`sim_plant.drive.disobedience`).
    """

    disobedience = OBEDIENT

    def begin(self) -> None:
        """Start to ignore the commands."""
        self.node.disobedience = self.disobedience

    def end(self) -> list[CanFrame]:
        """Obey the next commands."""
        self.node.disobedience = OBEDIENT
        return []


class QuickStopIgnored(_Disobedient):
    """Quick stop without effect: the drive continues its move."""

    disobedience = Disobedience(ignored=frozenset({Command.QUICK_STOP}))


class DisableVoltageIgnored(_Disobedient):
    """Disable voltage without effect: the drive stops quickly but cannot be switched off."""

    disobedience = Disobedience(
        ignored=frozenset({Command.DISABLE_VOLTAGE, Command.SHUTDOWN, Command.SWITCH_ON}),
        keeps_voltage=True,
    )


class StopWithoutEffect(_Disobedient):
    """Stop without effect: the drive shows a stop and continues its move."""

    disobedience = Disobedience(runs_on=True)
