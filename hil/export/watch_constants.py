"""Constants and state of the exported watch, and its translation into C and structured text.

Constants come from the model and from the thresholds learned by a watch. They are those of
`hil.watching`, for the functions of `hil.export.watch_steps`.

The functions are translated from a subset of Python: functions without results of arguments `c`
(constants), `s` (state), indices, numbers and arrays; declarations with a type at the first
assignment; assignments, `if`, `for` over `range`, arithmetic, comparisons, calls of other
functions. In C, functions stay functions; the state is a structure. In structured text, which has
no references to a state, a call is replaced by the function's body, in one function block.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.export import watch_steps
from hil.results.watch import LEARNING
from hil.watching import detector, friction
from hil.watching.detector import Detector
from hil.watching.watcher import OVER

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from hil.export.source_code import Syntax
    from hil.results.model import Model
    from hil.results.watch import Watched


BLIND = 1e30
"""Threshold where no push is visible, relative to the torque limit."""


class Constant(NamedTuple):
    """Constant of the code: a number, or an array as nested lists."""

    value: object
    unit: str
    meaning: str


def constants(model: Model, found: Watched) -> dict[str, Constant]:
    """Return the constants of the code, in SI units; `limit` is a share of the torque limit.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    robot, period = model.robot, found.period
    fresh, started = (Detector(model, period) for _ in range(2))
    started.begin(found.axes)
    tables, turn, windows = fresh.tables.values, fresh.turning, fresh.windows
    shares = "1, of the torque limit"
    rows: dict[str, tuple[object, str, str]] = {
        "joints": (robot.n_joints, "", "number of axes"),
        "parameters": (len(model.values), "", "number of base parameters"),
        "period": (period, "s", "time between two samples"),
        "gap": (detector.GAP, "", "longest time between successive samples, in periods"),
        "needed": (
            round((found.learned or LEARNING) / period),
            "",
            "samples in motion for learning anew",
        ),
        "over": (OVER + period / 4, "s", "time without a sign after which an alarm ends"),
        "limit": (robot.torque_limit, robot.torque_units, "torque limits"),
        "fastest": (robot.velocity_limit, "rad/s or m/s", "velocity limits"),
        "inertia": (robot.reflected_inertia, "kg m2 or kg", "inertia of the motors, joint side"),
        "covariance": (model.covariance, "", "covariance of the base parameters"),
        "slow": (detector.SLOW, "", "share of the velocity limit below which an axis may rest"),
        "per_node": (fresh.tables.per_node, "s/rad or s/m", "nodes of the tables by speed"),
        "last_place": (friction.LAST_PLACE, "", "last place in the tables"),
        "offset": (tables[0].T, "N m or N", "offset of friction by speed"),
        "level": (tables[1].T, "N m or N", "level of friction by speed"),
        # friction depends on the load in proportion, at every speed
        "offset_of_load": (tables[2].mean(axis=0), "1", "offset of friction by load"),
        "level_of_load": (tables[3].mean(axis=0), "1", "level of friction by load"),
        "last_speed": (len(friction.SPEEDS) - 1, "", "last node of the deviation of friction"),
        "unknowns": (friction.N_UNKNOWNS, "", "number of unknowns of the deviation of friction"),
        "speeds": (friction.SPEEDS, "1", "nodes of the deviation, shares of the velocity limit"),
        "first_p": (fresh.level.covariance, "", "first covariance of the deviation of friction"),
        "wander": (
            fresh.level.wander * fresh.n_block * period / 60,
            "",
            "covariance of the deviation's random walk in a block",
        ),
        "error": (friction.ERROR, shares, "error of a block's mean, not by friction"),
        "block": (fresh.n_block, "", "samples in a block, after which learned values hold"),
        "lasting": (detector.LASTING, "s", "duration from which a deviation is learned"),
        "sure": (detector.SURE, "1", "largest doubt of samples for learning"),
        "rest": (turn.n_still, "", "samples within the shortest distance for a standstill"),
        "n_distances": (len(friction.DISTANCES), "", "number of presliding distances"),
        "distances": (friction.DISTANCES, "rad or m", "presliding distances"),
        "free": (~turn.known * 1.0, "", "1 for axes with a distance to be found"),
        "first_taken": (turn.taken, "", "first presliding distance of each axis, from 0"),
        "turning": (friction.TURNING, "1", "difference of directions in a reversal"),
        "damping_doubt": (friction.DAMPING_DOUBT, "1", "relative uncertainty of the damping"),
        "unclear": (friction.UNKNOWN, "1", "doubt about an unknown direction"),
        "enough_seen": (float(friction.ENOUGH), "", "samples in reversals for a distance"),
        "n_windows": (len(windows), "", "number of windows"),
        "windows": (windows, "samples", "lengths of the windows"),
        "longest": (int(windows[-1]), "samples", "longest window"),
        "sigmas": (detector.SIGMAS, "1", "threshold in standard deviations of the scatter"),
        "visible": (detector.VISIBLE, shares, "largest threshold"),
        "blind": (BLIND, shares, "threshold where no push is visible"),
        "allowance": (detector.CERTAIN, "1", "allowance for few squares, in standard deviations"),
        "enough": (detector.ENOUGH / period, "samples", "motion for a valid scatter"),
        "most": (detector.MEMORY / period, "samples", "averaging time of the scatter"),
        "learned_squares": (started.scatter.squares.T, "1", "learned squares of the scatter"),
        "learned_weight": (started.scatter.weights, "samples", "motion in the scatter"),
        "learned_shown": (
            started.turning.sums[:3].transpose(2, 0, 1),
            "",
            "learned sums for presliding distance and damping",
        ),
        "learned_seen": (started.turning.sums[3, 0], "samples", "reversals in the sums"),
    }
    return {
        name: Constant(value.tolist() if isinstance(value, np.ndarray) else value, unit, meaning)
        for name, (value, unit, meaning) in rows.items()
    }


