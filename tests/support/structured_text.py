"""Parser and interpreter of a subset of structured text (IEC 61131-3, second edition).

Written from the standard's grammar, not from the exporter: declared types, functions and function
blocks, their instances, assignments, IF and FOR. Names have no case. Unknown syntax, duplicate or
missing declarations, and mixed types are refused with their line. Values are numbers or arrays of
one number per sample.
"""

from __future__ import annotations

import math
import operator
import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

TOKEN = re.compile(
    r"LREAL\#-?\d+\.\d+(?:E-?\d+)?|\d+(?!\.\d)|[A-Z]\w*|:=|<=|>=|<>|\.\.|[-+*/()\[\],.;:<>=]"
)
KEYWORDS = (
    "AND ARRAY AT BOOL BY CASE CONSTANT DINT DO ELSE ELSIF EN ENO EXIT FALSE FOR FUNCTION"
    " FUNCTION_BLOCK IF INT LREAL MOD NOT OF OR PROGRAM REAL REPEAT RETAIN RETURN STRING STRUCT"
    " TASK THEN TIME TO TRUE TYPE UNTIL VAR VAR_INPUT VAR_OUTPUT VAR_TEMP WHILE WITH XOR"
)
REAL, BOOL, WHOLE = "LREAL", "BOOL", "DINT"
SAME = "of the second argument"


def _chosen(which: Any, no: Any, yes: Any) -> Any:
    return np.where(which, yes, no) if isinstance(which, np.ndarray) else yes if which else no


