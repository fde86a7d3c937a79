"""Review of a drive's suitability for measuring, from its dictionary alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from data_sheets import MAKERS_CURRENT, TORQUE, Place, Spec, sheet

from drivers.canopen.eds_file import parse_eds
from drivers.canopen.rules import REQUIREMENTS, RULES
from drivers.cia402.states import Mode
from drivers.commissioning.requirements import Lack
from drivers.dictionary.review import Review, review
from drivers.drives_file import Basis
from sim_plant.canopen.eds import EDS_PATH
from sim_plant.canopen.eds_variant import variant
from sim_plant.personality import load_personality, packaged_personalities

if TYPE_CHECKING:
    from drivers.commissioning.requirements import Requirement

Changes = dict[Place, Spec | None]


def reviewed(changes: Changes | None = None) -> Review:
    return review(parse_eds(sheet(changes).encode(), "drive.eds"), RULES)


def findings(changes: Changes) -> list[str]:
    return [str(finding) for finding in reviewed(changes).findings]


def test_a_complete_drive_serves_without_a_remark() -> None:
    found = reviewed()
    assert found.serves
    assert found.findings == ()
    assert found.profile == 402
    assert found.modes == (Mode.PROFILE_POSITION, Mode.HOMING)


def test_a_default_of_another_profile_does_not_make_a_drive_s_objects_none() -> None:
    found = reviewed({(0x1000, 0): {"DefaultValue": "0x191"}})
    assert found.serves
    assert "assumed to be a CiA 402 drive" in str(found.findings[0])


MENTIONED = [row for row in REQUIREMENTS.values() if row.lack is not Lack.SILENT]


@pytest.mark.parametrize("row", MENTIONED, ids=lambda row: f"{row.entry.index:04X}")
def test_every_missing_object_is_stated_with_its_consequence(row: Requirement) -> None:
    missing = (row.entry, *row.instead)
    found = reviewed({(entry.index, entry.subindex): None for entry in missing})
    stated = [finding for finding in found.findings if finding.about == str(row.entry)]
    assert [finding.problem for finding in stated] == ["is missing"]
    assert stated[0].consequence.startswith(row.without)
    assert stated[0].fatal == (row.lack is Lack.REFUSED)


@pytest.mark.parametrize(
    ("changes", "refusal"),
    [
        (
            {(0x1000, 0): {"DefaultValue": "0x191"}, (0x607A, 0): None},
            "says device profile 401 (I/O modules)",
        ),
        ({(0x6040, 0): None, (0x6041, 0): None}, "has neither controlword nor statusword"),
        ({(0x6502, 0): {"DefaultValue": "0x40"}}, "does not name profile position mode (bit 0)"),
        ({(0x6064, 0): {"PDOMapping": 0}}, "6064:00 (position actual value) cannot be mapped"),
        ({(0x607A, 0): {"AccessType": "ro"}}, "607A:00 (target position) cannot be written (ro)"),
        ({(0x6061, 0): {"AccessType": "wo"}}, "cannot be read (wo)"),
        ({(0x6072, 0): {"DataType": 7}}, "has 32 bits, 16 expected (u16)"),
        ({(0x6078, 0): None}, "torques cannot be measured"),
        ({(0x6078, 0): {"PDOMapping": 0}}, "torques cannot be measured"),
        ({(0x1800, 1): None}, "TPDO 1 is missing"),
        ({(0x1800, 2): {"AccessType": "ro", "DefaultValue": 255}}, "fixed transmission type 255"),
        ({(0x1A00, 0): {"HighLimit": 1}}, "TPDO 1 takes 1 objects at most: 6041:00, 6064:00"),
        (
            {(0x1A00, 0): {"HighLimit": 2}, (0x1801, 1): None},
            "TPDO 2 is missing: 6078:00 cannot be exchanged",
        ),
        (
            {(0x607D, sub): {"AccessType": "ro", "DefaultValue": 0} for sub in (1, 2)},
            "607D is fixed at 0 and 0, which means off",
        ),
        ({(0x1019, 0): {"AccessType": "const", "DefaultValue": 240}}, "is fixed at 240"),
    ],
)
def test_a_drive_that_cannot_serve_is_refused_with_the_reason(
    changes: Changes, refusal: str
) -> None:
    refusals = [str(finding) for finding in reviewed(changes).refusals]
    assert any(refusal in text for text in refusals), refusals


def test_of_a_device_that_is_no_drive_nothing_else_is_told() -> None:
    assert len(findings({(0x1000, 0): {"DefaultValue": "0x191"}, (0x607A, 0): None})) == 1


@pytest.mark.parametrize(
    ("changes", "remark"),
    [
        ({(0x6072, 0): {"AccessType": "ro"}}, "6072:00 (max torque) cannot be written (ro)"),
        ({(0x6066, 0): {"LowLimit": 0, "HighLimit": 0}}, "accepts only 0"),
        ({(0x605D, 0): {"LowLimit": 2, "HighLimit": 3}}, "accepts only values 2 to 3"),
        ({(0x1800, 1): {"AccessType": "ro"}}, "TPDO 1 cannot be switched off"),
        ({(0x1801, 1): {"AccessType": "ro"}}, "TPDO 2 cannot be switched off"),
        (
            {(0x1A00, 0): {"HighLimit": 2}},
            "TPDO 1 has no room for 3 objects: the current is mapped",
        ),
        ({(0x607D, 1): {"AccessType": "ro", "DefaultValue": -9}}, "607D:01 (min position limit)"),
        (
            {(0x1016, 1): None, (0x100C, 0): {"DataType": 6}, (0x100D, 0): {"DataType": 5}},
            "1016:01 (consumer heartbeat time) is missing: node guarding (100C, 100D) is used",
        ),
        ({(0x1600, sub): None for sub in range(2, 9)}, "RPDO 1 declares room for 1 objects"),
    ],
)
def test_what_can_be_done_without_is_a_remark(changes: Changes, remark: str) -> None:
    found = reviewed(changes)
    assert found.serves
    assert remark in str(found.findings[0])


@pytest.mark.parametrize("code", [{"AccessType": "const", "DefaultValue": 0}, {"HighLimit": 0}])
def test_a_value_that_cannot_be_other_than_we_write_it_is_no_remark(code: Spec) -> None:
    assert findings({(0x6086, 0): {"LowLimit": 0, **code}}) == []


def test_a_fixed_mapping_serves_if_it_is_the_right_one() -> None:
    def fixed(*words: int) -> Changes:
        count: Changes = {(0x1A00, 0): {"AccessType": "ro", "DefaultValue": len(words)}}
        entries: Changes = {
            (0x1A00, sub): {"AccessType": "ro", "DefaultValue": word}
            for sub, word in enumerate(words, start=1)
        }
        return {**count, **entries, (0x6077, 0): TORQUE}

    right = reviewed(fixed(0x60410010, 0x60640020, 0x60770010))
    assert right.serves
    assert right.current is not None
    assert right.current.declared.index == 0x6077  # 6078 would be preferred, but cannot be mapped
    other_order = reviewed(fixed(0x60770010, 0x60640020, 0x60410010))
    assert other_order.serves
    assert other_order.current == right.current
    wrong = reviewed(fixed(0x60410010, 0x60770010, 0x60610008))
    assert "is fixed and carries 6041:00, 6077:00, 6061:00" in str(wrong.refusals[0])


def test_a_fixed_rpdo_serves_in_our_order_alone() -> None:
    def fixed(*words: int) -> Changes:
        count: Changes = {(0x1600, 0): {"AccessType": "ro", "DefaultValue": len(words)}}
        entries: Changes = {
            (0x1600, sub): {"AccessType": "ro", "DefaultValue": word}
            for sub, word in enumerate(words, start=1)
        }
        return {**count, **entries}

    assert reviewed(fixed(0x607A0020, 0x60400010)).serves
    assert "RPDO 1 is fixed" in str(reviewed(fixed(0x60400010, 0x607A0020)).refusals[0])


@pytest.mark.parametrize(
    ("changes", "place", "basis"),
    [
        ({(0x6077, 0): TORQUE}, (0x6078, 0), Basis.RATED_CURRENT),
        ({(0x6077, 0): TORQUE, (0x6078, 0): None}, (0x6077, 0), Basis.RATED_TORQUE),
        ({(0x2030, 0): MAKERS_CURRENT}, (0x6078, 0), Basis.RATED_CURRENT),
        ({(0x2030, 0): MAKERS_CURRENT, (0x6077, 0): TORQUE, (0x6078, 0): None}, (0x2030, 0), None),
    ],
)
def test_the_current_object_is_chosen_by_what_it_is(
    changes: Changes, place: Place, basis: Basis | None
) -> None:
    chosen = reviewed(changes).current
    assert chosen is not None
    assert (chosen.declared.index, chosen.declared.subindex) == place
    assert chosen.basis is basis


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("Current actual value", True),
        ("Motor currents: I_q", True),
        ("Measured torque", True),
        ("Active current", True),
        ("Motorstrom Istwert", True),
        ("Current demand value", False),
        ("Torque limit", False),
        ("Actual current phase A", False),
        ("Current controller gain", False),
        ("Nominal current", False),
        ("Current position actual value", False),
        ("Holding current actual", False),
        ("Frequency actual value", False),
    ],
)
def test_makers_objects_are_known_by_their_names(name: str, found: bool) -> None:
    object_ = {**MAKERS_CURRENT, "ParameterName": name}
    places = [candidate.declared.index for candidate in reviewed({(0x2030, 0): object_}).currents]
    assert (0x2030 in places) == found


def test_an_unsmoothed_current_comes_before_a_smoothed_one() -> None:
    averaged = {**MAKERS_CURRENT, "ParameterName": "Current actual value averaged"}
    objects: Changes = {
        (0x2030, 1): averaged,
        (0x2030, 2): MAKERS_CURRENT,
        (0x6078, 0): None,
    }
    first, second = reviewed(objects).currents
    assert (first.declared.subindex, second.declared.subindex) == (2, 1)
    assert "smoothed by the drive" in second.why


@pytest.mark.parametrize("kind", [{"DataType": 0x11}, {"DataType": 7}, {"PDOMapping": 0}])
def test_a_current_that_no_pdo_can_carry_as_a_signed_or_real_number_is_of_no_use(
    kind: Spec,
) -> None:
    makers = {**MAKERS_CURRENT, **kind}
    found = reviewed({(0x2030, 0): makers, (0x6078, 0): None})
    assert [candidate.usable for candidate in found.currents] == [False]
    assert not found.serves
    assert any("2030:00" in str(finding) for finding in found.findings)


def test_a_current_of_32_bits_needs_a_second_tpdo() -> None:
    makers: Changes = {(0x2030, 0): MAKERS_CURRENT, (0x6078, 0): None, (0x6077, 0): TORQUE}
    no_second = {**makers, (0x1801, 1): None}
    chosen = reviewed(no_second).current
    assert chosen is not None
    assert chosen.declared.index == 0x6077


PLACES = {
    "int32-current": "30D1:02",
    "torque-only": "6077:00",
    "centiampere": "6077:00",
    "float-current": "30D1:00",
    "no-current": None,
}
"""Objects of the current other than 6078."""
FATAL = ("no-current", "wrong-pdos")
"""Personalities that prevent measuring; without a watchdog the drives
file may name another stop.
"""


@pytest.mark.parametrize("personality", packaged_personalities())
def test_the_plant_s_personalities_are_judged_as_the_driver_takes_them(personality: str) -> None:
    text = variant(EDS_PATH.read_text(), load_personality(personality))
    found = review(parse_eds(text.encode(), f"{personality}.eds"), RULES)
    assert found.serves == (personality not in FATAL), found.refusals
    assert (found.current and found.current.declared.place) == PLACES.get(personality, "6078:00")
