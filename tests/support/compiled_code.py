"""Exported code as it is used: C compiled into a library, Python as a module."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from hil.export.functions import functions
from hil.export.languages import write_c, write_python
from hil.export.source_code import identifier

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

COMPILER = shutil.which("cc")
STRICT = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler (cc)")


def module(model: Model) -> dict[str, Any]:
    (text,) = write_python(model, ("origin",)).files.values()
    names: dict[str, Any] = {}
    exec(compile(text, "exported", "exec"), names)  # noqa: S102 - our own text
    return names


def compiled(model: Model, folder: Path, *flags: str) -> ctypes.CDLL:
    """The header as a library: each function once more, with a name to be found by."""
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


def called(function: Any, arguments: tuple[Array, ...], shape: tuple[int, ...], kind: Any) -> Array:
    """Call a C function sample by sample."""
    out = np.empty(shape, dtype=kind)
    samples = [np.ascontiguousarray(each, dtype=kind) for each in arguments]
    for k in range(len(out)):
        function(*(ctypes.c_void_p(each[k].ctypes.data) for each in (*samples, out)))
    return out.astype(float)
