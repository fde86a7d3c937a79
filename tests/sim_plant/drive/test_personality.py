"""Effect of a personality on a drive of the plant: EDS, dictionary, firmware."""

from __future__ import annotations

import configparser
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import canopen
import pytest
from canopen.objectdictionary import ODArray
from desk import Desk
from ideal_machine import IdealMachine
from personalities import PLANT

from checked_files.yaml_file import FileError
from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.eds import drive_eds, drive_entries, inner_entries, key
from sim_plant.personality import (
    PLAIN,
    CurrentReadback,
    ObjectChange,
    Personality,
    load_personality,
    packaged_personalities,
)
from sim_plant.slave_network import SlaveNetwork
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from pathlib import Path

    from sim_plant.canopen.object_dictionary import ObjectDictionary

ENABLE, NEW, HALT = 0x0F, 0x10, 0x100
REACHED, ACKNOWLEDGE = 0x400, 0x1000
ALL = [load_personality(name) for name in packaged_personalities()]


def desk_of(personality: Personality) -> Desk:
    """Return drives of a personality with ideal axes."""
    machine = IdealMachine()
    machine.drives = tuple(replace(drive, personality=personality) for drive in machine.drives)
    network = SlaveNetwork(machine)
    network.power_on()
    return Desk(network, machine)


def enabled(personality: Personality) -> Desk:
    desk = desk_of(personality)
    for word in (6, 7, ENABLE):
        desk.write(0x6040, word)
    desk.sync(10)
    return desk


def dictionary_of(desk: Desk) -> ObjectDictionary:
    return desk.network.nodes[0].dictionary


def status(desk: Desk) -> int:
    return dictionary_of(desk).get(0x6041)


def describe(personality: Personality) -> str:
    return personality.name


# The EDS


@pytest.mark.parametrize("personality", ALL, ids=describe)
def test_a_drive_serves_what_its_eds_says_and_nothing_else(personality: Personality) -> None:
    dictionary = dictionary_of(desk_of(personality))
    declared = drive_entries(personality)
    for number, entry in inner_entries(personality).items():
        index, subindex = number >> 8, number & 0xFF
        if number not in declared:
            with pytest.raises(SdoAbort):
                dictionary.upload(index, subindex)
        elif index != 0x1003 or not subindex:
            data = dictionary.upload(index, subindex)
            assert not entry.code or len(data) == declared[number].size
    assert dictionary.upload(0x1021, 0) == drive_eds(personality).encode("ascii")


@pytest.mark.parametrize("personality", ALL, ids=describe)
def test_the_eds_lists_and_counts_what_it_declares(
    personality: Personality, tmp_path: Path
) -> None:
    eds = configparser.RawConfigParser(strict=True)
    eds.optionxform = str  # type: ignore[assignment,method-assign]
    eds.read_string(drive_eds(personality))
    listed = [
        eds[name][str(n)]
        for name in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
        for n in range(1, int(eds[name]["SupportedObjects"]) + 1)
    ]
    objects = [name for name in eds.sections() if re.fullmatch("[0-9A-F]{4}", name)]
    assert sorted(listed) == sorted(f"0x{name}" for name in objects)
    for name in objects:
        subs = [section for section in eds.sections() if section.startswith(f"{name}sub")]
        assert int(eds[name].get("SubNumber", "0")) == len(subs)
    path = tmp_path / "drive.eds"
    path.write_text(drive_eds(personality))
    assert len(list(canopen.import_od(str(path)))) == len(objects) + 6  # plus six dummy objects


def test_mappings_may_be_arrays_of_few_entries(tmp_path: Path) -> None:
    personality = load_personality("fixed-identifiers")
    assert key(0x1A00, 3) in drive_entries(personality)
    assert key(0x1A00, 4) not in drive_entries(personality)
    desk = desk_of(personality)
    desk.write(0x1A00, 0)
    with pytest.raises(SdoAbort) as refused:
        desk.write(0x1A00, 4)
    assert refused.value.code is AbortCode.VALUE_HIGH
    path = tmp_path / "drive.eds"
    path.write_text(drive_eds(personality))
    assert isinstance(canopen.import_od(str(path))[0x1A00], ODArray)


