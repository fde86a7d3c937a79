"""Command `hil run`: measurement of a plan, and the options of live page and stream."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer
from typer import Option
from typer.core import TyperCommand

from hil.cli.arguments import (
    PlanFile,
    RealTime,
    RobotOption,
    RobotsBus,
    WorkspaceOption,
    expand_records,
    parse_pairs,
    refuse_no_channel,
    runs,
)
from hil.cli.outputs import file_to_write, folder_to_write, output_option
from hil.measuring import REHEARSAL_SPEED
from hil.runs import SIMULATED
from hil.terminal.console import say, working

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from typer.models import OptionInfo

    from drivers.drive_bus import DriveBus
    from drivers.drives_file import DrivesFile
    from hil.cli.run_session import Display
    from hil.live.feed import Feed
    from hil.live.listener import Listener
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.watching.watcher import Watcher


PORTS = {"--live": 8420, "--foxglove": 8765}
"""Options with a port, and the default ports."""
LOOPBACK = "127.0.0.1"


def _address(value: str | None) -> str | None:
    from ipaddress import ip_address

    if value is not None:
        try:
            ip_address(value)
        except ValueError:
            raise typer.BadParameter(
                f"{value!r} is not an IP address; give that of an interface of this computer, "
                "such as 192.168.0.5, or 0.0.0.0 for all"
            ) from None
    return value


def _address_options(option: str, what: str, elsewhere: str) -> tuple[OptionInfo, OptionInfo]:
    """Create the options for port and address of a live display."""
    port = Option(
        option, metavar="PORT", min=0, max=65535,
        help=f"{what}; port {PORTS[option]} unless one is given, 0 for a free one.",
    )  # fmt: skip
    address = Option(f"{option}-address", metavar="ADDRESS", callback=_address, help=elsewhere)
    return cast("OptionInfo", port), cast("OptionInfo", address)


def hand_of(bus_option: Sequence[str] | None) -> str:
    """Return the path of the virtual plant's push interface from the bus options, or ""."""
    given = [each.removeprefix("hand=") for each in bus_option or () if each.startswith("hand=")]
    return given[-1] if given else ""


_LIVE, _LIVE_ADDRESS = _address_options(
    "--live",
    "Show the run on a page in the browser of this computer",
    "Serve the live page to other computers at this IP address; its URL contains a secret.",
)
_FOXGLOVE, _FOXGLOVE_ADDRESS = _address_options(
    "--foxglove",
    "Stream the run to Foxglove on this computer",
    "Stream to Foxglove on other computers at this IP address, without access control.",
)


class PortsOptional(TyperCommand):
    """Command that inserts default ports after the options in `PORTS`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments after the insertion of default ports."""
        parsed: list[str] = super().parse_args(ctx, insert_ports(args))
        return parsed


def insert_ports(arguments: list[str]) -> list[str]:
    """Insert the default port after every option in `PORTS` without a number."""
    found = []
    for word, after in zip(arguments, [*arguments, ""][1:], strict=True):
        found.append(word)
        if word in PORTS and not after.lstrip("-").isdecimal():
            found.append(str(PORTS[word]))
    return found


@dataclass(frozen=True)
class Shown:
    """Options for the live display of a run."""

    live: Annotated[int | None, _LIVE] = None
    live_address: Annotated[str | None, _LIVE_ADDRESS] = None
    foxglove: Annotated[int | None, _FOXGLOVE] = None
    foxglove_address: Annotated[str | None, _FOXGLOVE_ADDRESS] = None


