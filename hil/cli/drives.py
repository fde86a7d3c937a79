"""Commands for an unknown bus: scan, and draft of a drives file.

The commands only read. A scan sends only SDO read requests. A drives file is drafted from the
manufacturers' data sheets, or from the object dictionaries of the scanned drives.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text
from typer import Option

from drivers.cia402.states import Mode, State, decode_state
from drivers.drive_bus import DriveRefused, NodeSilent
from hil.cli import commissioning, monitoring
from hil.cli.arguments import PLANT, BitRate, BusOptions, DrivesBus, Interface, refuse_no_channel
from hil.cli.outputs import folder_to_write, new_file, output_option, refuse_existing
from hil.planning import BITRATE
from hil.runs import SIMULATED
from hil.show.table import Column, Marked, table
from hil.show.terminal import broken, show
from hil.terminal.console import out, say, working

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.dictionary.dictionary import Dictionary
    from drivers.dictionary.review import FoundNode, Scan
    from hil.show.table import Row

commands = typer.Typer()
drives_commands = typer.Typer(
    help="Commission drives: scan, check, jog, home, monitor, write files, restore.",
    no_args_is_help=True,
)
commands.add_typer(drives_commands, name="drives")
HIGHEST_NODE = 127
MODES = dict(zip(Mode, ["PP", "VL", "PV", "TQ", "HM", "IP", "CSP", "CSV", "CST"], strict=True))
"""Modes of operation, abbreviated as in drives' manuals."""

Channel = Annotated[str | None, Option(help="Channel of the interface, such as can0 or eth0.")]
Nodes = Annotated[str | None, Option(help="Node numbers, such as 1-6 or 1,2,11-16.")]


@drives_commands.command()
def scan(
    interface: Interface = SIMULATED,
    channel: Channel = None,
    bus_option: BusOptions = None,
    bitrate: Annotated[int, BitRate(help="Bit rate of the bus \\[bit/s].")] = BITRATE,
    nodes: Nodes = None,
) -> None:
    """Find the drives on a bus and what they lack for measuring; only reads."""
    found = _scan(DrivesBus(interface, channel, bus_option), bitrate, _numbers(nodes))
    nodes_found = list(found.nodes.values())
    title = "1 node" if len(nodes_found) == 1 else f"{len(nodes_found)} nodes"
    rows: list[Row] = []
    remarks: dict[tuple[str, bool], list[int]] = {}
    for node in nodes_found:
        about, review = node.dictionary, node.review
        identity = (about.vendor, about.product, about.revision) if about else ()
        serves = Marked("no") if review and not review.serves else "yes" if review else "unknown"
        heard = []
        if node.state and node.state != "boot-up":
            heard.append(f"{node.shown_by} ({node.state})")
        counted = {"boot-up": node.boots, "EMCY": node.emergencies, "SDO": node.answers}
        heard += [how for how, noticed in counted.items() if noticed]
        rows.append(
            (
                str(node.node),
                ", ".join(heard),
                about.model if about else "",
                ", ".join("?" if part is None else f"{part:X}h" for part in identity),
                " ".join(MODES[mode] for mode in (review.modes if review else None) or ()),
                _state(about),
                serves,
            )
        )
        for within, further, offers in node.further:
            modes = " ".join(MODES[mode] for mode in offers.modes or ())
            axis, cells = f"{node.node}, axis {within.axis}", (further.model, "", modes)
            serves = "yes" if offers.serves else Marked("no")
            rows.append((axis, "", *cells, _state(further), serves))
        for remark in _remarks(node):
            remarks.setdefault(remark, []).append(node.node)
    folding = (Column(head, folds=True) for head in SCANNED)
    show(table(title, ("node", *folding, "serves"), rows), out)
    for (text, fatal), which in sorted(remarks.items(), key=lambda item: not item[0][1]):
        spans: list[list[int]] = []
        for number in sorted(set(which)):
            if spans and number == spans[-1][-1] + 1:
                spans[-1].append(number)
            else:
                spans.append([number])
        texts = (f"{span[0]}-{span[-1]}" if len(span) > 1 else f"{span[0]}" for span in spans)
        of = ("nodes " if len(set(which)) > 1 else "node ") + ", ".join(texts)
        line = Text(broken(f"{of}: {text}", out))
        line.stylize("bold red" if fatal else "yellow", 0, line.plain.index(":") + 1)
        out.print(line, soft_wrap=True, highlight=False)
    if found.syncs:
        say(
            f"{found.syncs} SYNCs of another master received: stop that master before measuring",
            style="yellow",
        )


