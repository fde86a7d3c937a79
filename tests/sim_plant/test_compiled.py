"""Compiled code on disk matches the sources, including callees in other files."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

CALLER = """
from sim_plant.compiled import compiled
from {package} import constants
from {package}.callee import factor

@compiled
def call(x: float) -> float:
    return factor(x) + constants.OFFSET
"""
CALLEE = """
from sim_plant.compiled import {decorator}

@{decorator}
def factor(x: float) -> float:
    return {factor} * x
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "kernels"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "caller.py").write_text(CALLER.format(package=folder.name))
    (folder / "constants.py").write_text("OFFSET = 0.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # separate key: seconds and length
    return folder


def fresh(package: Path) -> Callable[[float], float]:
    """Return the compiled function as seen by a new process."""
    for name in [name for name in sys.modules if name.partition(".")[0] == package.name]:
        del sys.modules[name]
    importlib.invalidate_caches()
    return importlib.import_module(f"{package.name}.caller").call


def loaded(function: Callable[[float], float]) -> bool:
    """Return True if the only compiled variant came from disk."""
    return sum(function.stats.cache_hits.values()) == 1


def kept(package: Path) -> set[str]:
    return {path.name for path in package.glob("__pycache__/*.nb?")}


@pytest.mark.parametrize("decorator", ["compiled", "inlined", "ordered"])
def test_a_changed_callee_in_another_file_is_compiled_anew(package: Path, decorator: str) -> None:
    callee = package / "callee.py"
    callee.write_text(CALLEE.format(decorator=decorator, factor=2.0))
    assert fresh(package)(1.0) == 2.0
    again = fresh(package)
    assert again(1.0) == 2.0
    assert loaded(again)
    callee.write_text(CALLEE.format(decorator=decorator, factor=3.0))
    assert fresh(package)(1.0) == 3.0


def test_a_changed_constant_in_another_file_is_compiled_anew(package: Path) -> None:
    (package / "callee.py").write_text(CALLEE.format(decorator="compiled", factor=2.0))
    assert fresh(package)(1.0) == 2.0
    (package / "constants.py").write_text("OFFSET = 10.0\n")
    assert fresh(package)(1.0) == 12.0


def test_a_file_that_is_not_imported_costs_no_compilation(package: Path) -> None:
    (package / "callee.py").write_text(CALLEE.format(decorator="compiled", factor=2.0))
    assert fresh(package)(1.0) == 2.0
    (package / "other.py").write_text("OFFSET = 10.0\n")
    again = fresh(package)
    assert again(1.0) == 2.0
    assert loaded(again)


def test_what_was_compiled_of_older_sources_is_removed(package: Path) -> None:
    callee = package / "callee.py"
    callee.write_text(CALLEE.format(decorator="compiled", factor=2.0))
    fresh(package)(1.0)
    first = kept(package)
    assert first
    for factor in (3.0, 4.0):
        callee.write_text("\n" + CALLEE.format(decorator="compiled", factor=factor))
        fresh(package)(1.0)
    assert len(kept(package)) == len(first)
    assert not kept(package) & first