FUNCTIONS: dict[str, tuple[tuple[str, ...], Callable[..., Any], str]] = {
    "ABS": ((REAL,), abs, REAL),
    "SIN": ((REAL,), np.sin, REAL),
    "COS": ((REAL,), np.cos, REAL),
    "ATAN": ((REAL,), np.arctan, REAL),
    "EXP": ((REAL,), np.exp, REAL),
    "SQRT": ((REAL,), np.sqrt, REAL),
    "EXPT": ((REAL, REAL), np.power, REAL),
    "SEL": ((BOOL, SAME, SAME), _chosen, SAME),
    "TRUNC": ((REAL,), math.trunc, WHOLE),
    "DINT_TO_LREAL": ((WHOLE,), float, REAL),
}
LEVELS: tuple[dict[str, tuple[Callable[..., Any], str]], ...] = (
    {"OR": (operator.or_, BOOL)},
    {"AND": (operator.and_, BOOL)},
    {"<": (operator.lt, BOOL), ">": (operator.gt, BOOL), "<=": (operator.le, BOOL),
     ">=": (operator.ge, BOOL), "=": (operator.eq, BOOL), "<>": (operator.ne, BOOL)},
    {"+": (operator.add, SAME), "-": (operator.sub, SAME)},
    {"*": (operator.mul, SAME), "/": (operator.truediv, SAME)},
)  # fmt: skip
"""Operators in order of precedence, with operation and type of the result."""


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
        self._shapes: dict[str, tuple[tuple[int, ...], str]] = {}
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
        name = self._name(self._shapes, self.units)
        self._take(":")
        self._shapes[name] = self._shapes[self._array()]
        self._take(";")
        self._take("END_TYPE")

    def _array(self) -> str:
        """Parse an array type; return its text, by which its shape is known."""
        self._take("ARRAY")
        shape: list[int] = []
        while self._take("[" if not shape else ",", "]") != "]":
            self._take("0")
            self._take("..")
            shape.append(int(self._take()) + 1)
        self._take("OF")
        kind = self._take(REAL, BOOL, WHOLE)
        text = f"{shape} OF {kind}"
        self._shapes[text] = tuple(shape), kind
        return text

    def _unit(self) -> None:
        opened, self._variables = self._take(), {}
        name = self._name(self._shapes, self.units)
        if opened == "FUNCTION":
            self._take(":")
            self._variables[name] = Variable("VAR_OUTPUT", self._take(REAL), 0.0)
        while self._see() in {"VAR", "VAR_INPUT", "VAR_OUTPUT"}:
            section = self._take()
            if self._see() == "CONSTANT":
                section = self._take()
            while self._see() != "END_VAR":
                self._declaration(section)
            self._take("END_VAR")
        self.units[name] = Unit(self._variables, self._statements(f"END_{opened}"))
        self._take(f"END_{opened}")

    def _declaration(self, section: str) -> None:
        names = [self._name(self._variables)]
        while self._take(",", ":") == ",":
            names.append(self._name(self._variables, names))
        single = {REAL: 0.0, BOOL: False, WHOLE: 0}
        kind = self._array() if self._see() == "ARRAY" else self._take(*single, *self._known())
        shape, of = self._shapes.get(kind, ((), kind))
        first: Any = single.get(kind)
        if shape:
            first = [single[of]] * math.prod(shape)
        elif kind in self.units:
            first = self.units[kind].start()
        if self._take(":=", ";") == ":=":
            first = self._initial(of, len(first) if shape else 0)
            self._take(";")
        self._variables.update(dict.fromkeys(names, Variable(section, kind, first)))

    def _known(self) -> list[str]:
        return [*self._shapes, *self.units]

    def _initial(self, kind: str, size: int) -> Any:
        """Parse an initial value, a list for an array."""
        if not size:
            self._check(self._see() not in {"-", "(", "NOT"}, "an initial value is a literal")
            wanted, run = self._operand()
            self._check(wanted == kind, f"initial value of {kind}")
            return run({})
        found: list[Any] = []
        while self._take("[" if not found else ",", "]") != "]":
            found.append(self._initial(kind, 0))
        self._check(len(found) == size, f"{len(found)} values of {size}")
        return found

    def _statements(self, *ends: str) -> list[Any]:
        found = [self._statement()]
        while self._see() not in ends:
            found.append(self._statement())
        return found

    def _statement(self) -> Callable[[Values], Any]:
        if self._see() in {"IF", "FOR"}:
            return self._condition() if self._take() == "IF" else self._loop()
        name = self._take(*self._variables)
        section, kind, _ = self._variables[name]
        if kind in self.units:
            return self._call(name, self.units[kind])
        self._check(section not in {"VAR_INPUT", "CONSTANT"}, f"{name} is an input or a constant")
        index, element = self._index(kind)
        self._take(":=")
        value = self._expression(element)
        self._take(";")
        if index is not None:
            return lambda values: operator.setitem(values[name], index(values), value(values))
        return lambda values: operator.setitem(values, name, _copy(value(values)))

    def _condition(self) -> Callable[[Values], Any]:
        test = self._expression(BOOL)
        self._take("THEN")
        inner, other = self._statements("ELSE", "END_IF"), []
        if self._take() == "ELSE":
            other = self._statements("END_IF")
            self._take("END_IF")
        self._take(";")
        return lambda values: [run(values) for run in (inner if test(values) else other)]

    def _loop(self) -> Callable[[Values], Any]:
        name = self._take(*self._variables)
        self._check(self._variables[name].kind == WHOLE, f"{name} counts")
        self._take(":=")
        begin = self._expression(WHOLE)
        self._take("TO")
        end = self._expression(WHOLE)
        self._take("DO")
        inner = self._statements("END_FOR")
        self._take("END_FOR")
        self._take(";")

        def run_all(values: Values) -> None:
            for count in range(begin(values), end(values) + 1):
                values[name] = count
                for run in inner:
                    run(values)

        return run_all

    def _call(self, name: str, unit: Unit) -> Callable[[Values], Any]:
        given: dict[str, Callable[[Values], Any]] = {}
        while self._take("(" if not given else ",", ")") != ")":
            argument = self._take(*unit.variables)
            self._take(":=")
            given[argument] = self._expression(unit.variables[argument].kind)
        self._take(";")
        inputs = [k for k, each in unit.variables.items() if each.section == "VAR_INPUT"]
        self._check(sorted(given) == sorted(inputs), f"inputs {inputs}")
        return lambda values: unit.call(values[name], *(given[each](values) for each in inputs))

    def _index(self, kind: str) -> tuple[Callable[[Values], int] | None, str]:
        """Parse the indices of an array element, if any; return the position and the type."""
        if self._see() != "[":
            return None, kind
        shape, element = self._shapes[kind]
        places: list[Callable[[Values], Any]] = []
        for size in shape:
            self._take("[" if not places else ",")
            word, at = self._see(), self._at
            places.append(self._expression(WHOLE))
            stated = word.isdigit() and self._at == at + 1
            self._check(not stated or int(word) < size, f"no element {word} in {kind}")
        self._take("]")

        def position(values: Values) -> int:
            found = 0
            for size, place in zip(shape, places, strict=True):
                at = place(values)
                assert 0 <= at < size, f"no element {at} in {kind}"
                found = found * size + at
            return found

        return position, element

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
            wanted = (BOOL,) if level < 2 else (REAL, WHOLE)
            self._check(kind == other and kind in wanted, f"{kind} and {other}")
            kind, left = (
                kind if gives == SAME else gives,
                lambda v, act=act, a=left, b=right: act(a(v), b(v)),
            )
        return kind, left

    def _operand(self) -> tuple[str, Any]:
        word = self._take()
        if word in {"-", "NOT"}:
            kind, of = self._operand()
            self._check(kind in ((BOOL,) if word == "NOT" else (REAL, WHOLE)), f"{word} {kind}")
            act: Any = operator.neg if word == "-" else operator.not_
            return kind, lambda v: act(of(v))
        if word == "(":
            kind, inner = self._operation(0)
            self._take(")")
            return kind, inner
        if word in {"TRUE", "FALSE"}:
            return BOOL, lambda _: word == "TRUE"
        if word.isdigit() or word.startswith("LREAL#"):
            whole = word.isdigit()
            number = int(word) if whole else float(word.removeprefix("LREAL#"))
            return WHOLE if whole else REAL, lambda _: number
        if word in self._variables and word not in self.units:
            return self._value(word, self._variables[word].kind)
        return self._function(word)

    def _value(self, name: str, kind: str) -> tuple[str, Any]:
        """Return the value of a variable, of an element, or of an output of a block."""
        if self._see() == ".":
            self._take()
            output = self._take(*self.units[kind].variables)
            return self.units[kind].variables[output].kind, lambda v: v[name][output]
        index, element = self._index(kind)
        if index is None:
            return kind, lambda v: v[name]
        return element, lambda v: v[name][index(v)]

    def _function(self, word: str) -> tuple[str, Any]:
        if word in FUNCTIONS:
            wanted, act, gives = FUNCTIONS[word]
        else:
            unit, wanted, gives = self.units[word], (REAL,), REAL
            act = lambda x: unit.call(unit.start(), x)[word]  # noqa: E731
        given: list[Any] = []
        for kind, before in zip(wanted, "(,,", strict=False):
            self._take(before)
            found, run = self._operation(0)
            gives = found if gives == SAME and len(given) == 1 else gives
            self._check(found == (gives if kind == SAME else kind), f"{found} for {word}")
            given.append(run)
        self._take(")")
        return gives, lambda v: act(*(run(v) for run in given))
