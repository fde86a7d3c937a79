"""Nodes of a bus and their properties, found by reading alone."""

from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING

import can
import pytest
from local_drives import LocalBus

from drivers.canopen.monitor import Scan, scan_bus
from drivers.cia402.states import Mode
from sim_plant.serving.server import serve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable


def scanned(bus: can.BusABC, **options: object) -> Scan:
    return scan_bus(bus, **options)  # type: ignore[arg-type]


def is_reading(frame: can.Message) -> bool:
    """Return True if a frame is an SDO read request."""
    reads = frame.data[0] >> 5 in {2, 3} if len(frame.data) == 8 else False
    return frame.arbitration_id >> 7 == 0x600 >> 7 and reads


def frame(identifier: int, *data: int) -> can.Message:
    return can.Message(arbitration_id=identifier, data=bytes(data), is_extended_id=False)


def test_all_drives_are_found_with_identity_and_modes() -> None:
    found = scanned(LocalBus(6, {}))
    assert list(found.nodes) == [1, 2, 3, 4, 5, 6]
    first = found.nodes[1]
    assert first.dictionary is not None
    assert first.review is not None
    assert (first.dictionary.vendor, first.dictionary.product) == (0x4D2, 0x402)
    assert first.review.modes == (Mode.PROFILE_POSITION,)
    assert first.review.serves


def test_drives_that_leave_open_how_long_their_answers_are_are_judged_alike() -> None:
    options = {"interface": "sim_plant", "ignore_config": True}
    with can.Bus(channel="manutec-r15", **options) as bus:
        plain = scanned(bus, only=(1,)).nodes[1].review
    with can.Bus(channel="manutec-r15", personality="sizeless", **options) as bus:
        found = scanned(bus, only=(1,)).nodes[1].review
    assert found == plain


def test_nothing_is_written_and_no_state_changes() -> None:
    bus = LocalBus(3, {})
    scanned(bus)
    assert bus.sent
    assert all(is_reading(frame) for frame in bus.sent)
    assert all(drive.history == ["off"] for drive in bus.drives.values())


def test_all_127_numbers_are_asked() -> None:
    bus = LocalBus(1, {})
    scanned(bus)
    first = [frame.arbitration_id - 0x600 for frame in bus.sent[:127]]
    assert first == list(range(1, 128))


def test_several_robots_drives_stand_side_by_side() -> None:
    bus = Several(
        {3, 19, 126},
        lambda _, request: answer(request, {(0x1000, 0): 0x00020192}),
    )
    assert list(scanned(bus).nodes) == [3, 19, 126]


def test_what_a_drive_lacks_is_told() -> None:
    found = scanned(LocalBus(2, {2: {(0x6084, 0): None, (0x6060, 0): None}}))
    review = found.nodes[2].review
    assert review is not None
    stated = [str(finding) for finding in review.findings]
    assert any(
        "6084:00 (profile deceleration) is missing: profile acceleration (6083)" in t
        for t in stated
    )
    assert not review.serves


def test_a_missing_current_is_no_refusal_of_a_live_drive() -> None:
    found = scanned(LocalBus(1, {1: {(0x6078, 0): None}}))
    review = found.nodes[1].review
    assert review is not None
    assert review.serves
    assert review.current is None
    assert any("looks for an object of the maker" in str(finding) for finding in review.findings)


class Several(can.BusABC):
    """Nodes whose answers are computed by a function, and `heard` frames sent unasked."""

    lock_step = True

    def __init__(
        self,
        nodes: Iterable[int],
        respond: Callable[[int, bytes], list[bytes]],
        heard: Iterable[can.Message] = (),
    ) -> None:
        super().__init__("several")
        self.channel_info = "several"
        self.nodes = set(nodes)
        self.respond = respond
        self.inbox: deque[can.Message] = deque(heard)
        self.sent: list[can.Message] = []

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg)
        node = msg.arbitration_id & 0x7F
        if node in self.nodes:
            for data in self.respond(node, bytes(msg.data)):
                self.inbox.append(frame(0x580 + node, *data))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.inbox.popleft() if self.inbox else None), False


def answer(request: bytes, values: dict[tuple[int, int], int]) -> list[bytes]:
    """Return an expedited answer of four bytes, or the abort code of a missing object."""
    place = (int.from_bytes(request[1:3], "little"), request[3])
    if place in values:
        return [b"\x43" + request[1:4] + values[place].to_bytes(4, "little")]
    return [b"\x80" + request[1:4] + (0x06020000).to_bytes(4, "little")]


