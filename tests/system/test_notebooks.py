"""Notebooks of the documentation agree with their text, and become pages."""

from __future__ import annotations

import json
import re
import runpy
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOKS = DOCS / "tutorials" / "notebooks"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EXAMPLES", str(DOCS.parent / "examples"))
    return tmp_path


def test_all_notebooks_are_tested() -> None:
    names = {path.stem for path in NOTEBOOKS.glob("*.py")}
    assert names == {"virtual_robot", "gravity_compensation"}


def test_the_virtual_robot_is_planned_measured_identified_and_compared(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = runpy.run_path(str(NOTEBOOKS / "virtual_robot.py"))
    assert len(found["run"]) == len(found["plan"].measurements) == 32
    assert found["inside"].sum() >= 13
    assert "good: " in capsys.readouterr().out


def test_gravity_of_a_recorded_head_is_found_and_taken_away(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = runpy.run_path(str(NOTEBOOKS / "gravity_compensation.py"))
    assert found["judgement"].word == "good"
    size = [(found[name] ** 2).mean(axis=0) ** 0.5 for name in ("tau", "left")]
    assert size[1][1] < size[0][1] / 2  # tilting fights gravity
    assert size[1][0] == pytest.approx(size[0][0], rel=0.02)  # panning does not
    assert list((place / "exported").glob("*.c"))


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.py")), ids=lambda path: path.stem)
def test_a_notebook_imports_hil_by_its_public_names_alone(path: Path) -> None:
    imported = re.findall(r"(?m)^(?:from|import) (\S+)", path.read_text(encoding="utf-8"))
    assert [name for name in imported if name.split(".")[0] in {"hil", "drivers"}] == ["hil"]


def test_a_notebook_becomes_a_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "site"))
    monkeypatch.delitem(sys.modules, "notebooks", raising=False)
    from notebooks import carried_out, cells, notebook, page

    source = "# %% [markdown]\n# # Head\n#\n# Prose.\n\n# %%\nx = 1  # one\n"
    assert page(source) == "# Head\n\nProse.\n\n```python\nx = 1  # one\n```\n"
    found = carried_out(cells(source + "# %%\nprint(x)\nx + 1\n"))
    assert page(source, found).endswith("```text\n1\n```\n\n```text\n2\n```\n")
    *_, last = json.loads(notebook(found))["cells"]
    assert [each["output_type"] for each in last["outputs"]] == ["stream", "execute_result"]
    assert last["outputs"][1]["data"] == {"text/plain": "2"}
    with pytest.raises(ValueError, match="begin with # %%"):
        page("x = 1\n# %%\n")
