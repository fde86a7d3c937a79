"""Targets of links in the documents exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
PACKAGES = "checked_files|hil|drivers|sim_plant|tests|benchmarks|tools|examples"
PLACE = re.compile(rf"`((?:{PACKAGES})/[\w./-]*)`")
OURS = r"https://github\.com/canopen-robot-identification/[\w-]+/(?:blob|raw)/main/"
"""Address of this repository in README, which stands on the package index, too."""
LINK = re.compile(rf"\]\((?:{OURS})?([^)#:]+)(?:#[^)]*)?\)")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_file_that_a_document_names_or_links_exists(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    named = {ROOT / place for place in PLACE.findall(text)}
    linked = {document.parent / place for place in LINK.findall(text)}
    assert [str(path) for path in sorted(named | linked) if not path.exists()] == []


def test_links_of_readme_hold_on_the_package_index() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"\]\((?!https://)[^)]*\)", text) == []
    (source,) = re.findall(r'(?m)^Source = "(.*)"$', (ROOT / "pyproject.toml").read_text())
    assert len(re.findall(OURS, text)) == text.count(f"({source}/") > 20


def test_readme_and_front_page_of_the_documents_open_the_same_doors() -> None:
    def doors(path: Path) -> list[str]:
        table = path.read_text(encoding="utf-8").partition("| you are | begin with |")[2]
        return re.sub(rf"\]\({OURS}docs/", "](", table.partition("\n\n")[0]).splitlines()[2:]

    assert doors(ROOT / "README.md") == doors(ROOT / "docs" / "index.md") != []
