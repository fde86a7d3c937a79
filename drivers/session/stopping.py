"""The stop of all axes: commanded once, for a reason that latches.

Nothing moves after a trip until it is ended on purpose (`Stopping.end`), and all that time
each SYNC sees to it that the axes stay stopped. How fast an axis may be and how its drive slows it
down decide how far it may go on before its voltage is disabled (`drivers.cia402.stop`), so a speed
is rather too high than too low, and a deceleration rather too low than too high.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NoReturn

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.cia402.shutdown import Shutdown
from drivers.commissioning.effective_limits import SLOWEST_STOP
from drivers.drive_bus import DriveFault, Tripped
from drivers.interrupts import interrupts_held
from drivers.safety.trips import SPEED_SHARE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from drivers.cia402.cyclic_position import CyclicPosition
    from drivers.cia402.profile_position import ProfilePosition
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drive_bus import DriveError
    from drivers.drives_file import DrivesFile
    from drivers.session.connection import Connection


class Stopping:
    """Stops all axes and remembers why.

    Parameters
    ----------
    connection : Connection
        To the drives.
    drives : DrivesFile
        The axes as they are stated.
    period : float
        Time between two SYNCs [s].
    limits : sequence of EffectiveLimits
        Those that hold.
    profile_position, cyclic_position
        What may be moving the axes.

    Attributes
    ----------
    shutdown : Shutdown
        Sees to it that the axes stop, and switches them off.
    trip : DriveError or None
        Why all axes were stopped.
    """

    def __init__(
        self,
        connection: Connection,
        drives: DrivesFile,
        period: float,
        limits: Sequence[EffectiveLimits],
        profile_position: ProfilePosition,
        cyclic_position: CyclicPosition,
    ) -> None:
        self.trip: DriveError | None = None
        self.shutdown = Shutdown(
            connection.process_data,
            connection.heartbeats,
            connection.servers,
            drives.axes,
            period,
            drives.heartbeat_timeout,
            connection.power.switch_off,
        )
        self._process_data = connection.process_data
        self._servers = connection.servers
        self._stated = drives.axes
        self._limits = limits
        self._limited = [limit.of(axis) for limit, axis in zip(limits, drives.axes, strict=True)]
        self._profile_position = profile_position
        self._cyclic_position = cyclic_position

    def stop(self) -> None:
        """Command all axes to stop, once; from then on `shutdown` sees to it."""
        if self.shutdown.begun:
            return
        axes = range(len(self._stated))
        decelerations = [self._deceleration(axis) for axis in axes]
        speeds = self._speeds()
        self._profile_position.active.clear()
        self._cyclic_position.abandon()
        self.shutdown.begin(speeds, decelerations)

    def fail(self, trouble: DriveError) -> NoReturn:
        """Bring all axes to rest, remember why, and raise it."""
        if self.trip is None:
            self.stop()
            self.trip = trouble
            self.shutdown.await_rest()
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

    def supervise(self) -> None:
        """See to it for one SYNC that stopped axes stay so, and refuse (see `refuse`)."""
        self.shutdown.supervise()
        self.refuse()

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
        with interrupts_held():
            self.stop()
            self.shutdown.switch_off()
            note(self.shutdown.conclude())
        pairs = zip(self._servers, self.shutdown.off, strict=True)
        left = [server.label for server, off in pairs if not off]
        if left:
            raise DriveFault(
                f"{', '.join(left)}: not shown to be off, so nothing is powered on again; leave, "
                "and check the drive"
            )
        note(self.shutdown.problems)
        self.shutdown.forget()
        self.trip = None

    def _speeds(self) -> list[float]:
        """Return how fast each axis may be [rad/s or m/s]: as measured, or commanded if faster."""
        try:
            measured = self._process_data.speeds()
            return [self._speed(axis, counts) for axis, counts in enumerate(measured)]
        except Exception:  # nothing may keep the axes from being stopped
            return [axis.limits.velocity for axis in self._limited]

    def _speed(self, axis: int, counts: float) -> float:
        """Return the speed of one axis whose encoder shows `counts` [increments/s], inf: unseen."""
        drive = self._limited[axis]
        limit = drive.limits.velocity
        seen = limit if math.isinf(counts) else counts * abs(AxisScale.of(drive).position)
        fastest = drive.trip.velocity or SPEED_SHARE * limit  # a jump of the encoder is none
        planned = self._cyclic_position.velocity(axis), self._profile_position.velocity(axis)
        return max(*planned, min(seen, fastest))

    def _deceleration(self, axis: int) -> float:
        """Return how an axis slows down in a quick stop [rad/s^2 or m/s^2].

        As the drives file states it, as the drive has it, or as the axis was moved.
        """
        stated, holding, server = self._stated[axis], self._limits[axis], self._servers[axis]
        slowest = SLOWEST_STOP * stated.limits.acceleration
        ours = max(holding.stop_deceleration or holding.limits.acceleration, slowest)
        if server.missing & {objects.QUICK_STOP_OPTION, objects.QUICK_STOP_DECELERATION}:
            ours = min(ours, self._profile_position.deceleration(axis))  # it may take that of 6084
        return stated.quick_stop_deceleration or ours