def listeners(
    shown: Shown,
    bus_option: Sequence[str] | None = None,
    folder: Path | None = None,
    *,
    while_open: bool = False,
) -> list[Listener]:
    """Create the processes informed of the run.

    Parameters
    ----------
    bus_option : sequence of str, optional
        Options of the bus, for access to the virtual plant's hand from the page.
    folder : Path, optional
        Run folder whose recordings are identified while the page shows the run.
    while_open : bool
        Stop the run once its page has been closed, and show the report of `folder` on the page when
        finished.

    Raises
    ------
    typer.BadParameter
        An address for a display that is not served.
    """
    page = "--live", "the live page", "hil.live.page_server"
    stream = "--foxglove", "the stream to Foxglove", "hil.live.foxglove_server"
    found = []
    pushed = ["--hand", hand] if (hand := hand_of(bus_option)) else []
    if while_open:
        pushed += ["--while-open"]
        pushed += ["--report", str(folder / "report.html")] if folder is not None else []
    for option, what, module, port, address, more in (
        (*page, shown.live, shown.live_address, pushed),
        (*stream, shown.foxglove, shown.foxglove_address, ()),
    ):
        if port is not None:
            found.append((what, module, address or LOOPBACK, str(port), *more))
        elif address is not None:
            raise typer.BadParameter(
                f"needs {option}; add {option}", param_hint=f"{option}-address"
            )
    if not found:
        return []
    from hil.live.listener import Listener

    started = [Listener(*each) for each in found]
    if shown.live is not None and folder is not None:
        estimator = "the estimation during the run", "hil.live.estimator", str(folder)
        started.append(Listener(*estimator, answers=True))
    return started


commands = typer.Typer()


@commands.command(cls=PortsOptional)
@expand_records
def run(
    plan_file: PlanFile,
    output: Annotated[Path, output_option(folder_to_write, "Run folder to write.")],
    *,
    where: RobotsBus,
    resume: Annotated[bool, Option("--resume", help="Continue a run that was stopped.")] = False,
    frame_log: Annotated[
        Path | None,
        Option(
            callback=file_to_write, help="Log of all CAN frames to write: *.asc, *.log or *.blf."
        ),
    ] = None,
    robot_file: RobotOption = None,
    workspace: WorkspaceOption = None,
    rehearse: Annotated[
        bool,
        Option("--rehearse", help="Move along all paths of the plan slowly; record nothing."),
    ] = False,
    speed: Annotated[
        float,
        Option(
            min=0.01, max=1, help="Speed of the rehearsal, as a fraction of the velocity limits."
        ),
    ] = REHEARSAL_SPEED,
    symmetric: Annotated[
        Path | None,
        Option(
            help="Run whose friction must be symmetric; otherwise no axis moves.",
            autocompletion=runs,
        ),
    ] = None,
    what_changes: Annotated[
        bool,
        Option("--what-changes", help="List what a run would write to the drives; write nothing."),
    ] = False,
    realtime: RealTime = False,
    shown: Shown,
) -> None:
    """Measure a plan into a run folder; the robot moves."""
    with working("reading the plan") as now:
        from hil.cli.plan_view import load

        the_plan, the_robot = load(plan_file, robot_file, workspace)
        if symmetric is not None:
            from hil.commands.friction import refuse_asymmetric
            from hil.runs.run import Run

            now(f"testing the friction of {symmetric}")
            for line in refuse_asymmetric(Run.open(symmetric), the_robot):
                say(line, style="yellow")
    how = OnBus(**vars(where), frame_log=frame_log, realtime=realtime)
    identified = None if rehearse or what_changes else output
    how = replace(how, listeners=listeners(shown, where.bus_option, identified))
    if what_changes:
        from hil.cli import bus_access
        from hil.tasks.bus_state import kept_in

        drives, _ = _check_drives(the_plan, the_robot, plan_file, how)
        interface, channel = how.interface, how.channel or the_robot.name
        parse_pairs(how.bus_option)
        kept = kept_in(output, interface, channel)
        with bus_access.open_interface(interface, channel, drives.bitrate, how.bus_option) as bus:
            bus_access.show_changes(drives, bus, kept)
        say("no object was written, no axis was powered")
    else:
        measure(the_plan, the_robot, plan_file, output, how, resume, speed if rehearse else None)


