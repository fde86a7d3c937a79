"""Text from files as a terminal may show it: control characters are written out.

Names of columns and files come from somebody else; an escape sequence in one would move the cursor,
recolour or rename the operator's terminal.
"""

from __future__ import annotations

_KEPT = "\n\t"
_CONTROL = [*range(0x20), *range(0x7F, 0xA0)]
_WRITTEN_OUT = {code: f"\\x{code:02x}" for code in _CONTROL if chr(code) not in _KEPT}


def printable(text: str) -> str:
    """Text with each control character as its code in hexadecimal, save line ends and tabs."""
    return text.translate(_WRITTEN_OUT)