class Field(NamedTuple):
    """Field of the state: type, and names of the constants that are its dimensions."""

    kind: str
    shape: tuple[str, ...] = ()


_AXIS, _WINDOWS, _SUMS = ("joints",), ("joints", "n_windows"), ("joints", "three", "n_distances")
_UNKNOWNS, _SQUARE = ("joints", "unknowns"), ("unknowns", "unknowns")
OUTPUTS = {"external": "float", "threshold": "float", "alarm": "bool"}
"""Fields of the state for the user: torque [N m or N], its threshold, and alarms."""
STATE: dict[str, Field] = {
    **{name: Field(kind, _AXIS) for name, kind in OUTPUTS.items()},
    "lost": Field("float"),
    **dict.fromkeys(("held", "since", "newest", "latest", "moved", "in_block"), Field("int")),
    **dict.fromkeys(
        (
            "now", "before", "measured", "velocity", "acceleration", "rigid", "friction", "level",
            "path", "unknown", "damping", "damped", "doubt", "quiet", "weight", "seen", "seen_now",
            "used", "doubted",
        ),
        Field("float", _AXIS),
    ),
    "columns": Field("float", ("rows",)),
    "taken": Field("int", _AXIS),
    "doubtful": Field("bool", _AXIS),
    "paths": Field("float", ("joints", "rest")),
    "row": Field("float", ("joints", "n_distances")),
    **dict.fromkeys(("residuals", "bands"), Field("float", ("joints", "longest"))),
    **dict.fromkeys(("bound", "squares", "squares_now"), Field("float", _WINDOWS)),
    **dict.fromkeys(("shown", "shown_now"), Field("float", _SUMS)),
    **dict.fromkeys(("x", "b"), Field("float", _UNKNOWNS)),
    **dict.fromkeys(("p", "f"), Field("float", ("joints", *_SQUARE))),
    **dict.fromkeys(("g", "h"), Field("float", _SQUARE)),
}  # fmt: skip
"""Fields of the state, with values kept between calls: see `hil.export.watch_steps`."""


OPERATORS = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Gt: ">", ast.Lt: "<",
    ast.GtE: ">=", ast.LtE: "<=",
}  # fmt: skip


def steps() -> dict[str, ast.FunctionDef]:
    """Return the functions of `hil.export.watch_steps` by name."""
    parsed = ast.parse(inspect.getsource(watch_steps)).body
    return {each.name: each for each in parsed if isinstance(each, ast.FunctionDef)}


class Language(NamedTuple):
    """Syntax of statements in a language, as formats.

    Attributes
    ----------
    syntax : Syntax
        Numbers and functions.
    words : mapping of str to str
        Texts of types, truth values and operators, by their names in Python.
    constant, state : callable
        Functions from a name and its indices to the text of a constant array, and of a state.
    select : str
        Conditional expression of a condition and two values.
    declare, assign : str
        Declaration of a type, a name and a value; assignment to a place of a value.
    loop, branch : tuple of str
        Begin and end of a loop of a counter, its first value and its end; begin, alternative and
        end of a condition.
    """

    syntax: Syntax
    words: Mapping[str, str]
    constant: Callable[[str, list[str]], str]
    state: Callable[[str, list[str]], str]
    select: str
    declare: str
    assign: str
    loop: tuple[str, str]
    branch: tuple[str, str, str]


Call = Callable[["Translator", str, list[str]], "Iterable[str]"]
"""Function from a translator, the name of a called function and its arguments to lines."""


