"""Linear combinations of standard parameters with polynomial weights, and how they read.

A row of the regrouping is such a combination: standard parameter (by index) to weight. Printed as
the paper prints eq. (22): first what carries no length, the head leading, then by rising power of
the lengths, parameters of equal weight in brackets: ``Izz1 + Iyy2 + Iyy3 + l1^2 (m3 + m4)``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.model.polynomial import Monomial, Polynomial, monomial_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from hil.arrays import Array

Combination = dict[int, Polynomial]
"""Weight of each standard parameter, by its index in eq. (5)."""


def add(left: Combination, right: Combination) -> Combination:
    """Return the sum of two combinations."""
    total = dict(left)
    for parameter, weight in right.items():
        total[parameter] = total[parameter] + weight if parameter in total else weight
    return total


def scale(row: Combination, factor: Polynomial | float) -> Combination:
    """Return a combination times a factor."""
    return {parameter: weight * factor for parameter, weight in row.items()}


def combine(weights: NDArray[np.object_] | Array, rows: Sequence[Combination]) -> list[Combination]:
    """Return the product of a matrix, shape (n, len(rows)), with rows."""
    result = []
    for line in weights:
        total: Combination = {}
        for weight, row in zip(line, rows, strict=True):
            if weight:
                total = add(total, scale(row, weight))
        result.append(total)
    return result


def text(row: Combination, head: int, names: Sequence[str]) -> str:
    """Return a combination in the parameters' `names`, `head` first."""
    order = sorted(row, key=lambda parameter: (parameter != head, parameter))
    grouped: dict[tuple[Monomial, float], list[int]] = {}
    for place, parameter in enumerate(order):
        for monomial, weight in row[parameter].terms.items():
            grouped.setdefault((monomial, weight), []).append(place)
    pieces = [
        (len(monomial), places, weight, monomial)
        for (monomial, weight), together in grouped.items()
        for places in _brackets(monomial, weight, together)
    ]
    terms = [_term(m, w, [names[order[k]] for k in places]) for _, places, w, m in sorted(pieces)]
    return _signed_sum(terms) or "0"


def _brackets(monomial: Monomial, weight: float, places: list[int]) -> list[list[int]]:
    """Group parameters of equal weight, unless the weight is a mere sign."""
    return [places] if monomial or abs(weight) != 1 else [[place] for place in places]


def _term(monomial: Monomial, weight: float, names: Sequence[str]) -> tuple[bool, str]:
    size = "" if abs(weight) == 1 else f"{abs(weight):.6g}"
    what = names[0] if len(names) == 1 else f"({' + '.join(names)})"
    return weight < 0, " ".join(part for part in (size, monomial_text(monomial), what) if part)


def _signed_sum(terms: Iterable[tuple[bool, str]]) -> str:
    joined = "".join((" - " if negative else " + ") + term for negative, term in terms)
    return "-" + joined[3:] if joined.startswith(" - ") else joined[3:]
