"""Draft of a drives file: values known to the drive, marks for all others, refused until filled."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
import yaml
from data_sheets import MAKERS_CURRENT, Place, Spec, sheet

from checked_files.yaml_file import UNSTATED, FileError
from drivers.canopen.eds_file import parse_eds
from drivers.canopen.rules import RULES
from drivers.dictionary.review import review
from drivers.drive_bus import DriveRefused
from drivers.drives_file import load_drives
from drivers.operator_tools.draft import DraftedAxis, draft_drives

if TYPE_CHECKING:
    from pathlib import Path

Changes = dict[Place, Spec | None]

ANSWERS = {
    "bitrate": "1000000",
    "node": "1",
    "vendor": "0x4D2",
    "product": "0x402",
    "joint": "revolute",
    "gear_ratio": "105",
    "sign": "1",
    "zero": "0",
    "increments_per_revolution": "4096",
    "velocity_unit": "inc/s",
    "acceleration_unit": "inc/s^2",
    "basis": "mA",
    "amplitude": "peak",
    "rated_current": "2.583",
    "rated_torque": "3.0",
    "torque_constant": "1.16",
    "torque_constant_amplitude": "peak",
    "q_min": "-2.8",
    "q_max": "2.8",
    "velocity": "3.0",
    "acceleration": "15",
    "torque": "945",
    "following_error_window": "0.05",
    "following_error_time": "0.05",
    "position_window": "0.002",
    "position_window_time": "0.02",
    "allow_no_heartbeat": "the cell's safety controller cuts power",
}


def drafted(axes: list[DraftedAxis]) -> str:
    """Write a draft of drives on CANopen."""
    return draft_drives(axes, RULES)


def axis(changes: Changes | None = None, node: int | None = 1) -> DraftedAxis:
    dictionary = parse_eds(sheet(changes).encode(), "drive.eds", node)
    return DraftedAxis(dictionary, review(dictionary, RULES), node)


def marked(text: str) -> dict[str, str]:
    """Return the marked keys and the quantities to be stated."""
    return dict(re.findall(rf'(\w+): {UNSTATED} "(.*)"', text))


def filled(text: str) -> str:
    return re.sub(rf"(\w+): {UNSTATED} .*", lambda key: f"{key[1]}: {ANSWERS[key[1]]}", text)


def test_an_unedited_draft_is_refused_line_by_line_with_what_to_state(tmp_path: Path) -> None:
    text = drafted([axis(), axis(node=2)])
    path = tmp_path / "drives.yaml"
    path.write_text(text)
    with pytest.raises(FileError) as stated:
        load_drives(path)
    problems = str(stated.value).splitlines()
    lines = text.splitlines()
    assert len(problems) == text.count(f": {UNSTATED} ") > 40
    for problem in problems:
        number = int(problem.removeprefix(f"{path}:").partition(":")[0])
        assert UNSTATED in lines[number - 1]
    gear = text.splitlines().index(next(line for line in lines if "gear_ratio" in line)) + 1
    assert (
        f"{path}:{gear}: axes.0.gear_ratio: must be stated: motor angle over"
        in stated.value.args[0]
    )


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {(0x2030, 0): MAKERS_CURRENT, (0x6078, 0): None},
        {(0x1018, 1): None, (0x1018, 2): None},
        {(0x1016, 1): None, (0x6075, 0): None, (0x608F, 1): None},
    ],
)
def test_a_draft_whose_marks_are_filled_in_is_a_drives_file(
    tmp_path: Path, changes: Changes
) -> None:
    path = tmp_path / "drives.yaml"
    path.write_text(filled(drafted([axis(changes), axis(changes, node=2)])))
    assert [drive.node for drive in load_drives(path).axes] == [1, 2]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {
                (0x1A00, 0): {"AccessType": "ro", "DefaultValue": 3},
                (0x1A00, 1): {"AccessType": "ro", "DefaultValue": 0x60780010},
                (0x1A00, 2): {"AccessType": "ro", "DefaultValue": 0x60640020},
                (0x1A00, 3): {"AccessType": "ro", "DefaultValue": 0x60410010},
            },
            "tpdos: [[0x60780010, 0x60640020, 0x60410010]]",
        ),
        ({(0x1A00, 0): {"HighLimit": 2}}, "tpdos: [[0x60410010, 0x60640020], [0x60780010]]"),
    ],
)
def test_tpdos_that_are_not_as_we_would_have_them_are_stated(
    changes: Changes, line: str, tmp_path: Path
) -> None:
    text = drafted([axis(changes)])
    assert line in text
    assert "tpdos" not in drafted([axis()])
    (tmp_path / "drives.yaml").write_text(filled(text))
    assert load_drives(tmp_path / "drives.yaml").axes[0].tpdos


def test_no_default_of_a_data_sheet_becomes_a_value() -> None:
    text = drafted([axis()])
    asked = marked(text)
    assert "the data sheet's default of 6075 is 5000" in asked["rated_current"]
    assert {"gear_ratio", "sign", "zero", "increments_per_revolution", "basis"} <= asked.keys()


def test_configured_values_are_facts() -> None:
    configured: Changes = {
        (0x6075, 0): {"ParameterValue": 2583},
        (0x608F, 1): {"ParameterValue": 8192},
        (0x608F, 2): {"ParameterValue": 2},
        (0x60A9, 0): {"ParameterValue": "0xFFB44700"},
    }
    read = yaml.safe_load(filled(drafted([axis(configured)])))["axes"][0]
    asked = marked(drafted([axis(configured)]))
    assert (read["rated_current"], read["increments_per_revolution"]) == (2.583, 4096)
    assert read["velocity_unit"] == "0.1 rpm"
    assert not {"rated_current", "increments_per_revolution", "velocity_unit"} & asked.keys()


def test_a_unit_is_a_fact_where_the_maker_fixed_it_and_a_hint_where_he_did_not() -> None:
    code = {"DefaultValue": "0x00C00300"}
    fixed = {**code, "LowLimit": "0x00C00300", "HighLimit": "0x00C00300"}
    assert "acceleration_unit: rpm/s # 60AA" in drafted([axis({(0x60AA, 0): fixed})])
    asked = marked(drafted([axis({(0x60AA, 0): code})]))
    assert "by default rpm/s (60AA)" in asked["acceleration_unit"]


def test_a_default_that_may_hold_in_the_drive_keeps_a_reading_from_being_a_fact() -> None:
    encoder: Changes = {
        (0x608F, 1): {"ParameterValue": 2000},
        (0x608F, 2): {"ParameterValue": 1},
        (0x6092, 1): {"DefaultValue": 3600},
        (0x6092, 2): {"DefaultValue": 1},
    }
    asked = marked(drafted([axis(encoder)]))["increments_per_revolution"]
    assert "2000 counts per motor revolution (608F = 2000, in increments)" in asked
    assert "3600 counts per motor revolution (feed 6092 = 3600" in asked


def test_positions_in_other_units_than_increments_are_told() -> None:
    asked = marked(drafted([axis({(0x60A8, 0): {"ParameterValue": "0xFD010000"}})]))
    assert "60A8 = FD010000h says that positions are no" in asked["increments_per_revolution"]


def test_the_choice_of_the_current_object_is_explained_and_the_others_are_named() -> None:
    text = drafted([axis({(0x2030, 0): MAKERS_CURRENT})])
    assert "# 6078:00 (i16): the standard's motor current, per mille of 6075 by CiA 402" in text
    assert "# alternative, 2030:00 (i32): the maker's own" in text


def test_where_ratings_may_be_found_is_told() -> None:
    makers: Changes = {
        (0x3001, 1): {"ParameterName": "Nominal current", "DefaultValue": 5000},
        (0x3001, 5): {"ParameterName": "Torque constant"},
        (0x6075, 0): None,
    }
    asked = marked(drafted([axis(makers)]))
    assert "3001:01 (Object 3001: Nominal current) may hold it" in asked["rated_current"]
    assert "3001:05" in asked["torque_constant"]


def test_a_hint_quotes_what_is_configured_and_a_default_only_where_nothing_is() -> None:
    makers: Changes = {
        (0x3001, 1): {
            "ParameterName": "Nominal current",
            "DefaultValue": 5000,
            "ParameterValue": 4760,
        },
        (0x3001, 2): {"ParameterName": "Encoder resolution", "ParameterValue": 2048},
        (0x6075, 0): None,
    }
    asked = marked(drafted([axis(makers)]))
    assert "(Object 3001: Nominal current) may hold it, it is 4760" in asked["rated_current"]
    assert "5000" not in asked["rated_current"]
    assert "Encoder resolution) may hold it, it is 2048" in asked["increments_per_revolution"]


@pytest.mark.parametrize(
    ("vendor", "ratings", "reason"),
    [
        # a torque constant of 108 N m/A in units of mN m
        (0x4D2, {(0x6075, 0): 4760, (0x6076, 0): 512_871}, "512.9 N m if it is in mN m, 0.5129"),
        # a maker with uN m, without any configured value that would confirm the unit
        (0xFB, {(0x6076, 0): 512_871}, "0.5129 N m if it is in uN m"),
        # neither unit gives a value near 0.513 N m
        (
            0xFB,
            {(0x3001, 1): 4760, (0x3001, 5): 107_746, (0x6076, 0): 51_000_000},
            "5.1e+04 N m if it is in mN m, 51 N m if it is in uN m",
        ),
    ],
)
def test_a_rated_torque_whose_unit_nothing_proves_is_left_to_be_stated(
    vendor: int, ratings: dict[Place, int], reason: str
) -> None:
    configured: Changes = {place: {"ParameterValue": value} for place, value in ratings.items()}
    configured[0x1018, 1] = {"DefaultValue": vendor}
    asked = marked(drafted([axis(configured)]))
    assert reason in asked["rated_torque"]
    assert "mN m or uN m" in asked["rated_torque_unit"]


def test_the_time_that_a_brake_takes_is_quoted_where_the_maker_has_an_object_for_it() -> None:
    configured: Changes = {
        (0x1018, 1): {"DefaultValue": 0xFB},
        (0x3158, 2): {"DataType": 6, "ParameterValue": 50},
    }
    text = drafted([axis(configured)])
    assert "    brake_delay: 0.05 # s, 3158:02 of the drive (holding brake fall time)" in text


def test_a_drive_that_cannot_watch_our_heartbeat_needs_a_reason() -> None:
    assert "allow_no_heartbeat" in marked(drafted([axis({(0x1016, 1): None})]))
    assert "allow_no_heartbeat" not in drafted([axis()])
    guarded = {(0x1016, 1): None, (0x100C, 0): {"DataType": 6}, (0x100D, 0): {"DataType": 5}}
    assert "allow_no_heartbeat" not in drafted([axis(guarded)])


def test_what_is_missing_stands_above_the_axis() -> None:
    text = drafted([axis({(0x6072, 0): None})])
    assert (
        "  # 6072:00 (max torque) is missing: only the driver enforces this limit, not the drive"
        in text
    )


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (
            [{(0x6064, 0): None}],
            "drive.eds: cannot be used: 6064:00 (position actual value) is missing",
        ),
        ([{(0x6078, 0): None}], "torques cannot be measured"),
    ],
)
def test_a_drive_that_cannot_serve_is_refused(axes: list[Changes], message: str) -> None:
    with pytest.raises(DriveRefused) as stated:
        drafted([axis(changes) for changes in axes])
    assert message in str(stated.value)


@pytest.mark.parametrize(
    ("nodes", "message"),
    [((3, 3), "node 3: is given to 2 axes"), ((127,), "node 127: must be in 1...126")],
)
def test_nodes_that_cannot_be_are_refused(nodes: tuple[int, ...], message: str) -> None:
    with pytest.raises(DriveRefused, match=message.replace(".", r"\.")):
        drafted([axis(node=node) for node in nodes])


def test_names_from_a_foreign_file_cannot_break_the_draft() -> None:
    evil = {**MAKERS_CURRENT, "ParameterName": 'Current actual "\\ \x85 # : value\u2028- a: b'}
    text = drafted([axis({(0x2030, 0): evil, (0x6078, 0): None})])
    read = yaml.safe_load(filled(text))
    assert read["axes"][0]["current"]["index"] == 0x2030