class Translator:
    """Translator of a function.

    Parameters
    ----------
    numbers : mapping of str to int or float
        Values of the scalar constants.
    call, outside : Call
        Calls of functions of `hil.export.watch_steps`, and of those among the constants.
    names : mapping of str to str, optional
        Texts that replace the function's arguments and variables.
    """

    def __init__(
        self,
        language: Language,
        numbers: Mapping[str, float],
        call: Call,
        outside: Call,
        names: Mapping[str, str] | None = None,
    ) -> None:
        self.language, self.numbers, self._names = language, numbers, names or {}
        self.call, self.outside = call, outside

    def renamed(self, names: Mapping[str, str]) -> Translator:
        """Return a translator with other texts for arguments and variables."""
        return Translator(self.language, self.numbers, self.call, self.outside, names)

    def lines(self, body: list[ast.stmt]) -> Iterator[str]:
        """Yield the lines of statements."""
        language = self.language
        for node in body:
            match node:
                case ast.Expr(value=ast.Constant()):
                    pass
                case ast.Expr(value=ast.Call(func=ast.Name(id=name), args=args)):
                    yield from self.call(self, name, list(map(self.text, args)))
                case ast.Expr(value=ast.Call(func=ast.Attribute(attr=name), args=args)):
                    yield from self.outside(self, name, list(map(self.text, args)))
                case ast.AnnAssign(target=to, annotation=ast.Name(id=kind), value=ast.expr() as of):
                    place, kind = self.text(to), language.words[kind]
                    yield language.declare.format(kind, place, self.text(of))
                case ast.Assign(targets=[to], value=of):
                    yield language.assign.format(self.text(to), self.text(of))
                case ast.AugAssign(target=to, op=op, value=of):
                    yield language.assign.format(self.text(to), self.text(ast.BinOp(to, op, of)))
                case ast.For(target=to, iter=ast.Call(args=args), body=inner):
                    *begin, end = map(self.text, args)
                    first = begin[0] if begin else "0"
                    yield language.loop[0].format(self.text(to), first, end)
                    yield from (*self._indented(inner), language.loop[1])
                case ast.If(test=test, body=inner, orelse=other):
                    begin_if, alternative, end_if = language.branch
                    yield from (begin_if.format(self.text(test)), *self._indented(inner))
                    yield from ((alternative, *self._indented(other)) if other else ())
                    yield end_if
                case _:
                    raise NotImplementedError(ast.dump(node))

    def _indented(self, body: list[ast.stmt]) -> Iterator[str]:
        return (f"    {line}" for line in self.lines(body))

    def text(self, node: ast.expr) -> str:  # noqa: PLR0911 - one case a kind of node
        """Return the text of an expression; operations within others have brackets."""
        words, syntax = self.language.words, self.language.syntax
        match node:
            case ast.Constant(value=bool() as value):
                return words[str(value)]
            case ast.Constant(value=int() as value):
                return str(value)
            case ast.Constant(value=float() as value):
                return syntax.number(value)
            case ast.Name(id=name):
                return self._names.get(name, name)
            case ast.Attribute() | ast.Subscript():
                return self._place(node)
            case ast.BinOp(left=left, op=op, right=right):
                return f"{self._held(left)} {OPERATORS[type(op)]} {self._held(right)}"
            case ast.UnaryOp(op=ast.USub(), operand=of):
                return f"-{self._held(of)}"
            case ast.UnaryOp(op=ast.Not(), operand=of):
                return f"{words['not']}{self._held(of)}"
            case ast.BoolOp(op=op, values=values):
                word = words["and" if isinstance(op, ast.And) else "or"]
                return f" {word} ".join(map(self._held, values))
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                sign = words.get(type(op).__name__) or OPERATORS[type(op)]
                return f"{self._held(left)} {sign} {self._held(right)}"
            case ast.IfExp(test=test, body=body, orelse=other):
                return self._select(test, body, other)
            case ast.Call(func=ast.Name(id="min" | "max" as name), args=[a, b]):
                test = ast.Compare(a, [ast.Lt() if name == "min" else ast.Gt()], [b])
                return self._select(test, a, b)
            case ast.Call(func=ast.Name(id="float" | "int" as name), args=[of]):
                return words[f"to {name}"].format(self.text(of))
            case ast.Call(func=ast.Name(id=name), args=[of]):
                return syntax.function(name, self.text(of))
        raise NotImplementedError(ast.dump(node))

    def _select(self, *parts: ast.expr) -> str:
        return self.language.select.format(*map(self.text, parts))

    def _held(self, node: ast.expr) -> str:
        simple = ast.Name, ast.Attribute, ast.Subscript, ast.Call, ast.Constant
        text = self.text(node)
        return text if isinstance(node, simple) else f"({text})"

    def _place(self, node: ast.expr) -> str:
        indices: list[str] = []
        while isinstance(node, ast.Subscript):
            indices.insert(0, self.text(node.slice))
            node = node.value
        match node:
            case ast.Attribute(value=ast.Name(id="s"), attr=name):
                return self.language.state(name, indices)
            case ast.Attribute(attr=name) if name in self.numbers:
                value = self.numbers[name]
                whole = isinstance(value, int)
                return str(value) if whole else self.language.syntax.number(value)
            case ast.Attribute(attr=name):
                return self.language.constant(name, indices)
        return f"{self.text(node)}[{indices[0]}]"


def arguments(function: ast.FunctionDef) -> dict[str, str]:
    """Return the arguments of a function with types."""
    return {
        each.arg: ast.unparse(each.annotation or ast.Name("Any")) for each in function.args.args
    }


def variables(function: ast.FunctionDef) -> dict[str, str]:
    """Return the variables of a function with types, counters of loops included."""
    found: dict[str, str] = {}
    for node in ast.walk(function):
        match node:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=ast.Name(id=kind)):
                found[name] = kind
            case ast.For(target=ast.Name(id=name)):
                found[name] = "int"
    return found
