"""Parser and interpreter of a subset of structured text (IEC 61131-3, second edition).

Written from the standard's grammar, not from the exporter: declared types, functions and function
blocks, assignments and IF. Names have no case. Unknown syntax, duplicate or missing declarations,
and mixed types are refused with their line. Values are numbers or arrays of one number per sample.
"""

from __future__ import annotations

import operator
import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

TOKEN = re.compile(
    r"LREAL\#\d+\.\d+(?:E-?\d+)?|\d+(?!\.\d)|[A-Z]\w*|:=|<=|>=|<>|\.\.|[-+*/()\[\],.;:<>=]"
)
KEYWORDS = (
    "AND ARRAY AT BOOL BY CASE CONSTANT DINT DO ELSE ELSIF EN ENO EXIT FALSE FOR FUNCTION"
    " FUNCTION_BLOCK IF INT LREAL MOD NOT OF OR PROGRAM REAL REPEAT RETAIN RETURN STRING STRUCT"
    " TASK THEN TIME TO TRUE TYPE UNTIL VAR VAR_INPUT VAR_OUTPUT VAR_TEMP WHILE WITH XOR"
)
REAL, BOOL = "LREAL", "BOOL"
FUNCTIONS: dict[str, tuple[tuple[str, ...], Callable[..., Any]]] = {
    "ABS": ((REAL,), np.abs),
    "SIN": ((REAL,), np.sin),
    "COS": ((REAL,), np.cos),
    "ATAN": ((REAL,), np.arctan),
    "EXP": ((REAL,), np.exp),
    "EXPT": ((REAL, REAL), np.power),
    "SEL": ((BOOL, REAL, REAL), lambda which, no, yes: np.where(which, yes, no)),
}
LEVELS: tuple[dict[str, tuple[Callable[..., Any], str]], ...] = (
    {"<": (np.less, BOOL), ">": (np.greater, BOOL), "<=": (np.less_equal, BOOL),
     ">=": (np.greater_equal, BOOL)},
    {"+": (operator.add, REAL), "-": (operator.sub, REAL)},
    {"*": (operator.mul, REAL), "/": (operator.truediv, REAL)},
)  # fmt: skip
"""Operators on numbers in order of precedence, with operation and type of the result."""

Values = dict[str, Any]


class Variable(NamedTuple):
    section: str
    kind: str
    first: Any


class Unit(NamedTuple):
    """Function or function block."""

    variables: dict[str, Variable]
    body: list[Callable[[Values], Any]]

    def start(self) -> Values:
        """Return initial values."""
        return {name: _copy(each.first) for name, each in self.variables.items()}

    def call(self, values: Values, *inputs: Any) -> Values:
        """Run the unit with values kept from the previous call, and inputs in their order."""
        names = (n for n, each in self.variables.items() if each.section == "VAR_INPUT")
        values.update(dict(zip(names, map(_copy, inputs), strict=True)))
        for run in self.body:
            run(values)
        return values


def _copy(value: Any) -> Any:
    return list(value) if isinstance(value, list) else value


