"""Process data: mapping procedure, transmission types, inhibit time, event timer, dummies."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort

if TYPE_CHECKING:
    import canopen
    from desk import Desk

STATUSWORD, POSITION, CURRENT = 0x60410010, 0x60640020, 0x60780010
CONTROLWORD, TARGET, MODE = 0x60400010, 0x607A0020, 0x60600008
START = 1
TPDO, RPDO = 0x181, 0x201


def refused(desk: Desk, index: int, value: int, subindex: int = 0) -> AbortCode:
    with pytest.raises(SdoAbort) as error:
        desk.write(index, value, subindex)
    return error.value.code


def tpdos(frames: list[tuple[int, bytes]], identifier: int = TPDO) -> list[bytes]:
    return [data for number, data in frames if number == identifier]


def quiet_others(desk: Desk) -> None:
    """Switch off the event-driven TPDO1 of the other nodes."""
    for node in range(2, 7):
        desk.write(0x1800, 1 << 31 | 0x180 + node, 1, node)


# Mapping procedure


def test_a_mapping_cannot_change_while_the_pdo_is_on(desk: Desk) -> None:
    assert refused(desk, 0x1A00, 0) is AbortCode.UNSUPPORTED_ACCESS
    assert refused(desk, 0x1A00, POSITION, 1) is AbortCode.UNSUPPORTED_ACCESS


def test_entries_cannot_change_while_they_count(desk: Desk) -> None:
    desk.write(0x1800, 1 << 31 | TPDO, 1)
    assert refused(desk, 0x1A00, POSITION, 1) is AbortCode.UNSUPPORTED_ACCESS
    desk.write(0x1A00, 0)
    desk.write(0x1A00, POSITION, 1)
    assert desk.read(0x1A00, 1) == POSITION


@pytest.mark.parametrize(
    ("mapping", "entry", "code"),
    [
        (0x1A00, 0x5FFF0010, AbortCode.NO_OBJECT),
        (0x1A00, 0x60640120, AbortCode.NO_OBJECT),
        (0x1A00, 0x60810020, None),
        (0x1A00, 0x60650020, AbortCode.NOT_MAPPABLE),
        (0x1A00, 0x60640010, AbortCode.NOT_MAPPABLE),
        (0x1A00, 0x10080020, AbortCode.NOT_MAPPABLE),
        (0x1A00, 0x00050008, AbortCode.NOT_MAPPABLE),
        (0x1600, 0x60640020, AbortCode.NOT_MAPPABLE),
        (0x1600, 0x00050008, None),
        (0x1600, 0x00070020, None),
        (0x1600, 0x00050010, AbortCode.NOT_MAPPABLE),
        (0x1600, 0x00010001, AbortCode.NO_OBJECT),
        (0x1600, TARGET, None),
    ],
)
def test_only_what_fits_can_be_mapped(
    desk: Desk, mapping: int, entry: int, code: AbortCode | None
) -> None:
    communication = mapping - 0x200
    desk.write(communication, desk.read(communication, 1) | 1 << 31, 1)
    desk.write(mapping, 0)
    if code is None:
        desk.write(mapping, entry, 1)
        assert desk.read(mapping, 1) == entry
    else:
        assert refused(desk, mapping, entry, 1) is code


def test_more_than_eight_bytes_are_refused_at_the_count(desk: Desk) -> None:
    desk.write(0x1800, 1 << 31 | TPDO, 1)
    desk.write(0x1A00, 0)
    for subindex in (1, 2, 3):
        desk.write(0x1A00, POSITION, subindex)
    assert refused(desk, 0x1A00, 3) is AbortCode.PDO_LENGTH
    desk.write(0x1A00, 2)
    assert refused(desk, 0x1A00, 9) is AbortCode.VALUE_HIGH


def test_a_hole_in_the_mapping_is_refused_at_the_count(desk: Desk) -> None:
    desk.write(0x1800, 1 << 31 | TPDO, 1)
    desk.write(0x1A00, 0)
    desk.write(0x1A00, 0, 1)
    assert refused(desk, 0x1A00, 1) is AbortCode.NOT_MAPPABLE


@pytest.mark.parametrize("kind", [241, 252, 253])
def test_unknown_transmission_types_are_refused(desk: Desk, kind: int) -> None:
    assert refused(desk, 0x1800, kind, 2) is AbortCode.INVALID_VALUE
    assert refused(desk, 0x1400, kind, 2) is AbortCode.INVALID_VALUE


@pytest.mark.parametrize("identifier", [0x0, 0x7F, 0x101, 0x581, 0x601, 0x701, 0x2000_0181])
def test_identifiers_of_other_services_are_refused(desk: Desk, identifier: int) -> None:
    desk.write(0x1800, 1 << 31, 1)
    assert refused(desk, 0x1800, identifier, 1) is AbortCode.INVALID_VALUE


def test_identifier_and_inhibit_time_cannot_change_while_the_pdo_is_on(desk: Desk) -> None:
    assert refused(desk, 0x1800, 0x191, 1) is AbortCode.INVALID_VALUE
    assert refused(desk, 0x1800, 100, 3) is AbortCode.INVALID_VALUE
    desk.write(0x1800, 1 << 31 | TPDO, 1)
    desk.write(0x1800, 100, 3)
    desk.write(0x1800, 0x191, 1)
    assert desk.read(0x1800, 1) == 0x191


# TPDO on SYNC


def test_type_1_answers_every_sync_with_what_was_latched(desk: Desk) -> None:
    quiet_others(desk)
    desk.map_tpdo(1, STATUSWORD, POSITION, CURRENT)
    desk.nmt(START)
    desk.machine.axes[0].demand = -77
    assert desk.sync(3) == [(TPDO, struct.pack("<Hih", desk.status(), -77, -22))] * 3


@pytest.mark.parametrize("n", [2, 3, 240])
def test_type_n_answers_every_nth_sync(desk: Desk, n: int) -> None:
    desk.map_tpdo(n, STATUSWORD)
    desk.nmt(START)
    answers = [len(tpdos(desk.sync())) for _ in range(2 * n)]
    assert answers == ([0] * (n - 1) + [1]) * 2


def test_type_0_answers_a_sync_only_when_something_has_changed(desk: Desk) -> None:
    desk.map_tpdo(0, POSITION)
    desk.nmt(START)
    assert len(tpdos(desk.sync(3))) == 1
    desk.machine.axes[0].demand = 5
    assert tpdos(desk.sync(3)) == [struct.pack("<i", 5)]


def test_frames_of_one_sync_come_in_the_order_of_arbitration(desk: Desk) -> None:
    for node in (6, 3, 1, 2, 5, 4):
        desk.map_tpdo(1, STATUSWORD, node=node)
        desk.map_tpdo(1, POSITION, number=1, node=node)
    desk.nmt(START)
    identifiers = [identifier for identifier, _ in desk.sync()]
    assert identifiers == [0x180 + n for n in range(1, 7)] + [0x280 + n for n in range(1, 7)]


def test_a_measured_value_beyond_its_object_wraps_or_saturates_like_a_real_one(desk: Desk) -> None:
    desk.map_tpdo(1, POSITION, STATUSWORD)
    desk.nmt(START)
    desk.machine.axes[0].demand = 2**31
    assert tpdos(desk.sync())[0][:4] == struct.pack("<i", -(2**31))


def test_sync_can_be_moved_to_another_identifier(desk: Desk) -> None:
    desk.map_tpdo(1, POSITION)
    desk.write(0x1005, 0x85)
    desk.nmt(START)
    assert tpdos(desk.sync()) == []
    assert len(tpdos(desk.send(0x85))) == 1


def test_mixed_mappings_hold_any_object_of_the_dictionary(desk: Desk) -> None:
    desk.map_tpdo(1, 0x60610008, 0x10010008, 0x603F0010, STATUSWORD)
    desk.nmt(START)
    assert tpdos(desk.sync()) == [struct.pack("<bBHH", 1, 0, 0, desk.status())]


# TPDO on event


@pytest.mark.parametrize("kind", [254, 255])
def test_an_event_driven_tpdo_is_sent_at_start_and_on_change(desk: Desk, kind: int) -> None:
    desk.map_tpdo(kind, STATUSWORD)
    assert len(tpdos(desk.nmt(START, 1))) == 1
    assert tpdos(desk.sync(5)) == []
    desk.write(0x6040, 0x06)
    assert [data for _, i, data in desk.log if i == TPDO][1:] == [struct.pack("<H", desk.status())]


def test_the_inhibit_time_spaces_events(desk: Desk) -> None:
    desk.map_tpdo(255, STATUSWORD)
    desk.write(0x1800, 1 << 31 | TPDO, 1)
    desk.write(0x1800, 100, 3)
    desk.write(0x1800, TPDO, 1)
    desk.nmt(START, 1)
    for controlword in (6, 7, 6, 7):
        desk.write(0x6040, controlword)
    desk.sync(4)
    times = [round(time, 6) for time, i, _ in desk.log if i == TPDO]
    assert times == [0.0, 0.01]


def test_the_event_timer_repeats_without_change(desk: Desk) -> None:
    desk.map_tpdo(255, STATUSWORD)
    desk.write(0x1800, 10, 5)
    desk.nmt(START, 1)
    desk.sync(10)
    times = [round(time, 6) for time, i, _ in desk.log if i == TPDO]
    assert times == [0.0, 0.01, 0.02, 0.03, 0.04]


def test_a_remote_frame_is_answered_where_bit_30_allows_it(desk: Desk) -> None:
    desk.map_tpdo(1, POSITION)
    desk.nmt(START, 1)
    assert [i for _, i, _ in desk.network.receive_remote(TPDO)] == [TPDO]
    desk.write(0x1800, 1 << 30 | TPDO, 1)
    assert desk.network.receive_remote(TPDO) == []


# RPDO


def test_an_event_driven_rpdo_acts_at_once(desk: Desk) -> None:
    desk.map_rpdo(255, TARGET, CONTROLWORD)
    desk.nmt(START)
    desk.send(RPDO, struct.pack("<iH", -5, 6))
    assert (desk.read(0x607A), desk.read(0x6040)) == (-5, 6)


@pytest.mark.parametrize("kind", [0, 1, 240])
def test_a_synchronous_rpdo_acts_at_the_next_sync(desk: Desk, kind: int) -> None:
    desk.map_rpdo(kind, TARGET)
    desk.nmt(START)
    desk.send(RPDO, struct.pack("<i", 9))
    assert desk.read(0x607A) == 0
    desk.sync()
    assert desk.read(0x607A) == 9


def test_what_waits_for_sync_is_dropped_when_the_node_leaves_operational(desk: Desk) -> None:
    desk.map_rpdo(1, TARGET)
    desk.nmt(START)
    desk.send(RPDO, struct.pack("<i", 9))
    desk.nmt(128)
    desk.nmt(START)
    desk.sync()
    assert desk.read(0x607A) == 0


def test_dummies_skip_bytes(desk: Desk) -> None:
    desk.map_rpdo(255, 0x00050008, 0x00030010, MODE, TARGET)
    desk.nmt(START)
    desk.send(RPDO, struct.pack("<BhBi", 0xEE, -2, 1, 1234))
    assert desk.read(0x607A) == 1234


def test_a_frame_that_is_too_short_is_refused_with_an_emergency(desk: Desk) -> None:
    desk.map_rpdo(255, TARGET)
    desk.nmt(START)
    frames = desk.send(RPDO, b"\1\2\3")
    assert [data[:3] for i, data in frames if i == 0x81] == [struct.pack("<HB", 0x8210, 0x11)]
    assert desk.read(0x607A) == 0


def test_a_frame_that_is_too_long_is_used_and_reported(desk: Desk) -> None:
    desk.map_rpdo(255, TARGET)
    desk.nmt(START)
    frames = desk.send(RPDO, struct.pack("<ii", 3, 4))
    assert [data[:2] for i, data in frames if i == 0x81] == [struct.pack("<H", 0x8220)]
    assert desk.read(0x607A) == 3


def test_a_value_that_the_object_refuses_is_reported(desk: Desk) -> None:
    desk.map_rpdo(255, MODE, TARGET)
    desk.nmt(START)
    frames = desk.send(RPDO, struct.pack("<bi", 3, 42))
    assert [data[:2] for i, data in frames if i == 0x81] == [struct.pack("<H", 0x8200)]
    assert (desk.read(0x6060), desk.read(0x607A)) == (1, 42)


# canopen's own PDO objects


def test_canopens_pdo_objects_configure_and_read(master: canopen.Network) -> None:
    node = master[1]
    node.tpdo.read()
    node.rpdo.read()
    tpdo, rpdo = node.tpdo[1], node.rpdo[1]
    tpdo.clear()
    for index in (0x6041, 0x6064, 0x6078):
        tpdo.add_variable(index)
    tpdo.trans_type, tpdo.enabled = 1, True
    tpdo.save()
    rpdo.clear()
    rpdo.add_variable(0x607A)
    rpdo.add_variable(0x6040)
    rpdo.trans_type, rpdo.enabled = 255, True
    rpdo.save()
    node.nmt.state = "OPERATIONAL"
    rpdo[0x607A].raw, rpdo[0x6040].raw = 321, 6
    rpdo.transmit()
    master.sync.transmit()
    assert node.sdo[0x607A].raw == 321
    assert tpdo[0x6041].raw & 0x6F == 0x21
    assert tpdo[0x6078].raw == -22
