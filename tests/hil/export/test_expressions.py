"""Expressions have the value of their arithmetic, and constants are folded."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.export.expressions import Count, Graph, count, needed
from hil.export.source_code import Syntax, assignments

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.export.expressions import Expression

PLAIN = Syntax(number=lambda value: f"({value!r})", function=lambda name, of: f"{name}({of})")
VALUES = {"x": 1.7, "y": -0.6, "z": 2.3}
OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul,
}  # fmt: skip

leaves = st.sampled_from([*VALUES, 0.0, 1.0, -1.0, 2.0, -0.5])
trees = st.recursive(
    leaves, lambda inner: st.tuples(st.sampled_from([*OPERATIONS]), inner, inner), max_leaves=30
)


def calculated(tree: Any, leaf: Callable[[Any], Any]) -> Any:
    if not isinstance(tree, tuple):
        return leaf(tree)
    return OPERATIONS[tree[0]](*(calculated(part, leaf) for part in tree[1:]))


def traced(graph: Graph, tree: Any) -> Expression:
    made = calculated(tree, lambda x: graph.symbol(x) if isinstance(x, str) else graph.number(x))
    return graph.lift(made)


def value(results: list[Expression]) -> list[float]:
    """Return the result of the code made of expressions."""
    named, texts = assignments(results, PLAIN)
    known = dict(VALUES)
    for name, made in named.items():
        known[name] = eval(made, {}, known)  # noqa: S307 - our own text
    return [eval(text, {}, known) for text in texts]  # noqa: S307


@given(tree=trees)
def test_the_code_computes_what_the_arithmetic_does(tree: Any) -> None:
    expected = calculated(tree, lambda x: VALUES.get(x, x))
    (found,) = value([traced(Graph(), tree)])
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(tree=trees)
def test_no_zero_and_no_one_is_left_in_a_product_or_a_sum(tree: Any) -> None:
    for each in needed([traced(Graph(), tree)]):
        if each.operation in OPERATIONS:
            assert not any(part.is_number(0.0) for part in each.operands)
        if each.operation == "*":
            assert not any(part.is_number(1.0) or part.is_number(-1.0) for part in each.operands)


def test_equal_expressions_are_computed_once() -> None:
    graph = Graph()
    x, y, z = (graph.symbol(name) for name in VALUES)
    assert (x + y) * z is z * (y + x)
    assert x - y is -(y - x)
    assert count([(x + y) * z, (y + x) * x]) == Count(2, 1, 0)


def test_what_only_a_zero_would_have_needed_is_gone() -> None:
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    assert count([x + graph.function("sin", y * 3.0) * 0.0]) == Count(0, 0, 0)


def test_a_long_expression_is_broken_into_named_parts() -> None:
    graph = Graph()
    total = graph.number(0.0)
    for k in range(60):
        total = total + graph.symbol("x") * (k + 2.5)
    named, (text,) = assignments([total], PLAIN)
    assert max(len(line) for line in [text, *named.values()]) < 120