class Parser:
    """Parser of a file; `units` contains its functions and function blocks by name."""

    def __init__(self, text: str) -> None:
        bare = re.sub(r"(?s)\(\*.*?\*\)", lambda found: "\n" * found[0].count("\n"), text.upper())
        self._words: list[tuple[str, int]] = []
        for number, line in enumerate(bare.splitlines(), start=1):
            assert not TOKEN.sub("", line).strip(), f"line {number}: {line}"
            self._words += [(word, number) for word in TOKEN.findall(line)]
        self._at = 0
        self._sizes: dict[str, int] = {}
        self._variables: dict[str, Variable] = {}
        self.units: dict[str, Unit] = {}
        reads = {"TYPE": self._type, "FUNCTION": self._unit, "FUNCTION_BLOCK": self._unit}
        while self._at < len(self._words):
            reads[self._see()]()

    def _see(self) -> str:
        return self._words[self._at][0]

    def _take(self, *wanted: str) -> str:
        word, line = self._words[self._at]
        assert not wanted or word in wanted, f"line {line}: {word}, wanted {wanted}"
        self._at += 1
        return word

    def _check(self, right: bool, what: str) -> None:
        assert right, f"line {self._words[self._at - 1][1]}: {what}"

    def _name(self, *taken: Any) -> str:
        word = self._take()
        known = (KEYWORDS.split(), FUNCTIONS, *taken)
        self._check(bool(re.fullmatch(r"[A-Z]\w*", word)), f"{word} is no name")
        self._check(
            not any(word.removeprefix("END_") in each for each in known), f"{word} is taken"
        )
        return word

    def _type(self) -> None:
        self._take("TYPE")
        name = self._name(self._sizes, self.units)
        words = [self._take() for _ in range(11)]
        self._check(" ".join(words) == f": ARRAY [ 0 .. {words[5]} ] OF LREAL ; END_TYPE", name)
        self._sizes[name] = int(words[5]) + 1

    def _unit(self) -> None:
        opened, self._variables = self._take(), {}
        name = self._name(self._sizes, self.units)
        if opened == "FUNCTION":
            self._take(":")
            self._variables[name] = Variable("VAR_OUTPUT", self._take(REAL), 0.0)
        while self._see() in {"VAR", "VAR_INPUT", "VAR_OUTPUT"}:
            section = self._take()
            while self._see() != "END_VAR":
                self._declaration(section)
            self._take("END_VAR")
        self.units[name] = Unit(self._variables, self._statements(f"END_{opened}"))

    def _declaration(self, section: str) -> None:
        names = [self._name(self._variables)]
        while self._take(",", ":") == ",":
            names.append(self._name(self._variables, names))
        kind = self._take(REAL, BOOL, *self._sizes)
        first: Any = [0.0] * self._sizes[kind] if kind in self._sizes else 0.0
        if self._take(":=", ";") == ":=":
            self._check(kind == BOOL, f"initial value of {kind}")
            first = self._take("TRUE", "FALSE") == "TRUE"
            self._take(";")
        self._variables.update(dict.fromkeys(names, Variable(section, kind, first)))

    def _statements(self, end: str) -> list[Any]:
        found = [self._statement()]
        while self._see() != end:
            found.append(self._statement())
        self._take()
        return found

    def _statement(self) -> Callable[[Values], Any]:
        if self._see() == "IF":
            self._take()
            test = self._expression(BOOL)
            self._take("THEN")
            inner = self._statements("END_IF")
            self._take(";")
            return lambda values: [run(values) for run in inner] if test(values) else None
        name = self._take(*self._variables)
        section, kind, _ = self._variables[name]
        self._check(section != "VAR_INPUT", f"{name} is an input")
        index = self._index(kind)
        self._take(":=")
        value = self._expression(kind if index is None else REAL)
        self._take(";")
        if index is not None:
            return lambda values: operator.setitem(values[name], index, value(values))
        return lambda values: operator.setitem(values, name, _copy(value(values)))

    def _index(self, kind: str) -> int | None:
        """Parse the index of an array element within bounds; return None if there is no index."""
        if self._see() != "[":
            return None
        self._take()
        index = int(self._take())
        self._check(index < self._sizes.get(kind, 0), f"no element {index} in {kind}")
        self._take("]")
        return index

    def _expression(self, wanted: str) -> Callable[[Values], Any]:
        kind, run = self._operation(0)
        self._check(kind == wanted, f"{kind}, wanted {wanted}")
        return run

    def _operation(self, level: int) -> tuple[str, Any]:
        if level == len(LEVELS):
            return self._operand()
        kind, left = self._operation(level + 1)
        while self._see() in LEVELS[level]:
            act, gives = LEVELS[level][self._take()]
            other, right = self._operation(level + 1)
            self._check(kind == other == REAL, f"{kind} and {other}")
            kind, left = gives, lambda v, act=act, a=left, b=right: act(a(v), b(v))
        return kind, left

    def _operand(self) -> tuple[str, Any]:
        word = self._take()
        if word == "-":
            kind, of = self._operand()
            self._check(kind == REAL, f"- before {kind}")
            return REAL, lambda v: -of(v)
        if word == "(":
            kind, inner = self._operation(0)
            self._take(")")
            return kind, inner
        if word in {"TRUE", "FALSE"} or word.startswith("LREAL#"):
            number = word == "TRUE" if word in KEYWORDS else float(word.removeprefix("LREAL#"))
            return BOOL if word in KEYWORDS else REAL, lambda _: number
        if word in self._variables and word not in self.units:
            index = self._index(self._variables[word].kind)
            if index is None:
                return self._variables[word].kind, lambda v: v[word]
            return REAL, lambda v: v[word][index]
        if word in FUNCTIONS:
            wanted, act = FUNCTIONS[word]
        else:
            unit, wanted = self.units[word], (REAL,)
            act = lambda x: unit.call(unit.start(), x)[word]  # noqa: E731
        given = []
        for kind, before in zip(wanted, "(,,", strict=False):
            self._take(before)
            given.append(self._expression(kind))
        self._take(")")
        return REAL, lambda v: act(*(run(v) for run in given))
