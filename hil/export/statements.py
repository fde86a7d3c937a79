"""Assignments that compute expressions, one after the other, in the arithmetic of C and Python.

What is used several times gets a name; what is used once is written where it is used, as long as
the line stays readable. Brackets keep the order in which the expressions were made, so that the
code gives the same bits as they do.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from hil.export.expressions import needed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.export.expressions import Expression

LONGEST = 84
"""Characters of what is still written into another expression."""
SUM, PRODUCT, ATOM = 1, 2, 3
"""How strongly a text holds together."""


class Syntax(NamedTuple):
    """What differs between languages.

    Attributes
    ----------
    number : callable
        From a number to its text, which must hold together as an atom.
    function : callable
        From the name of a function and the text of its argument to its call.
    """

    number: Callable[[float], str]
    function: Callable[[str, str], str]


class Assignment(NamedTuple):
    """A name and the text of its value."""

    name: str
    value: str


def assignments(
    results: Sequence[Expression], syntax: Syntax
) -> tuple[list[Assignment], list[str]]:
    """Write out expressions.

    Returns
    -------
    named : list of Assignment
        In order; names are ``t0`` and on.
    values : list of str
        Text of each result.
    """
    nodes = needed(results)
    uses = Counter(each.index for node in nodes for each in node.operands)
    named: list[Assignment] = []
    texts: dict[int, tuple[str, int]] = {}
    for node in nodes:
        text, hold = _text(node, texts, syntax)
        if hold < ATOM or node.operands:
            shared = uses[node.index] > 1 or len(text) > LONGEST
            if shared and node.operation != "negative":
                named.append(Assignment(f"t{len(named)}", text))
                text, hold = named[-1].name, ATOM
        texts[node.index] = text, hold
    return named, [texts[each.index][0] for each in results]


def _text(node: Expression, texts: dict[int, tuple[str, int]], syntax: Syntax) -> tuple[str, int]:
    """Text of an expression, and how strongly it holds together."""
    operands = [texts[each.index] for each in node.operands]
    match node.operation:
        case "number":
            return syntax.number(node.number), ATOM
        case "symbol":
            return node.name, ATOM
        case "negative":
            return f"-{_held(operands[0], PRODUCT)}", SUM
        case "+" | "-" as sign:
            return f"{_held(operands[0], SUM)} {sign} {_held(operands[1], PRODUCT)}", SUM
        case "*":
            return f"{_held(operands[0], PRODUCT)} * {_held(operands[1], ATOM)}", PRODUCT
    return syntax.function(node.operation, operands[0][0]), ATOM


def _held(operand: tuple[str, int], least: int) -> str:
    text, hold = operand
    return text if hold >= least else f"({text})"
