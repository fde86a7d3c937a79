"""Expression graphs, recorded from equations so that code can be generated.

The equations run once with expressions in place of numbers, and their operations are recorded as a
graph. Constants are folded immediately: products with zero disappear, with all their unused
operands. Equal expressions share a node, independent of the order of their operands, so that
nothing is computed twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(eq=False, repr=False, slots=True)
class Expression:
    """Node of a `Graph`, created by arithmetic with expressions and numbers.

    Attributes
    ----------
    operation : str
        ``number``, ``symbol``, ``+``, ``-``, ``*``, ``negative``, or the name of a function.
    number : float
        Value of a number.
    name : str
        Name of a symbol in the generated code.
    index : int
        Position in the order of creation: operands come before their users.
    """

    graph: Graph
    operation: str
    operands: tuple[Expression, ...]
    number: float
    name: str
    index: int

    def is_number(self, value: float) -> bool:
        """Return True for a constant of the given value."""
        return self.operation == "number" and self.number == value

    def __neg__(self) -> Expression:
        match self.operation:
            case "number":
                return self.graph.number(-self.number)
            case "negative":
                return self.operands[0]
            case "-":
                return self.graph.combine("-", self.operands[::-1])
            case "*" if self.operands[0].operation == "number":
                return -self.operands[0] * self.operands[1]
        return self.graph.combine("negative", (self,))

    def __add__(self, other: Expression | float) -> Expression:
        right = self.graph.lift(other)
        if self.operation == right.operation == "number":
            return self.graph.number(self.number + right.number)
        if self.is_number(0.0) or right.is_number(0.0):
            return right if self.is_number(0.0) else self
        (a, negative_a), (b, negative_b) = _unsigned(self), _unsigned(right)
        if a is b:
            return self.graph.number(0.0) if negative_a != negative_b else self * 2.0
        # the sum of two expressions with separate signs
        if negative_a and negative_b:
            return -(a + b)
        if negative_a or negative_b:
            return a.graph.combine("-", (b, a) if negative_a else (a, b))
        return a.graph.combine("+", _ordered(a, b))

    def __radd__(self, other: Expression | float) -> Expression:
        return self + other

    def __sub__(self, other: Expression | float) -> Expression:
        return self + -self.graph.lift(other)

    def __rsub__(self, other: Expression | float) -> Expression:
        return -self + other

    def __mul__(self, other: Expression | float) -> Expression:
        left, right = self, self.graph.lift(other)
        if right.operation == "number":
            left, right = right, left
        if left.operation == "number":
            return _scaled(left.number, right)
        (a, negative_a), (b, negative_b) = _unsigned(left), _unsigned(right)
        product = self.graph.combine("*", _ordered(a, b))
        return -product if negative_a != negative_b else product

    def __rmul__(self, other: Expression | float) -> Expression:
        return self * other


class Graph:
    """Expressions with shared subexpressions."""

    def __init__(self) -> None:
        self._nodes: dict[object, Expression] = {}

    def __len__(self) -> int:
        return len(self._nodes)

    def number(self, value: float) -> Expression:
        """Return a constant."""
        return self._known(("number", value + 0.0), "number", (), value + 0.0, "")

    def symbol(self, name: str) -> Expression:
        """Return a symbol by its name in the generated code."""
        return self._known(("symbol", name), "symbol", (), 0.0, name)

    def function(self, name: str, of: Expression) -> Expression:
        """Return a function of an expression, without constant folding."""
        return self.combine(name, (of,))

    def lift(self, value: Expression | float) -> Expression:
        """Return an expression unchanged, and a number as a constant."""
        return value if isinstance(value, Expression) else self.number(float(value))

    def combine(self, operation: str, operands: tuple[Expression, ...]) -> Expression:
        """Return the result of an operation, without further folding."""
        key = (operation, *(each.index for each in operands))
        return self._known(key, operation, operands, 0.0, "")

    def _known(
        self,
        key: object,
        operation: str,
        operands: tuple[Expression, ...],
        number: float,
        name: str,
    ) -> Expression:
        if key not in self._nodes:
            self._nodes[key] = Expression(self, operation, operands, number, name, len(self))
        return self._nodes[key]


class Count(NamedTuple):
    """Numbers of operations for computing some outputs."""

    multiplications: int
    additions: int
    functions: int

    def __str__(self) -> str:
        return (
            f"{self.multiplications} multiplications, {self.additions} additions,"
            f" {self.functions} functions"
        )


def needed(outputs: Iterable[Expression]) -> list[Expression]:
    """Return the subexpressions of outputs, operands first."""
    found: dict[int, Expression] = {}
    waiting = list(outputs)
    while waiting:
        each = waiting.pop()
        if each.index not in found:
            found[each.index] = each
            waiting += each.operands
    return [found[index] for index in sorted(found)]


def count(outputs: Iterable[Expression]) -> Count:
    """Count the operations for some outputs; subtractions and sign changes count as additions."""
    operations = [each.operation for each in needed(outputs)]
    plain = [operations.count(kind) for kind in ("number", "symbol")]
    added = sum(operations.count(kind) for kind in ("+", "-", "negative"))
    multiplied = operations.count("*")
    return Count(multiplied, added, len(operations) - multiplied - added - sum(plain))


def _scaled(factor: float, of: Expression) -> Expression:
    graph = of.graph
    if of.operation == "number":
        return graph.number(factor * of.number)
    if factor in {0.0, 1.0, -1.0}:
        return {0.0: graph.number(0.0), 1.0: of}.get(factor) or -of
    if of.operation == "negative":
        return _scaled(-factor, of.operands[0])
    if of.operation == "*" and of.operands[0].operation == "number":
        return _scaled(factor * of.operands[0].number, of.operands[1])
    return graph.combine("*", (graph.number(factor), of))


def _unsigned(of: Expression) -> tuple[Expression, bool]:
    """Return an expression without its sign change, and True if a sign change was removed."""
    return (of.operands[0], True) if of.operation == "negative" else (of, False)


def _ordered(left: Expression, right: Expression) -> tuple[Expression, Expression]:
    return (left, right) if left.index <= right.index else (right, left)
