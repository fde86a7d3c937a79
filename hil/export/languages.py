"""Model as source code: C99, a Python module, or structured text of IEC 61131-3.

C: one header of static inline functions, an example, and a CMake file. The code allocates no
memory, keeps no state, and includes only <math.h>, from which it calls only sin, cos and atan (fabs
is an instruction). Numbers are double, or float if ``NAME_SINGLE`` is defined before the header is
included. Python: a module with numpy as its only dependency; its functions take any number of
samples. Structured text: one function block per function, without pointers, methods or loops, so
that compilers for the second edition of the standard accept the code. One more block remembers the
direction of friction. A separate file, for CODESYS only, contains a block for use as the dynamic
model of an axis group in CODESYS SoftMotion.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.export.exported import Exported, cautions
from hil.export.expressions import count, needed
from hil.export.functions import MEMORY, PARTS, functions, stateful_dynamics
from hil.export.source_code import Syntax, assignments, description, identifier, remarks

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.export.functions import Function
    from hil.results.model import Model

_C_BODIES = {
    "sign": """\
    int turn = 0;

    if (x > HIL_R(0.0)) {{
        turn = 1;
    }}
    if (x < HIL_R(0.0)) {{
        turn = -1;
    }}
    return ({name}_real)turn;""",
    "direction": """\
    int turn = 0;

    if (x >= HIL_R(1.0)) {{
        turn = 1;
    }}
    if (x <= HIL_R(-1.0)) {{
        turn = -1;
    }}
    return ({name}_real)turn;""",
    "cbrt": """\
    {name}_real a = HIL_F(fabs)(x), scale = HIL_R(1.0), y;
    int k;

    for (k = 0; k < 400; k++) {{
        if ((a >= HIL_R(0.125)) || (a <= HIL_R(0.0))) {{
            break;
        }}
        a *= HIL_R(8.0);
        scale *= HIL_R(0.5);
    }}
    for (k = 0; k < 400; k++) {{
        if (a <= HIL_R(1.0)) {{
            break;
        }}
        a *= HIL_R(0.125);
        scale *= HIL_R(2.0);
    }}
    y = (HIL_R(3.0) + HIL_R(4.0) * a) / HIL_R(7.0);
    for (k = 0; k < 3; k++) {{
        const {name}_real cube = y * y * y;
        y *= (cube + HIL_R(2.0) * a) / (HIL_R(2.0) * cube + a);
    }}
    return (x < HIL_R(0.0)) ? -y * scale : ((a > HIL_R(0.0)) ? y * scale : x);""",
}
"""Functions without calls of the mathematics library; cube roots use Halley's rule."""


def c_syntax(name: str) -> Syntax:
    """Return the arithmetic of C; `name` of the robot prefixes the helpers."""
    return Syntax(
        number=lambda value: f"HIL_R({value!r})",
        function=lambda function, of: (
            f"{name}_{function}({of})"
            if function in _C_BODIES
            else f"HIL_F({function.replace('abs', 'fabs')})({of})"
        ),
    )


TYPES = """\
#ifdef {upper}_SINGLE
typedef float {name}_real;
#define HIL_F(function) function##f
#else
typedef double {name}_real;
#define HIL_F(function) function
#endif
#define HIL_R(number) (({name}_real)(number))
"""
_EXAMPLE = """\
#include <stdio.h>

#include "{name}_dynamics.h"

int main(void)
{{
    const {name}_real q[{upper}_JOINTS] = {{0}}, qd[{upper}_JOINTS] = {{0}};
    const {name}_real qdd[{upper}_JOINTS] = {{0}};
    {name}_real gravity[{upper}_JOINTS], torque[{upper}_JOINTS];
    int joint;

    {name}_gravity(q, gravity);
    {name}_torque(q, qd, qdd, torque);
    for (joint = 0; joint < {upper}_JOINTS; joint++)
        printf("joint %d: gravity %g, torque of the drive %g\\n",
               joint + 1, (double)gravity[joint], (double)torque[joint]);
    return 0;
}}
"""
_CMAKE = """\
cmake_minimum_required(VERSION 3.10)
project({name}_dynamics C)

add_library({name}_dynamics INTERFACE)
target_include_directories({name}_dynamics INTERFACE ${{CMAKE_CURRENT_SOURCE_DIR}})
if(UNIX)
  target_link_libraries({name}_dynamics INTERFACE m)
endif()

add_executable(example example.c)
set_target_properties(example PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON)
target_link_libraries(example PRIVATE {name}_dynamics)
"""


