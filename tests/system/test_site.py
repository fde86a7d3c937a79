"""Documentation as a site: built without a warning, with all commands and all keys."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hil import cli
from hil.planning.plan import Plan

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Site built from a copy, since generated pages are written beside the others."""
    made = tmp_path_factory.mktemp("site")
    shutil.copytree(ROOT / "docs", made / "docs")
    shutil.copy(ROOT / "pyproject.toml", made)
    shutil.copytree(ROOT / "benchmarks", made / "benchmarks")
    # test_notebooks.py runs the notebooks
    once = ["-q", "-W", "--keep-going", "-D", "carry_out=0"]
    command = [sys.executable, "-m", "sphinx", *once, made / "docs", made]
    built = subprocess.run(  # noqa: S603 - our own
        command, capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert (built.returncode, built.stderr) == (0, "")
    return made


def test_every_command_has_its_section(site: Path) -> None:
    page = (site / "reference" / "commands.html").read_text(encoding="utf-8")
    assert [name for name in cli.COMMANDS if f'id="hil-{name}"' not in page] == []


def test_the_keys_of_files_stand_there_with_their_meaning(site: Path) -> None:
    page = (site / "reference" / "files.html").read_text(encoding="utf-8")
    assert [key for key in Plan.model_fields if f">{key}</span>" not in page] == []


def test_pages_need_no_network_and_formulas_are_drawn(site: Path) -> None:
    loaded = re.compile(r'<(?:script|img)[^>]+src="https?:|<link[^>]+stylesheet[^>]+https?:')
    pages = {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    assert [str(page) for page, text in pages.items() if loaded.search(text)] == []
    assert '<span class="formula"' in pages[site / "explanation" / "excluded.html"]
