"""What `hil run` does once it knows plan, robot and bus: folder, progress, the end of it all."""

from __future__ import annotations

import signal
import sys
from contextlib import closing
from typing import TYPE_CHECKING

import typer

from drivers.drive_bus import DriveError
from drivers.yaml_file import FileError
from hil.measuring.campaign import run_campaign
from hil.measuring.events import Finished
from hil.measuring.run_folder import RunFolder
from hil.results.rounding import clock
from hil.terminal.progress import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from rich.console import Console

    from drivers.drive_bus import DriveBus
    from hil.model.robot import Robot
    from hil.planning.plan import Plan


def bus_options(pairs: Sequence[str]) -> dict[str, object]:
    """Turn ``key=value`` into keyword arguments: numbers and true or false become such."""
    options: dict[str, object] = {}
    for pair in pairs:
        key, separator, value = pair.partition("=")
        if not separator or not key.isidentifier():
            raise typer.BadParameter(f"{pair!r} must read key=value, such as bitrate=1000000")
        options[key] = _value(value)
    return options


def _value(text: str) -> object:
    if text in {"true", "false"}:
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def prepare_folder(
    path: Path, the_plan: Plan, the_robot: Robot, drives: str, resume: bool, out: Console
) -> RunFolder:
    """Make the folder of a new run, or open that of one to be resumed.

    Raises
    ------
    FileError
        There is a run already, or the one to resume measured something else.
    """
    if not resume:
        return RunFolder.create(path, the_plan, the_robot, drives)
    folder = RunFolder.open(path)
    folder.refuse_changes(the_plan, the_robot, drives)
    for told in folder.set_aside_damaged():
        out.print(told, highlight=False, soft_wrap=True)
    return folder


def carry_out(
    folder: RunFolder, open_bus: Callable[[], DriveBus], bus_name: str, out: Console
) -> None:
    """Run the campaign; Ctrl-C and SIGTERM stop the axes and keep what was measured.

    Where nothing is missing no bus is opened.

    Raises
    ------
    typer.Exit
        With status 130 when interrupted, 1 when drives, bus or disk failed; all has been told.
    """
    if not folder.missing:
        out.print(f"{folder.path}: nothing is missing", highlight=False, soft_wrap=True)
        return
    previous = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with shown(out) as show, closing(run_campaign(folder, open_bus(), bus_name)) as events:
            for event in events:
                show(event)
                last = event
    except KeyboardInterrupt:
        sys.stderr.write(f"stopped, the axes are off; {_what_remains(folder)}\n")
        raise typer.Exit(130) from None
    except (BrokenPipeError, SystemExit):  # rich turns the one into the other
        sys.stderr.write(f"nobody reads the output, the axes are off; {_what_remains(folder)}\n")
        raise typer.Exit(1) from None
    except (DriveError, FileError) as error:
        sys.stderr.write(f"{error}\n{_what_remains(folder)}\n")
        raise typer.Exit(1) from None
    except Exception:
        folder.discard_if_empty()
        raise
    finally:
        signal.signal(signal.SIGTERM, previous)
    if isinstance(last, Finished):
        kept = f", {len(last.gave_up)} with findings: {', '.join(last.gave_up)}"
        out.print(
            f"{last.recorded} measurements in {folder.path}"
            f" ({clock(last.time)} of robot time){kept if last.gave_up else ''}",
            highlight=False,
            soft_wrap=True,
        )


def _what_remains(folder: RunFolder) -> str:
    if folder.discard_if_empty():
        return "nothing was measured"
    return f"what was measured stays in {folder.path}; finish with hil run ... --resume"
