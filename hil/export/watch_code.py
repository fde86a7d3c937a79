"""Watch of the axes as code for controllers: the alarms of `hil watch`, and thresholds as JSON.

The code of `hil.export.watch_steps` is written beside the model in its language, with constants
from the model and from the thresholds learned by a watch. Called with the positions and torques of
each sample, it raises an alarm at the same sample of the same axis as `hil watch`.
"""

from __future__ import annotations

import ast
import inspect
import json
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from checked_files.foreign_text import shown
from hil.export import watch_steps
from hil.export.functions import regressor, rigid
from hil.export.languages import (
    TYPES,
    c_comment,
    c_function,
    c_syntax,
    indented,
    literal,
    python_function,
    st_block,
    st_comment,
    st_type,
    st_variables,
    structured_text,
)
from hil.export.source_code import identifier
from hil.export.watch_constants import (
    OUTPUTS,
    STATE,
    Constant,
    Field,
    Language,
    Translator,
    arguments,
    constants,
    steps,
    variables,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hil.results.model import Model
    from hil.results.watch import Watched

GIVEN = (
    "Call it every {:g} ms, the period of that watch; at another period velocities are wrong.",
    "It takes the time since the last sample [s], positions and measured torques, joint side.",
    "Pass NaN for a missing sample, or leave it out: the next one then comes after two periods.",
    "An alarm begins at a sample and ends 0.25 s after its last sign. external is the mean torque",
    "by contact over the window nearest to its threshold, both in N m or N. It is monitoring, no",
    "safety function.",
)


class _Parts(NamedTuple):
    name: str
    model: Model
    found: Watched
    head: tuple[str, ...]
    numbers: dict[str, int | float]
    arrays: dict[str, Constant]

    def shape(self, field: Field) -> list[int]:
        n, p = self.numbers["joints"], self.numbers["parameters"]
        sizes = self.numbers | {"three": 3, "rows": n * p}
        return [int(sizes[each]) for each in field.shape]


def write_watch(model: Model, name: str, origin: tuple[str, ...], found: Watched) -> dict[str, str]:
    """Return files with the watch in one of `WATCHES`, by name.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    listed = constants(model, found)
    arrays = {name: each for name, each in listed.items() if isinstance(each.value, list)}
    numbers = {k: v.value for k, v in listed.items() if isinstance(v.value, int | float)}
    head = (
        *map(shown, origin),
        "",
        f"Watch of {model.robot.name}, written by hil export.",
        f"Thresholds of {found.model} (model {model.digest[:12]}), learned by hil watch.",
        *(line.format(1e3 * found.period) for line in GIVEN),
    )
    robot = identifier(model.robot.name)
    return WATCHES[name](_Parts(robot, model, found, head, numbers, arrays))


def _c(parts: _Parts) -> dict[str, str]:
    name, upper = parts.name, parts.name.upper()
    language = Language(
        syntax=c_syntax(name),
        words={
            "float": f"{name}_real", "int": "int", "bool": "bool", "True": "true", "False": "false",
            "not": "!", "and": "&&", "or": "||", "Eq": "==", "NotEq": "!=",
            "to float": f"({name}_real)({{}})", "to int": "(int)({})",
        },
        constant=lambda array, at: f"{name}_watch_{array}{_brackets(at)}",
        state=lambda field, at: f"s->{field}{_brackets(at)}",
        select="(({0}) ? ({1}) : ({2}))",
        declare="{} {} = {};",
        assign="{} = {};",
        loop=("for (int {0} = {1}; {0} < {2}; {0}++) {{", "}"),
        branch=("if ({}) {{", "} else {", "}"),
    )  # fmt: skip

    def call(_: Translator, to: str, given: list[str]) -> Iterator[str]:
        yield f"{name}_{to}({', '.join(given)});"

    translator = Translator(
        language, parts.numbers,
        lambda inner, to, given: call(inner, to, ["s", *given[2:]]), call,
    )  # fmt: skip
    fields = [
        f"{language.words[each.kind]} {field}{_brackets(map(str, parts.shape(each)))};"
        for field, each in STATE.items()
    ]
    kinds = {**language.words, "Any": f"const {name}_real *"}
    begin = ["(void)memset(s, 0, sizeof *s);"]
    bodies = []
    for to, function in reversed(steps().items()):
        given = list(arguments(function).items())[2:]
        inputs = [f"{kinds[kind]} {each}".replace("* ", "*") for each, kind in given]
        zero = begin if to == "start_watch" else []
        bodies.append(
            f"/* {ast.get_docstring(function)} */\n"
            f"static inline void {name}_{to}({', '.join([f'{name}_watch *s', *inputs])})\n{{\n"
            f"{indented([*zero, *translator.lines(function.body)])}\n}}\n"
        )
    text = "\n".join([
        c_comment(parts.head),
        f"#ifndef {upper}_WATCH_H\n#define {upper}_WATCH_H\n\n#include <math.h>\n"
        f'#include <stdbool.h>\n#include <string.h>\n\n#include "{name}_dynamics.h"\n',
        TYPES[TYPES.index("#define HIL_R") :].format(name=name)
        + f"#ifdef {upper}_SINGLE\n#define HIL_F(function) function##f\n#else\n"
        "#define HIL_F(function) function\n#endif\n",
        *(_c_array(name, array, each) for array, each in parts.arrays.items()),
        f"typedef struct {{\n{indented(fields)}\n}} {name}_watch;\n",
        c_function(name, upper, regressor(parts.model)),
        *bodies,
        "#undef HIL_F\n#undef HIL_R\n\n#endif\n",
    ])  # fmt: skip
    return {f"{name}_watch.h": text}


def _brackets(indices: Iterable[str]) -> str:
    return "".join(f"[{each}]" for each in indices)


def _c_array(name: str, array: str, constant: Constant) -> str:
    values = np.array(constant.value)
    kind = "int" if values.dtype.kind == "i" else f"{name}_real"
    head = f"static const {kind} {name}_watch_{array}{_brackets(map(str, values.shape))} ="
    number = str if kind == "int" else c_syntax(name).number

    def rows(of: object, depth: int) -> str:
        if isinstance(of, list):
            return "{" + (",\n" if depth > 1 else ", ").join(rows(x, depth - 1) for x in of) + "}"
        return number(of)  # type: ignore[arg-type]

    unit = f" [{constant.unit}]" if constant.unit else ""
    return f"/* {constant.meaning}{unit} */\n{head}\n{rows(constant.value, values.ndim)};\n"


def _python(parts: _Parts) -> dict[str, str]:
    empty = {"float": "0.0", "int": "0", "bool": "False"}
    fields = [
        f"self.{field} = _array({', '.join([empty[each.kind], *map(str, parts.shape(each))])})"
        for field, each in STATE.items()
    ]
    source = inspect.getsource(watch_steps)
    listed = parts.numbers | {name: each.value for name, each in parts.arrays.items()}
    text = "\n".join([
        "\n".join(f"# {line}".rstrip() for line in parts.head),
        '"""Alarms of external torques on a robot; see above."""\n',
        "from math import exp, sqrt\nfrom typing import Any\n\nimport numpy as np\n",
        f"from {parts.name}_dynamics import _columns, _stacked, rigid_bodies",
        python_function(regressor(parts.model)),
        _PYTHON_HELPERS,
        "class Constants:",
        *(f"    {name} = {value!r}" for name, value in listed.items()),
        "    rigid_bodies, regressor = _filling(rigid_bodies), _filling(regressor)",
        _PYTHON_CLASS.format(fields="\n".join(f"        {line}" for line in fields)),
        "\n" + source[source.index("def start_watch") :],
    ])  # fmt: skip
    return {f"{parts.name}_watch.py": text}


_PYTHON_HELPERS = """
def _filling(function):
    def fill(*arguments):
        *given, out = arguments
        out[:] = function(*given).tolist()

    return staticmethod(fill)


def _array(value, *shape):
    return [_array(value, *shape[1:]) for _ in range(shape[0])] if shape else value

"""
_PYTHON_CLASS = '''

class Watch:
    """Watch; `alarm`, `external` and `threshold` have one value per axis after each sample.

    It begins with the learned thresholds, or learns anew, without alarms meanwhile.
    """

    def __init__(self, learned=True):
{fields}
        start_watch(Constants, self, learned)

    def sample(self, elapsed, q, tau):
        """Process a sample, `elapsed` [s] after the previous sample."""
        watch_sample(Constants, self, elapsed, list(map(float, q)), list(map(float, tau)))
'''


def _st(parts: _Parts) -> dict[str, str]:
    name, n = parts.name, int(parts.numbers["joints"])
    blocks = {each.name: each for each in (rigid(parts.model), regressor(parts.model))}
    kinds: dict[str, str] = {}
    language = Language(
        syntax=structured_text(name),
        words={
            "float": "LREAL", "int": "DINT", "bool": "BOOL", "True": "TRUE", "False": "FALSE",
            "not": "NOT ", "and": "AND", "or": "OR", "Eq": "=", "NotEq": "<>",
            "to float": "DINT_TO_LREAL({})", "to int": "TRUNC({})",
        },
        constant=lambda array, at: f"c_{array}{_subscripts(at)}",
        state=lambda field, at: f"{_st_name(field)}{_subscripts(at)}",
        select="SEL({0}, {2}, {1})",
        declare="{1} := {2};",
        assign="{} := {};",
        loop=("FOR {0} := {1} TO {2} - 1 DO", "END_FOR;"),
        branch=("IF {} THEN", "ELSE", "END_IF;"),
    )  # fmt: skip

    def call(translator: Translator, to: str, given: list[str]) -> Iterator[str]:
        """Yield the body of a function, with numbers assigned to variables before."""
        function = steps()[to]
        named = arguments(function)
        own = {k: kind for k, kind in named.items() if kind != "Any"} | variables(function)
        names = {each: f"{to}_{each}" for each in own}
        kinds.update({names[each]: language.words[kind] for each, kind in own.items()})
        for each, text in zip(named, given, strict=True):
            if each in own:
                yield language.assign.format(names[each], text)
        arrays = {k: text for k, text in zip(named, given, strict=True) if k not in own}
        yield from translator.renamed(names | arrays).lines(function.body)

    def outside(_: Translator, to: str, given: list[str]) -> Iterator[str]:
        inputs = zip(blocks[to].arguments, given, strict=False)
        yield f"{to}({', '.join(f'{a} := {b}' for a, b in inputs)});"
        yield f"{given[-1]} := {to}.out;"

    translator = Translator(language, parts.numbers, call, outside)
    started = list(call(translator, "start_watch", ["", "", "learned"]))
    lines = [
        "IF first THEN",
        *(f"    {line}" for line in started),
        "    first := FALSE;",
        "END_IF;",
        *call(translator, "watch_sample", ["", "", "elapsed", "q", "tau"]),
    ]
    types = {
        field: _st_array(parts, each, language.words[each.kind]) for field, each in STATE.items()
    }
    columns = st_type(name, n, len(blocks["regressor"].results))
    size = f"TYPE {columns} : ARRAY[0..{len(blocks['regressor'].results) - 1}] OF LREAL; END_TYPE\n"
    text = "\n".join([
        st_comment((*parts.head, f"Compile it with {name}_dynamics.st.")),
        *([size] if columns.endswith("columns") else []),
        st_block(name, blocks["regressor"], n),
        f"FUNCTION_BLOCK {name}_watch",
        st_variables("VAR_INPUT", [
            "elapsed : LREAL;", f"q : {name}_joints;", f"tau : {name}_joints;",
            "learned : BOOL := TRUE;",
        ])
        + st_variables("VAR_OUTPUT", [f"{field} : {types[field]};" for field in OUTPUTS])
        + st_variables("VAR CONSTANT", [
            f"{st_comment((each.meaning,)).strip()}\n    c_{array} : {_st_constant(each)};"
            for array, each in parts.arrays.items()
        ])
        + st_variables("VAR", [
            "first : BOOL := TRUE;",
            *(f"{block} : {name}_{block};" for block in blocks),
            *(f"{_st_name(each)} : {types[each]};" for each in types if each not in OUTPUTS),
            *(f"{each} : {kind};" for each, kind in kinds.items()),
        ])
        + indented(lines),
        "END_FUNCTION_BLOCK\n",
    ])  # fmt: skip
    return {f"{name}_watch.st": text}


def _subscripts(indices: list[str]) -> str:
    return f"[{', '.join(indices)}]" if indices else ""


def _st_name(field: str) -> str:
    return field if field in OUTPUTS else f"s_{field}"


def _st_array(parts: _Parts, field: Field, kind: str) -> str:
    """Return the type of a field; arrays that blocks exchange have the names of their types."""
    shape = parts.shape(field)
    joints = int(parts.numbers["joints"])
    if kind == "LREAL" and field.shape in (("joints",), ("rows",)):
        return st_type(parts.name, joints, shape[0])
    return f"ARRAY[{', '.join(f'0..{k - 1}' for k in shape)}] OF {kind}" if shape else kind


def _st_constant(constant: Constant) -> str:
    values = np.array(constant.value)
    whole = values.dtype.kind == "i"
    # the sign of an initial value belongs to the number
    texts = [
        str(x) if whole else literal(abs(x)).replace("#", "#-" if x < 0 else "#")
        for x in values.ravel().tolist()
    ]
    rows = (", ".join(texts[k : k + 6]) for k in range(0, len(texts), 6))
    limits = ", ".join(f"0..{k - 1}" for k in values.shape)
    body = ",\n        ".join(rows)
    return f"ARRAY[{limits}] OF {'DINT' if whole else 'LREAL'} := [\n        {body}]"


FORMULAS = {
    "threshold": "sqrt((sigmas bound)^2 + (2 standard error)^2) + band, of the mean over a window",
    "bound": "scatter; greater after little motion",
    "standard error": "of base parameters and of friction, at the present speed",
    "band": "mean over the window of doubt times level: friction just after a reversal or at rest",
}
"""Rules for evaluating the thresholds."""


def _json(parts: _Parts) -> dict[str, str]:
    """Return the thresholds with names and units, and the constants of the code."""
    robot, found = parts.model.robot, parts.found
    seconds = np.array(parts.arrays["windows"].value) * found.period
    content = {
        "origin": list(parts.head[: -len(GIVEN)]),
        "robot": robot.name,
        "robot_digest": robot.digest,
        "model": found.model,
        "model_digest": found.model_digest,
        "period_s": found.period,
        "windows_s": seconds.round(9).tolist(),
        "formulas": FORMULAS,
        "axes": [
            {
                "axis": axis.axis,
                "torque_unit": axis.unit,
                "torque_limit": axis.limit,
                "scatter": axis.scatter,
                "sigmas": parts.numbers["sigmas"],
                "threshold_within_20_ms": axis.soon,
                "threshold_within_100_ms": axis.late,
                "presliding_distance": axis.distance,
                "presliding_distance_unit": robot.position_unit(axis.axis - 1),
            }
            for axis in found.axes
        ],
        "constants": {name: each._asdict() for name, each in constants(parts.model, found).items()},
    }
    return {f"{parts.name}_watch.json": json.dumps(content, indent=1, allow_nan=False) + "\n"}


WATCHES = {"c": _c, "python": _python, "st": _st, "json": _json}
"""Formats with a watch."""
