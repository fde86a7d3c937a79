"""Check of a drive's own reactions: option codes, brake and interlock.

Three reactions are the drive's own, without influence of the driver: on a fault (605E), when
disabled (605C) and when shut down (605B). Option 0 removes the torque at once, so that the axis
coasts, and a hanging one falls until its brake has closed. Quick stop (605A) and the reaction to a
lost connection (6007) are written before a run; the values found apply to every other master.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.supervision import safe_torque_off
from drivers.cia402.vendor_objects import MAKERS
from drivers.commissioning.verdict import Grade, Verdict, grade_check

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary

COASTS, GOES_ON = "takes the torque away", "does nothing"
_RAMPS = {1: "slows down on the ramp", 2: "slows down on the quick stop ramp"}
_LIMITS = {3: "slows down at the current limit", 4: "slows down at the voltage limit"}
_STAYS = {number + 4: f"{text} and stays powered" for number, text in (_RAMPS | _LIMITS).items()}
_QUICK_STOP = {0: COASTS} | _RAMPS | _LIMITS | _STAYS
_SHUT_DOWN = {0: COASTS, 1: _RAMPS[1]}
_FAULT = {0: COASTS} | _RAMPS | _LIMITS
_CONNECTION = {0: GOES_ON, 1: "goes into a fault", 2: COASTS, 3: "makes a quick stop"}

_FALLS = "the axis coasts, and one that hangs falls until its brake has closed"
_CONSEQUENCES = {COASTS: _FALLS, GOES_ON: "the axis goes on"}
_SET = "set it with the maker's tool"
_WRITTEN = "hil run writes another option over it, every other master meets this one"


def check_reactions(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Judge the reactions of a drive (see `verdict.Check`)."""
    for entry, check, meanings, when, remedy in (
        (objects.FAULT_REACTION, "fault reaction", _FAULT, "on a fault", _SET),
        (objects.DISABLE_OPTION, "switching off", _SHUT_DOWN, "when it is switched off", _SET),
        (objects.SHUTDOWN_OPTION, "shutting down", _SHUT_DOWN, "when it is shut down", _SET),
        (objects.QUICK_STOP_OPTION, "quick stop", _QUICK_STOP, "at a quick stop", _WRITTEN),
        (objects.ABORT_CONNECTION_OPTION, "lost bus", _CONNECTION, "without a bus", _WRITTEN),
    ):
        present = server.find(entry)
        if present is not None:
            # a warning if the axis would coast or go on
            meaning = meanings.get(present, "the maker's own, see its manual")
            consequence = _CONSEQUENCES.get(meaning)
            grade = Grade.OK if consequence is None else Grade.WARNING
            advice = "" if consequence is None else f"{when} {consequence}: {remedy}"
            name, found = f"{check} ({entry.index:04X})", f"{present}, {meaning}"
            yield Verdict(grade, server.label, name, found, remedy=advice)
    yield from _judge_brake(server, axis)
    active = safe_torque_off(server)
    if active:
        remedy = "release it before you agree to motion: while it is active nothing powers on"
        yield Verdict(Grade.WARNING, server.label, "interlock", active, remedy=remedy)
    elif server.find(objects.DIGITAL_INPUTS) is not None:
        yield Verdict(Grade.OK, server.label, "interlock (60FD)", "none")


def _judge_brake(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Compare the closing time of a brake, if the maker has an object for it."""
    maker = MAKERS.get(axis.identity.vendor)
    counts = server.find(maker.brake_delay.entry) if maker else None
    if maker and counts:
        delay = maker.brake_delay
        yield grade_check(
            delay.value(counts) <= axis.brake_delay * (1 + 1e-9),
            Grade.WARNING,
            server.label,
            f"brake ({delay.entry.place})",
            f"{delay.value(counts):g} s",
            f"file: {axis.brake_delay:g} s",
            "the voltage goes before the brake has closed: an axis that hangs sags; state it as "
            "brake_delay",
        )
