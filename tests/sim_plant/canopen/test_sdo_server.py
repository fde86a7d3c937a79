"""SDO server, driven by canopen's client or, beyond its abilities, frame by frame."""

from __future__ import annotations

import binascii
import struct
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.eds import EDS_PATH
from sim_plant.canopen.object_dictionary import TEXT_MAX, ObjectDictionary, wrapped
from sim_plant.canopen.sdo_server import SdoServer

if TYPE_CHECKING:
    import canopen
    from desk import Desk

LABEL = (0x00, 0x20, 0x00)
"""2000h:0 as three bytes of a request."""
STORE_EDS = (0x21, 0x10, 0x00)
TARGET = (0x7A, 0x60, 0x00)


def abort_of(response: bytes) -> AbortCode:
    assert response[0] == 0x80
    return AbortCode(struct.unpack_from("<I", response, 4)[0])


# canopen's client


def test_expedited_values_come_back_as_written(master: canopen.Network) -> None:
    node = master[1]
    node.sdo[0x607A].raw = -123456
    assert node.sdo[0x607A].raw == -123456


def test_text_longer_than_four_bytes_is_uploaded_in_segments(master: canopen.Network) -> None:
    assert master[1].sdo[0x1008].raw == "Simulated servo drive"


def test_identity_differs_from_node_to_node(master: canopen.Network) -> None:
    assert [master[n].sdo[0x1018][4].raw for n in range(1, 7)] == [100, 101, 102, 103, 104, 105]


@pytest.mark.parametrize("length", [1, 4, 5, 7, 8, 14, 100, 1000])
def test_segmented_download_stores_every_length(master: canopen.Network, length: int) -> None:
    data = bytes(32 + n % 90 for n in range(length))
    master[1].sdo.download(0x2000, 0, data, force_segment=True)
    assert master[1].sdo.upload(0x2000, 0) == data


@pytest.mark.parametrize("length", [7, 8, 127 * 7, 127 * 7 + 1, 2000])
@pytest.mark.parametrize("checked", [True, False])
def test_block_download_stores_every_length(
    master: canopen.Network, length: int, checked: bool
) -> None:
    data = bytes(32 + n % 90 for n in range(length))
    sdo = master[1].sdo
    with sdo.open(
        0x2000, 0, "wb", size=length, block_transfer=True, request_crc_support=checked
    ) as stream:
        stream.write(data)
    assert sdo.upload(0x2000, 0) == data


@pytest.mark.parametrize("checked", [True, False])
def test_block_upload_hands_out_the_whole_eds(master: canopen.Network, checked: bool) -> None:
    with master[1].sdo.open(
        0x1021, 0, "rb", block_transfer=True, request_crc_support=checked
    ) as stream:
        assert stream.read() == EDS_PATH.read_bytes()


# Sequence of abort codes


@pytest.mark.parametrize(
    ("index", "subindex", "code"),
    [
        (0x5FFF, 0, AbortCode.NO_OBJECT),
        (0x0005, 0, AbortCode.NO_OBJECT),
        (0x1018, 5, AbortCode.NO_SUBINDEX),
        (0x6041, 1, AbortCode.NO_SUBINDEX),
        (0x1003, 1, AbortCode.NO_DATA),
    ],
)
def test_reading_is_refused_with_the_code_that_says_why(
    desk: Desk, index: int, subindex: int, code: AbortCode
) -> None:
    assert abort_of(desk.request(1, 0x40, *struct.pack("<HB", index, subindex))) is code


@pytest.mark.parametrize(
    ("index", "subindex", "data", "code"),
    [
        (0x5FFF, 0, b"\1\0", AbortCode.NO_OBJECT),
        (0x1018, 5, b"\1\0\0\0", AbortCode.NO_SUBINDEX),
        (0x6041, 0, b"\1\0", AbortCode.READ_ONLY),
        (0x1008, 0, b"\1\0", AbortCode.READ_ONLY),
        (0x6040, 0, b"\1\0\0\0", AbortCode.LENGTH_HIGH),
        (0x6040, 0, b"\1", AbortCode.LENGTH_LOW),
        (0x1006, 0, struct.pack("<I", 1_000_001), AbortCode.VALUE_HIGH),
        (0x6081, 0, bytes(4), AbortCode.VALUE_LOW),
        (0x6072, 0, struct.pack("<H", 3001), AbortCode.VALUE_HIGH),
        (0x605B, 0, struct.pack("<h", -1), AbortCode.VALUE_LOW),
        (0x605A, 0, struct.pack("<h", 4), AbortCode.INVALID_VALUE),
        (0x6060, 0, struct.pack("<b", 3), AbortCode.INVALID_VALUE),
        (0x1003, 0, b"\2", AbortCode.INVALID_VALUE),
        (0x1005, 0, struct.pack("<I", 0x4000_0080), AbortCode.INVALID_VALUE),
        (0x1014, 0, struct.pack("<I", 0x90), AbortCode.INVALID_VALUE),
        (0x1016, 1, struct.pack("<I", 0x0100_0000), AbortCode.INVALID_VALUE),
        (0x1600, 1, struct.pack("<I", 0x60400010), AbortCode.UNSUPPORTED_ACCESS),
    ],
)
def test_writing_is_refused_with_the_code_that_says_why(
    desk: Desk, index: int, subindex: int, data: bytes, code: AbortCode
) -> None:
    command = 0x23 | (4 - len(data)) << 2
    response = desk.request(1, command, *struct.pack("<HB", index, subindex), *data)
    assert abort_of(response) is code
    assert response[1:4] == struct.pack("<HB", index, subindex)


