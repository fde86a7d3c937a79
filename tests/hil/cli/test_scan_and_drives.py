"""`hil drives scan` and `hil drives new`, on a bus unknown to the operator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from data_sheets import MAKERS_CURRENT, sheet

from checked_files.yaml_file import UNSTATED, FileError
from drivers.drives_file import load_drives

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


@pytest.fixture
def eds(tmp_path: Path) -> Path:
    path = tmp_path / "drive.eds"
    path.write_text(sheet())
    return path


def test_a_scan_shows_every_drive_of_the_plant(hil: Hil, ideal_channel: str) -> None:
    status, out, err = hil("drives", "scan", "--channel", ideal_channel)
    assert (status, err) == (0, "")
    assert "6 nodes" in out
    assert "1234h, 402h, 7h" in out
    assert "PP" in out
    assert "switch on disabled" in out


def test_a_scan_of_an_empty_bus_says_what_to_check(hil: Hil) -> None:
    status, _, err = hil(
        "drives", "scan", "--interface", "virtual", "--channel", "empty", "--nodes", "5"
    )
    assert status == 1
    assert "no response from node 5; check the drives' power, the bit rate" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("drives", "scan", "--interface", "socketcan"), "needs a channel too"),
        (("drives", "scan", "--nodes", "0-3"), "must be numbers from 1 to 127"),
        (("drives", "scan", "--nodes", "six"), "must be numbers from 1 to 127"),
        (("drives", "new", "-o", "x.yaml"), "give data sheets with --eds, or a bus"),
    ],
)
def test_wrong_usage_is_told(hil: Hil, arguments: tuple[str, ...], message: str) -> None:
    status, _, err = hil(*arguments)
    assert status == 2
    assert message in err


def test_one_sheet_serves_all_nodes(hil: Hil, eds: Path, tmp_path: Path) -> None:
    output = tmp_path / "drives.yaml"
    status, out, err = hil("drives", "new", "--eds", eds, "--nodes", "1-3,11", "-o", output)
    assert (status, err) == (0, "")
    text = output.read_text()
    assert [line.strip() for line in text.splitlines() if line.strip().startswith("node:")] == [
        "node: 1",
        "node: 2",
        "node: 3",
        "node: 11",
    ]
    assert "joint 1, 2, 3, 4: current from 6078:00 (i16): the standard's motor current" in out
    assert f"4 axes in {output}; {text.count(f': {UNSTATED} ')} lines marked !state" in out
    with pytest.raises(FileError, match="must be stated"):
        load_drives(output)


def test_configuration_files_bring_their_nodes(hil: Hil, tmp_path: Path) -> None:
    files = [tmp_path / "a.dcf", tmp_path / "b.dcf"]
    files[0].write_text(sheet(node=2))
    files[1].write_text(sheet({(0x2030, 0): MAKERS_CURRENT, (0x6078, 0): None}, node=5))
    output = tmp_path / "drives.yaml"
    status, out, _ = hil("drives", "new", "--eds", files[0], "--eds", files[1], "-o", output)
    assert status == 0
    text = output.read_text()
    assert "bitrate: 500000 # bit/s" in text
    assert "node: 2\n" in text
    assert "node: 5\n" in text
    assert "joint 1: current from 6078:00 (i16)" in out
    assert "joint 2: current from 2030:00 (i32): the maker's own" in out


def test_without_numbers_the_nodes_are_to_be_stated(hil: Hil, eds: Path, tmp_path: Path) -> None:
    output = tmp_path / "drives.yaml"
    assert hil("drives", "new", "--eds", eds, "-o", output)[0] == 0
    assert f'node: {UNSTATED} "node number of the drive, 1 to 126"' in output.read_text()


def test_a_drives_file_can_be_drafted_from_the_drives_themselves(
    hil: Hil, ideal_channel: str, tmp_path: Path
) -> None:
    output = tmp_path / "drives.yaml"
    bus = ("--interface", "sim_plant", "--channel", ideal_channel, "--nodes", "2,3")
    status, out, err = hil("drives", "new", *bus, "-o", output)
    assert (status, err) == (0, "")
    assert "joint 1, 2: current from 6078:00 (i16)" in out
    text = output.read_text()
    assert "rated_current: 5 # A, 6075" in text
    assert "increments_per_revolution: 4096 # feed 6092 = " in text
    assert "      revision: 0x7" in text


def test_a_drive_that_cannot_serve_leaves_no_file(hil: Hil, tmp_path: Path) -> None:
    bad = tmp_path / "bad.eds"
    bad.write_text(sheet({(0x6064, 0): None}))
    output = tmp_path / "drives.yaml"
    status, _, err = hil("drives", "new", "--eds", bad, "-o", output)
    assert status == 1
    assert f"{bad}: cannot be used: 6064:00 (position actual value) is missing" in err
    assert not output.exists()


def test_a_file_that_is_there_is_never_overwritten(hil: Hil, eds: Path, tmp_path: Path) -> None:
    output = tmp_path / "drives.yaml"
    output.write_text("mine")
    status, _, err = hil("drives", "new", "--eds", eds, "-o", output)
    assert status == 1
    assert "already exists" in err
    assert output.read_text() == "mine"


@pytest.mark.parametrize(
    ("files", "nodes", "status", "message"),
    [(2, "1-3", 2, "3 nodes and 2 data sheets"), (2, "4,4", 1, "node 4: is given to 2 axes")],
)
def test_nodes_must_fit_the_sheets(
    hil: Hil, eds: Path, tmp_path: Path, files: int, nodes: str, status: int, message: str
) -> None:
    sheets = [part for _ in range(files) for part in ("--eds", eds)]
    got, _, err = hil("drives", "new", *sheets, "--nodes", nodes, "-o", tmp_path / "d.yaml")
    assert got == status
    assert message in err


def test_a_silent_node_is_told_by_number(hil: Hil, ideal_channel: str, tmp_path: Path) -> None:
    bus = ("--interface", "sim_plant", "--channel", ideal_channel, "--nodes", "6,7")
    status, _, err = hil("drives", "new", *bus, "-o", tmp_path / "d.yaml")
    assert status == 1
    assert "node 7: answers no SDO" in err


def test_a_draft_holds_gear_speed_torque_and_window_that_live_drives_state(
    hil: Hil, tmp_path: Path
) -> None:
    path = tmp_path / "drives.yaml"
    bus = ("--interface", "sim_plant", "--channel", "manutec-r15", "--nodes", "1")
    status, _, err = hil("drives", "new", *bus, "-o", path)
    assert (status, err) == (0, "")
    lines = {line.split(":")[0].strip(): line.strip() for line in path.read_text().splitlines()}
    assert lines["gear_ratio"] == "gear_ratio: 105 # 6091, if the joint is revolute"
    assert lines["velocity"] == "velocity: 3.001 # rad/s, 6080 = 3009 rpm of the motor"
    assert lines["torque"] == "torque: 945 # N m, 6072 = 3000 per mille of rated_torque"
    assert lines["following_error_window"] == "following_error_window: 0.05844 # rad, 6065 = 4000"
    assert "607D is [-197120, 197120], -2.88 to 2.88 rad" in lines["q_min"]
    assert "!state" in lines["q_max"]
    assert "!state" in lines["sign"]
