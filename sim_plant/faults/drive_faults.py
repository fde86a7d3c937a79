"""Faults of a drive: of its firmware, its supply, its sensors and its motor."""

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
    """The drive sends an emergency and works on."""

    def begin(self) -> None:
        """Send it."""
        self.node.emergencies.report(self.fault.code or 0)


class Failed(NodeInjection):
    """The drive falls into a fault."""

    def begin(self) -> None:
        """Fall."""
        self.node.fail(self.fault.code or 0)


class Reset(NodeInjection):
    """The node restarts, as its watchdog has it."""

    def begin(self) -> None:
        """Restart."""
        self.node.restart()


class NodeBusOff(NodeInjection):
    """The node is cut off the bus and works on."""

    def begin(self) -> None:
        """Leave the bus."""
        self.node.connect(False)

    def end(self) -> list[CanFrame]:
        """Come back."""
        self.node.connect(True)
        return []

    def outgoing(self, frames: list[CanFrame]) -> list[CanFrame]:
        """Drop what comes from this node."""
        return [frame for frame in frames if frame[1] & _NODE != self.node.node_id]


class VoltageLost(NodeInjection):
    """The DC link is gone, the controller lives."""

    def begin(self) -> None:
        """Lose it."""
        self.node.lose_voltage()

    def end(self) -> list[CanFrame]:
        """Have it again."""
        self.node.regain_voltage()
        return []


class SupplyLost(NodeBusOff):
    """The node is dead."""

    def begin(self) -> None:
        """Die."""
        super().begin()
        self.node.lose_voltage()

    def end(self) -> list[CanFrame]:
        """Boot."""
        super().end()
        self.node.regain_voltage()
        self.node.restart()
        return []


class EncoderJump(NodeInjection):
    """The encoder shows another angle than before."""

    def begin(self) -> None:
        """Jump."""
        self.machine.jump(self.axis, round(self.fault.size or 0))

    def end(self) -> list[CanFrame]:
        """Jump back."""
        self.machine.jump(self.axis, -round(self.fault.size or 0))
        return []


class CurrentOffset(NodeInjection):
    """The current sensor shows too much."""

    def begin(self) -> None:
        """Show too much."""
        self.machine.offsets[self.axis] = round(self.fault.size or 0)

    def end(self) -> list[CanFrame]:
        """Show what is."""
        del self.machine.offsets[self.axis]
        return []


class CurrentClipped(NodeInjection):
    """The current sensor has a small range."""

    def begin(self) -> None:
        """Clip."""
        self.machine.clips[self.axis] = round(self.fault.size or 0)

    def end(self) -> list[CanFrame]:
        """Show what is."""
        del self.machine.clips[self.axis]
        return []


class CurrentStuck(NodeInjection):
    """The current sensor shows one value."""

    def begin(self) -> None:
        """Stick."""
        self.machine.freeze_current(self.axis)

    def end(self) -> list[CanFrame]:
        """Show what is."""
        del self.machine.frozen[self.axis]
        return []


class PositionSlow(NodeInjection):
    """The drive renews its position less often than it sends it."""

    places: tuple[int, ...] = POSITIONS

    def begin(self) -> None:
        """Renew it now and then."""
        self.machine.renew(self.axis, self.places, (self.fault.size or 0.0) / 1000.0)

    def end(self) -> list[CanFrame]:
        """Show what is."""
        self.machine.renew(self.axis, self.places, None)
        return []


class CurrentSlow(PositionSlow):
    """The drive renews its current less often than it sends it."""

    places = CURRENTS


class BrakeClosed(NodeInjection):
    """The brake closes on an energised axis."""

    def begin(self) -> None:
        """Close."""
        self.machine.press_brake(self.axis, 1)

    def end(self) -> list[CanFrame]:
        """Open."""
        self.machine.press_brake(self.axis, -1)
        return []


class AxisWeak(NodeInjection):
    """The motor has little strength left."""

    def begin(self) -> None:
        """Weaken."""
        self.machine.axes[self.axis].weaken(round(self.fault.size or 0))

    def end(self) -> list[CanFrame]:
        """Recover."""
        self.machine.axes[self.axis].weaken(None)
        return []


class Pushed(NodeInjection):
    """Something pushes the axis from outside."""

    def begin(self) -> None:
        """Push."""
        self.machine.push(self.axis, self.fault.size or 0.0)

    def end(self) -> list[CanFrame]:
        """Let go."""
        self.machine.push(self.axis, 0.0)
        return []


class _Disobedient(NodeInjection):
    """The drive does not do all that its controlword commands.

    Its reaction to the loss of a heartbeat works all the same (`sim_plant.drive.disobedience`).
    """

    disobedience = OBEDIENT

    def begin(self) -> None:
        """Disobey."""
        self.node.disobedience = self.disobedience

    def end(self) -> list[CanFrame]:
        """Obey the commands to come."""
        self.node.disobedience = OBEDIENT
        return []


class QuickStopIgnored(_Disobedient):
    """The drive goes on with its move at a quick stop."""

    disobedience = Disobedience(ignored=frozenset({Command.QUICK_STOP}))


class DisableVoltageIgnored(_Disobedient):
    """The drive stops quickly but cannot be switched off."""

    disobedience = Disobedience(
        ignored=frozenset({Command.DISABLE_VOLTAGE, Command.SHUTDOWN, Command.SWITCH_ON}),
        keeps_voltage=True,
    )


class StopWithoutEffect(_Disobedient):
    """The drive shows that it stops, and does not."""

    disobedience = Disobedience(runs_on=True)
