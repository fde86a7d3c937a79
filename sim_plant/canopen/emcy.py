"""Emergencies of a node (CiA 301): EMCY message, error register 1001h, history 1003h.

An error is raised once and stays active until it is cleared. The error register is the union of all
active errors' bits. When the last one goes, an EMCY with code 0000h reports it.
"""

from __future__ import annotations

import enum
import functools
import struct
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.cob_id import IDENTIFIER, INVALID, check_change

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.object_dictionary import ObjectDictionary

_HISTORY = 8


class ErrorCode(enum.IntEnum):
    """Error codes of CiA 301 and CiA 402 raised by the drives without an injected fault.

    PDO_VALUE is a protocol error. Injected faults may have any code.
    """

    UNDER_VOLTAGE = 0x3220
    COMMUNICATION = 0x8100
    HEARTBEAT_LOST = 0x8130
    PDO_VALUE = 0x8200
    PDO_TOO_SHORT = 0x8210
    PDO_TOO_LONG = 0x8220
    SYNC_LENGTH = 0x8240
    FOLLOWING_ERROR = 0x8611
    POSITION_LIMIT = 0x8612


_GENERIC = 0x01
_REGISTER_BITS = {
    0x2: 0x02,
    0x3: 0x04,
    0x4: 0x08,
    0x81: 0x10,
    0x82: 0x10,
    0x84: 0x20,
    0x85: 0x20,
    0x86: 0x20,
    0xFF: 0x80,
}
"""Error register by the code's first digit or two: current (1), voltage (2), temperature (3),
communication (4), drive profile (5), maker (7); beside the generic bit."""


class Emergencies:
    """Active errors and their history."""

    def __init__(self, dictionary: ObjectDictionary, emit: Callable[[int, bytes], None]) -> None:
        self._dictionary = dictionary
        self._emit = emit
        self._active: set[int] = set()
        self.enabled = False
        dictionary.guard(0x1003, self._only_clear)
        dictionary.react(0x1003, self._forget)
        dictionary.source(0x1001, 0, self._register)
        dictionary.source(0x1003, 0, lambda: len(self._history))
        for subindex in range(1, _HISTORY + 1):
            dictionary.source(0x1003, subindex, functools.partial(self._read_history, subindex))
        dictionary.guard(0x1014, self._check_identifier)
        self._history: list[int] = []

    @property
    def active(self) -> frozenset[int]:
        """Codes of all errors now present."""
        return frozenset(self._active)

    def raise_error(self, code: int) -> None:
        """Report an error unless already present."""
        if code not in self._active:
            self._active.add(code)
            self.report(code)

    def report(self, code: int) -> None:
        """Report an event without lasting error."""
        self._history = [code, *self._history][:_HISTORY]
        self._dictionary.set(0x603F, 0, code)
        self._send(code, self._register() | _bits(code))

    def clear(self, code: int) -> None:
        """Clear an error; after the last error is cleared, an EMCY reports it."""
        if code in self._active:
            self._active.remove(code)
            if not self._active:
                self._dictionary.set(0x603F, 0, 0)
                self._send(0, 0)

    def clear_all(self) -> None:
        """Clear all errors."""
        for code in sorted(self._active):
            self.clear(code)

    def reset(self) -> None:
        """Forget everything, as at power-on."""
        self._active.clear()
        self._history.clear()

    def _register(self) -> int:
        register = 0
        for code in self._active:
            register |= _bits(code)
        return register

    def _send(self, code: int, register: int) -> None:
        identifier = self._dictionary.get(0x1014)
        if self.enabled and not identifier & INVALID:
            self._emit(identifier & IDENTIFIER, struct.pack("<HB5x", code, register))

    def _read_history(self, subindex: int) -> int:
        if subindex > len(self._history):
            raise SdoAbort(AbortCode.NO_DATA)
        return self._history[subindex - 1]

    def _check_identifier(self, _subindex: int, value: int) -> None:
        check_change(self._dictionary.get(0x1014), value)

    def _only_clear(self, _subindex: int, value: int) -> None:
        if value != 0:
            raise SdoAbort(AbortCode.INVALID_VALUE)

    def _forget(self, _subindex: int, _value: int) -> None:
        self._history.clear()


def _bits(code: int) -> int:
    return _GENERIC | _REGISTER_BITS.get(code >> 12, 0) | _REGISTER_BITS.get(code >> 8, 0)
