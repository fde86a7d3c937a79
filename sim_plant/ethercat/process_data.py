"""Process data of a drive: mappings assigned by 1C12h and 1C13h, sizes, exchange of values.

Assignment and mappings are changed in PREOP, with the number of entries set to zero first, and
applied on the way to SAFEOP. From SAFEOP on every cycle exchanges all mapped objects. The
controlword acts last, after the other values of its frame.
"""

from __future__ import annotations

import struct
from operator import itemgetter
from typing import TYPE_CHECKING

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.eds import key
from sim_plant.canopen.emcy import ErrorCode
from sim_plant.canopen.object_dictionary import wrapped
from sim_plant.canopen.pdo_mapping import PdoMapping
from sim_plant.ethercat.objects import ASSIGNED_IN, ASSIGNED_OUT, PDOS, RECEIVED, SENT

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from sim_plant.canopen.eds import Entry
    from sim_plant.canopen.emcy import Emergencies
    from sim_plant.canopen.object_dictionary import ObjectDictionary

SIZE_MAX = 256
"""Maximum bytes in one direction: four mappings of eight objects have 128 at most."""
_CONTROLWORD, _TARGET = 0x6040, 0x607A
_EVERY_CYCLE = (_CONTROLWORD, _TARGET)
"""Objects that act in every cycle; others act on a change."""


class ProcessData:
    """Outputs (from the master) and inputs of a drive.

    Parameters
    ----------
    dictionary : ObjectDictionary
    emergencies : Emergencies
    is_fixed : callable
        Returns True while assignment and mappings must not be changed.

    Attributes
    ----------
    is_taken : bool
        True if the outputs were accepted unchanged, without another write since.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        emergencies: Emergencies,
        is_fixed: Callable[[], bool],
    ) -> None:
        self._dictionary = dictionary
        self._emergencies = emergencies
        self._is_fixed = is_fixed
        self._mappings = {
            index: PdoMapping(
                dictionary,
                index,
                self._check_free,
                receives=base == RECEIVED,
                bytes_max=SIZE_MAX,
            )
            for base in (RECEIVED, SENT)
            for index in range(base, base + PDOS)
        }
        for index, base in ((ASSIGNED_OUT, RECEIVED), (ASSIGNED_IN, SENT)):
            dictionary.guard(index, self._assignment_check(index, base))
        self.compile()

    def compile(self) -> None:
        """Apply the present assignment and mappings."""
        received, self._outputs = self._layout(ASSIGNED_OUT)
        sent, self._inputs = self._layout(ASSIGNED_IN)
        self._received, self._sent = struct.Struct(received), struct.Struct(sent)
        writers = [self._dictionary.writer(e.index, e.subindex) for e in self._outputs]
        order = sorted(range(len(writers)), key=lambda n: self._outputs[n].index == _CONTROLWORD)
        self._writers = [(n, writers[n], self._outputs[n].index in _EVERY_CYCLE) for n in order]
        numbers = [key(e.index, e.subindex) for e in self._inputs]
        self._read = self._dictionary.row_reader(numbers)
        slots = [slot for n in numbers if (slot := self._dictionary.slot(n)) is not None]
        imaged = len(slots) == len(numbers) > 1
        self._pick = itemgetter(*slots) if imaged else None
        self.forget()

    @property
    def sizes(self) -> tuple[int, int]:
        """Bytes of outputs and inputs by the present assignment and mappings."""
        received, sent = self._layout(ASSIGNED_OUT)[0], self._layout(ASSIGNED_IN)[0]
        return struct.calcsize(received), struct.calcsize(sent)

    def forget(self) -> None:
        """Treat the next outputs as changed."""
        self._last: tuple[int, ...] = ()
        self.is_taken = False

    def act(self, memory: bytearray, start: int, size: int) -> None:
        """Apply the outputs in a part of a memory."""
        if size < self._received.size:
            return
        self.is_taken = True
        values = self._received.unpack_from(memory, start)
        last, self._last = self._last, values
        for n, write, always in self._writers:
            if always or not last or values[n] != last[n]:
                try:
                    write(values[n])
                except SdoAbort:
                    self.is_taken = False  # every further attempt is refused, too
                    self._emergencies.report(ErrorCode.PDO_VALUE)

    def latch(self, image: Sequence[int]) -> bytes:
        """Return the present inputs, taken from the latched process image of all axes."""
        values = self._pick(image) if self._pick is not None else self._read()
        try:
            return self._sent.pack(*values)
        except struct.error:
            fitting = zip(self._inputs, values, strict=True)
            return self._sent.pack(*[wrapped(entry.code, value) for entry, value in fitting])

    def _layout(self, assignment: int) -> tuple[str, tuple[Entry, ...]]:
        layout = "<"
        entries: tuple[Entry, ...] = ()
        for subindex in range(1, self._dictionary.get(assignment) + 1):
            mapping = self._mappings.get(self._dictionary.get(assignment, subindex))
            if mapping is not None:
                one, mapped = mapping.compile()
                layout += one.format.lstrip("<")
                entries += mapped
        return layout, entries

    def _check_free(self) -> None:
        if self._is_fixed():
            raise SdoAbort(AbortCode.DEVICE_STATE)

    def _assignment_check(self, assignment: int, base: int) -> Callable[[int, int], None]:
        def check(subindex: int, value: int) -> None:
            self._check_free()
            if subindex == 0:
                numbers = [self._dictionary.get(assignment, n) for n in range(1, value + 1)]
                if len(set(numbers) - {0}) < len([number for number in numbers if number]):
                    raise SdoAbort(AbortCode.INCOMPATIBLE)
            elif self._dictionary.get(assignment) != 0:
                raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
            elif value and not base <= value < base + PDOS:
                raise SdoAbort(AbortCode.INVALID_VALUE)

        return check
