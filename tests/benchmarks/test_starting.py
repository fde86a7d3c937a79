"""Benchmarks that import helpers of the tests start from the command line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
TAKING = sorted(path for path in BENCHMARKS.glob("*.py") if '"tests"' in path.read_text())
EACH = """
import os, runpy, sys
import hil.imports.importing, hil.measuring.campaign, hil.report.page, hil.results.identification
for path in sys.argv[1:]:
    if not os.fork():
        runpy.run_path(path)
        os._exit(0)
    print(path, os.wait()[1], flush=True)
"""
"""Program that starts each benchmark in a fork of itself, since all take long to import `hil`."""


@pytest.fixture(scope="module")
def started() -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", EACH, *map(str, TAKING)]
    return subprocess.run(command, cwd=BENCHMARKS, capture_output=True, text=True, check=True)  # noqa: S603 - our own


@pytest.mark.parametrize("path", TAKING, ids=lambda path: path.stem)
def test_a_benchmark_starts(path: Path, started: subprocess.CompletedProcess[str]) -> None:
    assert f"{path} 0\n" in started.stdout, started.stderr
