"""Process data objects (PDOs): transmitted without a request, on SYNC or on event.

Transmission types: 0 and 1...240 act on SYNC (a TPDO of type n every n-th, one of type 0 when its
data have changed; an RPDO takes effect at the next SYNC), 254 and 255 act at once. Only an
event-driven TPDO has inhibit time and event timer. Layouts are compiled when they change, so that a
SYNC costs one `struct` call per PDO.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.cob_id import FLAG, IDENTIFIER, INVALID, check_change
from sim_plant.canopen.eds import key
from sim_plant.canopen.emcy import ErrorCode
from sim_plant.canopen.object_dictionary import wrapped
from sim_plant.canopen.pdo_mapping import PdoMapping

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.canopen.emcy import Emergencies
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.canopen.timers import Timers

_SYNC_MAX = 240
_EVENT_MIN = 254


class Pdo:
    """Base of both directions: identifier, transmission type, layout.

    Parameters
    ----------
    dictionary : ObjectDictionary
    number : int
        From 0.
    base : int
        Index of the first communication record: 1400h or 1800h; mapping records are 200h higher.
    rewired : callable
        Called when the identifier or the type has changed.
    """

    def __init__(
        self, dictionary: ObjectDictionary, number: int, base: int, rewired: Callable[[], None]
    ) -> None:
        self._dictionary = dictionary
        self._parameters = base + number
        self._mapping = PdoMapping(
            dictionary, base + 0x200 + number, self._check_off, receives=base == 0x1400
        )
        self._rewired = rewired
        dictionary.guard(base + number, self._check)
        for index in (base + number, base + 0x200 + number):
            dictionary.react(index, lambda _subindex, _value: self.configure())
        self._load()

    def configure(self) -> None:
        """Apply the present configuration in the dictionary."""
        self._load()
        self._rewired()

    def _load(self) -> None:
        identifier = self._dictionary.get(self._parameters, 1)
        self.enabled = not identifier & INVALID
        self.answers_remote = not identifier & FLAG
        self.identifier = identifier & IDENTIFIER
        self.transmission = self._dictionary.get(self._parameters, 2)
        self._layout, self._entries = self._mapping.compile()
        self._size = self._layout.size

    def _check_off(self) -> None:
        """Refuse changes of a mapping in use, unless the COB-ID is read-only."""
        on = not self._dictionary.get(self._parameters, 1) & INVALID
        if on and self._dictionary.entry(self._parameters, 1).writable:
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)

    def _check(self, subindex: int, value: int) -> None:
        if subindex == 1:
            check_change(self._dictionary.get(self._parameters, 1), value)
        unknown_type = subindex == 2 and _SYNC_MAX < value < _EVENT_MIN
        inhibit_in_use = subindex == 3 and self.enabled
        if unknown_type or inhibit_in_use:
            raise SdoAbort(AbortCode.INVALID_VALUE)

    @property
    def is_synchronous(self) -> bool:
        """True if the transmission type is synchronous."""
        return self.transmission <= _SYNC_MAX

    @property
    def answers_every_sync(self) -> bool:
        """True if the PDO is sent after every SYNC."""
        return False


class Rpdo(Pdo):
    """Receive PDO: objects written by the master."""

    def __init__(
        self,
        dictionary: ObjectDictionary,
        number: int,
        rewired: Callable[[], None],
        emergencies: Emergencies,
    ) -> None:
        self._emergencies = emergencies
        self.pending: bytes | None = None
        super().__init__(dictionary, number, 0x1400, rewired)

    def _load(self) -> None:
        super()._load()
        self._write = [self._dictionary.writer(e.index, e.subindex) for e in self._entries]

    def receive(self, data: bytes) -> None:
        """Apply a frame now, or keep it for the next SYNC."""
        if len(data) < self._size:
            self._emergencies.report(ErrorCode.PDO_TOO_SHORT)
            return
        if len(data) > self._size:
            self._emergencies.report(ErrorCode.PDO_TOO_LONG)
        if self.is_synchronous:
            self.pending = data
        else:
            self._apply(data)

    def act_on_sync(self) -> None:
        """Apply the frame received since the last SYNC."""
        data, self.pending = self.pending, None
        if data is not None and len(data) >= self._size:
            self._apply(data)

    def stop(self) -> None:
        """Discard a frame not yet applied."""
        self.pending = None

    def _apply(self, data: bytes) -> None:
        values = self._layout.unpack_from(data)
        for write, value in zip(self._write, values, strict=True):
            try:
                write(value)
            except SdoAbort:
                self._emergencies.report(ErrorCode.PDO_VALUE)


class Report(NamedTuple):
    """TPDO sent after every SYNC.

    Attributes
    ----------
    identifier : int
    data : callable
        Returns the present data.
    imaged : tuple of (int, str), or None
        Slots of the values in the image, with struct codes; None if a value has no slot.
    """

    identifier: int
    data: Callable[[], bytes]
    imaged: tuple[tuple[int, str], ...] | None


class Tpdo(Pdo):
    """Transmit PDO: objects sent by the node."""

    def __init__(
        self,
        dictionary: ObjectDictionary,
        number: int,
        rewired: Callable[[], None],
        emit: Callable[[int, bytes], None],
        timers: Timers,
    ) -> None:
        self._emit = emit
        self._timers = timers
        self._inhibit_name = (dictionary.owner, "inhibit", number)
        self._event_name = (dictionary.owner, "event", number)
        self._inhibited = False
        self._last: bytes | None = None
        self._countdown = 0
        super().__init__(dictionary, number, 0x1800, rewired)

    def _load(self) -> None:
        super()._load()
        self._read = self._dictionary.row_reader([key(e.index, e.subindex) for e in self._entries])
        self._inhibit = self._dictionary.get(self._parameters, 3) / 10_000
        self._event = self._dictionary.get(self._parameters, 5) / 1000
        self.stop()

    def stop(self) -> None:
        """Forget the data sent, and stop all timers."""
        self._timers.stop(self._inhibit_name)
        self._timers.stop(self._event_name)
        self._inhibited = False
        self._last = None
        self._countdown = max(1, self.transmission)

    @property
    def answers_every_sync(self) -> bool:
        """True if the PDO is sent after every SYNC."""
        return self.transmission == 1

    def report(self) -> Report:
        """Return identifier and contents of the answer to SYNC."""
        found = [(self._dictionary.slot(key(e.index, e.subindex)), e.code) for e in self._entries]
        imaged = tuple((slot, code) for slot, code in found if slot is not None)
        whole = len(imaged) == len(found)
        return Report(self.identifier, self._data, imaged if whole else None)

    def act_on_sync(self) -> None:
        """Send on this SYNC if the transmission type asks for it."""
        if self.transmission == 0:
            self._send_changed()
        else:
            self._send_nth()

    def _send_changed(self) -> None:
        data = self._data()
        if data != self._last:
            self._last = data
            self._emit(self.identifier, data)

    def _send_nth(self) -> None:
        self._countdown -= 1
        if self._countdown == 0:
            self._countdown = self.transmission
            self._emit(self.identifier, self._data())

    def event(self) -> None:
        """Send if the data have changed and the inhibit time is over."""
        if not self._inhibited:
            data = self._data()
            if data != self._last:
                self._send(data)

    def answer_remote(self) -> None:
        """Answer a remote frame."""
        self._emit(self.identifier, self._data())

    def _send(self, data: bytes) -> None:
        self._last = data
        self._emit(self.identifier, data)
        if self._inhibit:
            self._inhibited = True
            self._timers.start(self._inhibit_name, self._inhibit, self._release)
        if self._event:
            self._timers.start(self._event_name, self._event, self._elapse)

    def _release(self) -> None:
        self._inhibited = False
        self.event()

    def _elapse(self) -> None:
        self._send(self._data())

    def _data(self) -> bytes:
        values = self._read()
        try:
            return self._layout.pack(*values)
        except struct.error:
            fitting = zip(self._entries, values, strict=True)
            return self._layout.pack(*[wrapped(entry.code, value) for entry, value in fitting])
