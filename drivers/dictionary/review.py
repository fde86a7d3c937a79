"""Review of an object dictionary: suitability for measurements, and the meaning of each gap.

One review serves data sheets, drives found by a scan and drives about to be used: `review` takes a
`Dictionary` of any source and does no I/O. Each `Finding` states a deficiency and its consequence.
A `fatal` one excludes the drive; objects that a live drive left unanswered only have to be looked
up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.states import Mode
from drivers.commissioning.requirements import DRIVE_PROFILE, OF_PROFILES, REQUIREMENTS
from drivers.dictionary.current_candidates import current_candidates
from drivers.dictionary.missing_objects import Finding, fixed_at, gaps

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.dictionary.bus_rules import BusRules
    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary
    from drivers.drives_file import AxisDrive

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
        axis a drive is not refused for what a file may state.

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
    """Yield a data sheet with a drive's objects whose default of 1000 is another profile."""
    declared = dictionary.entry(objects.DEVICE_TYPE)
    by_default = declared is not None and declared.value is None
    if profile in {None, DRIVE_PROFILE} or not by_default:
        return
    if all(dictionary.entry(entry) is not None for entry in _OF_DRIVES):
        problem = f"is by default that of profile {profile}, and the objects are those of a drive"
        so = "taken for a CiA 402 drive; what the drive itself answers counts"
        yield Finding(str(objects.DEVICE_TYPE), problem, so, fatal=False)


def _no_drive(source: str, profile: int | None, problem: str) -> Review:
    so = "it is no CiA 402 drive and is left alone"
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
            else "the drive cannot make the motions of a measurement, nor follow them (bit 7)",
            fatal=not planned,
        )


def _no_range(dictionary: Dictionary) -> Iterator[Finding]:
    """Yield software limits that are off and cannot be changed."""
    ends = [
        dictionary.entry(entry)
        for entry in (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)
    ]
    low, high = (fixed_at(end) for end in ends)
    if low is not None and high is not None and low >= high:
        so = REQUIREMENTS[objects.SOFTWARE_LIMIT_MIN].without
        yield Finding("607D", f"is fixed at {low} and {high}, off", so, fatal=True)


def _no_current(
    dictionary: Dictionary, candidates: tuple[CurrentCandidate, ...], usable: list[CurrentCandidate]
) -> Iterator[Finding]:
    if usable:
        return
    about = "motor current (6078, 6077 or a maker's object)"
    for candidate in candidates:
        yield Finding(candidate.place, candidate.why, "it is no source of torque", fatal=False)
    if dictionary.live:
        so = "look for a maker's object in its data sheet: `hil drives new --eds` does"
        yield Finding(about, "was not found on the bus", so, fatal=False)
    else:
        so = "torques cannot be measured, which is all that this is about"
        yield Finding(about, "is missing", so, fatal=True)
