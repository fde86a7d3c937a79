"""Polynomials in named lengths, and the arithmetic that a robot file may write.

Coefficients of regrouped parameters are products of direction cosines (mostly 0 and +-1) with
powers of a robot's lengths. Kept as polynomials in the lengths' names they stay readable, as in
``l1^2 (m3 + m4)``, and need no computer algebra system. A robot file writes its frames in the same
terms, as in ``pi/2``, ``l2`` or ``l1 + 0.05``; `parse` reads these without evaluating any code.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

Monomial = tuple[str, ...]
"""Sorted names, each as often as its power: ``("l1", "l1")`` is l1^2, ``()`` is 1."""


_LENGTH_MAX = 200
"""Longest expression that a file may write; nested products of sums have no end otherwise."""
_TERMS_MAX = 100
"""Most terms that a product may have."""
_ROUNDING = 1e-12
"""Coefficients this near to a whole number are meant to be it."""


class Polynomial:
    """A sum of monomials in names, with float coefficients; immutable by convention.

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
        """Return the polynomial that is `value` everywhere."""
        return cls({(): value})

    @classmethod
    def symbol(cls, name: str) -> Polynomial:
        """Return the polynomial that is the quantity called `name`."""
        return cls({(name,): 1.0})

    def __add__(self, other: Polynomial | float) -> Polynomial:
        terms = dict(self.terms)
        for monomial, c in _lift(other).terms.items():
            terms[monomial] = terms.get(monomial, 0.0) + c
        return Polynomial(terms)

    def __mul__(self, other: Polynomial | float) -> Polynomial:
        terms: dict[Monomial, float] = {}
        for left, a in self.terms.items():
            for right, b in _lift(other).terms.items():
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
        """Names that the value depends on."""
        return frozenset(name for monomial in self.terms for name in monomial)

    def evaluate(self, values: Mapping[str, float]) -> float:
        """Return the value at `values` of the names."""
        return sum(c * math.prod(values[name] for name in m) for m, c in self.terms.items())

    def tidied(self) -> Polynomial:
        """Return the polynomial without what rounding left of terms that cancel."""
        near = {monomial: float(round(c)) for monomial, c in self.terms.items()}
        return Polynomial(
            {m: near[m] if abs(c - near[m]) < _ROUNDING else c for m, c in self.terms.items()}
        )


def _lift(value: Polynomial | float) -> Polynomial:
    return value if isinstance(value, Polynomial) else Polynomial.constant(value)


def monomial_text(monomial: Monomial) -> str:
    """Return a monomial as text: ``l1^2 l2``; empty for 1."""
    powers = Counter(monomial).items()
    return " ".join(name if power == 1 else f"{name}^{power}" for name, power in powers)


def parse(text: str) -> Polynomial:
    """Read arithmetic of numbers, ``pi`` and names: ``+ - *``, and ``/`` by a number.

    Raises
    ------
    ValueError
        The text is no such expression; the message says what may be written.
    """
    try:
        return _finite(_convert(_tree(text)))
    except (SyntaxError, ArithmeticError, _NotArithmetic, RecursionError, MemoryError):
        shown = text if len(text) <= _LENGTH_MAX else f"{text[:_LENGTH_MAX]}..."
        raise ValueError(
            f"{shown!r} is no expression; write a number, pi, a length's name, or sums, products"
            " and quotients by numbers of these"
        ) from None


class _NotArithmetic(Exception):
    """A construct that the file may not write."""


def _finite(polynomial: Polynomial) -> Polynomial:
    if not all(map(math.isfinite, polynomial.terms.values())):
        raise _NotArithmetic
    return polynomial


def _tree(text: str) -> ast.expr:
    if len(text) > _LENGTH_MAX:
        raise _NotArithmetic
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python's advice on its own style
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
        case ast.Mult() if len(left.terms) * len(right.terms) <= _TERMS_MAX:
            return left * right
        case ast.Div() if not right.names:
            divisor = right.evaluate({})
            return Polynomial({m: c / divisor for m, c in left.terms.items()})
    raise _NotArithmetic
