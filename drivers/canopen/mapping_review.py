"""Review of a drive's PDOs: room for status, position and current of a SYNC.

A writable mapping needs room only, and objects that TPDO 1 cannot hold may go into TPDO 2. With a
fixed mapping the drive is suitable only if its PDOs carry the right objects already, TPDOs in any
order, and the fixed mapping decides on the current object (the set-up itself is in
`drivers.canopen.pdo_set_up`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.canopen.objects import OFF
from drivers.canopen.pdo_mapping import COMMAND, ON_SYNC, STATE
from drivers.dictionary.review import Finding, ProcessDataReview, fixed_at

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.dictionary.current_candidates import CurrentCandidate
    from drivers.dictionary.dictionary import Dictionary

_STATE, _COMMAND = (tuple(entry.word for entry in entries) for entries in (STATE, COMMAND))


@dataclass(frozen=True, slots=True)
class PdoOffer:
    """PDO offered by a drive.

    Attributes
    ----------
    name : str
        "TPDO 1" and so on.
    writable : bool or None
        True if the mapping may be changed; None if unknown.
    switchable : bool or None
        True if the COB-ID may be changed, and thus the PDO switched off.
    on : bool
        True if the PDO is switched on.
    transmission : int or None
        Transmission type, if fixed.
    room : int or None
        Largest number of objects, if stated by the count (sub-index 0).
    declared : int or None
        Number of sub-indices declared for objects by a data sheet.
    carries : tuple of int
        Present mapping, as `drivers.fieldbus.Entry.word`.
    """

    name: str
    writable: bool | None
    switchable: bool | None
    on: bool
    transmission: int | None
    room: int | None
    declared: int | None
    carries: tuple[int, ...]


_Tpdos = tuple[PdoOffer | None, PdoOffer | None]
"""Used TPDOs; None for a missing one."""


def review_mapping(dictionary: Dictionary, usable: Sequence[CurrentCandidate]) -> ProcessDataReview:
    """Review the capacity of the PDOs (see `drivers.dictionary.review.ProcessDataReview`)."""
    tpdos = _offer(dictionary, "TPDO 1", 0x1800), _offer(dictionary, "TPDO 2", 0x1801)
    receiving = tuple(_obstacles(_offer(dictionary, "RPDO 1", 0x1400), "RPDO 1", _COMMAND))
    attempts = [(current, tuple(_sending(tpdos, current))) for current in usable]
    if not attempts:
        return ProcessDataReview(None, None, receiving)
    fitting = (attempt for attempt in attempts if not any(each.fatal for each in attempt[1]))
    current, obstacles = next(fitting, attempts[0])
    return ProcessDataReview(current, _other_tpdos(tpdos, current), (*receiving, *obstacles))


def _other_tpdos(tpdos: _Tpdos, current: CurrentCandidate) -> tuple[tuple[int, ...], ...] | None:
    """Return the mappings of TPDO 1 and 2 for the drives file, None for the preferred ones."""
    measured = _word(current)
    together, apart = ((*_STATE, measured),), (_STATE, (measured,))
    usual = together if current.declared.bits == 16 else apart
    fits = usual is together and not any(
        each.fatal for each in _obstacles(tpdos[0], "TPDO 1", together[0])
    )
    wanted = together if fits else apart
    found = tuple(
        offer.carries if offer is not None and offer.writable is False else objects
        for offer, objects in zip(tpdos, wanted, strict=False)
    )
    return None if found == usual else found


def _offer(dictionary: Dictionary, name: str, communication: int) -> PdoOffer | None:
    mapping = communication + 0x200
    if {(communication, 1), (mapping, 0)} & dictionary.unanswered.keys():
        return PdoOffer(name, None, None, False, None, None, None, ())
    cob = dictionary.find(communication, 1)
    members = list(dictionary.members(mapping))
    if cob is None or not members:
        return None
    slots = [member for member in members if member.subindex]
    writable = [member.writable for member in members]
    count = members[0].stated if members[0].subindex == 0 else None
    return PdoOffer(
        name,
        None if None in writable else all(writable),
        cob.writable,
        not (cob.stated or 0) & OFF,
        fixed_at(dictionary.find(communication, 2)),
        members[0].high if members[0].subindex == 0 else None,
        None if dictionary.live else len(slots),
        tuple(
            slot.stated for slot in slots[: len(slots) if count is None else count] if slot.stated
        ),
    )


def _sending(tpdos: _Tpdos, current: CurrentCandidate) -> Iterator[Finding]:
    declared, carried = current.declared, _word(current)
    first, second = tpdos
    together = list(_obstacles(first, "TPDO 1", (*_STATE, carried)))
    if declared.bits == 16 and not any(each.fatal for each in together):
        yield from _types(first)
        yield from together
        if second is not None and second.switchable is False and second.on:
            so = "still sent, harmless under its own identifier"
            yield Finding(
                second.name, "cannot be switched off (its COB-ID is fixed)", so, fatal=False
            )
        return
    fixed = first is not None and first.writable is False
    elsewhere = second is not None and carried in second.carries
    if declared.bits == 16 and (first is None or (fixed and not elsewhere)):
        yield from together
        return
    if declared.bits == 16 and not fixed:
        so = "the current is mapped to TPDO 2, with more bus load"
        yield Finding("TPDO 1", "has no room for 3 objects", so, fatal=False)
    yield from _types(first, second)
    yield from _obstacles(first, "TPDO 1", _STATE)
    yield from _obstacles(second, "TPDO 2", (carried,))


def _word(current: CurrentCandidate) -> int:
    declared = current.declared
    return declared.index << 16 | declared.subindex << 8 | (declared.bits or 0)


def _shown(words: Sequence[int]) -> str:
    return ", ".join(f"{word >> 16:04X}:{word >> 8 & 0xFF:02X}" for word in words)


def _types(*offers: PdoOffer | None) -> Iterator[Finding]:
    for offer in offers:
        if offer is not None and offer.transmission not in {None, ON_SYNC}:
            problem = f"has the fixed transmission type {offer.transmission}"
            so = "its values are not sampled at SYNC (type 1)"
            yield Finding(offer.name, problem, so, fatal=True)


def _obstacles(offer: PdoOffer | None, name: str, wanted: tuple[int, ...]) -> Iterator[Finding]:
    what = _shown(wanted)
    if offer is None:
        yield Finding(name, "is missing", f"{what} cannot be exchanged", fatal=True)
        return
    if offer.writable is False:
        # an RPDO must match exactly; a TPDO may have any order, and more objects of whole bytes
        whole = all((word & 0xFF) % 8 == 0 for word in offer.carries)
        serves = offer.carries == wanted or (
            wanted != _COMMAND and whole and set(wanted) <= set(offer.carries)
        )
        if not serves:
            has = _shown(offer.carries) or "nothing"
            so = f"{what} is needed; map it with the maker's tool or use another drive"
            yield Finding(name, f"is fixed and carries {has}", so, fatal=True)
    elif offer.room is not None and offer.room < len(wanted):
        problem = f"takes {offer.room} objects at most"
        yield Finding(name, problem, f"{what} does not fit", fatal=True)
    elif offer.declared is not None and offer.declared < len(wanted):
        so = f"{what} is needed; verified only when the drive is set up"
        yield Finding(name, f"declares room for {offer.declared} objects", so, fatal=False)
    elif offer.switchable is False and offer.carries != wanted:
        so = "the mapping may still be writable, tried when the drive is set up"
        yield Finding(name, "cannot be switched off (its COB-ID is fixed)", so, fatal=False)