def test_a_device_that_is_no_drive_is_named_and_left_alone() -> None:
    bus = Several({7}, lambda _, request: answer(request, {(0x1000, 0): 0x00030191}))
    review = scanned(bus).nodes[7].review
    assert review is not None
    assert [str(finding) for finding in review.findings] == [
        "the device says device profile 401 (I/O modules): not a CiA 402 drive: ignored"
    ]


def test_of_what_a_node_leaves_unanswered_nothing_is_concluded() -> None:
    known = {(0x1000, 0): 0x00020192, (0x1018, 1): 0x4D2}

    def grumpy(_: int, request: bytes) -> list[bytes]:
        place = (int.from_bytes(request[1:3], "little"), request[3])
        if place in known:
            return answer(request, known)
        if place == (0x6041, 0):
            return [b"\x80" + request[1:4] + (0x08000022).to_bytes(4, "little")]
        return []

    bus = Several({5}, grumpy)
    found = scanned(bus).nodes[5]
    assert found.review is not None
    assert found.dictionary is not None
    assert found.review.serves
    assert found.dictionary.vendor == 0x4D2
    stated = [str(finding) for finding in found.review.findings]
    assert any("6041:00 (statusword) was refused with 08000022" in text for text in stated)
    assert any("was not answered: if it is missing, " in text for text in stated)
    assert any("was not asked for any more" in text for text in stated)
    assert len(bus.sent) < 127 + 30


def test_a_node_without_sdo_is_known_by_what_it_sends() -> None:
    heard = [
        frame(0x709, 0x00),
        frame(0x709, 0x04),
        frame(0x08A, 0x10, 0x23, 1, 0, 0, 0, 0, 0),
        frame(0x70B),
    ]
    found = scanned(Several((), lambda *_: [], heard)).nodes
    assert list(found) == [9, 10, 11]
    assert (found[9].state, found[9].boots, found[9].review) == ("stopped", 1, None)
    assert found[10].emergencies == 1
    assert found[11].state == "unknown state"


def test_two_devices_with_one_number_are_noticed() -> None:
    bus = Several({4}, lambda _, request: 2 * answer(request, {(0x1000, 0): 0x00020192}))
    assert scanned(bus).nodes[4].answers == 2


def test_another_master_is_noticed_by_its_sync() -> None:
    found = scanned(Several((), lambda *_: [], [frame(0x80), frame(0x80)]))
    assert found.syncs == 2
    assert not found.nodes


def test_only_the_nodes_asked_for_are_told() -> None:
    bus = LocalBus(6, {})
    assert list(scanned(bus, only=(2, 3)).nodes) == [2, 3]
    assert all(frame.arbitration_id in {0x602, 0x603} for frame in bus.sent)


@pytest.mark.parametrize("data", [b"", b"\x80", b"\x43\x00\x10\x00", bytes(8), b"\xff" * 8])
def test_malformed_answers_are_no_drive_and_no_crash(data: bytes) -> None:
    found = scanned(Several({6}, lambda *_: [data]))
    assert all(node.review is None for node in found.nodes.values())


def test_an_answer_without_end_is_given_up() -> None:
    def endless(_: int, request: bytes) -> list[bytes]:
        if request[0] >> 5 == 3:
            return [bytes([request[0] & 0x10]) + b"forever"]
        return [b"\x40" + request[1:4] + bytes(4)]

    found = scanned(Several({6}, endless)).nodes[6]
    assert found.dictionary is not None
    assert not found.dictionary.entries


@pytest.mark.long
def test_drives_in_real_time_are_heard_and_asked(ideal_machine) -> None:
    stop = threading.Event()
    with (
        can.Bus("scanned", "virtual", ignore_config=True) as theirs,
        can.Bus("scanned", "virtual", ignore_config=True) as ours,
    ):
        server = threading.Thread(target=serve, args=(theirs, ideal_machine, "wall", stop))
        server.start()
        try:
            assert ours.recv(60.0)  # first boot-up: the plant is ready
            found = scanned(ours, answering=1.0, timeout=5.0).nodes
        finally:
            stop.set()
            server.join()
    assert list(found) == [1, 2, 3, 4, 5, 6]
    assert {node.dictionary.vendor for node in found.values() if node.dictionary} == {0x1234}
    assert all(node.review is not None and node.review.serves for node in found.values())


def test_a_scan_of_silence_ends() -> None:
    bus = Several((), lambda *_: [])
    bus.lock_step = False
    assert not scanned(bus, listening=0.0, answering=0.05).nodes
    assert len(bus.sent) == 127
