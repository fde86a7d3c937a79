"""Import and identification without Numba and without the compiled recursion.

Numba is absent as in a Python without a wheel of Numba: the module cannot be imported, and no
package of this name is installed. The absence of the compiled recursion is that of a machine
without C compiler.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.results.model import Model

if TYPE_CHECKING:
    import pytest
    from command_line import Hil

ROOT = Path(__file__).parents[3]
ABSENT = """
import importlib.metadata, sys
sys.modules["numba"] = sys.modules["llvmlite"] = sys.modules["hil.model.recursion"] = None
found = importlib.metadata.version
def version(name):
    if name == "numba":
        raise importlib.metadata.PackageNotFoundError(name)
    return found(name)
importlib.metadata.version = version
from hil.cli import main
main(sys.argv[1:])
"""
PAN_TILT = ROOT / "examples" / "pan_tilt"
STEPS = (
    ("import", PAN_TILT / "excitation.yaml", "-o", "head"),
    ("identify", "head"),
    ("import", PAN_TILT / "other.yaml", "-o", "other"),
    ("validate", "other", "--model", "head"),
    ("report", "head"),
)


def run_without_numba(*arguments: object, place: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", ABSENT, *map(str, arguments)],
        cwd=place, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_recording_gives_the_same_figures(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "with").mkdir()
    (tmp_path / "without").mkdir()
    monkeypatch.chdir(tmp_path / "with")
    for step in STEPS:
        status, shown, err = hil(*step)
        done = run_without_numba(*step, place=tmp_path / "without")
        assert (status, err, done.returncode, done.stderr) == (0, "", 0, ""), step
        if step[0] == "validate":
            assert done.stdout == shown
    kept = [Model.load(tmp_path / place / "head") for place in ("with", "without")]
    scale = np.sqrt(np.diag(kept[0].covariance))
    np.testing.assert_allclose(kept[1].values / scale, kept[0].values / scale, atol=1e-6)
    np.testing.assert_allclose(kept[1].covariance, kept[0].covariance, rtol=1e-6, atol=1e-18)
    assert [each.verdict.word for each in kept] == ["good", "good"]
    pages = {page.name for page in (tmp_path / "without").rglob("*.html")}
    assert pages == {"report.html", "validation.html"}


def test_the_virtual_plant_says_what_it_needs(tmp_path: Path) -> None:
    run_without_numba("plan", "manutec-r15", "-o", "plan.yaml", place=tmp_path)
    done = run_without_numba("run", "plan.yaml", "-o", "run", place=tmp_path)
    assert (done.returncode, "Traceback" in done.stderr) == (1, False), done.stderr
    assert "the virtual plant needs Numba, which is not installed: pip install numba" in done.stderr