def test_motor_data_cannot_change_while_the_drive_has_power(desk: Desk) -> None:
    desk.enable()
    with pytest.raises(SdoAbort) as refused:
        desk.write(0x6080, 100)
    assert refused.value.code is AbortCode.DEVICE_STATE
    desk.write(0x6040, 0)
    desk.write(0x6080, 100)
    assert desk.read(0x6080) == 100


def test_watching_one_node_twice_contradicts_itself(desk: Desk) -> None:
    desk.write(0x1016, 127 << 16 | 100, 1)
    with pytest.raises(SdoAbort) as refused:
        desk.write(0x1016, 127 << 16 | 200, 2)
    assert refused.value.code is AbortCode.INCOMPATIBLE


def test_an_expedited_write_without_size_takes_what_the_object_holds(desk: Desk) -> None:
    assert desk.request(1, 0x22, 0x60, 0x60, 0, 1, 0xEE, 0xEE, 0xEE)[0] == 0x60
    assert desk.read(0x6060) == 1


@pytest.mark.parametrize("first", [0xE0, 0x00, 0x10, 0x60, 0x70, 0xA1, 0xA2, 0xA3, 0xC1])
def test_a_request_that_fits_no_transfer_is_an_unknown_command(desk: Desk, first: int) -> None:
    assert abort_of(desk.request(1, first, *TARGET)) is AbortCode.UNKNOWN_COMMAND


def test_a_toggle_bit_that_does_not_alternate_ends_a_download(desk: Desk) -> None:
    assert desk.request(1, 0x21, *LABEL, 14)[0] == 0x60
    assert desk.request(1, 0x00, *b"abcdefg")[0] == 0x20
    assert abort_of(desk.request(1, 0x00, *b"abcdefg")) is AbortCode.TOGGLE_BIT
    assert abort_of(desk.request(1, 0x10, *b"abcdefg")) is AbortCode.UNKNOWN_COMMAND


def test_a_toggle_bit_that_does_not_alternate_ends_an_upload(desk: Desk) -> None:
    assert desk.request(1, 0x40, 0x08, 0x10, 0)[0] == 0x41
    assert desk.request(1, 0x60)[0] == 0x00
    response = desk.request(1, 0x60)
    assert abort_of(response) is AbortCode.TOGGLE_BIT
    assert response[1:4] == bytes([0x08, 0x10, 0])


def test_a_download_of_other_length_than_announced_is_refused(desk: Desk) -> None:
    desk.request(1, 0x21, *LABEL, 9)
    assert abort_of(desk.request(1, 0x01, *b"abcdefg")) is AbortCode.LENGTH


@pytest.mark.parametrize(("size", "code"), [(5, AbortCode.LENGTH_HIGH), (3, AbortCode.LENGTH_LOW)])
@pytest.mark.parametrize("command", [0x21, 0xC2])
def test_an_announced_length_that_does_not_fit_is_refused_at_once(
    desk: Desk, command: int, size: int, code: AbortCode
) -> None:
    assert abort_of(desk.request(1, command, *TARGET, size)) is code


def test_a_download_without_announced_length_is_refused_when_it_grows_too_long(
    desk: Desk,
) -> None:
    desk.request(1, 0x20, *TARGET)
    assert abort_of(desk.request(1, 0x00, *b"abcdefg")) is AbortCode.LENGTH_HIGH