def test_a_default_mapping_of_a_missing_object_is_empty() -> None:
    entries = drive_entries(Personality(name="x", missing=(0x606C,)))
    assert entries[key(0x1A03)].default == 0
    assert drive_entries()[key(0x1A03)].default == 2


def test_defaults_follow_the_units() -> None:
    entries = drive_entries(
        Personality(name="x", velocity_unit="rpm", acceleration_unit="0.1 rpm/s")
    )
    assert entries[key(0x6081)].default == 4096 * 60 // 4096
    assert entries[key(0x6083)].default == 40960 * 600 // 4096
    assert entries[key(0x60C5)].default == 0xFFFF_FFFF


# Objects


def test_the_current_stands_where_and_in_what_the_personality_says() -> None:
    current = CurrentReadback(index=0x30D1, subindex=2, type="i32", unit="mA")
    desk = desk_of(Personality(name="x", current=current))
    desk.sync()
    dictionary = dictionary_of(desk)
    assert dictionary.upload(0x30D1, 2) == (-22).to_bytes(4, "little", signed=True)
    with pytest.raises(SdoAbort, match="NO_OBJECT"):
        dictionary.upload(0x6078, 0)


def test_milliamperes_are_those_of_the_motor() -> None:
    per_mille, milliampere = (
        load_machine("manutec-r15", 1, name).read().reshape(6, -1) for name in (None, "milliampere")
    )
    rated = [drive.rated_current for drive in load_machine("manutec-r15").drives]
    assert abs(milliampere[:, 3] - per_mille[:, 3] * rated / 1000).max() <= 0.5 + 0.5 * 3.005
    assert (milliampere[:, 0] == per_mille[:, 0]).all()


def test_a_default_of_the_personality_outlives_the_plant_file_s() -> None:
    desk = desk_of(load_personality("milliampere"))
    assert (desk.read(0x607D, 1), desk.read(0x607D, 2)) == (0, 0)


def test_velocities_and_accelerations_are_in_the_drive_s_units() -> None:
    desk = enabled(Personality(name="x", velocity_unit="rpm", acceleration_unit="rpm/s"))
    desk.write(0x607A, 100_000)
    desk.write(0x6081, 60)
    desk.write(0x6083, 120)
    desk.write(0x6084, 180)
    desk.write(0x6040, ENABLE | NEW)
    assert desk.machine.axes[0].calls[-1] == ("move", 100_000, 4096, 8192, 12288)
    desk.sync(2000)
    assert desk.read(0x606C) == 60


def test_a_drive_without_6084_decelerates_as_it_accelerates() -> None:
    desk = enabled(Personality(name="x", missing=(0x6084,)))
    desk.write(0x6083, 5000)
    desk.write(0x607A, 1000)
    desk.write(0x6040, ENABLE | NEW)
    assert desk.machine.axes[0].calls[-1][3:] == (5000, 5000)


# Behaviour


def test_a_slow_mode_display_shows_minus_one_for_a_while() -> None:
    desk = desk_of(Personality(name="x", mode_display_lag=0.1))
    desk.write(0x6060, 1)
    desk.sync(24)
    assert desk.read(0x6061) == -1
    desk.sync(2)
    assert desk.read(0x6061) == 1


def test_a_node_may_become_operational_late_unless_it_is_commanded_otherwise_meanwhile() -> None:
    desk = desk_of(Personality(name="x", start_lag=0.1))
    node = desk.network.nodes[0]
    for commands, after in (((1,), 5), ((128, 1, 128), 127), ((1, 1), 5)):
        for command in commands:
            desk.nmt(command)
        desk.sync(24)
        assert node.nmt.state == 127
        desk.sync(2)
        assert node.nmt.state == after
        desk.nmt(128)


def test_a_mode_change_may_be_refused_while_halt_is_set() -> None:
    desk = desk_of(Personality(name="x", mode_locked_by_halt=True))
    desk.write(0x6040, HALT)
    with pytest.raises(SdoAbort, match="DEVICE_STATE"):
        desk.write(0x6060, 1)
    desk.write(0x6040, 0)
    desk.write(0x6060, 1)


