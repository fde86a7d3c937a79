"""Numbers and names as plans hold them.

Numbers are rounded to a millionth as they enter, far below an encoder's increment, so that what is
read back equals what was written.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from checked_files.names import PlainName


def to_millionths(value: float) -> float:
    """Round to a millionth; never -0.0."""
    return round(value, 6) + 0.0


Real = Annotated[float, AfterValidator(to_millionths)]
Positive = Annotated[float, Field(ge=1e-6), AfterValidator(to_millionths)]
Fraction = Annotated[float, Field(ge=1e-6, le=1.0), AfterValidator(to_millionths)]
LONGEST_NAME = 64
"""Characters of the longest `Name`."""
Name = Annotated[PlainName, Field(max_length=LONGEST_NAME)]
"""Identifies a measurement and names its file."""
