"""What an object dictionary offers for measuring, and what each gap in it means.

The same review serves a data sheet that lies on the desk, a drive that a scan has found and a drive
that is about to be used: `review` takes a `Dictionary`, whatever told it, and does no I/O. Each
`Finding` says what is lacking and what follows. One that is `fatal` keeps the drive from being used
at all; of what a live drive left unanswered nothing is concluded but that it must be looked up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.canopen import objects as cia301
from drivers.cia402 import objects
from drivers.cia402.states import Mode
from drivers.commissioning.requirements import NEEDS, NO_RANGE, Need, Use
from drivers.dictionary.current_candidates import current_candidates
from drivers.dictionary.mapping_review import Mapping, review_mapping

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Declared, Dictionary

DRIVE_PROFILE = 402
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


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that a drive lacks or does otherwise.

    Attributes
    ----------
    about : str
        Which object, such as "6084:00 (profile deceleration)".
    problem : str
        What is the matter with it.
    consequence : str
        What follows for our purpose.
    fatal : bool
        The drive cannot serve.
    """

    about: str
    problem: str
    consequence: str
    fatal: bool

    def __str__(self) -> str:
        return f"{self.about} {self.problem}: {self.consequence}"


@dataclass(frozen=True)
class Review:
    """What a drive offers.

    Attributes
    ----------
    source : str
        What was reviewed, for messages.
    profile : int or None
        Device profile (1000); 402 is a drive.
    modes : tuple of Mode or None
        That it supports (6502).
    currents : tuple of CurrentCandidate
        Objects that may show the motor current, the most suitable first.
    current : CurrentCandidate or None
        The one to be used.
    mapping : Mapping
        What can be said of its PDOs.
    findings : tuple of Finding
        The fatal ones first.
    """

    source: str
    profile: int | None
    modes: tuple[Mode, ...] | None
    currents: tuple[CurrentCandidate, ...]
    current: CurrentCandidate | None
    mapping: Mapping
    findings: tuple[Finding, ...]

    @property
    def serves(self) -> bool:
        """Nothing that is known keeps the drive from being used."""
        return not self.refusals

    @property
    def refusals(self) -> tuple[Finding, ...]:
        """Why the drive cannot be used."""
        return tuple(finding for finding in self.findings if finding.fatal)


def review(dictionary: Dictionary) -> Review:
    """Judge a dictionary.

    Raises
    ------
    FileError
        An object that we need is declared in a way that cannot be understood.
    """
    profile = _profile(dictionary)
    if profile not in {None, DRIVE_PROFILE}:
        named = PROFILES.get(profile or 0, "no drive")
        return _no_drive(dictionary.source, profile, f"says device profile {profile} ({named})")
    if _commandless(dictionary):
        return _no_drive(dictionary.source, profile, "has neither controlword nor statusword")
    modes = _modes(dictionary)
    candidates = current_candidates(dictionary)
    usable = [candidate for candidate in candidates if candidate.usable]
    mapping, current, obstacles = review_mapping(dictionary, usable)
    findings = [
        *(finding for need in NEEDS for finding in _gaps(dictionary, need)),
        *_wrong_mode(modes),
        *_no_range(dictionary),
        *_counted(dictionary),
        *_no_current(dictionary, candidates, usable),
        *(Finding(about, problem, so, fatal) for about, problem, so, fatal in obstacles),
    ]
    findings.sort(key=lambda finding: not finding.fatal)
    return Review(dictionary.source, profile, modes, candidates, current, mapping, tuple(findings))


def _profile(dictionary: Dictionary) -> int | None:
    declared = dictionary.entry(cia301.DEVICE_TYPE)
    if declared is None:
        return None
    # 0 as a default says that the maker's tool left it open.
    number = declared.default or None if declared.value is None else declared.value
    return None if number is None else number & 0xFFFF


def _commandless(dictionary: Dictionary) -> bool:
    keys = {(entry.index, entry.subindex) for entry in (objects.CONTROLWORD, objects.STATUSWORD)}
    known = {*dictionary.entries, *dictionary.unanswered, *dictionary.damaged}
    return not keys & known


