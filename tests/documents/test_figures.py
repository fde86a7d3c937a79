"""Figures in the documents equal those kept by benchmarks, and are not older than stated."""

from __future__ import annotations

import re
import subprocess
from typing import TYPE_CHECKING

import figures
import over_time
import pytest
from figures import MARKED, MOST_COMMITS, ROOT, Figure, expanded, keep, read

if TYPE_CHECKING:
    from pathlib import Path

DOCUMENTS = figures.documents()
USED = sorted({found[2] for path in DOCUMENTS for found in MARKED.findall(path.read_text())})
UNMEASURED = {"figures.py", "over_time.py", "golden.py", "two_users.py"}
"""Programs of benchmarks/ without measured figures, or with figures in benchmarks/golden."""
PROGRAMS = (path for path in (ROOT / "benchmarks").glob("*.py") if "__main__" in path.read_text())
BENCHMARKS = sorted(path for path in PROGRAMS if path.name not in UNMEASURED)
FENCED = re.compile(r"(?ms)^```.*?^```")
MEASURED = re.compile(r"\d[\d.]* (?:%|us|ms|mrad|kg|times)(?!\w)")
STATED = (
    "0.4 to 0.8 %", "5 % of the load", "80 % of the velocity limits", "within 20 ms", "95.1 kg",
    "published 95", "three times", "four times", "95 % intervals",
    "intervals of 95 %", "± 95 %",
)  # fmt: skip
"""Figures with a unit in README that are not measured here: conditions and published values."""


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_a_document_prints_what_was_measured(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    assert expanded(text) == text, "make figures writes it"


def test_readme_prints_no_figure_that_is_not_marked() -> None:
    text = MARKED.sub("", FENCED.sub("", (ROOT / "README.md").read_text(encoding="utf-8")))
    for stated in STATED:
        text = text.replace(stated, "")
    assert MEASURED.findall(text) == [], "mark it (benchmarks/figures.py), or list it as STATED"


def test_a_contradiction_and_an_unknown_name_are_found() -> None:
    marked = "<!--figure:claims-default.published-inside-->64.6 %<!--end-->"
    assert expanded(marked) == marked
    assert expanded(marked.replace("64.6", "64.9")) == marked
    with pytest.raises(KeyError, match=r"claims-default\.unknown: there is no such figure"):
        expanded("<!--number:claims-default.unknown-->95<!--end-->")
    with pytest.raises(KeyError, match=r"nobody: there is no benchmarks.results.nobody\.json"):
        expanded("<!--number:nobody.figure-->95<!--end-->")


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda path: path.stem)
def test_a_benchmark_keeps_its_figures(benchmark: Path) -> None:
    assert re.search(r"(?m)^ +keep\(", benchmark.read_text(encoding="utf-8")), "see figures.py"


@pytest.mark.parametrize("name", USED)
def test_the_code_of_a_figure_has_not_changed_too_often_since(name: str) -> None:
    if subprocess.run(["git", "rev-parse"], cwd=ROOT, check=False).returncode:  # noqa: S607
        pytest.skip("without git nobody knows what has changed")
    depends = [ROOT / place for place in read(name).depends]
    assert [place for place in depends if not place.exists()] == []
    assert figures.commits_since(name) <= MOST_COMMITS, f"repeat {read(name).command}"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0764, 2, "0.076"), (0.8, 2, "0.80"), (98.57, 3, "98.6"), (889.7, 3, "890"),
        (15234.0, 2, "15000"), (0.0, 1, "0"), (9.97, 2, "10"), (3.8, 2, "3.8"),
    ],
)  # fmt: skip
def test_figures_have_their_significant_digits(value: float, digits: int, text: str) -> None:
    assert Figure(value, "%", digits).number == text
    assert Figure(value, "%", digits).text == f"{text} %"


def test_a_count_has_all_its_digits() -> None:
    assert [Figure.count(number).text for number in (0, 7, 156, 5276)] == ["0", "7", "156", "5276"]


def test_a_median_is_not_moved_by_a_turn_that_was_disturbed() -> None:
    assert Figure.median([*[2.9, 3.0, 3.1] * 10, 200.0], "us").stated == "3.0 ± 0.1 us"


def test_what_is_kept_states_where_it_was_measured_and_what_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(figures, "RESULTS", tmp_path)
    how = {"depends": ["hil/export"], "command": "python benchmarks/x.py", "seeds": [1, 2]}
    keep("x", {"a": Figure(1.0, "s", scatter=0.1), "b": Figure(2.0)}, **how)
    assert read("x").figures == {"a": Figure(1.0, "s", scatter=0.1), "b": Figure(2.0)}
    assert re.fullmatch(r"[0-9a-f]{7,}(-dirty)?", read("x").commit)
    assert figures.commits_since("x") == 0
    capsys.readouterr()
    keep("x", {"a": Figure(1.05, "s"), "b": Figure(3.0)}, **how)
    assert capsys.readouterr().out == "x.b: 2.0 -> 3.0\nx: 1 of 2 figures have changed\n"


def test_what_is_no_figure_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "RESULTS", tmp_path)
    with pytest.raises(ValueError, match=r"x: no figures, so nothing is kept: b"):
        keep("x", {"a": Figure(1.0), "b": Figure(float("nan"))}, depends=(), command="")
    assert not list(tmp_path.iterdir())


def test_the_page_over_time_has_a_column_a_measurement_with_its_scatter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    results = tmp_path / "benchmarks" / "results"
    results.mkdir(parents=True)
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    monkeypatch.setattr(figures, "RESULTS", results)
    figures.git("init", "-q")
    as_somebody = ("-c", "user.name=x", "-c", "user.email=x")
    for value in (1.0, 2.0):
        figures.git(*as_somebody, "commit", "-q", "--allow-empty", "-m", "code")
        keep("x", {"a": Figure(value, "s", scatter=0.1)}, depends=(), command="python x.py")
        if value == 1.0:
            figures.git("add", ".")
            figures.git(*as_somebody, "commit", "-q", "-m", "figures")
    assert "| a | 2.0 ± 0.1 s | 1.0 ± 0.1 s |" in over_time.page()
    capsys.readouterr()
    over_time.main()
    assert capsys.readouterr().out.splitlines()[0] == "x.a: 1.0 ± 0.1 s -> 2.0 ± 0.1 s"
