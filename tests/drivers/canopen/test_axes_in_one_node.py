"""Several axes in one node behave like single drives, for any set of shared objects.

The plant is the manutec r15 with two or three axes in each node, without ripple, whose phases
follow from the node number; the peer is the same plant with a node for each axis.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import can
import canopen
import pytest
import yaml
from canopen_drive_bus import CanopenDriveBus
from personalities import DRIVES, PLANT

from checked_files.yaml_file import FileError
from drivers.canopen.bus import CanopenBus
from drivers.dictionary.review import review
from drivers.drive_bus import DriveFault, Move, NodeSilent, Sample, Tripped
from drivers.drives_file import DrivesFile
from drivers.opening import find_rules, read_eds
from drivers.operator_tools.draft import DraftedAxis, draft_drives
from drivers.session.connection import places_of
from sim_plant.canopen.eds import drive_eds
from sim_plant.canopen.multi_axis import multi_axis_eds
from sim_plant.ethercat.segment import Segment
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from pathlib import Path

MOVES = {axis: Move(target=0.1, velocity=0.5, acceleration=2.0) for axis in range(6)}


def regrouped(axes: list[dict[str, Any]], each: int, *, of_plant: bool = False) -> None:
    """Move axes of a plant file or drives file into nodes of `each` axes."""
    for number, axis in enumerate(axes):
        node, inner = divmod(number, each)
        (axis["drive"] if of_plant else axis).update(node=node + 1, axis=inner + 1)


def plant_of(folder: Path, each: int, **noise: float) -> str:
    data = yaml.safe_load(PLANT.read_text())
    data["noise"] = {"ripple": 0.0, **noise}
    regrouped(data["axes"], each, of_plant=True)
    path = folder / f"{each}-axes.yaml"
    path.write_text(yaml.safe_dump(data))
    return str(path)


def drives_of(each: int, **changes: Any) -> DrivesFile:
    data = {**yaml.safe_load(DRIVES.read_text()), **changes}
    regrouped(data["axes"], each)
    return DrivesFile.model_validate(data)


def opened(channel: str, **options: Any) -> can.BusABC:
    return can.Bus(channel, interface="sim_plant", ignore_config=True, **options)


def sampled(axes: CanopenDriveBus, number: int) -> None:
    for _ in range(number):
        axes.sample()


def moved(folder: Path, each: int) -> list[Sample]:
    """Return all samples of a motion of all axes."""
    samples = []
    with opened(plant_of(folder, each)) as bus, CanopenDriveBus(bus, drives_of(each)) as axes:
        axes.move(MOVES)
        while not samples or not samples[-1].reached:
            samples.append(axes.sample())
    return samples


@pytest.fixture(params=[2, 3])
def each(request: pytest.FixtureRequest) -> int:
    return int(request.param)


def test_axes_of_one_node_move_and_measure_as_single_drives_do(each: int, tmp_path: Path) -> None:
    together, alone = moved(tmp_path, each), moved(tmp_path, 1)
    assert len(alone) > 50
    assert [(s.q, s.tau, s.flags) for s in together] == [(s.q, s.tau, s.flags) for s in alone]


def test_a_scan_finds_each_axis_with_its_own_ratings_and_a_draft_names_all(
    each: int, tmp_path: Path
) -> None:
    with opened(plant_of(tmp_path, each)) as bus:
        nodes = CanopenBus(bus).scan().nodes
    assert [1 + len(node.further) for node in nodes.values()] == [each] * (6 // each)
    axes = [
        DraftedAxis(dictionary, reviewed, node.node, within)
        for node in nodes.values()
        if node.dictionary and node.review
        for within, dictionary, reviewed in (
            (node.within, node.dictionary, node.review),
            *node.further,
        )
    ]
    text = draft_drives(axes, find_rules(None))
    stated = [line.strip() for line in text.splitlines()]
    for number, drive in enumerate(load_machine(plant_of(tmp_path, each)).drives):
        assert axes[number].node == drive.node_id
        assert axes[number].within.axis == drive.axis
        assert f"rated_current: {drive.rated_current / 1000:g} # A, 6075" in stated
    second = "axis: 2 # of several in this drive: its objects are 800h after those below"
    assert stated.count(second) == 6 // each


def test_what_the_drives_held_is_put_back_pdos_without_identifier_included(
    each: int, tmp_path: Path
) -> None:
    def held(bus: can.BusABC) -> dict[tuple[int, int, int], bytes]:
        servers = CanopenBus(bus).servers(places_of(drives_of(6 // (6 // each)).axes[::each]))
        sheet = canopen.import_od(_named(multi_axis_eds([drive_eds()] * each)))
        found = {}
        for server in servers:
            for index, thing in sheet.items():
                parts = (
                    [thing]
                    if isinstance(thing, canopen.objectdictionary.ODVariable)
                    else (thing.values())
                )
                for part in parts:
                    if "w" in part.access_type and part.readable and index not in COMMANDS:
                        place = index, part.subindex
                        found[server.node, *place] = server.access.read(*place)
        return found

    with opened(plant_of(tmp_path, each)) as bus:
        before = held(bus)
        with CanopenDriveBus(bus, drives_of(each)) as axes:
            axes.sample()
            assert held(bus) != before
        assert held(bus) == before
    assert any(index == 0x1800 + 4 for _, index, _ in before)


COMMANDS = frozenset(
    base + axis * 0x800 for base in (0x6040, 0x6060, 0x607A, 0x6081, 0x6083, 0x6084)
    for axis in range(3)
)  # fmt: skip


def _named(text: str) -> Any:
    import io

    file = io.StringIO(text)
    file.name = "drive.eds"
    return file


def test_a_fault_of_the_second_axis_is_named_with_it_and_stops_the_first(tmp_path: Path) -> None:
    faults = tmp_path / "faults.yaml"
    faults.write_text("faults:\n  - {what: fault, axis: 2, at: {time: 0.5}, code: 0x2310}\n")
    with (
        opened(plant_of(tmp_path, 2), faults=str(faults)) as bus,
        CanopenDriveBus(bus, drives_of(2)) as axes,
    ):
        axes.move(MOVES)
        with pytest.raises(DriveFault, match=r"^joint 2 \(node 1, axis 2\): .*2310"):
            sampled(axes, 2000)


def test_axes_of_one_node_all_stop_when_our_heartbeat_stays_away(tmp_path: Path) -> None:
    channel = plant_of(tmp_path, 3)
    states: list[int] = []
    with (
        opened(channel) as bus,
        opened(channel) as other,
        suppress(Tripped, NodeSilent, DriveFault),
        CanopenDriveBus(bus, drives_of(3)) as axes,
    ):
        axes.sample()
        servers = CanopenBus(other).servers(places_of(drives_of(3).axes))
        for sent in (False, True):
            states = [server.access.read(0x6041, 0)[0] & 0x6F for server in servers]
            assert sent or states == [0x27] * 6
            for _ in range(200):
                other.send(can.Message(arbitration_id=0x80, is_extended_id=False))
    assert len(states) == 6
    assert 0x27 not in states


def test_a_data_sheet_with_the_first_four_pdos_for_two_axes_gives_two_to_each(
    tmp_path: Path,
) -> None:
    text = multi_axis_eds([drive_eds()] * 2)
    path = tmp_path / "dual.eds"
    for base in (0x1400, 0x1600, 0x1800, 0x1A00):
        for number in range(4, 8):
            text = text.replace(f"[{base + number:04X}", f"[{base + number + 0x40:04X}")
    path.write_text(text)
    sheet = read_eds(path, 5)
    assert [within.pdos for within in sheet.axes()] == [(1, 2), (3, 4)]
    assert all(review(sheet.select_axis(each), find_rules(None)).serves for each in sheet.axes())


def test_axes_of_one_node_are_counted_and_their_pdos_kept_apart() -> None:
    data = yaml.safe_load(DRIVES.read_text())
    regrouped(data["axes"], 2)
    drives = DrivesFile.model_validate(data)
    identifiers = [axis.cob_id for axis in drives.axes]
    assert identifiers == [None, 0x680, None, 0x685, None, 0x68A]
    data["axes"][1]["axis"] = 1
    with pytest.raises(ValueError, match="number the axes of one drive"):
        DrivesFile.model_validate(data)
    data["axes"][1].update(axis=2, pdos=[4, 7])
    with pytest.raises(ValueError, match="no other axis of the drive uses"):
        DrivesFile.model_validate(data)


def test_an_axis_keeps_to_its_own_objects_and_pdos(tmp_path: Path) -> None:
    with opened(plant_of(tmp_path, 2)) as bus:
        first, second = CanopenBus(bus).servers(places_of(drives_of(2).axes[:2]))
        assert first.access.read(0x6041 + 0x800, 0) == second.access.read(0x6041, 0)
        assert second.access.read(0x6041 + 0x800, 0) == first.access.read(0x6041, 0)
        assert second.access.read(0x1A00, 1) == first.access.read(0x1A00, 1)
        assert first.access.read(0x1A04, 1)[2:] == b"\x41\x68"
        with pytest.raises(Exception, match="another axis"):
            second.access.read(0x1804, 1)
        with pytest.raises(Exception, match=r"on the bus it is 6FFE:00"):
            second.access.read(0x67FE, 0)


def test_several_axes_in_one_node_are_refused_by_name_on_ethercat(tmp_path: Path) -> None:
    machine = load_machine(plant_of(tmp_path, 2))
    with pytest.raises(FileError, match="joint 2: axis 2 of node 1"):
        Segment(machine)
