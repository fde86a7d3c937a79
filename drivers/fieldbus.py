"""Interface between the drive profile (CiA 402) and a fieldbus.

A drive of this profile consists of an object dictionary and process data: statusword, position and
current arrive with each SYNC, target and controlword are sent. CANopen carries both
(`drivers.canopen`), and so does CANopen over EtherCAT (`drivers.ethercat`). `drivers.cia402` and
`drivers.safety` see objects (`drivers.remote_dictionary`), process data (`drivers.cycle_data`) and
a sign of life; the further needs of sessions and tools are in
`drivers.session.connection.Fieldbus`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from drivers.drive_bus import DriveError

PacingName = Literal["auto", "lock-step", "wall-clock"]
"""Source of SYNC's time: auto selects lock-step where the bus offers lock-step."""
TOO_LATE = 0.5
"""Largest delay of a SYNC as a share of the period; beyond it the deadline counts as missed."""
_PROFILES = 0x2000
"""First index after the communication objects."""


@dataclass(frozen=True, slots=True)
class Entry:
    """Numeric entry of an object dictionary.

    Attributes
    ----------
    index, subindex : int
        Address of the entry.
    type : str
        u8, u16, u32, i8, i16 or i32; f32 for measured values only.
    name : str
        Name in messages.
    """

    index: int
    subindex: int
    type: str
    name: str

    def shown(self, value: int) -> str:
        """Return a value as text; identifiers (COB-ID) and mappings in hexadecimal."""
        hexadecimal = self.index < _PROFILES and (value > 0xFFFF or "COB-ID" in self.name)
        return f"{value:08X}h" if hexadecimal else f"{value}"

    @property
    def key(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.subindex

    @property
    def place(self) -> str:
        """Index and sub-index as text, such as 6041:00."""
        return f"{self.index:04X}:{self.subindex:02X}"

    @property
    def bits(self) -> int:
        """Length [bits]."""
        return int(self.type[1:])

    @property
    def size(self) -> int:
        """Length [bytes]."""
        return int(self.type[1:]) // 8

    @property
    def word(self) -> int:
        """Entry of a PDO mapping: index, sub-index and length in bits."""
        return self.index << 16 | self.subindex << 8 | self.bits

    @property
    def signed(self) -> bool:
        """True for types with negative numbers."""
        return self.type.startswith("i")

    @property
    def bounds(self) -> tuple[int, int]:
        """Lowest and highest number of the type."""
        half = 1 << self.bits - 1
        return (-half, half - 1) if self.signed else (0, 2 * half - 1)

    def data(self, value: int) -> bytes:
        """Encode a number, little endian."""
        return value.to_bytes(self.size, "little", signed=self.signed)

    def number(self, data: bytes) -> float:
        """Decode a number, little endian; an integer except for f32."""
        if self.type == "f32":
            return float(struct.unpack("<f", data)[0])
        return int.from_bytes(data, "little", signed=self.signed)

    def __str__(self) -> str:
        return f"{self.place} ({self.name})"


class LifeSign(Protocol):
    """Mutual supervision of master and drives; drives stop when the sign of life ends.

    Attributes
    ----------
    name : str
        Name in messages: our heartbeat, or the trigger of a watchdog of the bus.
    timeout : float
        Time without a sign of life until a drive reacts [s].
    due : float
        Time of the next call of `service` [s].
    trouble : DriveError or None
        Reason why a drive has left the bus.
    """

    name: str
    timeout: float

    @property
    def due(self) -> float: ...  # noqa: D102 - an attribute

    @property
    def trouble(self) -> DriveError | None: ...  # noqa: D102 - an attribute

    def watch(self) -> None:
        """Start to supervise drives that exchange process data, and to send our sign of life."""

    def service(self) -> None:
        """Send our sign of life if due, and check the drives for overdue signs."""

    def beat(self) -> None:
        """Send our sign of life if due."""

    def cease(self) -> None:
        """Stop our sign of life: drives that supervise the master stop their axes."""
