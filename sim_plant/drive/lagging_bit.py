"""Lagging bit of the statusword, as shown by slow firmware."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

    from sim_plant.canopen.timers import Timers


class LaggingBit:
    """Delayed display of a condition.

    Parameters
    ----------
    timers : Timers
    name : hashable
        Name of the timer.
    rise, fall : float
        Lags of setting and clearing [s]; 0 for none.
    changed : callable
        Called when `shown` has changed after a lag.

    Attributes
    ----------
    shown : bool
    """

    def __init__(
        self,
        timers: Timers,
        name: Hashable,
        rise: float,
        fall: float,
        changed: Callable[[], None],
    ) -> None:
        self.shown = False
        self._timers = timers
        self._name = name
        self._lags = {True: rise, False: fall}
        self._changed = changed
        self._wanted = False

    def set(self, condition: bool) -> None:
        """Update the condition."""
        if condition is self._wanted:
            return
        self._wanted = condition
        self._timers.stop(self._name)
        lag = self._lags[condition]
        if lag and condition is not self.shown:
            self._timers.start(self._name, lag, self._follow)
        else:
            self.shown = condition

    def clear(self) -> None:
        """Clear bit and condition at once."""
        self._timers.stop(self._name)
        self._wanted = self.shown = False

    def _follow(self) -> None:
        self.shown = self._wanted
        self._changed()
