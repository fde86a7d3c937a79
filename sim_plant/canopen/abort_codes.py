"""SDO abort codes of CiA 301 (table 22), limited to those a slave has a reason to send."""

from __future__ import annotations

import enum


class AbortCode(enum.IntEnum):
    """Reason for the refusal of an SDO transfer."""

    TOGGLE_BIT = 0x0503_0000
    """The toggle bit did not alternate."""
    UNKNOWN_COMMAND = 0x0504_0001
    """Command specifier unknown, or not fitting the running transfer."""
    BLOCK_SIZE = 0x0504_0002
    """A block size outside 1...127."""
    SEQUENCE_NUMBER = 0x0504_0003
    """Sequence number never sent."""
    CRC = 0x0504_0004
    """The checksum of a block transfer is wrong."""
    OUT_OF_MEMORY = 0x0504_0005
    """More data than the server holds."""
    UNSUPPORTED_ACCESS = 0x0601_0000
    """The access is not possible now, such as a change of a mapping in use."""
    WRITE_ONLY = 0x0601_0001
    """Attempt to read a write-only object."""
    READ_ONLY = 0x0601_0002
    """Attempt to write a read-only object."""
    NO_OBJECT = 0x0602_0000
    """The object does not exist."""
    NOT_MAPPABLE = 0x0604_0041
    """The object cannot be mapped into this PDO."""
    PDO_LENGTH = 0x0604_0042
    """The mapped objects exceed eight bytes."""
    INCOMPATIBLE = 0x0604_0043
    """The parameter contradicts another parameter."""
    LENGTH = 0x0607_0010
    """The length of the data differs from the announced length."""
    LENGTH_HIGH = 0x0607_0012
    """More data than the object holds."""
    LENGTH_LOW = 0x0607_0013
    """Less data than the object holds."""
    NO_SUBINDEX = 0x0609_0011
    """The sub-index does not exist."""
    INVALID_VALUE = 0x0609_0030
    """Value not permitted by the object."""
    VALUE_HIGH = 0x0609_0031
    """The value is above the object's highest."""
    VALUE_LOW = 0x0609_0032
    """The value is below the object's lowest."""
    GENERAL = 0x0800_0000
    """Any other reason."""
    DEVICE_STATE = 0x0800_0022
    """The access is not possible in the present state of the device."""
    NO_DATA = 0x0800_0024
    """There is nothing to transfer."""


class SdoAbort(Exception):
    """Refused access to the object dictionary, with an abort code."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(f"{code.name} {code:#010x}")
        self.code = code
