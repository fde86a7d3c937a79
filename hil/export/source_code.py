"""Assignments for computing expressions in sequence, in C, Python or structured text.

Values used several times get a name. Values used once are written in place, as long as the line
stays readable. Brackets keep the order of the operations, so that the code gives the same bits as
the recorded equations.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from hil.export.expressions import count, needed
from hil.export.functions import count_whole_links
from hil.export.simple_friction import presliding_left_out
from hil.model.base_parameters import base_parameters
from hil.results.identified_robot import lacking

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.export.expressions import Expression
    from hil.export.functions import Function
    from hil.results.model import Model

SUM, PRODUCT, ATOM = 1, 2, 3
"""Binding strength of a text."""


class Syntax(NamedTuple):
    """Syntax of a language.

    Attributes
    ----------
    number : callable
        Function from a number to its text with the binding strength of an atom.
    function : callable
        Function from the name of a function and the text of its argument to the call.
    """

    number: Callable[[float], str]
    function: Callable[[str, str], str]


def assignments(results: Sequence[Expression], syntax: Syntax) -> tuple[dict[str, str], list[str]]:
    """Write out expressions.

    Returns
    -------
    named : dict of str to str
        Names and the texts of their values, in order; names are ``t0`` and on.
    values : list of str
        Text of each result.
    """
    nodes = needed(results)
    uses = Counter(each.index for node in nodes for each in node.operands)
    named: dict[str, str] = {}
    texts: dict[int, tuple[str, int]] = {}
    for node in nodes:
        text, hold = _text(node, texts, syntax)
        if hold < ATOM or node.operands:
            # longer than 84 characters: not inlined into another expression
            shared = uses[node.index] > 1 or len(text) > 84
            if shared and node.operation != "negative":
                name = f"t{len(named)}"
                named[name], text, hold = text, name, ATOM
        texts[node.index] = text, hold
    return named, [texts[each.index][0] for each in results]


def _text(node: Expression, texts: dict[int, tuple[str, int]], syntax: Syntax) -> tuple[str, int]:
    """Return the text of an expression, and its binding strength."""
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


def description(
    model: Model, origin: tuple[str, ...], functions: Sequence[Function]
) -> tuple[str, ...]:
    """Return lines for the head of a code file."""
    base = base_parameters(model.robot)
    rows = zip(base.names, model.values, base.units, base.expressions, strict=True)
    lines = [
        *(part for line in origin for part in line.splitlines()),
        "",
        f"Dynamics of {model.robot.name}, written by hil export.",
        f"Positions in {model.robot.position_units}, times in s, torques in"
        f" {model.robot.torque_units}, all joint side. Results may overwrite an argument.",
        *(f"{each.name}({', '.join(each.arguments)}): {each.purpose}" for each in functions),
        *missing(model, functions),
        "",
        "Base parameters used for the numbers below:",
        *[f"  {name} = {value:.9g} {unit}: {text}" for name, value, unit, text in rows],
    ]
    return tuple(lines)


def missing(model: Model, functions: Sequence[Function]) -> tuple[str, ...]:
    """Return sentences on missing parts of the code: functions, presliding."""
    there = {each.name for each in functions}
    said = []
    if "friction" not in there:
        said.append(
            "No friction: the model lacks a friction law for some axis; identify the run anew "
            "with: hil identify"
        )
    else:
        if lack := lacking(model):
            said.append(f"FRICTION UNKNOWN: {lack}")
        but = " of all functions except dynamics" if "dynamics" in there else ""
        said += presliding_left_out(model, but)
    if "current" not in there:
        said.append(
            "No current: gear ratio or torque constant of an axis is unknown; state them in the"
            f" robot file of {model.robot.name}"
        )
    return tuple(said)


def remarks(model: Model, functions: Sequence[Function]) -> tuple[str, ...]:
    """Return remarks for the terminal: numbers of operations, missing parts."""
    counted = {each.name: f"{each.name}: {count(each.results)}" for each in functions}
    counted["rigid_bodies"] += f"; {count_whole_links(model.robot)} for whole links"
    return (*counted.values(), *missing(model, functions))


def identifier(name: str) -> str:
    """Return a robot's name in small letters, digits and underscores, a letter first.

    A robot file admits letters, digits, dots, hyphens and underscores only. Generated names always
    end with a suffix such as ``_gravity``, so that no keyword results.
    """
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return plain if plain[:1].isalpha() else f"robot_{plain}"
