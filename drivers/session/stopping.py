"""The stop of all axes: commanded once, for a reason that latches.

Nothing moves after a trip until it is ended on purpose (`Stopping.end`), and all that time
each SYNC sees to it that the axes stay stopped. How fast an axis may be and how its drive slows it
down decide how far it may go on before its voltage is disabled (`drivers.cia402.stop`), so a speed
is rather too high than too low, and a deceleration rather too low than too high.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NoReturn

from drivers.cia402 import objects
from drivers.cia402.shutdown import Shutdown
from drivers.commissioning.effective_limits import SLOWEST_STOP
from drivers.drive_bus import DriveFault, Tripped
from drivers.interrupts import hold_interrupts
from drivers.safety.trips import fastest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from drivers.axis import Axis
    from drivers.cia402.cyclic_position import CyclicPosition
    from drivers.cia402.profile_position import ProfilePosition
    from drivers.drive_bus import DriveError
    from drivers.session.connection import Connection


class Stopping(Shutdown):
    """A shutdown that knows how fast axes may be and how they slow down, and remembers its reason.

    Parameters
    ----------
    connection : Connection
        To the drives.
    axes : sequence of Axis
        In joint order.
    period : float
        Time between two SYNCs [s].
    profile, cyclic
        What may be moving the axes.

    Attributes
    ----------
    trip : DriveError or None
        Why all axes were stopped.
    """

    def __init__(
        self,
        connection: Connection,
        axes: Sequence[Axis],
        period: float,
        profile: ProfilePosition,
        cyclic: CyclicPosition,
    ) -> None:
        data, life_sign = connection.process_data, connection.life_sign
        super().__init__(data, life_sign, axes, period, connection.power.switch_off)
        self.trip: DriveError | None = None
        self._profile, self._cyclic = profile, cyclic

    def stop(self) -> None:
        """Command all axes to stop, once; each SYNC that passes here sees to it from then on."""
        if self.begun:
            return
        decelerations = [self._deceleration(axis) for axis in self._axes]
        speeds = self._speeds()
        self._profile.active.clear()
        self._cyclic.abandon()
        self.begin(speeds, decelerations)

    def fail(self, trouble: DriveError) -> NoReturn:
        """Bring all axes to rest, remember why, and raise it."""
        if self.trip is None:
            self.stop()
            self.trip = trouble
            self.await_rest()
        raise trouble

    def refuse(self) -> None:
        """Refuse to move after a trip.

        Raises
        ------
        Tripped
            There was one, with its reason.
        """
        if self.trip is not None:
            raise Tripped(
                f"all axes were stopped and stay so until a deliberate reset(): {self.trip}"
            ) from self.trip

    def end(self, note: Callable[[Iterable[str]], None]) -> None:
        """Switch all axes off and allow motion again, where all have shown that they are off.

        Parameters
        ----------
        note : callable
            Takes what the operator should know.

        Raises
        ------
        DriveFault
            A drive does not show it; the trip stays.
        """
        with hold_interrupts():
            self.stop()
            self.switch_off()
            note(self.conclude())
        left = [axis.label for axis in self._axes if not self.off[axis.index]]
        if left:
            raise DriveFault(
                f"{', '.join(left)}: not shown to be off, so nothing is powered on again; leave, "
                "and check the drive"
            )
        note(self.problems)
        self.forget()
        self.trip = None

    def _speeds(self) -> list[float]:
        """Return how fast each axis may be [rad/s or m/s]: as measured, or commanded if faster."""
        try:
            seen = self._process_data.speeds()
            return [self._speed(axis, seen[axis.index]) for axis in self._axes]
        except Exception:  # nothing may keep the axes from being stopped
            return [axis.drive.limits.velocity for axis in self._axes]

    def _speed(self, axis: Axis, counts: float) -> float:
        """Return the speed of one axis whose encoder shows `counts` [increments/s], inf: unseen."""
        seen = axis.drive.limits.velocity if math.isinf(counts) else counts * axis.per_count
        commanded = (each.velocity(axis.index) for each in (self._cyclic, self._profile))
        return max(*commanded, min(seen, fastest(axis.drive)))  # a jump of the encoder is none

    def _deceleration(self, axis: Axis) -> float:
        """Return how an axis slows down in a quick stop [rad/s^2 or m/s^2].

        As the drives file states it, as the drive has it, or as the axis was moved.
        """
        slowest = SLOWEST_STOP * axis.stated.limits.acceleration
        ours = max(axis.stop_deceleration or axis.drive.limits.acceleration, slowest)
        if axis.server.missing & {objects.QUICK_STOP_OPTION, objects.QUICK_STOP_DECELERATION}:
            ours = min(ours, self._profile.deceleration(axis.index))  # it may take that of 6084
        return axis.stated.quick_stop_deceleration or ours
