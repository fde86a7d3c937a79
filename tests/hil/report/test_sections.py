"""A section of a report is defined by a function, its template and a line of the registry."""

from __future__ import annotations

import ast
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from small_run import empty_plots, write_run

from hil.planning.design.friction import sweep
from hil.report import page, sections
from hil.runs.run import Run
from hil.show.html import TEMPLATES
from hil.show.outcome import Plot, Section
from hil.show.table import Column, Part, Table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun

HERE = Path(sections.__file__).parent
MODULES = sorted(path.stem for path in HERE.glob("*.py") if path.stem != "__init__")
VOID = {"meta", "img", "br"}
ADDED = """{% from "plot.html" import figure %}
{{ robot }}{{ table | table }}{{ figure(plots.added) }}
"""


class Outline(HTMLParser):
    """Open tags in order, and the text of every section."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.sections: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.ids += [value for name, value in attributes if name == "id" and value]
        if tag == "section":
            self.sections.append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Ignore empty elements, which are never open."""

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"line {self.getpos()[0]}"

    def handle_data(self, data: str) -> None:
        if "section" in self.open:
            self.sections[-1] += data.strip()


@pytest.fixture(scope="module")
def mixed(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Campaign with friction measurements at six speeds of the last axis."""
    path = tmp_path_factory.mktemp("mixed") / "run"
    write_run(path, manutec, more=sweep(manutec, [5], speeds=6).measurements)
    return path


@pytest.fixture(scope="module")
def read(mixed: Path) -> Iterator[tuple[list[str], str]]:
    """Return ids of the recordings in their order of reading, and the report."""
    ids: list[str] = []
    read = Run.read
    with pytest.MonkeyPatch.context() as patched:
        empty_plots(patched)
        patched.setattr(Run, "read", lambda run, m: (ids.append(m.id), read(run, m))[1])
        yield ids, page.report(Run.open(mixed)).read_text()


def sections_and_templates() -> tuple[set[str], set[str]]:
    """Return the functions for sections of a run, and the templates named by their modules."""
    made, templates = set(), set()
    for module in MODULES:
        tree = ast.parse((HERE / f"{module}.py").read_text())
        texts = (each.value for each in ast.walk(tree) if isinstance(each, ast.Constant))
        templates |= {text for text in texts if str(text).endswith(".html")}
        for node in tree.body:
            if not isinstance(node, ast.FunctionDef) or node.args.args[0].arg != "run":
                continue
            if ast.unparse(node.returns).startswith("Section"):
                made.add(f"{module}.{node.name}")
    return made, templates


def test_every_section_is_listed_and_every_template_is_of_one() -> None:
    listed = (*sections.OF_IDENTIFIED, *sections.OF_FRICTION)
    made, templates = sections_and_templates()
    assert {f"{each.__module__.rpartition('.')[2]}.{each.__name__}" for each in listed} == made
    assert templates == {path.name for path in HERE.glob("*.html")}


def test_neither_the_page_nor_its_template_names_a_section() -> None:
    tree = ast.parse(Path(page.__file__).read_text())
    named = {node.name for node in ast.walk(tree) if isinstance(node, ast.alias)}
    assert not named & set(MODULES)
    template = (TEMPLATES / "report.html").read_text()
    assert not [name for name in MODULES if f"{name}." in template or f'"{name}"' in template]


@pytest.mark.long
def test_a_further_section_is_shown_with_its_table_and_its_plot_once_it_is_listed(
    mixed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = Table("Joints", (Column("axis"),), (Part((("of all",),)),))
    plot = Plot("added", tuple, "An empty plot.", "Nothing at all.")

    def added(run: ReportedRun) -> Section:
        values = {"table": table, "robot": run.robot.name}
        return Section("An added section", "added.html", values, (plot,))

    (tmp_path / "added.html").write_text(ADDED)
    monkeypatch.setattr(page, "TEMPLATES", (*page.TEMPLATES, tmp_path))
    monkeypatch.setattr(page, "OF_IDENTIFIED", (added,))
    written = page.report(Run.open(mixed), tmp_path / "figures").read_text()
    (shown,) = Outline(written).sections
    assert shown == "An added sectionmanutec-r15Jointsaxisof allNothing at all."
    assert (tmp_path / "figures" / "added.svg").read_bytes().startswith(b"<svg")


def test_a_mixed_run_is_read_once(read: tuple[list[str], str], mixed: Path) -> None:
    ids, _ = read
    assert ids == [measurement.id for measurement in Run.open(mixed).plan.measurements]


def test_a_mixed_run_has_friction_of_both_kinds_of_measurement(
    read: tuple[list[str], str],
) -> None:
    _, text = read
    places = [text.index(f"<h2>{heading}") for heading in ("Friction over", "Friction</h2>")]
    assert places == sorted(places)
    assert 'id="plot-models"' in text


def test_every_tag_is_closed_every_plot_has_an_id_of_its_own_and_no_section_is_empty(
    read: tuple[list[str], str],
) -> None:
    found = Outline(read[1])
    assert not found.open
    assert len(set(found.ids)) == len(found.ids)
    assert read[1].count("<figure") == len([i for i in found.ids if i.startswith("plot-")])
    # no load, diagnosis, validation, bodies, or import; the lead is no section
    assert len(found.sections) == len(sections.OF_IDENTIFIED) - 6
    assert all(len(text) > 100 for text in found.sections)
