"""Target reached: the actual position inside the position window 6067h for the time of 6068h."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.canopen.timers import Timers
    from sim_plant.drive.process_image import AxisImage

_OFF = 0xFFFF_FFFF


class TargetWindow:
    """Detection of target reached.

    Attributes
    ----------
    reached : bool
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        timers: Timers,
        image: AxisImage,
        changed: Callable[[], None],
    ) -> None:
        self._dictionary = dictionary
        self._timers = timers
        self._image = image
        self._changed = changed
        self._name = (dictionary.owner, "position window")
        self._target = 0
        self._inside = False
        self.reached = False
        self.close()

    def close(self) -> None:
        """Stop watching; the target counts as not reached."""
        self._timers.stop(self._name)
        self._open = self._inside = self.reached = False
        self._image.expect_nothing()

    def open(self, target: int) -> None:
        """Watch for `target` from the next observation on."""
        self.close()
        self._target = target
        self._open = True
        self.attend()

    def observe(self, position: int) -> None:
        """Process an actual position."""
        if not self._open:
            return
        width = self._dictionary.get(0x6067)
        inside = width == _OFF or abs(position - self._target) <= width
        if inside and not self._inside:
            self._enter(width)
        elif not inside:
            self._timers.stop(self._name)
            self.reached = False
            self.attend()
        self._inside = inside

    def attend(self) -> None:
        """Request every position from the process image."""
        self._image.expect_anything()

    def _enter(self, width: int) -> None:
        self._image.expect_within(self._target - width, self._target + width)
        time = self._dictionary.get(0x6068)
        if time:
            self._timers.start(self._name, time / 1000, self._reach)
        else:
            self.reached = True

    def _reach(self) -> None:
        self.reached = True
        self._changed()
