"""A first drives file from what dictionaries state; the rest is left to be stated, line by line.

A value stands in the draft only where a drive has it: read from the drive, set in its configuration
file, or fixed by its maker. A default of a data sheet is no such thing (the motor is another one),
and is at most mentioned. All else is marked `!state` with what to fill in, and `load_drives`
refuses the file until that is done; so nothing can be overlooked and nothing is guessed.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

from checked_files.foreign_text import one_line
from checked_files.yaml_file import UNSTATED
from checked_files.yaml_text import comment, quoted
from drivers.cia402.vendor_objects import MAKERS
from drivers.drive_bus import DriveRefused
from drivers.drives_file import TorqueUnit
from drivers.in_node import ALONE, InNode
from drivers.operator_tools.draft_hints import (
    acceleration_unit,
    increments,
    meaning_of,
    velocity_unit,
)
from drivers.operator_tools.draft_limits import drafted_limits
from drivers.operator_tools.draft_ratings import drafted_ratings

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.dictionary.bus_rules import BusRules
    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary
    from drivers.dictionary.review import Review
    from drivers.operator_tools.draft_hints import Drafted

HIGHEST_NODE = 126
WIDTH = 100
_LIMITS = ("q_min", "q_max", "velocity", "acceleration", "torque")
_WINDOWS = (
    "following_error_window", "following_error_time", "position_window", "position_window_time",
)  # fmt: skip


@dataclass(frozen=True)
class DraftedAxis:
    """One drive to be put into a drives file: what is known of it, and its node if that is."""

    dictionary: Dictionary
    review: Review
    node: int | None
    within: InNode = ALONE


def draft_drives(axes: Sequence[DraftedAxis], rules: BusRules, bitrate: int | None = None) -> str:
    """Write a drives file for these drives, in joint order.

    Parameters
    ----------
    axes : sequence of DraftedAxis
        The drives.
    rules : BusRules
        Of the bus that they are for.
    bitrate : int, optional
        Of the bus, if it is known [bit/s].

    Raises
    ------
    DriveRefused
        Drives that cannot serve, or node numbers that cannot be; a line each.
    """
    refuse_unfit(axes)
    sources = ", ".join(dict.fromkeys(axis.dictionary.source for axis in axes))
    lines = [
        comment(f"Drafted from {sources}."),
        f"# What nobody but you can know is marked {UNSTATED}: replace each mark and its text by",
        "# the value, joint side and SI unless said otherwise. Until then the file is refused.",
        *_shared(axes, bitrate),
        "",
        "axes:",
    ]
    for number, axis in enumerate(axes, start=1):
        lines += _axis(number, axis, rules)
    return "\n".join(lines) + "\n"


def refuse_unfit(axes: Sequence[DraftedAxis]) -> None:
    """Refuse drives that cannot serve, and nodes that cannot be or stand twice (`DriveRefused`)."""
    problems = [
        f"{axis.dictionary.source}: cannot serve: {refusal}"
        for axis in {axis.dictionary.source: axis for axis in axes}.values()
        for refusal in axis.review.refusals
    ]
    places = [(axis.node, axis.within.axis) for axis in axes if axis.node is not None]
    nodes = [node for node, _ in places]
    problems += [
        f"node {node}: must be in 1...{HIGHEST_NODE}; 127 is ours"
        for node in nodes
        if not 1 <= node <= HIGHEST_NODE
    ]
    problems += [
        f"node {place[0]}: is given to {places.count(place)} axes; give each drive its own"
        for place in sorted(set(places))
        if places.count(place) > 1
    ]
    if problems:
        raise DriveRefused("\n".join(problems))


def _shared(axes: Sequence[DraftedAxis], bitrate: int | None) -> Iterator[str]:
    rates = {axis.dictionary.bitrate for axis in axes} - {None}
    if bitrate is None and len(rates) == 1:
        bitrate = rates.pop()
    common = set.intersection(*(set(axis.dictionary.bitrates) for axis in axes))
    choice = f", one of {', '.join(map(str, sorted(common)))}" if common else ""
    yield _line("bitrate", bitrate, "bit/s", f"bit rate of the bus [bit/s]{choice}")
    yield "sync_period: 0.004 # s, a choice: the plan's sample_period"
    yield "master_node: 127 # our own number on the bus, a choice"
    yield "heartbeat_period: 0.1 # s, a choice"
    yield "heartbeat_timeout: 0.5 # s, a choice: how long after our death the drives stop"
    yield "quick_stop_option: 2 # 605A, a choice: quick stop ramp, then off"


def _axis(number: int, axis: DraftedAxis, rules: BusRules) -> Iterator[str]:
    dictionary = axis.dictionary
    device = ", ".join(filter(None, (dictionary.maker, dictionary.model))) or "unnamed device"
    yield from _comment(f"{device} ({dictionary.source})")
    for note in (*map(str, axis.review.findings), *(f"the file {n}" for n in dictionary.notes)):
        yield from _comment(note)
    limits = drafted_limits(dictionary)
    body = [
        f"name: joint {number}",
        _line("node", axis.node, "", "node number of the drive, 1 to 126"),
        *_within(axis.within),
        *_identity(dictionary),
        *_drive_train(dictionary, limits["gear_ratio"]),
        *_current(axis.review, dictionary),
        *_ratings(dictionary),
        "limits:",
        *(f"  {_drafted(key, limits[key])}" for key in _LIMITS),
        *(_drafted(key, limits[key]) for key in _WINDOWS),
        *_brake(dictionary),
        *_watch(dictionary, rules),
        *_tpdos(axis.review),
    ]
    yield f"  - {body[0]}"
    yield from (f"    {line}" for line in body[1:])


def _within(within: InNode) -> Iterator[str]:
    """State which axis of its drive it is."""
    if within != ALONE:
        after = f": its objects are {0x800 * (within.axis - 1):X}h after those below"
        yield f"axis: {within.axis} # of several in this drive{after if within.axis > 1 else ''}"
        yield f"pdos: [{within.pdos[0]}, {within.pdos[1]}] # numbers of its PDOs, first and last"


def _identity(dictionary: Dictionary) -> Iterator[str]:
    yield "identity: # object 1018; what is left out is not compared"
    for key, value, place in (
        ("vendor", dictionary.vendor, "1018:01"),
        ("product", dictionary.product, "1018:02"),
    ):
        shown = None if value is None else f"0x{value:X}"
        hint = f"{place} of the drive, a number such as 0x{0x4D2:X}: `hil drives scan` shows it"
        yield "  " + _line(key, shown, "", hint)
    if dictionary.revision is not None:
        revision = f"revision: 0x{dictionary.revision:X}"
        certain = "" if dictionary.live else "# of the data sheet, add it to have it compared: "
        yield f"  {certain}{revision}"


def _drive_train(dictionary: Dictionary, gear_ratio: Drafted) -> Iterator[str]:
    yield _line("joint", None, "", "revolute or prismatic")
    yield _drafted("gear_ratio", gear_ratio)
    yield _line("sign", None, "", "1 where the motor turns with the joint's q, -1 where against it")
    yield _line("zero", None, "", "position of the drive (6064) at q = 0 [counts]")
    yield _drafted("increments_per_revolution", increments(dictionary))
    yield _drafted("velocity_unit", velocity_unit(dictionary))
    yield _drafted("acceleration_unit", acceleration_unit(dictionary))


def _current(review: Review, dictionary: Dictionary) -> Iterator[str]:
    chosen = review.current
    yield "current: # torques are computed from this object: nothing about it may be guessed"
    if chosen is None:
        yield "  " + _line("index", None, "", "object of the motor current, such as 0x6078")
        yield "  " + _line("type", None, "", "i16, i32 or f32")
    else:
        yield from _chosen(chosen)
    for other in review.currents:
        if other is not chosen:
            may = "instead of it" if other.usable else "of no use"
            yield from _comment(f"{may}, {other.place}: {other.why}", "  ")
    yield "  " + _line("basis", None, "", meaning_of(chosen, dictionary))
    yield "  " + _line("amplitude", None, "", "rms or peak: how the drive counts a motor current")


def _chosen(chosen: CurrentCandidate) -> Iterator[str]:
    declared = chosen.declared
    yield from _comment(f"{chosen.place}: {chosen.why}", "  ")
    yield f"  index: 0x{declared.index:X}"
    yield f"  subindex: {declared.subindex}"
    yield f"  type: {declared.type}"


def _ratings(dictionary: Dictionary) -> Iterator[str]:
    ratings = drafted_ratings(dictionary)
    yield _drafted("rated_current", ratings["rated_current"])
    yield _drafted("rated_torque", ratings["rated_torque"])
    if ratings["rated_torque_unit"].value != TorqueUnit.MILLI.value:
        yield _drafted("rated_torque_unit", ratings["rated_torque_unit"])
    unless = "; remove this line if the basis is per mille of rated torque"
    constant = ratings["torque_constant"]
    yield _line("torque_constant", constant.value, constant.reason, constant.hint + unless)
    hint = f"rms or peak: the current that the torque constant refers to{unless}"
    yield _line("torque_constant_amplitude", None, "", hint)


def _brake(dictionary: Dictionary) -> Iterator[str]:
    """Quote the drive's own delay of its brake."""
    maker = MAKERS.get(dictionary.vendor or 0)
    counts = dictionary.value(maker.brake_delay.entry) if maker else None
    if maker and counts:
        delay = maker.brake_delay
        said = f"s, {delay.entry.place} of the drive ({delay.entry.name})"
        yield _line("brake_delay", f"{delay.value(counts):g}", said, "")


