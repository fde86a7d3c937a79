"""Benchmarks that import helpers of the tests start from the command line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
TAKING = sorted(path for path in BENCHMARKS.glob("*.py") if '"tests"' in path.read_text())


@pytest.mark.parametrize("path", TAKING, ids=lambda path: path.stem)
def test_a_benchmark_starts(path: Path) -> None:
    command = [sys.executable, "-c", f"import runpy; runpy.run_path({str(path)!r})"]
    done = subprocess.run(command, cwd=BENCHMARKS, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    assert done.returncode == 0, done.stderr
