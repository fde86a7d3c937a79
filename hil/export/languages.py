"""A model as C99 or as one Python module.

C: one header of static inline functions, an example, and a CMake file. No memory is allocated,
nothing is included but <math.h>, and no state is kept. Numbers are double, or float where
``NAME_SINGLE`` is defined before the header is included. Python: a module that needs numpy alone;
its functions take any number of samples.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.export.exported import Exported, cautions
from hil.export.expressions import count, needed
from hil.export.functions import functions
from hil.export.source_code import Syntax, assignments, description, identifier, remarks

if TYPE_CHECKING:
    from hil.export.functions import Function
    from hil.results.model import Model

_FUNCTIONS = {"abs": "fabs"}
_MACROS = {"sign": "HIL_SIGN", "direction": "HIL_DIRECTION"}
C = Syntax(
    number=lambda value: f"HIL_R({value!r})",
    function=lambda name, of: (
        f"{_MACROS[name]}({of})"
        if name in _MACROS
        else f"HIL_F({_FUNCTIONS.get(name, name)})({of})"
    ),
)
_TYPES = """\
#ifdef {upper}_SINGLE
typedef float {name}_real;
#define HIL_F(function) function##f
#else
typedef double {name}_real;
#define HIL_F(function) function
#endif
#define HIL_R(number) (({name}_real)(number))
#define HIL_SIGN(x) (({name}_real)(((x) > 0) - ((x) < 0)))
#define HIL_DIRECTION(x) (({name}_real)(((x) >= 1) - ((x) <= -1)))
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
        _c_comment(description(model, origin, found)),
        f"#ifndef {upper}_DYNAMICS_H\n#define {upper}_DYNAMICS_H\n\n#include <math.h>\n",
        _TYPES.format(name=name, upper=upper),
        f"#define {upper}_JOINTS {model.robot.n_joints}",
        "/* Motors' own inertia, joint side, for the diagonal of the mass matrix. */",
        f"#define {upper}_MOTOR_INERTIA {{{inertias}}}\n",
        *(_c_function(name, upper, each) for each in found),
        "#undef HIL_F\n#undef HIL_R\n#undef HIL_SIGN\n#undef HIL_DIRECTION\n\n#endif\n",
    ])  # fmt: skip
    files = {
        f"{name}_dynamics.h": header,
        "example.c": (_c_comment(against) if against else "")
        + _EXAMPLE.format(name=name, upper=upper),
        "CMakeLists.txt": "".join(f"# {line}\n" for line in against) + _CMAKE.format(name=name),
    }
    return Exported(files, remarks(model, found))


def _c_function(name: str, upper: str, function: Function) -> str:
    size = f"{upper}_JOINTS" + (f" * {upper}_JOINTS" if function.name == "mass_matrix" else "")
    inputs = [f"const {name}_real {each}[{upper}_JOINTS]" for each in function.arguments]
    named, values = assignments(function.results, C)
    results = [f"r{k}" for k in range(len(values))]
    lines = [
        *(f"(void){each};" for each in _unused(function)),
        *(f"const {name}_real {each} = {value};" for each, value in named.items()),
        *(f"const {name}_real {r} = {v};" for r, v in zip(results, values, strict=True)),
        *(f"out[{k}] = {each};" for k, each in enumerate(results)),
    ]
    body = "\n".join(f"    {line}" for line in lines)
    return (
        f"{_c_comment((f'{function.purpose} {count(function.results)}.',))}"
        f"static inline void {name}_{function.name}(\n"
        f"    {', '.join(inputs)},\n    {name}_real out[{size}])\n{{\n{body}\n}}\n"
    )


def _unused(function: Function) -> list[str]:
    """Arguments that the results do not depend on."""
    used = {each.name.partition("[")[0] for each in needed(function.results)}
    return [argument for argument in function.arguments if argument not in used]


def _c_comment(lines: tuple[str, ...]) -> str:
    """Lines as a comment, whatever stands in them."""
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
        *(_python_function(each) for each in found),
    ])  # fmt: skip
    return Exported({f"{name}_dynamics.py": text}, remarks(model, found))


def _python_function(function: Function) -> str:
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
