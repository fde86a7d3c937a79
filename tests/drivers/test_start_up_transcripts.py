"""Start-up, check and scan exchange the same messages with each kind of drive as before.

The folder `transcripts` holds the transfers of the plain drive, and for all others the differences
from these. A change there is either a defect or meant: then the transcripts are written anew (see
`start_up_transcripts`) and their difference is reviewed.
"""

from __future__ import annotations

from difflib import unified_diff
from typing import TYPE_CHECKING

import can
import pytest
from personalities import drives_for
from sdo_transcript import transcript
from start_up_transcripts import FOLDER, NAMES, kept_of, listened, path_of, run, text_of

if TYPE_CHECKING:
    from collections.abc import Iterable


@pytest.mark.parametrize("name", NAMES)
def test_what_is_said_to_a_drive_is_what_its_transcript_holds(name: str) -> None:
    kept = path_of(name)
    lines = kept.read_text().splitlines(), kept_of(name).splitlines()
    found = "\n".join(unified_diff(*lines, f"transcripts/{kept.name}", "now", lineterm=""))
    remedy = f"if it is meant, write it anew: python tests/support/start_up_transcripts.py {name}"
    assert not found, f"{found}\n{remedy}"


@pytest.mark.parametrize("name", NAMES)
def test_a_scan_asks_for_all_that_start_up_reads(name: str) -> None:
    started, _, scanned = text_of(name).split("# ")[1:]
    streamed = {0x60B1, 0x60B2, 0x60C2}  # objects read for streamed paths only
    measured = {0x30D1}  # motor current in a manufacturer-specific object
    pdos, watched = range(0x1400, 0x1C00), 0x1016  # PDOs other than ours; all entries of 1016
    missed = {
        place
        for place in _read(started) - _read(scanned)
        if int(place[:4], 16) not in {*streamed, *measured, *pdos, watched}
    }
    assert missed == set()


def _read(session: str) -> set[str]:
    """Return index and sub-index of the objects read by a session."""
    return {line.split()[2] for line in session.splitlines() if line[2:6] == "read"}


def test_each_transcript_is_that_of_a_personality() -> None:
    assert {path.stem for path in FOLDER.iterdir()} == set(NAMES)


def test_the_drives_of_one_robot_are_asked_and_written_alike() -> None:
    with listened("plain") as (bus, frames):
        run(bus, "plain", drives_for("plain"))
    steps = [[*_steps(transcript(frames, [node]))] for node in range(1, 7)]
    assert len(steps[0]) > 300
    assert steps[0] == steps[1] == steps[2]  # three have a fixed range, so two objects less
    assert steps[3] == steps[4] == steps[5]  # limits read back in turn before a move
    until_start, other = (each[: each.index(("nmt", "start"))] for each in (steps[0], steps[3]))
    assert len(until_start) > 250
    assert until_start == other


def _steps(lines: Iterable[str]) -> Iterable[tuple[str, str]]:
    """Return steps without node, values and range, which three drives store as stated."""
    for line in lines:
        _, what, place, *_ = line.split()
        if not place.startswith("607D"):
            yield what, place


def sdo(base: int, *data: int) -> can.Message:
    return can.Message(arbitration_id=base + 5, data=data, is_extended_id=False)


def test_expedited_transfers_are_decoded_in_the_length_that_is_stated() -> None:
    assert transcript(
        [
            sdo(0x600, 0x40, 0x41, 0x60, 0, 0, 0, 0, 0),
            sdo(0x580, 0x4B, 0x41, 0x60, 0, 0x37, 0x02, 0, 0),
            sdo(0x600, 0x40, 0x61, 0x60, 0, 0, 0, 0, 0),
            sdo(0x580, 0x42, 0x61, 0x60, 0, 0x01, 0, 0, 0),  # states no length
            sdo(0x600, 0x2F, 0x60, 0x60, 0, 0x01, 0, 0, 0),
            sdo(0x580, 0x60, 0x60, 0x60, 0, 0, 0, 0, 0),
        ],
        [5],
    ) == ["5 read  6041:00 0237", "5 read  6061:00 00000001", "5 write 6060:00 01"]


def test_segments_are_put_together_in_both_directions() -> None:
    name, toggled = b"ServoOne", (0x00, 0x1D)  # a segment of seven bytes, then the last byte
    segments = [(toggled[0], *name[:7]), (toggled[1], *name[7:].ljust(7, b"\0"))]
    begun = (0x08, 0x10, 0, 8, 0, 0, 0)
    assert transcript(
        [
            sdo(0x600, 0x40, 0x08, 0x10, 0, 0, 0, 0, 0),
            sdo(0x580, 0x41, *begun),
            sdo(0x600, 0x60, *bytes(7)),
            sdo(0x580, *segments[0]),
            sdo(0x600, 0x70, *bytes(7)),
            sdo(0x580, *segments[1]),
            sdo(0x600, 0x21, *begun),
            sdo(0x580, 0x60, 0x08, 0x10, 0, 0, 0, 0, 0),
            sdo(0x600, *segments[0]),
            sdo(0x580, 0x20, *bytes(7)),
            sdo(0x600, *segments[1]),
            sdo(0x580, 0x30, *bytes(7)),
        ],
        [5],
    ) == ["5 read  1008:00 'ServoOne'", "5 write 1008:00 'ServoOne'"]


def test_how_a_transfer_failed_is_stated_and_equal_lines_are_counted() -> None:
    asked = sdo(0x600, 0x40, 0xC5, 0x60, 0, 0, 0, 0, 0)
    refused = sdo(0x580, 0x80, 0xC5, 0x60, 0, 0x00, 0x00, 0x02, 0x06)
    ours = sdo(0x600, 0x80, 0xC5, 0x60, 0, 0x00, 0x00, 0x04, 0x05)
    assert transcript([asked, refused, asked, refused, asked, ours, asked, asked], [5]) == [
        "5 read  60C5:00 abort 06020000 (2 times)",
        "5 read  60C5:00 given up, abort 05040000",
        "5 read  60C5:00 no answer (2 times)",
    ]


def test_commands_to_one_node_or_all_are_stated_and_other_nodes_are_left_out() -> None:
    commands = [
        can.Message(arbitration_id=0, data=data, is_extended_id=False)
        for data in (b"\x80\x00", b"\x01\x05", b"\x02\x04")
    ]
    other = can.Message(arbitration_id=0x604, data=bytes(8), is_extended_id=False)
    assert transcript([*commands, other], [5]) == ["5 nmt   pre-operational", "5 nmt   start"]
