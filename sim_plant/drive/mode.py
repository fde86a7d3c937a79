"""Modes of operation: the requested mode 6060h and the displayed mode 6061h with its lag.

There are profile position, homing and cyclic synchronous position. While a change is under way a
slow drive shows -1, and some refuse a change as long as halt (controlword bit 8) is set.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.drive.cia402_states import Control

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.canopen.timers import Timers
    from sim_plant.personality import Personality

PROFILE_POSITION, HOMING, CYCLIC_POSITION = 1, 6, 8
_CHANGING = -1


class ModeOfOperation:
    """Server of 6060h and 6061h.

    Parameters
    ----------
    dictionary : ObjectDictionary
    timers : Timers
    personality : Personality
    changed : callable
        Called when a mode was chosen.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        timers: Timers,
        personality: Personality,
        changed: Callable[[], None],
    ) -> None:
        self._dictionary = dictionary
        self._timers = timers
        self._lag = personality.mode_display_lag
        self._changing = False
        self._changed = changed
        dictionary.allow(0x6060, (PROFILE_POSITION, HOMING, CYCLIC_POSITION))
        if personality.mode_locked_by_halt:
            dictionary.guard(0x6060, self._refuse_while_halted)
        dictionary.react(0x6060, self._change)
        dictionary.source(0x6061, 0, self._display)

    def _refuse_while_halted(self, _subindex: int, _mode: int) -> None:
        if self._dictionary.get(0x6040) & Control.HALT:
            raise SdoAbort(AbortCode.DEVICE_STATE)

    def _change(self, _subindex: int, _mode: int) -> None:
        self._changed()
        if self._lag:
            self._changing = True
            self._timers.start((self._dictionary.owner, "mode"), self._lag, self._settle)

    def _settle(self) -> None:
        self._changing = False

    def _display(self) -> int:
        return _CHANGING if self._changing else self._dictionary.get(0x6060)
