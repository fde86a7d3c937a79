"""Output paths, validated before computation, and display of results.

Results of simulated runs are marked as such (`say_simulated`). Each option that names something to
write has one of the callbacks of this module; a test finds the options of all commands and checks
their callbacks. The folder of a file must exist, against typing errors; folders are created with
their parents. `refuse_unwritable` checks files that a command writes into the folder of a run.
"""

from __future__ import annotations

import os
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer
from typer import Option

from checked_files.foreign_text import printable
from hil.terminal.console import give, give_each, out, say, working

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from typer.models import OptionInfo

    from hil.errors import FileError
    from hil.runs.run import Run
    from hil.show.outcome import Outcome, Verdict
    from hil.show.table import Table


class Status(IntEnum):
    """Exit status of completed commands with a negative result.

    REFUSED: an identification, a validation or an acceptance failed. ALARMED: a watch raised
    alarms. CHANGED: the newest run changed (--fail-on-change).
    """

    REFUSED = 3
    ALARMED = 3
    CHANGED = 4


STYLES = {"good": "green", "doubtful": "yellow", "failed": "bold red", "note": ""}


def refuse_existing(output: Path) -> None:
    """Refuse to overwrite a file.

    Raises
    ------
    FileError
        An existing file.
    """
    if os.path.lexists(output):
        raise _output_error(f"{output}: already exists; remove it or choose another name with -o")


def refuse_no_folder(output: Path) -> None:
    """Refuse a file in a missing or read-only folder.

    Raises
    ------
    FileError
    """
    if not output.parent.is_dir():
        raise _output_error(f"{output}: there is no folder {output.parent}; create it first")
    _refuse_closed(output.parent)


def refuse_unwritable(output: Path) -> None:
    """Refuse a result that could not be saved, before computation.

    A missing folder is not refused here, because reading from the folder has a separate error.

    Raises
    ------
    FileError
        The path is a folder, or the parent folder is not writable.
    """
    if output.is_dir() and not output.is_symlink():
        raise _output_error(f"{output}: is a folder, not a file; move it, or choose another name")
    if output.parent.is_dir() and not os.access(output.parent, os.W_OK):
        raise _output_error(
            f"{output}: cannot be written: {output.parent} is not writable for this user; copy "
            "the folder to a writable place"
        )


def _refuse_no_way(path: Path, folder: Path | None = None) -> None:
    """Refuse a path below a file, or below a read-only folder."""
    folder = folder or path
    there = next(each for each in (folder, *folder.absolute().parents) if os.path.lexists(each))
    if not there.is_dir():
        raise _output_error(f"{path}: {there} is not a folder; choose another name")
    _refuse_closed(there)


def _refuse_closed(folder: Path) -> None:
    if not os.access(folder, os.W_OK):
        raise _output_error(
            f"{folder} is not writable for this user; choose another place, or change its "
            "permissions"
        )


def _output_error(text: str) -> FileError:
    """Create an error with the path on one line, to be copied; usage errors break lines."""
    from hil.errors import FileError

    return FileError(text)


def _path_callback(*refuse: Callable[[Path], None]) -> Callable[..., Path | None]:
    """Create the callback of an option: the path unchanged, or an error from a check."""

    def take(ctx: typer.Context, path: Path | None) -> Path | None:
        if path is not None and not ctx.resilient_parsing:
            for each in refuse:
                each(path)
        return path

    return take


new_file = _path_callback(refuse_no_folder, refuse_existing)
"""Accept a new file in an existing folder."""
file_to_write = _path_callback(refuse_no_folder, refuse_unwritable)
"""Accept a file, existing or new; an existing one is overwritten."""
folder_to_write = _path_callback(_refuse_no_way)
"""Accept a folder, existing or to be created with parents."""
place_to_write = _path_callback(lambda path: _refuse_no_way(path, path.absolute().parent))
"""Accept a folder or a file, depending on another option."""
new_folder = _path_callback(refuse_existing, _refuse_no_way)
"""Accept a folder to be created, with parents."""


def output_option(callback: Callable[..., Path | None], text: str) -> OptionInfo:
    """Create the option -o with a callback of this module."""
    return cast("OptionInfo", Option("-o", "--output", callback=callback, help=text))


def page_option(text: str) -> OptionInfo:
    """Create the option --page of a command that writes a page on demand."""
    option = Option("--page", callback=file_to_write, help=f"{text}; one HTML file.")
    return cast("OptionInfo", option)


NewPlan = Annotated[Path, output_option(new_file, "Plan to write.")]


def say_simulated(*runs: Run) -> None:
    """State if any of the runs was measured on the virtual plant."""
    from hil.runs.journal import NO_REAL_MACHINE

    if any(run.journal.simulated for run in runs):
        say(NO_REAL_MACHINE, style="yellow")


def show(*found: Outcome | Table | str) -> None:
    """Print results: tables with rows, sentences and verdicts."""
    from hil.runs.journal import NO_REAL_MACHINE
    from hil.show import terminal
    from hil.show.outcome import Outcome

    for each in found:
        if isinstance(each, Outcome):
            if each.simulated:
                say(NO_REAL_MACHINE, style="yellow")
            show(*each.tables, *each.sentences)
            for remark in each.remarks:
                terminal.show_remark(remark, out)
            say_verdicts(each.verdicts)
        elif isinstance(each, str):
            give_each("sentences", each)
            terminal.show_sentence(each, out)
        else:
            terminal.show(each, out)


def say_verdicts(verdicts: Sequence[Verdict]) -> None:
    """Print the verdicts on a result: the worst, beginnings of further objections, notes."""
    if not verdicts:
        return
    first, *rest = verdicts
    give(judgement={"word": first.kind, "text": printable(str(first))})
    further = [each for each in rest if each.word == each.kind and each.kind != "note"]
    say(str(first), style=STYLES[first.kind])
    if further:
        say(f"also: {'; '.join(dict.fromkeys(each.text.split('; ')[0] for each in further))}")
    for each in rest:
        if each not in further:
            say(str(each), style=STYLES[each.kind])


def write_page(path: Path, found: Outcome) -> None:
    """Write the page of results, and state the path."""
    with working("drawing the page"):
        from hil.show.outcome import write_outcome

        write_outcome(path, found)
    say(f"page in {path}")


def show_causes(before: Path, *after: Run, known: Sequence[str] = ()) -> None:
    """Print a diagnosis of the change since a run, cause by cause."""
    from hil.commands.history import compare_causes

    with working("looking for causes in the recordings"):
        found = compare_causes(before, after, known)
    show(*found)