@dataclass(frozen=True)
class OnBus(RobotsBus):
    """Bus and settings for measuring a plan, from the options of `hil run`.

    Attributes
    ----------
    listeners : sequence of Listener
        Processes to be informed of events, not started yet.
    feed : Feed, optional
        Existing feed for listeners, shared with other runs.
    """

    frame_log: Path | None = None
    realtime: bool = False
    listeners: Sequence[Listener] = ()
    feed: Feed | None = None


def measure(
    the_plan: Plan,
    the_robot: Robot,
    source: Path,
    output: Path,
    how: OnBus,
    resume: bool = False,
    rehearsal: float | None = None,
    in_front: Callable[[DriveBus], DriveBus] | None = None,
    feeds: bool = False,
    display: Display | None = None,
    rounds: int = 1,
    watcher: Watcher | None = None,
) -> None:
    """Measure a plan into a folder.

    Parameters
    ----------
    source : Path
        Name of the plan in messages.
    rehearsal : float, optional
        Share of the speed limits for a rehearsal without measuring.
    in_front : callable, optional
        Function that wraps the bus of the drives in another bus with additional functions.
    feeds : bool
        True if the drives must accept feed-forward values.
    display : callable, optional
        See `hil.cli.run_session.carry_out`.
    rounds : int
        Number of repetitions of the plan, as separate measurements.
    watcher : Watcher, optional
        Source of the torques shown to listeners.
    """
    from functools import partial

    with working("checking the plan's motions against the limits"):
        from drivers.opening import open_drive_bus
        from hil.cli import bus_access
        from hil.cli.run_session import carry_out
        from hil.planning.plan import repeat_measurements
        from hil.runs.journal import BusName
        from hil.tasks.bus_state import keeper_of_run
        from hil.tasks.measuring import prepared_folder, refuse_unusable
        from hil.terminal.progress import shown

        refuse_unusable(output, resume)
        drives, text = _check_drives(the_plan, the_robot, source, how, feeds=feeds)
    channel = how.channel or the_robot.name
    options = parse_pairs(how.bus_option)
    planned = repeat_measurements(the_plan, rounds)
    feed, display = how.feed, display or shown
    if feed is None and how.listeners:
        from hil.live.audience import Audience
        from hil.live.feed import Feed

        feed = Feed(Audience(how.listeners), simulated=how.interface == SIMULATED)
    if feed is not None:
        hand = bool(hand_of(how.bus_option))
        feed.turn_to(the_robot, planned, rehearsal, hand=hand, watcher=watcher)

    def bus() -> DriveBus:
        found: DriveBus = open_drive_bus(
            drives, how.interface, channel, options, how.pacing, how.frame_log, keeper,
            feed_forward=feeds,
        )  # fmt: skip
        found = found if in_front is None else in_front(found)
        return found if feed is None else feed.wrap_bus(found)

    automatic = how.pacing == "auto" and how.interface == SIMULATED
    lock_step = automatic or how.pacing == "lock-step"
    with keeper_of_run(output, how.interface, channel) as keeper:
        folder, damaged = prepared_folder(output, planned, the_robot, text, resume=resume)
        for message in damaged:
            say(message)
        carry_out(
            folder,
            bus,
            BusName(how.interface, channel),
            rehearsal,
            lambda: bus_access.real_time_if(how.realtime, lock_step=lock_step),
            display if feed is None else partial(feed.display, display),
        )


def _check_drives(
    the_plan: Plan, the_robot: Robot, source: Path, how: OnBus, *, feeds: bool = False
) -> tuple[DrivesFile, str]:
    """Return drives of the robot and the text of the drives file; refuse an infeasible plan."""
    from hil.tasks.measuring import checked_drives

    refuse_no_channel(how.interface, how.channel)
    return checked_drives(the_plan, the_robot, how.drives_file, source, feeds=feeds)
