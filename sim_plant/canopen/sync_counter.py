"""SYNC counter (CiA 301): a node with 1019h set does not act on a SYNC without a counter.

1019h is 0 (no counter) or the value after which the producer begins again at 1. It cannot be
changed while there is a communication cycle period (1006h).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.emcy import ErrorCode

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.emcy import Emergencies
    from sim_plant.canopen.object_dictionary import ObjectDictionary


class SyncCounter:
    """Check of the counter in SYNC by a node.

    Parameters
    ----------
    dictionary : ObjectDictionary
    emergencies : Emergencies
    rewired : callable
        Called when `expected` has changed.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        emergencies: Emergencies,
        rewired: Callable[[], None],
    ) -> None:
        self._dictionary = dictionary
        self._emergencies = emergencies
        dictionary.guard(0x1019, self._check)
        dictionary.react(0x1019, lambda _subindex, _value: rewired())

    @property
    def expected(self) -> bool:
        """True if SYNC must have a counter."""
        return self._dictionary.get(0x1019) != 0

    def miss(self) -> None:
        """Receive a SYNC without counter."""
        self._emergencies.raise_error(ErrorCode.SYNC_LENGTH)

    def take(self) -> None:
        """Receive a SYNC with counter."""
        self._emergencies.clear(ErrorCode.SYNC_LENGTH)

    def _check(self, _subindex: int, value: int) -> None:
        if value == 1:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        if self._dictionary.get(0x1006):
            raise SdoAbort(AbortCode.DEVICE_STATE)
