"""Table of a run's requirements on a drive, and the documentation made from the table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from local_bench import build
from requirement_tables import DOCS, TABLES, insert_tables

from drivers.canopen.rules import REQUIREMENTS
from drivers.cia402 import objects
from drivers.commissioning.requirements import OWN_LIMITS, Lack, Use, reaction_for
from drivers.rate_units import ACCELERATIONS, VELOCITIES

if TYPE_CHECKING:
    from drivers.commissioning.requirements import Requirement
    from drivers.rate_units import RateUnit


@pytest.mark.parametrize("file", [file for file, _ in TABLES])
def test_the_documentation_has_the_table_as_it_is(file: str) -> None:
    remedy = "write it anew: python tests/support/requirement_tables.py"
    assert (DOCS / file).read_text() == insert_tables(file), remedy


@pytest.mark.parametrize("names", [VELOCITIES, ACCELERATIONS])
def test_the_documentation_names_all_units_of_rates(names: dict[str, RateUnit]) -> None:
    assert f" one of {', '.join(names)}, " in (DOCS / "reference" / "drives.md").read_text()


SET_IF_PRESENT = [
    row for row in REQUIREMENTS.values() if row.lack is Lack.NOTED and Use.WRITE in row.use
]


@pytest.mark.parametrize("row", SET_IF_PRESENT, ids=lambda row: f"{row.entry.index:04X}")
def test_start_up_notes_of_a_missing_object_what_its_row_states(row: Requirement) -> None:
    missing = (row.entry, *row.instead)
    lacks = {(each.index, each.subindex): None for each in missing}
    can_bus, drive_bus = build({2: {(0x6502, 0): ("u32", 0xA5), **lacks}})  # cyclic position too
    with can_bus, drive_bus:
        noted = [note for note in drive_bus.notes if note.startswith("joint 2 (node 2): no object")]
    (note,) = (each for each in noted if str(row.entry) in each)
    assert note.endswith(f": {row.without}")


def test_what_limits_an_axis_has_a_quantity() -> None:
    assert len(OWN_LIMITS) == 7
    assert all(row.quantity is not None for row in OWN_LIMITS)


@pytest.mark.parametrize(("quick_stop", "reaction"), [(2, 3), (3, 3), (5, 1), (6, 1)])
def test_a_lost_bus_ends_in_a_fault_where_a_quick_stop_leaves_the_axis_powered(
    quick_stop: int, reaction: int
) -> None:
    assert reaction_for(quick_stop) == reaction
    assert reaction in REQUIREMENTS[objects.ABORT_CONNECTION_OPTION].serves
