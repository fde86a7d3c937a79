"""Formatting of figures: two digits of the uncertainty; units, probabilities, dates."""

from __future__ import annotations

import math
from datetime import datetime


def decimals(uncertainty: float, most: int = 9) -> int:
    """Return the decimals for an uncertainty with two digits; 4 without uncertainty."""
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 4
    return min(max(1 - math.floor(math.log10(uncertainty)), 0), most)


def rounded(value: float, uncertainty: float) -> str:
    """Round `value` to the decimals of the uncertainty, with a true minus sign."""
    return signed(f"{value:.{decimals(uncertainty)}f}")


def signed(text: str) -> str:
    """Replace a number's hyphen by a minus sign; zero has none."""
    digits = text.lstrip("-")
    is_zero = not any(digit in "123456789" for digit in digits.split("e")[0])
    return digits if is_zero else text.replace("-", "−")


def percent(part: float, whole: float) -> str:
    """Format a share with two digits, or ``> 100``."""
    if not abs(whole) > abs(part):
        return "> 100"
    return significant(100 * abs(part / whole), 2)


def above(share: float, limit: float) -> str:
    """Format a share above a limit in percent, with as many digits as show that it is above."""
    found = (significant(100.0 * share, digits) for digits in range(2 + (share >= 1.0), 18))
    return next(text for text in found if float(text) > 100.0 * limit)


def significant(value: float, digits: int) -> str:
    """Round a value to significant digits, without exponent below a million."""
    text = f"{value:#.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e6 else text.rstrip(".")


def count(number: int, noun: str) -> str:
    """Format a number of things, in the singular for one."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def clock(seconds: float) -> str:
    """Format a duration as h:mm:ss or m:ss."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def uncertain(value: float, standard_error: float) -> tuple[str, str]:
    """Format a value and its standard error with the decimals of the error."""
    return rounded(value, standard_error), rounded(standard_error, standard_error)


def unit(name: str) -> str:
    """Format a unit with a superscript: ``kg m²``."""
    return name.replace("m2", "m²")


def probability(p: float) -> str:
    """Format a p-value; tiny ones as a bound."""
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def when(stamp: str) -> str:
    """Format an ISO time stamp for readers."""
    return f"{datetime.fromisoformat(stamp):%d %B %Y, %H:%M %Z}".lstrip("0") if stamp else "unknown"


def duration(seconds: float) -> str:
    """Format a duration for readers."""
    return f"{clock(seconds)} {'h' if seconds >= 3600 else 'min'}"
