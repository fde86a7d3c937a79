"""How long a classical CAN frame is on the wire, at worst.

A frame with n data bytes and stuffing takes 47 + 8n + floor((33 + 8n) / 4) bits.
"""

from __future__ import annotations


def frame_bits(n_bytes: int) -> int:
    """Length of a data frame with the worst stuffing [bits]."""
    return 47 + 8 * n_bytes + (33 + 8 * n_bytes) // 4
