"""Tables of results, drawn on a terminal, on a page and in a notebook."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from rich.console import Console

from hil.estimation.excluded.result import Excluded, Found, Limit
from hil.results.tables.excluded import FOUND, UNTESTED, change_by_cause, excluded, untestable
from hil.show.html import html
from hil.show.outcome import Outcome, Verdict, write_outcome
from hil.show.table import Column, Marked, Part, Table, figures
from hil.show.terminal import show

if TYPE_CHECKING:
    from pathlib import Path

TABLE = Table(
    title="Parameters",
    columns=(
        Column("", symbols=True),
        *figures("value", "t"),
        Column("what it is made up of", folds=True, symbols=True),
    ),
    parts=(
        Part((("p5", "48.490", "1.2", "sx2 + l1 m3"),), "gravity"),
        Part((("p1", "−32.0061", Marked("9.7"), "Izz1 + l1^2 [m3]"),), "diagonal"),
    ),
    explanation="What a page has room for.",
    notes=("axis 2 <was> [not] measured",),
)


def printed(table: Table, width: int = 100) -> str:
    text = io.StringIO()
    show(table, Console(file=text, width=width))
    return text.getvalue()


def read(page: str) -> str:
    """Return the text of HTML as seen by a reader."""
    return re.sub(r"<[^>]+>", " ", re.sub(r"</?(i|b|sub|sup)>", "", page))


def test_terminal_and_page_show_the_same_cells_under_the_same_heads() -> None:
    terminal, page = printed(TABLE), read(html(TABLE))
    for text in ("Parameters", "value", "t", "what it is made up of", "gravity", "diagonal"):
        assert text in terminal
        assert text in page
    for row in TABLE.rows:
        assert re.search(r"\s+".join(map(re.escape, row)), terminal)
        assert re.search(r"\s+".join(map(re.escape, row)).replace(r"\^", ""), page)


def test_figures_stand_to_the_right_of_their_column() -> None:
    lines = [line for line in printed(TABLE).splitlines() if re.search("value|48|32", line)]
    assert len({re.search(r"(value|\d\.\d+) ", line).end() for line in lines}) == 1
    assert html(TABLE).count('<td class="number') == 4


def test_what_stands_out_is_marked_on_a_page_and_nothing_else() -> None:
    assert re.findall(r'class="number marked">([^<]+)<', html(TABLE)) == ["9.7"]


def test_brackets_and_angles_are_text_and_no_markup() -> None:
    assert "[m3]" in printed(TABLE)
    assert "axis 2 <was> [not] measured" in printed(TABLE)
    assert "axis 2 &lt;was&gt; [not] measured" in html(TABLE)


def test_powers_and_indices_are_typeset_on_a_page() -> None:
    assert "<i>I</i><sub>zz1</sub> + <i>l</i><sub>1</sub><sup>2</sup>" in html(TABLE)


def test_a_narrow_terminal_folds_expressions_and_no_figure() -> None:
    assert re.search("−32.0061 +9.7", printed(TABLE, width=40))


def test_a_table_without_rows_is_not_shown_but_its_notes_are() -> None:
    empty = replace(TABLE, parts=())
    assert not empty
    assert "Parameters" not in printed(empty) + html(empty)
    assert "measured" in printed(empty)
    assert "measured" in html(empty)


def test_a_row_has_a_cell_for_every_column() -> None:
    with pytest.raises(ValueError, match="must have 4 cells"):
        replace(TABLE, parts=(Part((("p5", "48.490"),)),))


def test_a_summary_is_text_and_html_of_all_its_tables() -> None:
    summary = Outcome((TABLE, replace(TABLE, title="Residuals")), ("left out: <g1>",))
    for shown in (str(summary), read(summary._repr_html_())):
        assert shown.index("Parameters") < shown.index("Residuals") < shown.index("left out")
    assert "&lt;g1&gt;" in summary._repr_html_()


def test_a_narrow_terminal_crops_no_figure() -> None:
    made = Table(
        "Condition",
        (Column("quantity"), *figures("value", "std. error")),
        (Part((("friction of axis 1 at 0.44 rad/s and more", "12.345678", "0.000123"),)),),
    )
    assert {"12.345678", "0.000123"} <= set(printed(made, width=40).split())


WIDE = Table(
    "Torques",
    (Column("axis"), *figures("torque", "mean, %", "inside, %", "own friction, %")),
    (Part((("12", "132 N m", "100.5", "99.1", "4.8"),)),),
)


@pytest.mark.parametrize("width", [10, 30, 36, 40, 80])
def test_no_terminal_is_too_narrow_for_a_row_and_its_name(width: int) -> None:
    assert {"12", "132", "100.5", "99.1", "4.8", "axis"} <= set(printed(WIDE, width).split())


def test_heads_take_several_lines_before_anything_folds() -> None:
    assert "own friction, %" in printed(WIDE, 80)
    narrow = printed(WIDE, 44).splitlines()
    assert max(map(len, narrow)) <= 44
    assert any(line.split()[-2:] == ["friction,", "%"] for line in narrow)


def test_no_limit_is_stated_beside_a_cause_that_was_found() -> None:
    limits = tuple(
        Limit(cause="joint offset", axis=axis, part="", unit="degrees", size=2.9, torque=0.01)
        for axis in (1, 2)
    )
    found = Found(cause="joint offset", axes=(2,), detail="joint offset error -1.99 degrees")
    proof = Excluded(found=(found,), limits=limits, tests=1)
    (row,) = excluded(proof, 2).parts[0].rows
    assert row[2:4] == ("(2.9)", FOUND)
    assert [each.axis for each in proof.invisible] == [1]


def test_recordings_that_would_show_no_change_give_a_sentence_in_place_of_a_table() -> None:
    hidden, shown = (
        Limit(cause="joint offset", axis=1, part="", unit="degrees", size=size, torque=0.01)
        for size in (None, 2.9)
    )
    (said,) = change_by_cause(Excluded(found=(), limits=(hidden,), tests=1), 2, "runs/a")
    assert said == "no change since runs/a would show in these recordings: measure longer"
    table, said = change_by_cause(Excluded(found=(), limits=(hidden, shown), tests=2), 2, "runs/a")
    assert isinstance(table, Table)
    assert said == "no lasting cause of a difference from runs/a found"


def test_a_cause_of_the_arm_has_a_column_of_its_own() -> None:
    gravity, offset = (
        Limit(cause=cause, axis=axis, part="", unit="degrees", size=size, torque=0.01)
        for cause, axis, size in (("gravity", 0, 0.048), ("joint offset", 1, 0.041))
    )
    found = excluded(Excluded(found=(), limits=(gravity, offset), tests=2), 2)
    assert [each.head for each in found.columns[2:5]] == ["arm", "axis 1", "axis 2"]
    assert [row[2:5] for row in found.rows] == [("0.048", "", ""), ("", "0.041", "")]
    alone = excluded(Excluded(found=(), limits=(offset,), tests=1), 2)
    assert "arm" not in [each.head for each in alone.columns]


def test_a_page_shows_three_verdicts_and_folds_the_others(tmp_path: Path) -> None:
    said = tuple(Verdict("doubtful", "changed", f"quantity {k}") for k in range(5))
    page = write_outcome(tmp_path / "page.html", Outcome(verdicts=said)).read_text()
    above, below = page.split("<summary>2 more</summary>")
    assert ["quantity 2" in each for each in (above, below)] == [True, False]
    assert "quantity 3" in below


def test_a_size_with_more_torque_than_the_recorded_one_is_no_limit() -> None:
    limits = tuple(
        Limit(cause="spring", axis=axis, part="", unit="N m/rad", size=size, torque=0.01)
        for axis, size in ((1, 3.5), (2, 550e3))
    )
    shown = excluded(Excluded(found=(), limits=limits, tests=1), 2)
    (row,) = shown.parts[0].rows
    assert row[2:] == ("3.5", UNTESTED, "3.5")
    assert any("these recordings: axis 2 has too little torque" in note for note in shown.notes)


@pytest.mark.parametrize(
    ("axes", "words"),
    [([0], "the arm has"), ([0, 2], "the arm and axis 2 have"), ([1, 3, 4], "axes 1, 3, 4 have")],
)
def test_axes_that_cannot_be_tested_are_listed(axes: list[int], words: str) -> None:
    assert (
        untestable(axes, "this plan") == f"not testable with this plan: {words} too little torque"
    )
