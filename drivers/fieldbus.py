"""What the profile of drives (CiA 402) needs of the fieldbus beneath it, whichever that is.

A drive of this profile is an object dictionary and process data: statusword, position and current
come with each SYNC, target and controlword go out. CANopen carries both (`drivers.canopen`);
another fieldbus that carries the profile (CANopen over EtherCAT) is a folder beside it that offers
the same protocols. `drivers.cia402` and `drivers.safety` see nothing else of a bus; what sessions
and tools need beside that is `drivers.session.connection.Fieldbus`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

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
        return self.bits // 8

    @property
    def word(self) -> int:
        """How a mapping names it: index, sub-index and length in bits."""
        return self.index << 16 | self.subindex << 8 | self.bits

    @property
    def signed(self) -> bool:
        """Whether negative numbers exist."""
        return self.type.startswith("i")

    def number(self, data: bytes) -> float:
        """Return the number that its bytes are, little endian; an integer but of f32."""
        if self.type == "f32":
            return float(struct.unpack("<f", data)[0])
        return int.from_bytes(data, "little", signed=self.signed)

    def __str__(self) -> str:
        return f"{self.place} ({self.name})"


class ProcessData(Protocol):
    """Process data of all axes, latched at SYNC, and the time that SYNC makes.

    Positions are in increments, currents in the drive's unit; axes are in joint order.

    Attributes
    ----------
    words, positions, currents : sequence of int (currents of float), length n_axes
        Statusword, position and current; where an axis's telegram is missing, those of the SYNC
        before.
    flags : sequence of int, length n_axes
        `drivers.drive_bus.SampleFlag` of each axis: MISSING, DOUBLED, LATE and SKIPPED.
    irregular : bool
        Some flag is set.
    time : float
        The last SYNC's instant [s].
    skipped : int
        SYNCs that were left out because we came too late for them; may be set.
    """

    skipped: int

    @property
    def words(self) -> Sequence[int]: ...  # noqa: D102 - an attribute

    @property
    def positions(self) -> tuple[int, ...]: ...  # noqa: D102 - an attribute

    @property
    def currents(self) -> Sequence[float]: ...  # noqa: D102 - an attribute

    @property
    def flags(self) -> Sequence[int]: ...  # noqa: D102 - an attribute

    @property
    def irregular(self) -> bool: ...  # noqa: D102 - an attribute

    @property
    def time(self) -> float: ...  # noqa: D102 - an attribute

    def now(self) -> float:
        """Time of the same clock as `time` [s]."""

    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send target position [increments] and controlword to one axis, at once.

        Each word counts, also where several are sent between two SYNCs: a fault reset sends two.
        """

    @property
    def on_arrival(self) -> tuple[int, ...]:
        """Axes on which set-points of a stream act when they arrive, and then those of all do.

        Where there are none they act at the next SYNC.
        """

    def lead(self, axis: int, target: int) -> None:
        """Send a set-point of a stream to one axis that follows it [increments]."""

    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        """Send offsets of velocity [the drive's unit] and torque [per mille of rated] to one axis.

        They count until the next ones; only for drives that were set up to take them.
        """

    def speeds(self) -> Sequence[float]:
        """Return how fast each axis went just now [increments/s], inf where it is not seen."""

    def withdraw(self, axis: int) -> None:
        """Take back what is fed forward to one axis; nothing where drives take no offsets."""

    def sync(self) -> float:
        """Send the next SYNC when it is due and collect its answers; return its instant [s].

        Raises
        ------
        drivers.drive_bus.BusUnavailable
            The bus does not take or give telegrams any more.
        """

    def tick(self) -> None:
        """Let one period pass while the drives send no process data yet."""

    def miss(self) -> None:
        """Let one period pass in which the bus took no SYNC."""

    def hurry(self, hurried: bool) -> None:
        """Wait for nothing longer than a stop of all axes can afford, or again as usual."""


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