def test_a_late_acknowledge_rises_and_falls_late() -> None:
    desk = enabled(Personality(name="x", acknowledge_lag=0.02))
    desk.write(0x607A, 100_000)
    desk.write(0x6040, ENABLE | NEW)
    desk.sync(4)
    assert not status(desk) & ACKNOWLEDGE
    desk.sync(2)
    assert status(desk) & ACKNOWLEDGE
    desk.write(0x6040, ENABLE)
    desk.sync(4)
    assert status(desk) & ACKNOWLEDGE
    desk.sync(2)
    assert not status(desk) & ACKNOWLEDGE


def test_target_reached_may_be_stale() -> None:
    desk = enabled(Personality(name="x", target_reached_lag=0.02))
    assert status(desk) & REACHED
    desk.write(0x607A, 100_000)
    desk.write(0x6040, ENABLE | NEW)
    desk.sync(4)
    assert status(desk) & REACHED
    desk.sync(2)
    assert not status(desk) & REACHED


@pytest.mark.parametrize("at_once", [False, True])
def test_an_rpdo_of_type_1_acts_at_once_where_the_drive_does_so(at_once: bool) -> None:
    desk = desk_of(Personality(name="x", rpdo_at_once=at_once))
    desk.map_rpdo(1, 0x60400010)
    desk.write(0x1400, 0x201, 1)
    desk.nmt(1)
    desk.send(0x201, b"\x06\0")
    assert (status(desk) & 0x6F == 0x21) is at_once
    desk.sync()
    assert status(desk) & 0x6F == 0x21


# Files


def test_an_upload_may_leave_open_how_many_of_its_bytes_count() -> None:
    desk = desk_of(Personality(name="x", sdo_states_size=False))
    answer = desk.request(1, 0x40, 0x17, 0x10, 0)
    assert answer[:4] == b"\x42\x17\x10\0"
    assert answer[6:] != b"\0\0"


def test_a_value_may_be_rounded_and_clipped_without_an_abort() -> None:
    changes = (
        ObjectChange(index=0x607F, step=16),
        ObjectChange(index=0x6065, low=10, high=2500, clip=True),
        ObjectChange(index=0x6066, high=100),
    )
    desk = desk_of(Personality(name="x", objects=changes))
    for index, written, kept in (
        (0x607F, 32594, 32592),
        (0x607F, 32600, 32608),
        (0x6065, 3000, 2500),
        (0x6065, 0, 10),
        (0x6065, 2000, 2000),
    ):
        desk.write(index, written)
        assert desk.read(index) == kept
    with pytest.raises(SdoAbort):
        desk.write(0x6066, 101)


def test_a_plant_file_may_name_a_personality_beside_it(tmp_path: Path) -> None:
    (tmp_path / "odd.yaml").write_text("name: odd\nmissing: [0x1006]\n")
    path = tmp_path / "plant.yaml"
    path.write_text(PLANT.read_text().replace("node: 2,", "node: 2, personality: odd.yaml,"))
    names = [drive.personality.name for drive in load_machine(str(path)).drives]
    assert names == [PLAIN.name, "odd", *[PLAIN.name] * 4]


def test_an_unknown_personality_is_refused_with_those_that_are_known() -> None:
    with pytest.raises(
        FileError, match=r"grumpy: neither a packaged personality \(bare, centiampere"
    ):
        load_machine("manutec-r15", personality="grumpy")


def test_a_change_of_an_object_that_is_not_there_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text("name: odd\nobjects: [{index: 0x6123, access: ro}]\n")
    with pytest.raises(FileError, match=r"odd: the drive has no object 6123:00 .* state a type"):
        load_machine("manutec-r15", personality=str(path))


def test_an_object_can_be_added() -> None:
    change = ObjectChange(index=0x60A9, type="u32", default=0x00B44700)
    desk = desk_of(Personality(name="x", objects=(change,)))
    assert dictionary_of(desk).get(0x60A9) == 0x00B44700