def _watch(dictionary: Dictionary, rules: BusRules) -> Iterator[str]:
    """Ask for a reason where the drive cannot watch us."""
    why = rules.unwatched(dictionary)
    if why is not None:
        hint = f"what else stops the axis when our process dies, in words: {why}"
        yield _line("allow_no_heartbeat", None, "", hint)


def _tpdos(review: Review) -> Iterator[str]:
    """State what the TPDOs carry, where that is fixed or does not fit into one."""
    if review.tpdos is not None:
        words = (", ".join(f"0x{word:08X}" for word in each) for each in review.tpdos)
        yield f"tpdos: [{', '.join(f'[{each}]' for each in words)}] # 1A00, 1A01"


def _drafted(key: str, drafted: Drafted) -> str:
    return _line(key, drafted.value, drafted.reason, drafted.hint)


def _line(key: str, value: object, unit: str, hint: str) -> str:
    """Return a line with the value and its unit or source, or one to be stated."""
    if value is None:
        return f"{key}: {UNSTATED} {quoted(one_line(hint, 1000))}"
    return f"{key}: {value}" + (f" {comment(unit)}" if unit else "")


def _comment(text: str, indent: str = "") -> list[str]:
    """Return a comment, folded."""
    start = f"{indent or '  '}# "
    return textwrap.wrap(
        one_line(text, 1000),
        WIDTH - len(indent and "    "),
        initial_indent=start,
        subsequent_indent=f"{start}  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
