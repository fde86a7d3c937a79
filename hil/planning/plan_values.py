"""Rounded numbers and names in plans.

Numbers are rounded to a millionth on input, far below an encoder's increment, so that values read
back equal those written.
"""

from __future__ import annotations

from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, Field

from checked_files.names import PlainName

Values = TypeVar("Values", bound=BaseModel)


def round_to_millionths(value: float) -> float:
    """Round to a millionth; never -0.0."""
    return round(value, 6) + 0.0


Real = Annotated[float, AfterValidator(round_to_millionths)]
Positive = Annotated[float, Field(ge=1e-6), AfterValidator(round_to_millionths)]
Fraction = Annotated[float, Field(ge=1e-6, le=1.0), AfterValidator(round_to_millionths)]
LONGEST_NAME = 64
"""Characters of the longest `Name`."""
Name = Annotated[PlainName, Field(max_length=LONGEST_NAME)]
"""Identifier of a measurement, also its file name."""


def replace_values(given: Values, **values: object) -> Values:
    """Return a copy with new values, rounded and validated as in a file."""
    return type(given).model_validate(given.model_dump() | values)