@drives_commands.command()
def new(
    output: Annotated[Path, output_option(new_file, "Drives file to write.")],
    eds: Annotated[
        list[Path] | None,
        Option(metavar="FILE", help="EDS or DCF file of a drive; may be repeated."),
    ] = None,
    esi: Annotated[
        list[Path] | None,
        Option(metavar="FILE", help="ESI file of an EtherCAT drive; may be repeated."),
    ] = None,
    nodes: Nodes = None,
    interface: Annotated[
        str | None,
        Option(help="Interface of python-can, or ethercat, to read the drives instead of files."),
    ] = None,
    channel: Channel = None,
    bus_option: BusOptions = None,
    bitrate: Annotated[
        int | None,
        BitRate(help=f"Bit rate of the bus \\[bit/s]; {BITRATE} by default with --interface."),
    ] = None,
) -> None:
    """Write a first drives file from data sheets or from the drives, and list what to fill in."""
    from checked_files.yaml_file import UNSTATED
    from drivers.dictionary.review import review
    from drivers.opening import ETHERCAT, find_rules, read_eds, read_esi
    from drivers.operator_tools.draft import DraftedAxis, draft_drives
    from hil.runs.atomic_file import write_file

    if [eds, esi, interface].count(None) != 2:
        raise typer.BadParameter(
            "give data sheets with --eds, or a bus with --interface, or descriptions with --esi"
        )
    numbers = _numbers(nodes)
    if interface is None:
        files = eds or esi or []
        if esi:
            interface, bitrate = ETHERCAT, bitrate or BITRATE
        if numbers and len(files) == 1:
            files = files * len(numbers)
        if numbers and len(numbers) != len(files):
            raise typer.BadParameter(
                f"{len(numbers)} nodes and {len(files)} data sheets: give one sheet for all nodes, "
                "or one per node"
            )
        axes, rules = [], find_rules(interface)
        for k, file in enumerate(files):
            whole = (read_esi if esi else read_eds)(file, numbers[k] if numbers else None)
            for within in whole.axes():
                dictionary = whole.select_axis(within)
                axes.append(DraftedAxis(dictionary, review(dictionary, rules), whole.node, within))
    else:
        bitrate = bitrate or BITRATE
        found = _scan(DrivesBus(interface, channel, bus_option), bitrate, numbers).nodes
        silent = [k for k in numbers or found if k not in found or not found[k].dictionary]
        if silent and numbers:
            raise NodeSilent(
                f"node {', '.join(map(str, silent))}: answers no SDO; check its power, its number, "
                "the bit rate and the CAN wiring"
            )
        axes = [
            DraftedAxis(dictionary, reviewed, node.node, within)
            for node in found.values()
            if node.dictionary and node.review and (numbers or node.review.profile in {None, 402})
            for within, dictionary, reviewed in (
                (node.within, node.dictionary, node.review),
                *node.further,
            )
        ]
        if not axes:
            raise DriveRefused(
                "no CiA 402 drive on the bus; `hil drives scan` lists all nodes that respond"
            )
    text = draft_drives(axes, find_rules(interface), bitrate)
    write_file(output, text.encode())
    choices: dict[str, list[str]] = {}
    for number, axis in enumerate(axes, start=1):
        chosen = axis.review.current
        why = (
            f"from {chosen.place}: {chosen.why}"
            if chosen
            else "object not found: state it in the file"
        )
        choices.setdefault(why, []).append(str(number))
    for why, joints in choices.items():
        say(f"joint {', '.join(joints)}: current {why}")
    marks = text.count(f": {UNSTATED} ")
    say(f"{len(axes)} axes in {output}; {marks} lines marked {UNSTATED} must be filled in by you")


