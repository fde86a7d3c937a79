"""Execution of `hil run` for given plan, robot and bus: folder, progress, end."""

from __future__ import annotations

import math
from contextlib import closing, nullcontext
from typing import TYPE_CHECKING, cast

import typer

from checked_files.yaml_file import FileError
from drivers.drive_bus import DriveError
from hil.measuring.campaign import rehearse_campaign, run_campaign
from hil.measuring.sequencer import Finished
from hil.runs import SIMULATED
from hil.runs.atomic_file import locked
from hil.runs.run_folder import RunFolder
from hil.show.rounding import clock, count
from hil.terminal.console import give, out, say
from hil.terminal.keys import HINT, KeyboardStop, interruptible, report
from hil.terminal.progress import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import AbstractContextManager

    from rich.console import Console

    from drivers.drive_bus import DriveBus
    from hil.measuring.sequencer import Event
    from hil.runs.journal import BusName

    RealTime = Callable[[], AbstractContextManager[Sequence[str] | None]]
    Display = Callable[[Console], AbstractContextManager[Callable[[Event], None]]]

NOT_REHEARSED = (
    "this plan has not been rehearsed: with --rehearse the robot first moves along all paths slowly"
)


def carry_out(
    folder: RunFolder,
    open_bus: Callable[[], DriveBus],
    bus_name: BusName,
    rehearsal: float | None = None,
    real_time: RealTime = nullcontext,
    display: Display = shown,
) -> None:
    """Run the campaign; Ctrl-C, s, space and signals stop the axes and keep the recordings.

    The bus is opened only if measurements are missing.

    Parameters
    ----------
    rehearsal : float, optional
        Share of the speed limits for a rehearsal without measuring.
    real_time : callable
        Function returning the context for moving the axes, which yields the granted real-time
        measures.
    display : callable
        Function returning the context for showing events, which yields a function for events.

    Raises
    ------
    FileError
        Another process measures into the folder.
    typer.Exit
        Status 130 after an interruption, 1 after a failure of drives, bus or disk, already
        reported.
    """
    if not folder.missing and rehearsal is None:
        say(f"{folder.path}: complete")
        return
    if rehearsal is None and folder.journal.rehearsed is None and bus_name.interface != SIMULATED:
        say(NOT_REHEARSED)

    def ended() -> str:
        return f"stopped, the axes are off; {_describe_rest(folder)}"

    with locked(folder.path), interruptible(ended) as refuse_lost:
        try:
            with KeyboardStop() as keyboard, display(out) as show, real_time() as granted:
                for line in granted or ():
                    say(line)
                if keyboard.listening:
                    say(HINT)
                own = keyboard.pause, granted or ()
                events = (
                    run_campaign(folder, open_bus(), bus_name, *own)
                    if rehearsal is None
                    else rehearse_campaign(folder, open_bus(), bus_name, rehearsal, *own)
                )
                with closing(events):
                    for last in events:
                        refuse_lost()
                        show(last)
        except (BrokenPipeError, SystemExit):  # rich raises SystemExit for a broken pipe
            report(f"the output was closed, the axes are off; {_describe_rest(folder)}")
            raise typer.Exit(1) from None
        except (DriveError, FileError) as error:
            report(f"{error.lines}\n{_describe_rest(folder)}")
            raise typer.Exit(1) from None
        except Exception:
            folder.discard_if_empty()
            raise
    if rehearsal is not None:
        say(
            f"all paths of the plan rehearsed at {rehearsal:.0%} of the speed limits; measure "
            "with the same command without --rehearse"
        )
        return
    last = cast("Finished", last)  # the last event of measuring
    give(run=str(folder.path), measurements=last.recorded, with_findings=list(last.gave_up))
    begun = ""
    if not math.isnan(last.before_first):  # up to a minute of motion, the gears count as cold
        minutes = last.before_first / 60
        begun = ", begun cold" if minutes < 1 else f", begun after {minutes:.1f} min of motion"
    kept = f", {len(last.gave_up)} with findings: {', '.join(last.gave_up)}"
    say(
        f"{count(last.recorded, 'measurement')} in {folder.path}"
        f" ({clock(last.time)} of robot time{begun})"
        f"{kept if last.gave_up else ''}; {folder.journal.sessions[-1].sync}"
    )


def _describe_rest(folder: RunFolder) -> str:
    if folder.discard_if_empty():
        return "nothing was measured"
    return f"recordings so far are in {folder.path}; finish with hil run ... --resume"
