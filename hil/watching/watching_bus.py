"""A bus whose samples are watched for torques from outside, whatever moves on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.drive_bus import Tripped
from hil.measuring.feeding import BusInFront

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drive_bus import DriveBus, Sample
    from hil.results.watch import Alarm
    from hil.watching.watcher import Watcher


class WatchingBus(BusInFront):
    """A `drivers.drive_bus.StreamingBus` in front of another one.

    Parameters
    ----------
    bus : DriveBus
        Not entered yet.
    watcher : Watcher
    show : callable
        Takes each alarm as it begins; and None after every sample without one.
    stop : bool
        Stop all axes at the first alarm: it is raised as `Tripped`, and who leaves the bus with it
        has the axes stopped and switched off.
    """

    def __init__(
        self,
        bus: DriveBus,
        watcher: Watcher,
        show: Callable[[Alarm | None], None],
        *,
        stop: bool = False,
    ) -> None:
        super().__init__(bus)
        self._watcher = watcher
        self._show = show
        self._stop = stop

    def sample(self) -> Sample:
        """Wait for the next SYNC, and judge what has come.

        Raises
        ------
        Tripped
            There is an alarm at which the axes are to be stopped.
        """
        sample = self._bus.sample()
        alarms = self._watcher.take(sample)
        if alarms and self._stop:
            raise Tripped(f"{in_words(alarms[0], self._watcher.unit(alarms[0]))}; all axes stop")
        for alarm in alarms or (None,):
            self._show(alarm)
        return sample


def in_words(alarm: Alarm, unit: str) -> str:
    """Axis, instant, size and estimate of an alarm."""
    return (
        f"axis {alarm.axis}: {alarm.torque:+.3g} {unit} from outside at {alarm.time:.3f} s, in a"
        f" mean over {1e3 * alarm.window:.0f} ms; threshold {alarm.threshold:.3g} {unit}"
    )