@drives_commands.command()
def example(
    output: Annotated[Path, output_option(folder_to_write, "Folder to write both files into.")],
) -> None:
    """Write drives file and data sheet of the virtual drives, to try the other commands."""
    from importlib.resources import files

    from hil.model.robot import ROBOTS
    from hil.runs.atomic_file import write_file

    sources = {
        output / "drives.yaml": ROBOTS / "manutec-r15.drives.yaml",
        # a file of the virtual plant, whose code stays a separate program
        output / "cia402_drive.eds": files("sim_plant") / "canopen" / "cia402_drive.eds",
    }
    for path in sources:
        refuse_existing(path)
    output.mkdir(parents=True, exist_ok=True)
    for path, source in sources.items():
        write_file(path, source.read_bytes())
    say(f"{' and '.join(map(str, sources))}: the virtual drives of manutec-r15")


for _command in (
    commissioning.check, commissioning.jog, commissioning.home, monitoring.monitor,
    commissioning.restore, commissioning.reset_faults,
):  # fmt: skip
    drives_commands.command()(_command)


def _scan(where: DrivesBus, bitrate: int, nodes: tuple[int, ...]) -> Scan:
    from hil.cli import bus_access

    refuse_no_channel(where.interface, where.channel)
    interface, channel = where.interface, where.channel or PLANT
    with (
        working(f"asking {len(nodes) or HIGHEST_NODE} nodes on {interface} {channel}"),
        bus_access.open_interface(interface, channel, bitrate, where.bus_option) as bus,
    ):
        found = bus.scan(nodes or None)
    if not found.nodes:
        asked = f"node {', '.join(map(str, nodes))}" if nodes else "any of 127 node numbers"
        raise NodeSilent(
            f"{interface} {channel}: no response from {asked}; check the drives' power, the bit "
            f"rate ({bitrate} bit/s), termination and CAN wiring"
        )
    return found


def _numbers(text: str | None) -> tuple[int, ...]:
    """Parse a list of node numbers such as 1-6,9."""
    numbers: list[int] = []
    for part in filter(None, (text or "").replace(" ", "").split(",")):
        found = re.fullmatch(r"(\d{1,3})(?:-(\d{1,3}))?", part)
        first, last = (int(found[1]), int(found[2] or found[1])) if found else (0, 0)
        if not 1 <= first <= last <= HIGHEST_NODE:
            raise typer.BadParameter(f"--nodes {part} must be numbers from 1 to 127, such as 1-6,9")
        numbers += range(first, last + 1)
    return tuple(numbers)


SCANNED = ("heard by", "device", "identity (1018)", "modes", "state")


def _state(dictionary: Dictionary | None) -> str:
    from drivers.cia402.objects import STATUSWORD

    word = dictionary.value(STATUSWORD) if dictionary else None
    state = None if word is None else decode_state(word)
    return "" if state is None else state.value.lower()


def _remarks(found: FoundNode) -> Iterator[tuple[str, bool]]:
    """Yield remarks about a node, True if fatal for measuring."""
    if found.answers > 1:
        text = f"{found.answers} devices have this node number: give each a number of its own"
        yield text, True
    if _state(found.dictionary) == State.OPERATION_ENABLED.value.lower():
        yield ("is powered and may move: another master controls it; stop that master first", False)
    if found.review is not None:
        yield from ((str(finding), finding.fatal) for finding in found.review.findings)
        return
    yield (
        "no SDO response: a node in state stopped, or another master's heartbeat; if the node is "
        "a drive, set it to pre-operational",
        False,
    )
