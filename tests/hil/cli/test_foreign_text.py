"""Foreign text in any output moves no cursor, forges no line and hides no message."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import pytest
import typer
from rich.table import Table
from rich.text import Text

from checked_files.errors import HilError
from checked_files.foreign_text import LINE, LINES, shown
from hil.cli import main
from hil.terminal.console import Output, say

if TYPE_CHECKING:
    from collections.abc import Callable

FOREIGN = "q\x1b[2J\x9b1m\u202e\u2028"
WRITTEN_OUT = r"q\x1b[2J\x9b1m\u202e\u2028"


def _table(text: str) -> Table:
    table = Table(text, title=text)
    table.add_row(text)
    return table


@pytest.mark.parametrize("make", [str, Text, _table])
@pytest.mark.parametrize("terminal", [True, False])
def test_it_is_written_out(make: Callable[[str], object], terminal: bool) -> None:
    console = Output()
    console.file, console._force_terminal = io.StringIO(), terminal
    console.width = 200
    console.print(make(FOREIGN), style="red", markup=False)
    printed = console.file.getvalue()
    assert r"q\x1b[" in printed  # cut off by the narrow column
    assert not {"\x9b", "\u202e", "\u2028"} & set(printed)
    assert "\x1b[2J" not in printed


def test_a_message_of_ours_says_it_the_same_way() -> None:
    console = Output()
    console.file = io.StringIO()
    say(FOREIGN, console=console)
    assert console.file.getvalue() == f"{WRITTEN_OUT}\n"


def test_a_refusal_that_quotes_a_hundred_kilobytes_is_cut(
    capsys: pytest.CaptureFixture[str],
) -> None:
    program = typer.Typer()

    @program.command()
    def refuse() -> None:
        raise HilError("robot.yaml:1: " + "x" * 100_000 + "\n" * 2 * LINES + FOREIGN)

    with pytest.raises(SystemExit):
        main([], program)
    message = capsys.readouterr().err
    assert len(message) < 2 * LINE
    assert "... (100014 characters)" in message
    assert message.endswith(f"... and {LINES + 1} lines more\n")


def test_what_fits_is_shown_as_it_is() -> None:
    text = "\n".join(["größe\t[rad]", "x" * LINE])
    assert shown(text) == text
