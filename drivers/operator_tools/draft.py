"""Draft of a drives file from dictionaries; unknown values are left to be stated, line by line.

The draft contains only values of the drive: read from it, set in its configuration file, or fixed
by its maker. A default of a data sheet may belong to another motor, and is at most mentioned. All
other values are marked `!state` with a hint, and `load_drives` refuses the file until they are
stated; so nothing can be overlooked and nothing is guessed.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

from checked_files.foreign_text import one_line
from checked_files.yaml_file import UNSTATED
from checked_files.yaml_text import comment, quoted
from drivers.cia402.objects import MAKERS
from drivers.drive_bus import DriveRefused
from drivers.drives_file import TorqueUnit
from drivers.in_node import ALONE, InNode
from drivers.operator_tools.draft_values import (
    acceleration_unit,
    draft_limits,
    draft_ratings,
    increments,
    meaning_of,
    velocity_unit,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.dictionary.dictionary import Dictionary
    from drivers.dictionary.review import BusRules, Review
    from drivers.operator_tools.draft_values import Drafted

HIGHEST_NODE = 126
WIDTH = 100
_LIMITS = ("q_min", "q_max", "velocity", "acceleration", "torque")
_WINDOWS = (
    "following_error_window", "following_error_time", "position_window", "position_window_time",
)  # fmt: skip


@dataclass(frozen=True)
class DraftedAxis:
    """Drive for a drives file: dictionary, review, and node number if known."""

    dictionary: Dictionary
    review: Review
    node: int | None
    within: InNode = ALONE


def draft_drives(axes: Sequence[DraftedAxis], rules: BusRules, bitrate: int | None = None) -> str:
    """Return the text of a drives file for these drives, in joint order.

    Parameters
    ----------
    axes : sequence of DraftedAxis
        The drives.
    rules : BusRules
        Rules of their bus.
    bitrate : int, optional
        Bit rate of the bus, if known [bit/s].

    Raises
    ------
    DriveRefused
        Unsuitable drives or node numbers; a line each.
    """
    refuse_unfit(axes)
    sources = ", ".join(dict.fromkeys(axis.dictionary.source for axis in axes))
    lines = [
        comment(f"Drafted from {sources}."),
        f"# Values unknown to drive and file are marked {UNSTATED}: replace each mark and its "
        "text by",
        "# the value, joint side and SI unless said otherwise. Until then the file is refused.",
        *_shared(axes, bitrate),
        "",
        "axes:",
    ]
    for number, axis in enumerate(axes, start=1):
        lines += _axis(number, axis, rules)
    return "\n".join(lines) + "\n"


def refuse_unfit(axes: Sequence[DraftedAxis]) -> None:
    """Refuse unsuitable drives, and impossible or repeated nodes (`DriveRefused`)."""
    problems = [
        f"{axis.dictionary.source}: cannot be used: {refusal}"
        for axis in {axis.dictionary.source: axis for axis in axes}.values()
        for refusal in axis.review.refusals
    ]
    places = [(axis.node, axis.within.axis) for axis in axes if axis.node is not None]
    nodes = [node for node, _ in places]
    problems += [
        f"node {node}: must be in 1...{HIGHEST_NODE}; 127 is the master"
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
    yield "sync_period: 0.004 # s, adjustable: sample_period of the plan"
    yield "master_node: 127 # node number of this program, adjustable"
    yield "heartbeat_period: 0.1 # s, adjustable"
    yield "heartbeat_timeout: 0.5 # s, adjustable: time until the drives stop after a crash"
    yield "quick_stop_option: 2 # 605A, adjustable: quick stop ramp, then off"


def _axis(number: int, axis: DraftedAxis, rules: BusRules) -> Iterator[str]:
    dictionary = axis.dictionary
    device = ", ".join(filter(None, (dictionary.maker, dictionary.model))) or "unnamed device"
    yield from _comment(f"{device} ({dictionary.source})")
    for note in (*map(str, axis.review.findings), *(f"the file {n}" for n in dictionary.notes)):
        yield from _comment(note)
    limits = draft_limits(dictionary)
    body = [
        f"name: joint {number}",
        _line("node", axis.node, "", "node number of the drive, 1 to 126"),
        *_within(axis.within),
        *_identity(dictionary),
        _line("joint", None, "", "revolute or prismatic"),
        _drafted("gear_ratio", limits["gear_ratio"]),
        _line("sign", None, "", "1 if motor angle and joint position rise together, -1 if not"),
        _line("zero", None, "", "position of the drive (6064) at q = 0 [counts]"),
        _drafted("increments_per_revolution", increments(dictionary)),
        _drafted("velocity_unit", velocity_unit(dictionary)),
        _drafted("acceleration_unit", acceleration_unit(dictionary)),
        *_current(axis.review, dictionary),
        *_ratings(dictionary),
        "limits:",
        *(f"  {_drafted(key, limits[key])}" for key in _LIMITS),
        *(_drafted(key, limits[key]) for key in _WINDOWS),
    ]
    maker = MAKERS.get(dictionary.vendor or 0)
    counts = dictionary.value(maker.brake_delay.entry) if maker else None
    if maker and counts:
        delay = maker.brake_delay
        said = f"s, {delay.entry.place} of the drive ({delay.entry.name})"
        body.append(_line("brake_delay", f"{delay.value(counts):g}", said, ""))
    why = rules.unwatched(dictionary)
    if why is not None:
        hint = f"what else stops the axis after a crash of this program: {why}"
        body.append(_line("allow_no_heartbeat", None, "", hint))
    if axis.review.tpdos is not None:
        words = (", ".join(f"0x{word:08X}" for word in each) for each in axis.review.tpdos)
        body.append(f"tpdos: [{', '.join(f'[{each}]' for each in words)}] # 1A00, 1A01")
    yield f"  - {body[0]}"
    yield from (f"    {line}" for line in body[1:])


def _within(within: InNode) -> Iterator[str]:
    """Yield the lines on the axis of a multi-axis drive."""
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


def _current(review: Review, dictionary: Dictionary) -> Iterator[str]:
    chosen = review.current
    yield "current: # torques are computed from this object: no value may be guessed"
    if chosen is None:
        yield "  " + _line("index", None, "", "object of the motor current, such as 0x6078")
        yield "  " + _line("type", None, "", "i16, i32 or f32")
    else:
        declared = chosen.declared
        yield from _comment(f"{chosen.place}: {chosen.why}", "  ")
        yield f"  index: 0x{declared.index:X}"
        yield f"  subindex: {declared.subindex}"
        yield f"  type: {declared.type}"
    for other in review.currents:
        if other is not chosen:
            may = "alternative" if other.usable else "unsuitable"
            yield from _comment(f"{may}, {other.place}: {other.why}", "  ")
    yield "  " + _line("basis", None, "", meaning_of(chosen, dictionary))
    yield "  " + _line("amplitude", None, "", "rms or peak: how the drive counts a motor current")


def _ratings(dictionary: Dictionary) -> Iterator[str]:
    ratings = draft_ratings(dictionary)
    yield _drafted("rated_current", ratings["rated_current"])
    yield _drafted("rated_torque", ratings["rated_torque"])
    if ratings["rated_torque_unit"].value != TorqueUnit.MILLI.value:
        yield _drafted("rated_torque_unit", ratings["rated_torque_unit"])
    unless = "; remove this line if the basis is per mille of rated torque"
    constant = ratings["torque_constant"]
    yield _line("torque_constant", constant.value, constant.reason, constant.hint + unless)
    hint = f"rms or peak: the current that the torque constant refers to{unless}"
    yield _line("torque_constant_amplitude", None, "", hint)


def _drafted(key: str, drafted: Drafted) -> str:
    return _line(key, drafted.value, drafted.reason, drafted.hint)


def _line(key: str, value: object, unit: str, hint: str) -> str:
    """Return a line with a value and the unit or source, or with a hint."""
    if value is None:
        return f"{key}: {UNSTATED} {quoted(one_line(hint, 1000))}"
    return f"{key}: {value}" + (f" {comment(unit)}" if unit else "")


def _comment(text: str, indent: str = "") -> list[str]:
    """Return the lines of a comment."""
    start = f"{indent or '  '}# "
    return textwrap.wrap(
        one_line(text, 1000),
        WIDTH - len(indent and "    "),
        initial_indent=start,
        subsequent_indent=f"{start}  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
