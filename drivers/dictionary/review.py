"""Review of an object dictionary: suitability for measurements, and the meaning of each gap.

One review serves data sheets, drives found by a scan and drives about to be used: `review` takes a
`Dictionary` of any source and does no I/O. Each `Finding` states a deficiency and its consequence.
A `fatal` finding excludes the drive. An object that a live drive left unanswered may exist: its
finding is not fatal.

An object may be missing, have a non-standard type, or refuse the value to be written. A read-only
object is judged by its fixed value; a value that is not stated, or depends on the axis, is judged
at start-up. A `Scan` collects the reviews of the nodes on a bus.
`BusRules` are the rules of a bus for the object dictionaries of its drives; no open bus is needed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402 import objects
from drivers.cia402.states import Mode
from drivers.commissioning.requirements import (
    DRIVE_PROFILE,
    OF_PROFILES,
    REQUIREMENTS,
    STATE_WHAT_STOPS,
    Lack,
    Use,
    is_set,
    reaction_for,
)
from drivers.dictionary.current_candidates import current_candidates
from drivers.found_settings.restoring import RestoringOrder
from drivers.in_node import ALONE, InNode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from drivers.commissioning.requirements import Requirement
    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Declared, Dictionary
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

    Table = Mapping[Entry, Requirement]


class ProcessDataReview(NamedTuple):
    """Capacity of the process data.

    Attributes
    ----------
    current : CurrentCandidate or None
        The first current object that fits, or the first of all if none does.
    words : tuple of tuple of int or None
        Value for `tpdos` of the drives file; None for the preferred mapping.
    obstacles : tuple of Finding
        Obstacles to the needed process data.
    """

    current: CurrentCandidate | None
    words: tuple[tuple[int, ...], ...] | None
    obstacles: tuple[Finding, ...]


@dataclass(frozen=True, kw_only=True)
class BusRules(RestoringOrder):
    """Rules of a bus for reading, review and drafts of dictionaries.

    Attributes
    ----------
    requirements : mapping of Entry to Requirement
        Requirements on a drive's dictionary, in the order of reading.
    asked : tuple of Entry
        Further objects to read from a live drive, besides the objects in `mappings`.
    review_process_data : callable
        Checks that the process data have room for the usable motor current objects.
    remarks : callable
        Yields further findings on objects of the bus.
    unwatched : callable
        Returns why a drive cannot supervise the master; None if it can, or if unknown.
    """

    requirements: Mapping[Entry, Requirement]
    asked: tuple[Entry, ...]
    mappings: tuple[int, ...]
    review_process_data: Callable[[Dictionary, Sequence[CurrentCandidate]], ProcessDataReview]
    remarks: Callable[[Dictionary], Iterable[Finding]] = lambda _: ()
    unwatched: Callable[[Dictionary], str | None] = lambda _: None


@dataclass(frozen=True, slots=True)
class Finding:
    """Deficiency or peculiarity of a drive.

    Attributes
    ----------
    about : str
        Object, such as "6084:00 (profile deceleration)".
    problem : str
        The deficiency.
    consequence : str
        Consequence for measurements.
    fatal : bool
        True if the drive is unsuitable.
    """

    about: str
    problem: str
    consequence: str
    fatal: bool

    def __str__(self) -> str:
        return f"{self.about} {self.problem}: {self.consequence}"


def gaps(
    dictionary: Dictionary, row: Requirement, axis: AxisDrive | None, table: Table
) -> Iterator[Finding]:
    """Yield the deficiencies of a dictionary in a row of the table.

    Raises
    ------
    FileError
        The declaration of the object is unintelligible.
    """
    if row.lack is Lack.SILENT and Use.ASK in row.use:
        return
    about, declared = str(row.entry), dictionary.entry(row.entry)
    refused = dictionary.unanswered.get(row.entry.key)
    if declared is not None:
        # a substitute is not needed if the objects that it replaces are present
        served = [each for each in table.values() if row.entry in each.instead]
        spare = Use.WRITE in row.use and row.lack is Lack.SILENT and bool(served)
        if not spare or not all(dictionary.entry(each.entry) for each in served):
            yield from _flaws(dictionary, declared, row)
    elif row.lack is Lack.SILENT:
        pass
    elif refused is not None:
        yield Finding(about, refused, f"if it is missing, {row.without}", fatal=False)
    elif not row.instead or not all(map(dictionary.entry, row.instead)):
        yield Finding(about, "is missing", *_consequence(row, axis))
    elif row.served:
        yield Finding(about, "is missing", row.served, fatal=False)


def fixed_at(declared: Declared | None) -> int | None:
    """Return the value of a read-only object; None if writable or not stated."""
    return None if declared is None or declared.writable is not False else declared.stated


def _consequence(row: Requirement, axis: AxisDrive | None) -> tuple[str, bool]:
    """Return the consequence of a missing object, and True if the drive is refused for it."""
    if row.lack is not Lack.REFUSED_UNLESS_STATED:
        return row.without, row.lack is Lack.REFUSED
    if axis is not None and axis.allow_no_heartbeat is not None:
        return f"{row.without}; allowed because: {axis.allow_no_heartbeat}", False
    return f"{row.without}: {STATE_WHAT_STOPS}", axis is not None


def _flaws(dictionary: Dictionary, declared: Declared, row: Requirement) -> Iterator[Finding]:
    about, entry = str(row.entry), row.entry
    harmless = Use.ASK in row.use
    mistyped = declared.bits is not None and declared.bits != 8 * entry.size
    if mistyped:
        problem = f"has {declared.bits} bits, {8 * entry.size} expected ({entry.type})"
        yield Finding(about, problem, row.without, fatal=not harmless)
    if Use.WRITE in row.use:
        # the reaction to a lost connection depends on the fixed quick stop option
        quick_stop = fixed_at(dictionary.entry(objects.QUICK_STOP_OPTION)) or 0
        is_reaction = entry == objects.ABORT_CONNECTION_OPTION
        value = reaction_for(quick_stop) if is_reaction else row.value
        yield from _unwritable(declared, row, value)
    if Use.READ in row.use and declared.readable is False:
        yield Finding(about, "cannot be read (wo)", row.without, fatal=True)
    if declared.mappable is False and row.use & (Use.SEND | Use.RECEIVE):
        problem = "cannot be mapped into a PDO"
        yield Finding(about, problem, "the value cannot be sent with SYNC", fatal=True)


def _unwritable(declared: Declared, row: Requirement, value: int | None) -> Iterator[Finding]:
    """Yield the reason why an object refuses the value to be written."""
    about, writable = str(row.entry), declared.writable is not False
    only = declared.fixed if writable else fixed_at(declared)
    if writable and only is None:
        if value is not None and not _takes(declared, value):
            problem = f"accepts only values {declared.low} to {declared.high}"
            serves = any(_takes(declared, other) for other in row.serves)
            yield Finding(about, problem, row.without if serves else row.fixed, fatal=not serves)
    elif only is None:
        so = row.fixed or row.served or row.without
        fatal = Use.VARY in row.use or (row.lack in _NEEDED and not row.serves)
        yield Finding(about, f"cannot be written ({declared.access})", so, fatal)
    elif only != value:
        serves = _serves(row, only)
        so = (row.served if serves else row.fixed) or row.without
        fixed = f"is fixed at {only} ({declared.access})"
        problem = f"accepts only {only}" if writable else fixed
        yield Finding(about, problem, so, fatal=not serves)


_NEEDED = (Lack.REFUSED, Lack.REFUSED_UNLESS_STATED)


def _serves(row: Requirement, only: int) -> bool:
    """Return True if the fixed value `only` is acceptable instead of the one to be written."""
    if Use.VARY in row.use:
        return False
    if row.serves or row.value is not None:
        return only in row.serves
    return row.lack not in _NEEDED and is_set(only, row.entry)


def _takes(declared: Declared, value: int) -> bool:
    low = value if declared.low is None else declared.low
    high = value if declared.high is None else declared.high
    return low <= value <= high


PROFILES = {
    401: "I/O modules",
    404: "measuring devices",
    405: "programmable controllers",
    406: "encoders",
    408: "hydraulic valves",
    410: "inclinometers",
    418: "batteries",
    419: "battery chargers",
}
_OF_DRIVES = (
    objects.CONTROLWORD, objects.STATUSWORD, objects.TARGET_POSITION, objects.SUPPORTED_MODES,
)  # fmt: skip
"""Objects found in no device of another profile."""


@dataclass(frozen=True)
class Review:
    """Suitability of a drive.

    Attributes
    ----------
    source : str
        Name of the reviewed dictionary in messages.
    profile : int or None
        Device profile (1000); 402 is a drive.
    modes : tuple of Mode or None
        Supported modes (6502).
    currents : tuple of CurrentCandidate
        Objects that may show the motor current, the most suitable first.
    current : CurrentCandidate or None
        Object to be used.
    tpdos : tuple of tuple of int or None
        Mapping of the TPDOs, unless it is the preferred one.
    findings : tuple of Finding
        Findings, the fatal ones first.
    """

    source: str
    profile: int | None
    modes: tuple[Mode, ...] | None
    currents: tuple[CurrentCandidate, ...]
    current: CurrentCandidate | None
    tpdos: tuple[tuple[int, ...], ...] | None
    findings: tuple[Finding, ...]

    @property
    def serves(self) -> bool:
        """True if no known fact excludes the drive."""
        return not self.refusals

    @property
    def refusals(self) -> tuple[Finding, ...]:
        """Findings that exclude the drive."""
        return tuple(finding for finding in self.findings if finding.fatal)


def review(dictionary: Dictionary, rules: BusRules, axis: AxisDrive | None = None) -> Review:
    """Review a dictionary.

    Parameters
    ----------
    dictionary : Dictionary
        Dictionary of a data sheet or of a live drive.
    rules : BusRules
        Rules of the bus for the drive.
    axis : AxisDrive, optional
        Axis of a drives file: object of the current, and other means to stop the axis. Without an
        axis, values that a drives file may state are no reason to refuse a drive.

    Raises
    ------
    FileError
        The declaration of a required object is unintelligible.
    """
    profile = _profile(dictionary)
    supposed = list(_supposed(dictionary, profile))
    if profile not in {None, DRIVE_PROFILE} and not supposed:
        named = PROFILES.get(profile or 0, "no drive")
        return _no_drive(dictionary.source, profile, f"says device profile {profile} ({named})")
    commands = {objects.CONTROLWORD.key, objects.STATUSWORD.key}
    if not commands & {*dictionary.entries, *dictionary.unanswered, *dictionary.damaged}:
        return _no_drive(dictionary.source, profile, "has neither controlword nor statusword")
    supported = dictionary.entry(objects.SUPPORTED_MODES)
    modes = None
    if supported is not None and supported.stated is not None:
        modes = tuple(mode for mode in Mode if supported.stated & mode.supported_bit)
    candidates = current_candidates(dictionary)
    usable = [candidate for candidate in candidates if candidate.usable]
    carried = rules.review_process_data(dictionary, usable)
    findings = [
        *supposed,
        *(
            finding
            for row in rules.requirements.values()
            if row.entry not in OF_PROFILES or modes is None or Mode.PROFILE_POSITION in modes
            for finding in gaps(dictionary, row, axis, rules.requirements)
        ),
        *_wrong_mode(modes),
        *_no_range(dictionary),
        *rules.remarks(dictionary),
        *(() if axis else _no_current(dictionary, candidates, usable)),
        *carried.obstacles,
    ]
    findings.sort(key=lambda finding: not finding.fatal)
    return Review(
        dictionary.source,
        profile,
        modes,
        candidates,
        carried.current,
        carried.words,
        tuple(findings),
    )


def _profile(dictionary: Dictionary) -> int | None:
    declared = dictionary.entry(objects.DEVICE_TYPE)
    if declared is None:
        return None
    # a default of 0 is a value left open by the maker's tool
    number = declared.default or None if declared.value is None else declared.value
    return None if number is None else number & 0xFFFF


def _supposed(dictionary: Dictionary, profile: int | None) -> Iterator[Finding]:
    """Yield a finding if 1000 defaults to another profile, but the objects are those of a drive."""
    declared = dictionary.entry(objects.DEVICE_TYPE)
    by_default = declared is not None and declared.value is None
    if profile in {None, DRIVE_PROFILE} or not by_default:
        return
    if all(dictionary.entry(entry) is not None for entry in _OF_DRIVES):
        problem = f"defaults to profile {profile}, but the objects are those of a drive"
        so = "assumed to be a CiA 402 drive; verified with the drive itself"
        yield Finding(str(objects.DEVICE_TYPE), problem, so, fatal=False)


def _no_drive(source: str, profile: int | None, problem: str) -> Review:
    so = "not a CiA 402 drive: ignored"
    finding = Finding("the device", problem, so, fatal=True)
    return Review(source, profile, None, (), None, None, (finding,))


def _wrong_mode(modes: tuple[Mode, ...] | None) -> Iterator[Finding]:
    if modes is not None and Mode.PROFILE_POSITION not in modes:
        planned = Mode.CYCLIC_POSITION in modes
        yield Finding(
            str(objects.SUPPORTED_MODES),
            "does not name profile position mode (bit 0)",
            "the driver plans the motions of a measurement and streams them (mode 8)"
            if planned
            else "the drive can neither plan motions nor follow set-points (bit 7)",
            fatal=not planned,
        )


def _no_range(dictionary: Dictionary) -> Iterator[Finding]:
    """Yield a finding for software limits that are off and cannot be changed."""
    ends = [
        dictionary.entry(entry)
        for entry in (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)
    ]
    low, high = (fixed_at(end) for end in ends)
    if low is not None and high is not None and low >= high:
        so = REQUIREMENTS[objects.SOFTWARE_LIMIT_MIN].without
        yield Finding("607D", f"is fixed at {low} and {high}, which means off", so, fatal=True)


def _no_current(
    dictionary: Dictionary, candidates: tuple[CurrentCandidate, ...], usable: list[CurrentCandidate]
) -> Iterator[Finding]:
    if usable:
        return
    about = "motor current (6078, 6077 or a maker's object)"
    for candidate in candidates:
        yield Finding(candidate.place, candidate.why, "not usable as torque", fatal=False)
    if dictionary.live:
        so = "`hil drives new --eds` looks for an object of the maker in the data sheet"
        yield Finding(about, "was not found on the bus", so, fatal=False)
    else:
        so = "torques cannot be measured"
        yield Finding(about, "is missing", so, fatal=True)


@dataclass
class FoundNode:
    """Node found by a scan.

    Attributes
    ----------
    node : int
        Node number.
    state, shown_by : str
        NMT state, empty if unknown, and the sign that showed it; on EtherCAT the AL state.
    boots, emergencies : int
        Number of boot-ups and emergencies received.
    answers : int
        Number of answers to one request: more than one come from devices with the same number.
    dictionary : Dictionary or None
        Dictionary read; None without SDO answers.
    review : Review or None
        Review of the dictionary.
    further : list of (InNode, Dictionary, Review)
        Further axes of the node.
    within : InNode
        PDOs of the first axis.
    """

    node: int
    state: str = ""
    shown_by: str = "heartbeat"
    boots: int = 0
    emergencies: int = 0
    answers: int = 0
    dictionary: Dictionary | None = None
    review: Review | None = None
    further: list[tuple[InNode, Dictionary, Review]] = field(default_factory=list)
    within: InNode = ALONE


@dataclass
class Scan:
    """Result of a scan.

    Attributes
    ----------
    nodes : dict of int to FoundNode
        Nodes by number.
    syncs : int
        SYNCs received, from another master.
    """

    nodes: dict[int, FoundNode] = field(default_factory=dict)
    syncs: int = 0

    def heard(self, node: int) -> FoundNode:
        """Return the node with this number; add the node if it is new."""
        return self.nodes.setdefault(node, FoundNode(node))
