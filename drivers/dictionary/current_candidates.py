"""Choice of the object for the motor's current or torque, by evidence.

Torques are computed from this object, so the user can check the choice: every possible object is
listed with its evidence. 6078 (current, per mille of 6075) is first; then a maker's current of 32
bits, finer but at the cost of a second TPDO; then 6077, a torque by name, but on many drives the
current over a rated value. The meaning of a count is never inferred from the index: the standard's
meaning is a suggestion to be confirmed by the drive's manual.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.drives_file import Basis

if TYPE_CHECKING:
    from drivers.dictionary.dictionary import Declared, Dictionary

CURRENT, TORQUE = 0x6078, 0x6077
MAKERS_OBJECTS = range(0x2000, 0x6000)

_QUANTITY = re.compile(
    r"current|torque|amperage|strom\b|drehmoment|moment\b|(?<![a-z])i_?q(?![a-z])", re.I
)
_MEASURED = re.compile(
    r"actual|measured|feedback|readback|present|active|istwert|[-_ ]act(ual)?\b|q[- ]?axis"
    r"|quadrature|(?<![a-z])i_?q(?![a-z])|motor currents?\b",
    re.I,
)
_OTHER = re.compile(
    r"demand|command|target|reference|set[- ]?(value|point)|limit|max|min\b|offset|gain|controller"
    r"|regulator|window|threshold|rated|nominal|constant|phase|adc|slope|peak|brake|braking|error"
    r"|direct axis|d[- ]axis|i_?d\b|reactive|homing|hold|standby|position|velocity|speed|version"
    r"|mode|time|scal|factor|ratio|i2t|i\u00b2t|warning|bandwidth|soll",
    re.I,
)
_SMOOTHED = re.compile(r"averag|filter|mean|smooth|rms", re.I)
_TORQUE = re.compile(r"torque|drehmoment|moment\b", re.I)


@dataclass(frozen=True, slots=True)
class CurrentCandidate:
    """Object that may show the motor's current.

    Attributes
    ----------
    declared : Declared
        The object.
    usable : bool
        True for a number of 16 or 32 bits that a PDO can carry, as far as known.
    basis : Basis or None
        Meaning of a count by the standard; None if stated only in the manual.
    why : str
        Evidence, or the reason why the object is not usable.
    """

    declared: Declared
    usable: bool
    basis: Basis | None
    why: str

    @property
    def place(self) -> str:
        """Index, sub-index and type as text, such as "30D1:02 (i32)"."""
        return f"{self.declared.place} ({self.declared.type or 'no number'})"


def current_candidates(dictionary: Dictionary) -> tuple[CurrentCandidate, ...]:
    """Return the objects that may show the current, the most suitable first."""
    found = []
    for (index, subindex), declared in sorted(dictionary.entries.items()):
        counts_members = not subindex and (index, 1) in dictionary.entries
        maker, name = index in MAKERS_OBJECTS, declared.name
        named = _QUANTITY.search(name) and _MEASURED.search(name) and not _OTHER.search(name)
        readable = declared.readable is not False and not counts_members
        if not (maker and readable and named) and (index not in {CURRENT, TORQUE} or subindex):
            continue
        if declared.type not in {"i16", "i32", "f32"}:
            why = "is neither a signed integer of 16 or 32 bits nor a 32-bit float"
        elif declared.mappable is False:
            why = "cannot be mapped into a PDO"
        else:
            basis, why = _meaning(declared)
            if maker and _SMOOTHED.search(name):
                why += ", smoothed by the drive, which delays it against the position"
            found.append(CurrentCandidate(declared, usable=True, basis=basis, why=why))
            continue
        found.append(CurrentCandidate(declared, usable=False, basis=None, why=why))
    return tuple(sorted(found, key=_preference))


def _meaning(declared: Declared) -> tuple[Basis | None, str]:
    if declared.index == CURRENT:
        return Basis.RATED_CURRENT, "the standard's motor current, per mille of 6075 by CiA 402"
    if declared.index == TORQUE:
        return (
            Basis.RATED_TORQUE,
            "the standard's torque, per mille of 6076 by CiA 402; on many drives it is the current "
            "over a rated value",
        )
    finer = "" if declared.type == "i16" else ", finer than per mille"
    return None, f'the maker\'s own, "{declared.name}"{finer}'


def _preference(candidate: CurrentCandidate) -> tuple[bool, int, bool, int, int]:
    declared = candidate.declared
    if declared.index == CURRENT:
        rank = 0
    elif declared.index == TORQUE:
        rank = 2
    elif _TORQUE.search(declared.name):
        rank = 4
    else:
        rank = 3 if declared.type == "i16" else 1
    smoothed = bool(_SMOOTHED.search(declared.name)) and declared.index in MAKERS_OBJECTS
    return (not candidate.usable, rank, smoothed, declared.index, declared.subindex)
