"""How figures, units and probabilities are written in the cells of a table."""

from __future__ import annotations

from hil.results.rounding import rounded


def uncertain(value: float, standard_error: float) -> tuple[str, str]:
    """Write a value and its standard error, both with the decimals that the latter deserves."""
    return rounded(value, standard_error), rounded(standard_error, standard_error)


def unit(name: str) -> str:
    """Write a unit with its power raised: ``kg m²``."""
    return name.replace("m2", "m²")


def probability(p: float) -> str:
    """Write a p-value; tiny ones by their bound."""
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"
