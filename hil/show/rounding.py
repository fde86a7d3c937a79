"""How figures are written: two digits of their uncertainty, no more; units, chances, instants."""

from __future__ import annotations

import math
from datetime import datetime


def decimals(uncertainty: float, most: int = 9) -> int:
    """Decimals that show an uncertainty with two digits; 4 where there is none."""
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 4
    return min(max(1 - math.floor(math.log10(uncertainty)), 0), most)


def rounded(value: float, uncertainty: float) -> str:
    """Write `value` to the decimals that its uncertainty deserves, with a true minus sign."""
    return signed(f"{value:.{decimals(uncertainty)}f}")


def signed(text: str) -> str:
    """Write a number's minus as such; a zero has none."""
    digits = text.lstrip("-")
    is_zero = not any(digit in "123456789" for digit in digits.split("e")[0])
    return digits if is_zero else text.replace("-", "−")


def percent(part: float, whole: float) -> str:
    """Write a share with two digits, ``> 100`` where it says nothing any more."""
    if not abs(whole) > abs(part):
        return "> 100"
    return significant(100 * abs(part / whole), 2)


def significant(value: float, digits: int) -> str:
    """Write a value with that many significant digits, in full below a million."""
    text = f"{value:#.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e6 else text.rstrip(".")


def clock(seconds: float) -> str:
    """Write a duration as h:mm:ss or m:ss."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def uncertain(value: float, standard_error: float) -> tuple[str, str]:
    """Write a value and its standard error, both with the decimals that the latter deserves."""
    return rounded(value, standard_error), rounded(standard_error, standard_error)


def unit(name: str) -> str:
    """Write a unit with its power raised: ``kg m²``."""
    return name.replace("m2", "m²")


def probability(p: float) -> str:
    """Write a p-value; tiny ones by their bound."""
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def when(stamp: str) -> str:
    """Write an ISO time stamp for readers."""
    return f"{datetime.fromisoformat(stamp):%d %B %Y, %H:%M %Z}".lstrip("0") if stamp else "unknown"


def duration(seconds: float) -> str:
    """Write a duration for readers."""
    return f"{clock(seconds)} {'h' if seconds >= 3600 else 'min'}"
