"""Polynomials in named lengths, and the arithmetic of robot files.

Coefficients of regrouped parameters are products of direction cosines (mostly 0 and +-1) with
powers of a robot's lengths. As polynomials in named lengths they stay readable, as in ``l1^2 (m3 +
m4)``, and need no computer algebra system. A robot file states its frames in the same terms, as in
``pi/2``, ``l2`` or ``l1 + 0.05``; `parse` reads these without evaluating any code.

A row of the regrouping is a linear combination of standard parameters with polynomial weights. The
format is that of eq. (22) of the paper: first the parameter that names the sum, then other terms
without lengths, then by increasing power
of the lengths, parameters of equal weight in brackets: ``Izz1 + Iyy2 + Iyy3 + l1^2 (m3 + m4)``.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections import Counter
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from hil.arrays import Array

Monomial = tuple[str, ...]
"""Sorted names, repeated by power: ``("l1", "l1")`` is l1^2, ``()`` is 1."""


_LENGTH_MAX = 200
"""Longest permitted expression [characters], a bound on nested products of sums."""


class Polynomial:
    """Sum of monomials in names, with float coefficients; immutable by convention.

    Parameters
    ----------
    terms : mapping of monomial to coefficient
        Zero coefficients are dropped.
    """

    __slots__ = ("terms",)

    def __init__(self, terms: Mapping[Monomial, float]) -> None:
        self.terms = {monomial: float(c) for monomial, c in terms.items() if c != 0.0}

    @classmethod
    def constant(cls, value: float) -> Polynomial:
        """Return the constant polynomial of `value`."""
        return cls({(): value})

    @classmethod
    def symbol(cls, name: str) -> Polynomial:
        """Return the polynomial of a single quantity, `name`."""
        return cls({(name,): 1.0})

    def __add__(self, other: Polynomial | float) -> Polynomial:
        if not (self and other):  # most elements of a pose are zero
            return self if self else _lift(other)
        terms = dict(self.terms)
        for monomial, c in _lift(other).terms.items():
            terms[monomial] = terms.get(monomial, 0.0) + c
        return Polynomial(terms)

    def __mul__(self, other: Polynomial | float) -> Polynomial:
        if not (self and other):
            return _NOTHING
        terms: dict[Monomial, float] = {}
        others = _lift(other).terms.items()
        for left, a in self.terms.items():
            for right, b in others:
                monomial = tuple(sorted(left + right)) if left and right else left + right
                terms[monomial] = terms.get(monomial, 0.0) + a * b
        return Polynomial(terms)

    def __neg__(self) -> Polynomial:
        return self * -1.0

    def __sub__(self, other: Polynomial | float) -> Polynomial:
        return self + _lift(other) * -1.0

    __radd__ = __add__
    __rmul__ = __mul__

    def __bool__(self) -> bool:
        return bool(self.terms)

    @property
    def names(self) -> frozenset[str]:
        """Names in the polynomial."""
        return frozenset(name for monomial in self.terms for name in monomial)

    def evaluate(self, values: Mapping[str, float]) -> float:
        """Return the value at `values` of the names."""
        return sum(c * math.prod(values[name] for name in m) for m, c in self.terms.items())

    def tidy(self) -> Polynomial:
        """Return the polynomial with coefficients cleaned of rounding errors."""
        near = {monomial: float(round(c)) for monomial, c in self.terms.items()}
        # round coefficients within 1e-12 of a whole number
        return Polynomial(
            {m: near[m] if abs(c - near[m]) < 1e-12 else c for m, c in self.terms.items()}
        )


_NOTHING = Polynomial({})


def _lift(value: Polynomial | float) -> Polynomial:
    return value if isinstance(value, Polynomial) else Polynomial.constant(value)


def parse(text: str) -> Polynomial:
    """Parse arithmetic of numbers, ``pi`` and names: ``+ - *``, and ``/`` by a number.

    Raises
    ------
    ValueError
        The text is not such an expression; the message states the permitted syntax.
    """
    with suppress(SyntaxError, ArithmeticError, _NotArithmetic, RecursionError, MemoryError):
        found = _convert(_tree(text))
        if all(map(math.isfinite, found.terms.values())):
            return found
    shown = text if len(text) <= _LENGTH_MAX else f"{text[:_LENGTH_MAX]}..."
    raise ValueError(
        f"{shown!r} is not an expression; write a number, pi, a length's name, or sums, products "
        "and quotients by numbers of these"
    )


class _NotArithmetic(Exception):
    """Unsupported construct in an expression."""


def _tree(text: str) -> ast.expr:
    if len(text) > _LENGTH_MAX:
        raise _NotArithmetic
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # syntax warnings of Python
        return ast.parse(text.strip(), mode="eval").body


def _convert(node: ast.expr) -> Polynomial:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return Polynomial.constant(value)
        case ast.Name(id="pi"):
            return Polynomial.constant(math.pi)
        case ast.Name(id=name):
            return Polynomial.symbol(name)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_convert(operand)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _convert(operand)
        case ast.BinOp(left=left, op=operator, right=right):
            return _combine(_convert(left), operator, _convert(right))
    raise _NotArithmetic


def _combine(left: Polynomial, operator: ast.operator, right: Polynomial) -> Polynomial:
    match operator:
        case ast.Add():
            return left + right
        case ast.Sub():
            return left - right
        case ast.Mult() if len(left.terms) * len(right.terms) <= 100:
            return left * right
        case ast.Div() if not right.names:
            divisor = right.evaluate({})
            return Polynomial({m: c / divisor for m, c in left.terms.items()})
    raise _NotArithmetic


Combination = dict[int, Polynomial]
"""Weights of standard parameters, by index in eq. (5)."""


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
    """Format a combination in the parameters' `names`, `head` first."""
    order = sorted(row, key=lambda parameter: (parameter != head, parameter))
    grouped: dict[tuple[Monomial, float], list[int]] = {}
    for place, parameter in enumerate(order):
        for monomial, weight in row[parameter].terms.items():
            grouped.setdefault((monomial, weight), []).append(place)
    pieces = [
        (len(monomial), places, weight, monomial)
        for (monomial, weight), together in grouped.items()
        # parameters of equal weight in brackets, unless the weight is only a sign
        for places in ([together] if monomial or abs(weight) != 1 else [[k] for k in together])
    ]
    terms = [_term(m, w, [names[order[k]] for k in places]) for _, places, w, m in sorted(pieces)]
    joined = "".join((" - " if negative else " + ") + term for negative, term in terms)
    return ("-" + joined[3:] if joined.startswith(" - ") else joined[3:]) or "0"


def _term(monomial: Monomial, weight: float, names: Sequence[str]) -> tuple[bool, str]:
    size = "" if abs(weight) == 1 else f"{abs(weight):.6g}"
    what = names[0] if len(names) == 1 else f"({' + '.join(names)})"
    powers = Counter(monomial).items()  # such as l1^2 l2
    lengths = [name if power == 1 else f"{name}^{power}" for name, power in powers]
    return weight < 0, " ".join(part for part in (size, *lengths, what) if part)
