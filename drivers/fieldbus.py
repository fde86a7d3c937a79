"""What the profile of drives (CiA 402) needs of the fieldbus beneath it, whichever that is.

A drive of this profile is an object dictionary and process data: statusword, position and current
come with each SYNC, target and controlword go out. CANopen carries both (`drivers.canopen`);
another fieldbus that carries the profile (CANopen over EtherCAT) is a folder beside it that offers
the same. `drivers.cia402` and `drivers.safety` see objects (`drivers.remote_dictionary`), process
data (`drivers.cycle_data`) and a sign of life; what sessions and tools need beside that is
`drivers.session.connection.Fieldbus`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from drivers.drive_bus import DriveError

PacingName = Literal["auto", "lock-step", "wall-clock"]
"""Where SYNC's time comes from: auto takes lock-step where a bus offers it."""
TOO_LATE = 0.5
"""Share of the period by which a SYNC may be late before its deadline counts as missed."""
_PROFILES = 0x2000
"""First index beyond the objects of communication."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of an object dictionary.

    Attributes
    ----------
    index, subindex : int
        Where it stands.
    type : str
        u8, u16, u32, i8, i16 or i32; f32 of what is only measured.
    name : str
        For messages.
    """

    index: int
    subindex: int
    type: str
    name: str

    def shown(self, value: int) -> str:
        """Return a value in words: identifiers and mappings, below 2000h, in hexadecimal."""
        hexadecimal = self.index < _PROFILES and value > 0xFFFF
        return f"{value:08X}h" if hexadecimal else f"{value}"

    @property
    def key(self) -> tuple[int, int]:
        """Index and sub-index."""
        return self.index, self.subindex

    @property
    def place(self) -> str:
        """Index and sub-index as they are written everywhere."""
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
        """How a mapping names it: index, sub-index and length in bits."""
        return self.index << 16 | self.subindex << 8 | self.bits

    @property
    def signed(self) -> bool:
        """Whether negative numbers exist."""
        return self.type.startswith("i")

    @property
    def bounds(self) -> tuple[int, int]:
        """The lowest number that it holds, and the highest."""
        half = 1 << self.bits - 1
        return (-half, half - 1) if self.signed else (0, 2 * half - 1)

    def data(self, value: int) -> bytes:
        """Return the bytes of a number, little endian."""
        return value.to_bytes(self.size, "little", signed=self.signed)

    def number(self, data: bytes) -> float:
        """Return the number that its bytes are, little endian; an integer but of f32."""
        if self.type == "f32":
            return float(struct.unpack("<f", data)[0])
        return int.from_bytes(data, "little", signed=self.signed)

    def __str__(self) -> str:
        return f"{self.place} ({self.name})"


class LifeSign(Protocol):
    """What the drives watch to know that we are alive, and we of them; without it they stop.

    Attributes
    ----------
    name : str
        Which that is, for messages: our heartbeat, or what feeds a watchdog of the bus.
    timeout : float
        After which drives miss it [s].
    due : float
        When `service` must be called next [s].
    trouble : DriveError or None
        Why a drive is no longer with us.
    """

    name: str
    timeout: float

    @property
    def due(self) -> float: ...  # noqa: D102 - an attribute

    @property
    def trouble(self) -> DriveError | None: ...  # noqa: D102 - an attribute

    def watch(self) -> None:
        """Begin to expect those of drives that exchange process data, and to give ours again."""

    def service(self) -> None:
        """Give ours if it is due, and look who is overdue."""

    def beat(self) -> None:
        """Give it if it is due."""

    def cease(self) -> None:
        """Give it no more: drives that watch it stop by themselves."""