def write_c(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as a header with an example and a CMake file."""
    name, found = identifier(model.robot.name), functions(model)
    upper, against = name.upper(), cautions(model)
    inertias = ", ".join(map(repr, model.robot.reflected_inertia.tolist()))
    header = "\n".join([
        c_comment(description(model, origin, found)),
        f"#ifndef {upper}_DYNAMICS_H\n#define {upper}_DYNAMICS_H\n\n#include <math.h>\n",
        TYPES.format(name=name, upper=upper),
        *(
            f"static inline {name}_real {name}_{each}({name}_real x)\n{{\n"
            f"{_C_BODIES[each].format(name=name)}\n}}\n"
            for each in _C_BODIES
            if each in _operations(found)
        ),
        f"#define {upper}_JOINTS {model.robot.n_joints}",
        "/* Motors' own inertia, joint side, for the diagonal of the mass matrix. */",
        f"#define {upper}_MOTOR_INERTIA {{{inertias}}}\n",
        *(c_function(name, upper, each) for each in found),
        "#undef HIL_F\n#undef HIL_R\n\n#endif\n",
    ])  # fmt: skip
    files = {
        f"{name}_dynamics.h": header,
        "example.c": (c_comment(against) if against else "")
        + _EXAMPLE.format(name=name, upper=upper),
        "CMakeLists.txt": "".join(f"# {line}\n" for line in against) + _CMAKE.format(name=name),
    }
    return Exported(files, remarks(model, found))


def _operations(functions: Iterable[Function]) -> set[str]:
    return {each.operation for function in functions for each in needed(function.results)}


def c_function(name: str, upper: str, function: Function) -> str:
    """Return a function of C with an argument for every array, the results last."""
    sizes = {"mass_matrix": f"{upper}_JOINTS * {upper}_JOINTS"}
    sizes["regressor"] = str(len(function.results))
    size = sizes.get(function.name, f"{upper}_JOINTS")
    inputs = [f"const {name}_real {each}[{upper}_JOINTS]" for each in function.arguments]
    named, values = assignments(function.results, c_syntax(name))
    results = [f"r{k}" for k in range(len(values))]
    used = {each.name.partition("[")[0] for each in needed(function.results)}
    lines = [
        *(f"(void){each};" for each in function.arguments if each not in used),
        *(f"const {name}_real {each} = {value};" for each, value in named.items()),
        *(f"const {name}_real {r} = {v};" for r, v in zip(results, values, strict=True)),
        *(f"out[{k}] = {each};" for k, each in enumerate(results)),
    ]
    body = "\n".join(f"    {line}" for line in lines)
    return (
        f"{c_comment((f'{function.purpose} {count(function.results)}.',))}"
        f"static inline void {name}_{function.name}(\n"
        f"    {', '.join(inputs)},\n    {name}_real out[{size}])\n{{\n{body}\n}}\n"
    )


def c_comment(lines: tuple[str, ...]) -> str:
    """Return lines as a comment, with comment delimiters in the text broken up."""
    harmless = (line.replace("*/", "* /").replace("/*", "/ *").rstrip("\\") for line in lines)
    return "/* " + "\n * ".join(harmless) + "\n */\n"


PYTHON = Syntax(
    number=lambda value: repr(value) if value >= 0 else f"({value!r})",
    function=lambda name, of: (
        f"_direction({of})" if name == "direction" else f"np.{name.replace('atan', 'arctan')}({of})"
    ),
)
_HELPERS = '''
def _columns(joint_array):
    """Values of each joint, from an array of shape (n_joints,) or (n_samples, n_joints)."""
    values = np.asarray(joint_array, dtype=float)
    if values.shape[-1:] != (JOINTS,):
        raise ValueError(f"shape {values.shape}: the last axis must be {JOINTS} joints")
    return np.moveaxis(values, -1, 0)


def _direction(share):
    """Sign of a velocity; 0 where it is too slow to have one."""
    return np.trunc(np.clip(share, -1.0, 1.0))


def _stacked(samples, results):
    """Results of each joint as one array, joints last."""
    return np.stack([np.broadcast_to(each, samples.shape) for each in results], axis=-1)
'''


def write_python(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as a module."""
    name, found = identifier(model.robot.name), functions(model)
    head = "\n".join(f"# {line}".rstrip() for line in description(model, origin, found))
    text = "\n".join([
        head,
        '"""Dynamics of an identified robot; see above for origin and units."""\n',
        "import numpy as np\n",
        f"JOINTS = {model.robot.n_joints}",
        f"MOTOR_INERTIA = np.array({model.robot.reflected_inertia.tolist()!r})",
        _HELPERS,
        *(python_function(each) for each in found),
    ])  # fmt: skip
    return Exported({f"{name}_dynamics.py": text}, remarks(model, found))


def python_function(function: Function) -> str:
    """Return a function of Python for any number of samples."""
    named, values = assignments(function.results, PYTHON)
    first = next(iter(function.arguments))
    is_matrix = function.name == "mass_matrix"
    square = ".reshape(*found.shape[:-1], JOINTS, JOINTS)" if is_matrix else ""
    lines = [
        f'"""{function.purpose}"""',
        *(f"{each} = _columns({each})" for each in function.arguments),
        *(f"{each} = {value}" for each, value in named.items()),
        "results = [",
        *(f"    {value}," for value in values),
        "]",
        f"found = _stacked({first}[0], results)",
        f"return found{square}",
    ]
    body = "\n".join(f"    {line}" for line in lines)
    return f"\ndef {function.name}({', '.join(function.arguments)}):\n{body}\n"


_ST_NAMES = {"cbrt": "root", "direction": "direction", "sign": "sign"}
"""Functions missing in the standard, with their names in the generated text."""
_ST_BODIES = {
    "root": "SEL(x < LREAL#0.0, EXPT(ABS(x), LREAL#1.0 / LREAL#3.0),"
    " -EXPT(ABS(x), LREAL#1.0 / LREAL#3.0))",
    "direction": "SEL(x >= LREAL#1.0, LREAL#0.0, LREAL#1.0)"
    " - SEL(x <= -LREAL#1.0, LREAL#0.0, LREAL#1.0)",
    "sign": "SEL(x > LREAL#0.0, LREAL#0.0, LREAL#1.0) - SEL(x < LREAL#0.0, LREAL#0.0, LREAL#1.0)",
}


def literal(value: float) -> str:
    """Return a number as a typed literal with a decimal point, as required by the standard."""
    digits, _, exponent = repr(abs(value)).partition("e")
    whole = digits if "." in digits else f"{digits}.0"
    typed = f"LREAL#{whole}E{int(exponent)}" if exponent else f"LREAL#{whole}"
    return f"(-{typed})" if value < 0 else typed


def structured_text(name: str) -> Syntax:
    """Return the arithmetic of structured text; `name` of the robot prefixes the helpers."""
    return Syntax(
        number=literal,
        function=lambda function, of: (
            f"{name}_{_ST_NAMES[function]}({of})"
            if function in _ST_NAMES
            else f"{function.upper()}({of})"
        ),
    )


_WRAPPER = """\
FUNCTION_BLOCK {name}_softmotion IMPLEMENTS SMDYN.ISMDynamics
VAR_INPUT
    (* SI units in one unit of each axis: rad in a degree; set 0.001 for a slide in mm. *)
    unit : ARRAY[0..{last}] OF LREAL := [{units}];
END_VAR
VAR
    arm : {name}_torque;
    q : {name}_joints;
    qd : {name}_joints;
    qdd : {name}_joints;
END_VAR

METHOD AxesStateToTorque : SMC_ERROR
VAR_IN_OUT CONSTANT
    position : AXISPOS_REF;
    velocity : AXISPOS_REF;
    acceleration : AXISPOS_REF;
    params : SMDYN.DynamicsParams;
END_VAR
VAR_IN_OUT
    torque : AXISPOS_REF;
END_VAR
{lines}
END_METHOD
END_FUNCTION_BLOCK
"""
AXES_OF_SOFTMOTION = 6
"""Number of members of AXISPOS_REF."""
_IN_CODESYS = (
    "In CODESYS, create an object per type, function and block, and paste declaration and body."
)
_SOFTMOTION = (
    "Dynamic model of an axis group, for SMC_GroupSetDynamics of CODESYS SoftMotion from 4.13 on.",
    "From the public documentation of CODESYS: interface ISMDynamics of library SM3_Dynamics"
    " (namespace SMDYN, 4.13 to 4.18) with its method AxesStateToTorque and the structure"
    " DynamicsParams; AXISPOS_REF of SM3_Transformation (a0 to a5); torques in N m or N at the"
    " gearbox output (SMC_ChangeDynamicLimits).",
    "NOT VERIFIED: names, types and order of the method's arguments, not given in that "
    "documentation. Let CODESYS declare the method (context menu of the block: Implement "
    "interfaces), and take over the lines below with the names that it declares.",
    "Gravity and load are those of the identified run: params is ignored.",
    "SoftMotion requests states in any order, so friction reverses here without presliding. "
    "Along a motion, call {name}_dynamics in each cycle.",
)


def write_st(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as function blocks of structured text."""
    name, found = identifier(model.robot.name), (*functions(model), stateful_dynamics(model))
    joints = model.robot.n_joints
    used = _operations(found)
    array = "TYPE {}_{} : ARRAY[0..{}] OF LREAL; END_TYPE\n"
    text = "\n".join([
        st_comment((*description(model, origin, found), "", _IN_CODESYS)),
        array.format(name, "joints", joints - 1) + array.format(name, "matrix", joints**2 - 1),
        *(
            f"FUNCTION {name}_{helper} : LREAL\nVAR_INPUT\n    x : LREAL;\nEND_VAR\n"
            f"    {name}_{helper} := {_ST_BODIES[helper]};\nEND_FUNCTION\n"
            for operation, helper in _ST_NAMES.items()
            if operation in used
        ),
        *(st_block(name, each, joints) for each in found),
    ])  # fmt: skip
    files, said = {f"{name}_dynamics.st": text}, remarks(model, found)
    if joints > AXES_OF_SOFTMOTION:
        lack = f"no block for SoftMotion, whose groups have {AXES_OF_SOFTMOTION} axes at most"
        return Exported(files, (*said, lack))
    axes = range(joints)
    states = {"q": "position", "qd": "velocity", "qdd": "acceleration"}
    lines = [
        *(f"    {a}[{k}] := {b}.a{k} * unit[{k}];" for a, b in states.items() for k in axes),
        "    arm(q := q, qd := qd, qdd := qdd);",
        *(f"    torque.a{k} := arm.out[{k}];" for k in axes),
        "    AxesStateToTorque := SMC_ERROR.SMC_NO_ERROR;",
    ]
    units = (literal(math.pi / 180 if each else 1.0) for each in model.robot.revolute.tolist())
    head = (*cautions(model), *(line.format(name=name) for line in _SOFTMOTION))
    wrapper = st_comment(head) + _WRAPPER.format(
        name=name, last=joints - 1, units=", ".join(units), lines="\n".join(lines)
    )
    return Exported(files | {f"{name}_softmotion.st": wrapper}, said)


def st_block(name: str, function: Function, joints: int) -> str:
    """Return a function block; arguments in `MEMORY` become variables kept between calls."""
    syntax, kept = structured_text(name), [each for each in MEMORY if each in function.arguments]
    named, values = assignments(function.results, syntax)
    results = [*PARTS, *kept[1:]] if kept else ["out"]
    size = len(values) // len(results)
    kind = st_type(name, joints, size)
    places = [f"{each}[{k}]" for each in results for k in range(size)]
    stated = (*named.items(), *zip(places, values, strict=True))
    lines = [f"{each} := {value};" for each, value in stated]
    names = list(named)
    rows = (names[k : k + 12] for k in range(0, len(names), 12))
    declared = [f"{', '.join(row)} : LREAL;" for row in rows]
    if kept:
        known = " AND ".join(f"(ABS(q[{k}]) >= LREAL#0.0)" for k in range(size))
        begin = ["IF first THEN", "    before := q;", f"    first := NOT ({known});", "END_IF;"]
        first = len(lines) - size * len(kept[1:])
        directions = lines[first:]
        lines = [*begin, *lines[:first]]
        for k in range(size):  # a position that is NaN changes neither direction nor memory
            lines += [
                f"IF ABS(q[{k}] - before[{k}]) >= LREAL#0.0 THEN",
                *(f"    {each}" for each in directions[k::size]),
                "END_IF;",
                f"IF ABS(q[{k}]) >= LREAL#0.0 THEN",
                f"    before[{k}] := q[{k}];",
                "END_IF;",
            ]
        declared = [*(f"{each} : {kind};" for each in kept), "first : BOOL := TRUE;", *declared]
    inputs = [f"{each} : {name}_joints;" for each in function.arguments if each not in kept]
    outputs = [f"{each} : {kind};" for each in results[: len(PARTS)]]
    return (
        f"{st_comment((f'{function.purpose} {count(function.results)}.',))}"
        f"FUNCTION_BLOCK {name}_{function.name}\n"
        f"{st_variables('VAR_INPUT', inputs)}{st_variables('VAR_OUTPUT', outputs)}"
        f"{st_variables('VAR', declared) if declared else ''}"
        f"{indented(lines)}\nEND_FUNCTION_BLOCK\n"
    )


def st_type(name: str, joints: int, size: int) -> str:
    """Return the name of the type of arrays of a size."""
    return f"{name}_{({joints**2: 'matrix'} | {joints: 'joints'}).get(size, 'columns')}"


def st_variables(section: str, declared: list[str]) -> str:
    """Return declarations of variables in a section."""
    return f"{section}\n{indented(declared)}\nEND_VAR\n"


def indented(lines: list[str]) -> str:
    """Return lines as a text with an indent."""
    return "\n".join(f"    {line}" for line in lines)


def st_comment(lines: tuple[str, ...]) -> str:
    """Return lines as a comment, with comment delimiters in the text broken up."""
    harmless = (line.replace("*)", "* )").replace("(*", "( *") for line in lines)
    return "(* " + "\n   ".join(harmless) + " *)\n"