def _no_drive(source: str, profile: int | None, problem: str) -> Review:
    so = "it is no CiA 402 drive and is left alone"
    finding = Finding("the device", problem, so, fatal=True)
    return Review(source, profile, None, (), None, Mapping(None, None, None), (finding,))


def _modes(dictionary: Dictionary) -> tuple[Mode, ...] | None:
    declared = dictionary.entry(objects.SUPPORTED_MODES)
    if declared is None:
        return None
    bits = declared.default if declared.value is None else declared.value
    if bits is None:
        return None
    return tuple(mode for mode in Mode if bits & mode.supported_bit)


def _wrong_mode(modes: tuple[Mode, ...] | None) -> Iterator[Finding]:
    if modes is not None and Mode.PROFILE_POSITION not in modes:
        yield Finding(
            str(objects.SUPPORTED_MODES),
            "does not name profile position mode (bit 0)",
            "the drive cannot make the motions of a measurement by itself",
            fatal=True,
        )


def _no_range(dictionary: Dictionary) -> Iterator[Finding]:
    """Software limits that are off and stay off."""
    ends = [
        dictionary.entry(entry)
        for entry in (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)
    ]
    low, high = (_fixed_at(end) for end in ends)
    if low is not None and high is not None and low >= high:
        yield Finding("607D", f"is fixed at {low} and {high}, off", NO_RANGE, fatal=True)


def _counted(dictionary: Dictionary) -> Iterator[Finding]:
    """A counter in SYNC that cannot be switched off."""
    counter = _fixed_at(dictionary.entry(cia301.SYNC_COUNTER))
    if counter:
        so = "it does not act on our SYNC, which has no counter"
        yield Finding(str(cia301.SYNC_COUNTER), f"is fixed at {counter}", so, fatal=True)


def _fixed_at(declared: Declared | None) -> int | None:
    if declared is None or declared.writable is not False:
        return None
    return declared.default if declared.value is None else declared.value


def _gaps(dictionary: Dictionary, need: Need) -> Iterator[Finding]:
    entry, about = need.entry, str(need.entry)
    refused = dictionary.unanswered.get((entry.index, entry.subindex))
    declared = dictionary.entry(entry)
    if refused is not None:
        yield Finding(about, refused, f"if it is missing, {need.without}", fatal=False)
    elif declared is None and need.instead and all(map(dictionary.entry, need.instead)):
        yield Finding(about, "is missing", need.served, fatal=False)
    elif declared is None:
        yield Finding(about, "is missing", need.without, need.required)
    else:
        yield from _flaws(declared, need)


def _flaws(declared: Declared, need: Need) -> Iterator[Finding]:
    about, fatal = str(need.entry), need.required
    if declared.bits is not None and declared.bits != 8 * need.entry.size:
        problem = f"has {declared.bits} bits, {8 * need.entry.size} expected ({need.entry.type})"
        yield Finding(about, problem, need.without, fatal=True)
    as_we_want_it = declared.fixed is not None and declared.fixed == need.value
    if as_we_want_it or Use.WRITE not in need.use:
        pass
    elif declared.writable is False:
        so = need.fixed or need.without
        yield Finding(about, f"cannot be written ({declared.access})", so, fatal and not need.fixed)
    elif not _takes(declared, need.value):
        span = f"{declared.low} to {declared.high}"
        problem = f"takes no value but {span if declared.fixed is None else declared.fixed}"
        yield Finding(about, problem, need.without, fatal)
    if Use.READ in need.use and declared.readable is False:
        yield Finding(about, "cannot be read (wo)", need.without, fatal)
    if declared.mappable is False and need.use & (Use.SEND | Use.RECEIVE):
        problem = "cannot be mapped into a PDO"
        yield Finding(about, problem, "it cannot travel with SYNC", fatal=True)


def _takes(declared: Declared, value: int | None) -> bool:
    if declared.fixed is not None:
        return False
    if value is None:
        return True
    low = value if declared.low is None else declared.low
    high = value if declared.high is None else declared.high
    return low <= value <= high


def _no_current(
    dictionary: Dictionary,
    candidates: tuple[CurrentCandidate, ...],
    usable: list[CurrentCandidate],
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
