"""Error codes of drives in words: the emergency object (EMCY) and object 603F.

An EMCY frame holds an error code (u16), the error register (1001, u8) and five manufacturer bytes.
Codes are hierarchical: the class of an unknown code still names the kind of error. Code 0000
reports the end of an error. Texts follow CiA 402-2, table of error codes, and CiA 301.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

ERROR_CODES: dict[int, str] = {
    0x0000: "no error",
    0x1000: "generic error",
    0x2000: "current",
    0x2110: "short circuit or earth leakage at the input",
    0x2220: "continuous over-current inside the device",
    0x2300: "current at the output",
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage at the motor",
    0x2330: "earth leakage at the motor",
    0x2340: "short circuit between motor phases",
    0x2350: "motor overload (I2t)",
    0x3000: "voltage",
    0x3100: "mains voltage",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3130: "mains phase failure",
    0x3200: "DC link voltage",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4000: "temperature",
    0x4110: "ambient temperature too high",
    0x4210: "device temperature too high",
    0x4310: "drive or motor temperature too high",
    0x5000: "device hardware",
    0x5100: "control supply",
    0x5400: "power section",
    0x5441: "emergency stop contact or safe torque off",
    0x5500: "data storage",
    0x6000: "device software",
    0x6010: "software reset by the watchdog",
    0x6300: "parameter data",
    0x6310: "loss of parameters",
    0x6320: "parameter error",
    0x7000: "additional modules",
    0x7110: "brake chopper",
    0x7120: "motor",
    0x7121: "motor blocked",
    0x7300: "position sensor",
    0x7305: "incremental encoder 1",
    0x7306: "incremental encoder 2",
    0x7310: "over-speed",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun, frames lost",
    0x8120: "CAN in error-passive mode",
    0x8130: "heartbeat of the master lost",
    0x8140: "recovered from bus-off",
    0x8150: "CAN identifier collision",
    0x8210: "PDO not processed: wrong length",
    0x8220: "PDO too long",
    0x8250: "RPDO missed its deadline",
    0x8300: "torque control",
    0x8400: "velocity control",
    0x8500: "position control",
    0x8600: "positioning",
    0x8611: "following error too large",
    0x8612: "position limit reached",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "specific to the maker: see the drive's manual",
}
"""Texts of error codes; those of codes ending in 00 also apply to their class."""

_CLASS_MASKS = (0xFFFF, 0xFFF0, 0xFF00, 0xF000)
_EMCY = struct.Struct("<HB5s")


class Emergency(NamedTuple):
    """Content of an EMCY frame.

    Attributes
    ----------
    code : int
        Error code, 0 at the end of an error.
    register : int
        Error register (1001).
    vendor : bytes
        Five manufacturer bytes.
    """

    code: int
    register: int
    vendor: bytes

    def __str__(self) -> str:
        text = f"{error_text(self.code)}, error register {self.register:02X}"
        return f"{text}, maker's data {self.vendor.hex(' ')}" if any(self.vendor) else text


def error_text(code: int) -> str:
    """Return an error code (u16) with the meaning, or with that of the class if unknown."""
    known = next((code & mask for mask in _CLASS_MASKS if code & mask in ERROR_CODES), None)
    if known is None:
        return f"{code:04X} (unknown error)"
    return f"{code:04X} ({ERROR_CODES[known]})"


def decode_emergency(data: bytes | bytearray) -> Emergency:
    """Decode the eight bytes of an EMCY frame; a shorter frame is padded with zeros."""
    return Emergency(*_EMCY.unpack(bytes(data[:8]).ljust(8, b"\0")))
