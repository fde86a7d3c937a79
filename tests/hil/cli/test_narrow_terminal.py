"""Tables and sentences on a narrow terminal: no line is too long, and nothing is truncated.

Columns wrap or repeat; no number is split, or separated from unit or heading.
"""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING

import pytest
from every_command import every_command
from rich.cells import cell_len
from rich.console import Console

from hil.show.table import Column, Part, Table, figures, table
from hil.show.terminal import broken, show

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

LONG = "shoulder_pan_joint_left"
WHAT, STEPS = Column("meaning", folds=True), Column("expression", folds=True, symbols=True)
TABLES = {
    "parameters": table(
        "14 base parameters of a robot",
        ("", WHAT, *figures("value", "std. error", "± 95 %", "error, %"), "unit", STEPS),
        [
            Part(
                (
                    ("p3", "product of inertia xz of link 2", "−2.1874", "0.0019", "0.0081",
                     "0.086", "kg m²", "Ixz2"),
                    ("p1", "inertia of axis 1", "32.0152", "0.0028", "0.0084", "> 100", "kg m²",
                     "Izz1 + Iyy2 + Iyy3 + l1^2 (m3 + m4 + m5 + m6)"),
                ),
                "diagonal, condition number 27.3",
            )
        ],
    ),
    "causes": table(
        "What these recordings exclude",
        ("cause larger than", "unit", *figures(*(f"axis {k}" for k in range(1, 13)), "effect, %")),
        [("drift of torque constant", "N m/rad", *(f"({k}.0094)" for k in range(12)), "5.01")],
    ),
    "drives": table(
        "12 axes",
        (Column("axis", folds=True), "node", *figures("position", "torque"), WHAT),
        [(f"{LONG}_{LONG}", "12", "−165.00°", "−1230 N m", f"8611h: following error, {LONG}")],
    ),
    "laws": table(
        "Laws of friction",
        ("axis", "model", *figures("rms, N m", "held out, N m"), "chosen", WHAT),
        [("1", "cube-root", "1.03", "1.00", "yes", "a1 7.94 ± 0.44 N m s/rad, a3 25.3 ± 2.1 N m")],
    ),
    "symmetry": table(
        "Is friction the same in both directions?",
        ("axis", *figures("n", "asymmetry, %", "std. error, %", "p (none)", "p (bound)"),
         Column("verdict", folds=True)),
        [("2", "5", "−0.586", "0.048", "< 0.0001", "1", "asymmetric, within 2 %")],
    ),
}  # fmt: skip


def printed(shown: Table, width: int) -> list[str]:
    file = io.StringIO()
    show(shown, Console(file=file, width=width))
    return file.getvalue().splitlines()


@pytest.mark.parametrize("width", [60, 80, 100])
@pytest.mark.parametrize("name", TABLES)
def test_no_line_is_longer_and_no_figure_is_lost(name: str, width: int) -> None:
    lines = printed(TABLES[name], width)
    assert max(map(cell_len, lines)) <= width
    words = " ".join(lines)
    for row in TABLES[name].rows:
        for column, cell in zip(TABLES[name].columns, row, strict=True):
            if column.align == "right":
                assert cell in words
            assert set(re.findall(r"[\w.]+", cell)) <= set(re.findall(r"[\w.]+", words)) or (
                LONG in cell
            )


@pytest.mark.parametrize("name", ["causes", "laws", "symmetry"])
def test_no_heading_takes_three_lines(name: str) -> None:
    lines = printed(TABLES[name], 80)
    rules = [at for at, line in enumerate(lines) if "──" in line]
    assert not [at for at in rules if all(line.strip() for line in lines[at - 3 : at])]


@pytest.mark.parametrize("width", [60, 80])
def test_each_figure_ends_below_the_end_of_its_heading(width: int) -> None:
    lines = printed(TABLES["causes"], width)
    rules = [at for at, line in enumerate(lines) if "──" in line]
    assert len(rules) > 1  # blocks
    found = {}
    for at in rules:
        first = lines[at - 1]
        ends = {match.end(): match[0] for match in re.finditer(r"\S+", first)}
        for figure in re.finditer(r"\(\d+\.0094\)|5\.01", lines[at + 1]):
            found[figure[0]] = ends.get(figure.end())
    assert found["(0.0094)"] == "1"
    assert found["(11.0094)"] == "12"
    assert found["5.01"] == "%"
    assert len(found) == 13


def test_an_expression_stands_below_its_row_and_a_group_s_name_spans_the_row() -> None:
    lines = printed(TABLES["parameters"], 80)
    at = next(k for k, line in enumerate(lines) if "32.0152" in line)
    assert lines[at + 1].strip() == "Izz1 + Iyy2 + Iyy3 + l1^2 (m3 + m4 + m5 + m6)"
    assert "inertia of axis 1" in lines[at]
    assert any(line.strip() == "diagonal, condition number 27.3" for line in lines)


@pytest.mark.parametrize("width", [60, 80])
def test_a_number_keeps_its_name_its_uncertainty_and_its_unit(width: int) -> None:
    lines = printed(TABLES["laws"], width)
    for quantity in ("a1 7.94 ± 0.44 N m s/rad", "a3 25.3 ± 2.1 N m"):
        assert any(quantity in line for line in lines)


SENTENCE = f"the model in {'/a/long/folder' * 8}/model.yaml explains all but 12.5 ± 0.1 N m of it"


def test_lines_of_a_terminal_end_between_words_and_those_of_a_file_with_the_sentence() -> None:
    terminal = Console(file=io.StringIO(), force_terminal=True, width=30)
    lines = broken(SENTENCE, terminal).split("\n")
    assert " ".join(lines) == SENTENCE
    assert [line for line in lines if len(line) > 30] == [SENTENCE.split()[3]]
    assert any("12.5 ± 0.1 N m" in line for line in lines)
    assert broken(SENTENCE, Console(file=io.StringIO(), width=30)) == SENTENCE
    command = f"hil run {LONG}.yaml -o runs/{LONG} --drives {LONG}"
    assert broken(command, terminal) == command


@pytest.mark.parametrize("name", ["", *every_command()])
def test_help_fits_and_breaks_no_word(name: str, hil: Hil, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", 80)
    lines = hil(*name.split(), "--help")[1].splitlines()
    assert max(map(cell_len, lines)) <= 80
    assert not {"tory", "clock>", "k>"} & {word for line in lines for word in line.split()}
    assert not any("<" in line.replace("<=", "") for line in lines)


@pytest.mark.parametrize("command", ["robot {}", "dry-run plan.yaml", "drives scan --nodes 1-2"])
def test_commands_draw_their_tables_so(
    command: str, hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hil.terminal.console.out._width", 80)
    hil("plan", "manutec-r15", "--gravity", 4, "--inertia", 10, "--coupling", 1, "-o", "plan.yaml")
    status, shown, _ = hil(*command.format("staubli-tx40").split())
    assert status == 0
    drawn = [line for line in shown.splitlines() if line.startswith(" ")]
    assert any("──" in line for line in drawn)
    assert max(map(cell_len, drawn)) <= 80
    assert not set("┃│┏╇") & set(shown)
