"""Stop of the axes, for a reason that latches.

After a trip nothing moves until it is ended on purpose (`Stopping.end`), and each SYNC commands the
axes to stay stopped. Speed and deceleration of an axis determine how far it may continue before its
voltage is disabled (`drivers.cia402.stop`), so a speed is rather estimated too high, and a
deceleration too low.
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
    """Shutdown with the largest speeds and decelerations of the axes, and its reason.

    Parameters
    ----------
    connection : Connection
        Connection to the drives.
    axes : sequence of Axis
        Axes in joint order.
    period : float
        Time between two SYNCs [s].
    profile, cyclic
        Possible motions of the axes.

    Attributes
    ----------
    trip : DriveError or None
        Reason of the stop.
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
        """Command all axes to stop, once; later SYNCs of this class supervise the stop."""
        if self.begun:
            return
        decelerations = [self._deceleration(axis) for axis in self._axes]
        speeds = self._bound_speeds()
        self._profile.active.clear()
        self._cyclic.abandon()
        self.begin(speeds, decelerations)

    def fail(self, trouble: DriveError) -> NoReturn:
        """Stop the axes, record the reason, and raise the error."""
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
            There was a trip; with its reason.
        """
        if self.trip is not None:
            raise Tripped(
                f"all axes were stopped and stay so until a deliberate reset(): {self.trip}"
            ) from self.trip

    def end(self, note: Callable[[Iterable[str]], None]) -> None:
        """Switch all axes off and permit motion again, if power-off is confirmed.

        Parameters
        ----------
        note : callable
            Receives messages for the operator.

        Raises
        ------
        DriveFault
            A drive does not confirm power-off; the trip stays.
        """
        with hold_interrupts():
            self.stop()
            self.switch_off()
            note(self.conclude())
        left = [axis.label for axis in self._axes if not self.off[axis.index]]
        if left:
            raise DriveFault(
                f"{', '.join(left)}: not confirmed off, so nothing is powered on again; leave "
                "the session, and check the drive"
            )
        note(self.problems)
        self.forget()
        self.trip = None

    def _bound_speeds(self) -> list[float]:
        """Return an upper bound of each axis's speed [rad/s or m/s]: measured or commanded."""
        try:
            speeds = []
            for axis, counts in zip(self._axes, self._process_data.speeds(), strict=True):
                # an unseen axis (inf) may have its limit; a jump of the encoder is not a speed
                unseen = math.isinf(counts)
                seen = axis.drive.limits.velocity if unseen else counts * axis.per_count
                commanded = (each.velocity(axis.index) for each in (self._cyclic, self._profile))
                speeds.append(max(*commanded, min(seen, fastest(axis.drive))))
        except Exception:  # no error may prevent the stop of the axes
            return [axis.drive.limits.velocity for axis in self._axes]
        return speeds

    def _deceleration(self, axis: Axis) -> float:
        """Return a lower bound of an axis's quick stop deceleration [rad/s^2 or m/s^2].

        As stated in the drives file, as held by the drive, or as commanded last.
        """
        slowest = SLOWEST_STOP * axis.stated.limits.acceleration
        ours = max(axis.stop_deceleration or axis.drive.limits.acceleration, slowest)
        if axis.server.missing & {objects.QUICK_STOP_OPTION, objects.QUICK_STOP_DECELERATION}:
            ours = min(ours, self._profile.deceleration(axis.index))  # the drive may use 6084
        return axis.stated.quick_stop_deceleration or ours