def test_text_beyond_the_memory_is_refused(desk: Desk) -> None:
    desk.request(1, 0x20, *LABEL)
    for n in range(TEXT_MAX // 7):
        assert desk.request(1, 0x10 * (n % 2), *b"abcdefg")[0] & 0xE0 == 0x20
    last = desk.request(1, 0x10 * (TEXT_MAX // 7 % 2), *b"abcdefg")
    assert abort_of(last) is AbortCode.OUT_OF_MEMORY


def test_a_client_abort_ends_the_transfer_in_silence(desk: Desk) -> None:
    desk.request(1, 0x21, *LABEL, 14)
    assert desk.send(0x601, bytes([0x80, *LABEL, 0, 0, 4, 5])) == []
    assert abort_of(desk.request(1, 0x00, *b"abcdefg")) is AbortCode.UNKNOWN_COMMAND


def test_a_new_request_abandons_the_transfer_under_way(desk: Desk) -> None:
    desk.request(1, 0x21, *LABEL, 14)
    assert desk.read(0x1000) == 0x00020192
    assert abort_of(desk.request(1, 0x00, *b"abcdefg")) is AbortCode.UNKNOWN_COMMAND


@pytest.mark.parametrize("length", range(8))
def test_a_frame_that_is_no_sdo_is_ignored(desk: Desk, length: int) -> None:
    assert desk.send(0x601, bytes(length)) == []


# Blocks, frame by frame


def test_a_block_download_with_wrong_crc_is_refused_and_changes_nothing(desk: Desk) -> None:
    assert desk.request(1, 0xC6, *LABEL, 3)[0] == 0xA4
    assert desk.request(1, 0x81, *b"abc")[:3] == bytes([0xA2, 1, 127])
    crc = binascii.crc_hqx(b"abc", 0) ^ 1
    assert abort_of(desk.request(1, 0xC1 | 4 << 2, *struct.pack("<H", crc))) is AbortCode.CRC
    assert desk.network.nodes[0].dictionary.upload(0x2000, 0) == b"axis 1"


def test_a_lost_segment_is_asked_for_again(desk: Desk) -> None:
    desk.request(1, 0xC2, *LABEL, 21)
    assert desk.send(0x601, bytes([1, *b"abcdefg"])) == []
    assert desk.request(1, 0x83, *b"opqrstu")[:2] == bytes([0xA2, 1])
    assert desk.send(0x601, bytes([1, *b"hijklmn"])) == []
    assert desk.request(1, 0x82, *b"opqrstu")[:2] == bytes([0xA2, 2])
    assert desk.request(1, 0xC1)[0] == 0xA1
    assert desk.network.nodes[0].dictionary.upload(0x2000, 0) == b"abcdefghijklmnopqrstu"


def test_segment_number_zero_is_out_of_sequence(desk: Desk) -> None:
    desk.request(1, 0xC2, *LABEL, 21)
    assert abort_of(desk.request(1, 0x00)) is AbortCode.SEQUENCE_NUMBER


@pytest.mark.parametrize("size", [0, 128, 255])
def test_a_block_size_outside_its_range_is_refused(desk: Desk, size: int) -> None:
    assert abort_of(desk.request(1, 0xA4, *STORE_EDS, size)) is AbortCode.BLOCK_SIZE


def test_an_acknowledgement_of_what_was_never_sent_is_refused(desk: Desk) -> None:
    assert desk.request(1, 0xA4, *STORE_EDS, 2)[0] == 0xC6
    assert [data[0] for _, data in desk.send(0x601, bytes([0xA3, *bytes(7)]))] == [1, 2]
    assert abort_of(desk.request(1, 0xA2, 3, 2)) is AbortCode.SEQUENCE_NUMBER


def test_upload_repeats_what_was_not_acknowledged(desk: Desk) -> None:
    desk.request(1, 0xA4, *STORE_EDS, 3)
    first = desk.send(0x601, bytes([0xA3, *bytes(7)]))
    again = desk.send(0x601, bytes([0xA2, 1, 3, *bytes(5)]))
    assert [data[1:] for _, data in again[:2]] == [data[1:] for _, data in first[1:]]


def test_a_short_value_is_uploaded_in_segments_below_the_protocol_switch_threshold(
    desk: Desk,
) -> None:
    assert desk.request(1, 0xA0, 0x08, 0x10, 0, 10, 100)[0] == 0x41
    assert desk.request(1, 0xA0, 0x08, 0x10, 0, 10, 5)[0] == 0xC6


# Properties


@given(st.lists(st.binary(min_size=8, max_size=8), max_size=30))
def test_whatever_a_client_sends_the_server_answers_in_eight_bytes_and_lives(
    frames: list[bytes],
) -> None:
    responses: list[bytes] = []
    server = SdoServer(ObjectDictionary(1), responses.append)
    for frame in frames:
        server.receive(frame)
    assert all(len(response) == 8 for response in responses)
    responses.clear()
    server.receive(bytes([0x80]) + bytes(7))
    server.receive(bytes([0x40, 0x00, 0x10, 0, 0, 0, 0, 0]))
    assert responses == [bytes([0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02, 0x00])]


@given(st.integers(-(2**40), 2**40))
def test_measured_values_fit_their_objects(value: int) -> None:
    assert (wrapped("i", value) - value) % 2**32 == 0
    assert -(2**31) <= wrapped("i", value) < 2**31
    assert wrapped("h", value) == min(max(value, -(2**15)), 2**15 - 1)
    assert wrapped("B", value) == min(max(value, 0), 255)
