"""Exported code in use: C and structured text compiled into libraries, Python as a module."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from hil.export.functions import MEMORY, PARTS, functions, stateful_dynamics
from hil.export.languages import write_c, write_python, write_st
from hil.export.source_code import identifier

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

COMPILER = shutil.which("cc")
STRICT = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler (cc)")
IEC2C = shutil.which("iec2c")
MATIEC = os.environ.get("MATIEC_LIB", str(Path(IEC2C or "").resolve().parent / "lib"))
"""Folder of matiec's standard functions, beside the compiler by default."""
needs_iec2c = pytest.mark.skipif(
    IEC2C is None or COMPILER is None, reason="there is no matiec (iec2c) or no cc"
)
SOURCE = '#include <string.h>\n#include "POUS.h"\n#include "POUS.c"\nTIME __CURRENT_TIME;\n'


def module(model: Model) -> dict[str, Any]:
    (text,) = write_python(model, ("origin",)).files.values()
    names: dict[str, Any] = {}
    exec(compile(text, "exported", "exec"), names)  # noqa: S102 - our own text
    return names


def compiled(model: Model, folder: Path, *flags: str) -> ctypes.CDLL:
    """Compile the header into a library with a public symbol for each function."""
    name = identifier(model.robot.name)
    for file, text in write_c(model, ("origin */ of /* a \\", "run")).files.items():
        (folder / file).write_text(text)
    lines = [f'#include "{name}_dynamics.h"']
    for each in functions(model):
        arguments = ", ".join(f"const {name}_real *{a}" for a in each.arguments)
        call = f"{name}_{each.name}({', '.join(each.arguments)}, out)"
        prototype = f"void {each.name}({arguments}, {name}_real *out)"
        lines += [f"{prototype};", f"{prototype} {{ {call}; }}"]
    (folder / "library.c").write_text("\n".join(lines) + "\n")
    assert COMPILER is not None
    command = [COMPILER, *STRICT, *flags, "-shared", "-fPIC", "library.c", "-o", "lib.so", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(folder / "lib.so"))


def compiled_text(model: Model, folder: Path) -> ctypes.CDLL:
    """Compile structured text by matiec and cc: each block as a C function; `dynamics` has one
    state.

    Results of `dynamics` are the `PARTS` in sequence.
    """
    assert IEC2C is not None
    assert COMPILER is not None
    name, n = identifier(model.robot.name), model.robot.n_joints
    (folder / "text.st").write_text(
        write_st(model, ("origin *) of (* a",)).files[f"{name}_dynamics.st"]
    )
    lines = [SOURCE]
    for each in (*functions(model), stateful_dynamics(model)):
        block = f"{name}_{each.name}".upper()
        inputs = [a for a in each.arguments if a not in MEMORY]
        outputs = PARTS if each.name == "dynamics" else ("out",)
        prototype = ", ".join(f"const double *{a}" for a in inputs)
        lines += [
            f"void {each.name}({prototype}, double *out) {{ static {block} b; static int ready;",
            f"if (!ready) {{ {block}_init__(&b, 0); ready = 1; }}",
            *(f"memcpy(b.{a.upper()}.value.table, {a}, {n} * sizeof(double));" for a in inputs),
            f"{block}_body__(&b);",
            *(
                f"memcpy(out + {k * n}, b.{a.upper()}.value.table, sizeof b.{a.upper()}.value);"
                for k, a in enumerate(outputs)
            ),
            "}",
        ]
    (folder / "library.c").write_text("\n".join(lines) + "\n")
    for command in (
        [IEC2C, "-I", MATIEC, "-T", ".", "text.st"],
        [
            COMPILER,
            "-w",
            "-I",
            f"{MATIEC}/C",
            "-shared",
            "-fPIC",
            "library.c",
            "-o",
            "st.so",
            "-lm",
        ],
    ):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
        assert done.returncode == 0, done.stdout + done.stderr
    return ctypes.CDLL(str(folder / "st.so"))


def called(function: Any, arguments: tuple[Array, ...], shape: tuple[int, ...], kind: Any) -> Array:
    """Call a C function sample by sample."""
    out = np.empty(shape, dtype=kind)
    samples = [np.ascontiguousarray(each, dtype=kind) for each in arguments]
    for k in range(len(out)):
        function(*(ctypes.c_void_p(each[k].ctypes.data) for each in (*samples, out)))
    return out.astype(float)
