"""Malicious frames cause no crash, no hang, no motion without command, and no false data.

The storms are those of ``benchmarks/hostile_frames.py``, with a hundredth of the frames there.
"""

from __future__ import annotations

import struct
from collections import deque
from typing import TYPE_CHECKING

import can
import pytest
from hostile.driver_storm import DriverStorm
from hostile.frames import Hostile
from hostile.harm import Harm
from hostile.plant_audit import PlantAudit, watched
from hostile.plant_storm import recorded_session, storm
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.canopen.network import PumpedNetwork
from drivers.canopen.sdo import server_of
from drivers.cia402.error_codes import decode_emergency
from drivers.cia402.objects import DEVICE_TYPE
from drivers.cia402.supervision import Supervision
from drivers.drive_bus import NodeSilent
from drivers.session.connection import Place
from sim_plant.serving.bus import PlantBus
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from ideal_machine import IdealMachine

N = 20_000
CONTROLWORD = struct.pack("<BHB", 0x2B, 0x6040, 0)


@pytest.fixture(scope="module")
def session() -> list[can.Message]:
    """Frames of the driver in an honest session."""
    return recorded_session()


@pytest.mark.parametrize("seed", [1, 2])
def test_a_storm_at_the_plant_moves_nothing_without_a_command(
    session: list[can.Message], seed: int
) -> None:
    figures = storm(N, seed, session)
    assert figures.frames == N
    assert min(figures.controlwords, figures.enabled, figures.moved) > 0  # enough cases were judged


@pytest.mark.parametrize("seed", [1, 2])
def test_a_storm_at_the_driver_puts_nothing_into_samples_unflagged(
    session: list[can.Message], seed: int
) -> None:
    # twice as many as at the plant: half of them come while a session begins or ends
    figures = DriverStorm(seed, session).run(2 * N)
    assert figures.frames >= 2 * N
    assert figures.flagged == figures.forged > 0
    assert figures.samples > 500


def test_the_same_seed_gives_the_same_frames(session: list[can.Message]) -> None:
    first, again = (Hostile(3, session).batch(500) for _ in range(2))
    assert all(a.equals(b, timestamp_delta=None) for a, b in zip(first, again, strict=True))


# The judge itself


@pytest.fixture
def audited(ideal_machine: IdealMachine) -> tuple[SlaveNetwork, PlantAudit]:
    """Plant whose frames are judged; node 1 is switched on but not enabled."""
    calls = watched(ideal_machine)
    network = SlaveNetwork(ideal_machine)
    network.power_on()
    for word in (6, 7):
        network.receive(0x601, CONTROLWORD + struct.pack("<I", word))
    return network, PlantAudit(network, calls)


def judged(audited: tuple[SlaveNetwork, PlantAudit], claimed: can.Message, word: int) -> None:
    """Let the plant handle a controlword, while the audit is given `claimed` as the frame."""
    network, audit = audited
    audit.expect(claimed)
    answers = network.receive(0x601, CONTROLWORD + struct.pack("<I", word))
    audit.judge(
        claimed,
        [can.Message(arbitration_id=i, data=data, is_extended_id=False) for _, i, data in answers],
    )


def sdo(data: bytes) -> can.Message:
    return can.Message(arbitration_id=0x601, data=data, is_extended_id=False)


def test_the_judge_lets_a_confirmed_command_pass(
    audited: tuple[SlaveNetwork, PlantAudit],
) -> None:
    judged(audited, sdo(CONTROLWORD + struct.pack("<I", 15)), 15)
    assert audited[1].enabled == 1


@pytest.mark.parametrize(
    "claimed",
    [
        sdo(struct.pack("<BHBI", 0x2B, 0x6041, 0, 15)),
        can.Message(arbitration_id=0x602, data=CONTROLWORD + bytes(4), is_extended_id=False),
        can.Message(arbitration_id=0x201, data=bytes(1), is_extended_id=False),
        can.Message(arbitration_id=0x601, data=CONTROLWORD + bytes(4), is_extended_id=True),
        can.Message(arbitration_id=0x80, is_extended_id=False),
    ],
)
def test_the_judge_convicts_a_plant_that_is_moved_by_anything_else(
    audited: tuple[SlaveNetwork, PlantAudit], claimed: can.Message
) -> None:
    with pytest.raises(Harm, match="no command for axis 1"):
        judged(audited, claimed, 15)


def test_the_judge_convicts_a_plant_that_moves_without_a_set_point(
    audited: tuple[SlaveNetwork, PlantAudit], ideal_machine: IdealMachine
) -> None:
    ideal_machine.axes[0].move(1000, 100, 100, 100)
    with pytest.raises(Harm, match="without set-point"):
        judged(audited, sdo(CONTROLWORD + struct.pack("<I", 6)), 6)


# One frame at a time

PLAIN = st.builds(
    can.Message,
    arbitration_id=st.integers(0, 0x7FF),
    data=st.binary(max_size=8),
    is_extended_id=st.just(False),
)
ANY = PLAIN | st.builds(
    can.Message,
    arbitration_id=st.integers(0, 0x1FFF_FFFF),
    data=st.binary(max_size=64),
    is_extended_id=st.booleans(),
    is_error_frame=st.booleans(),
) | st.builds(
    can.Message,
    arbitration_id=st.integers(0, 0x7FF),
    dlc=st.integers(0, 15),
    is_remote_frame=st.just(True),
    is_extended_id=st.booleans(),
)  # fmt: skip


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(st.lists(ANY, max_size=10))
def test_the_plant_survives_any_frames_that_an_adapter_may_deliver(
    ideal_channel: str, frames: list[can.Message]
) -> None:
    with PlantBus(ideal_channel) as bus:
        for frame in frames:
            bus.send(frame)
        bus.send(can.Message(arbitration_id=0, data=[129, 0], is_extended_id=False))
        heard = {frame.arbitration_id for frame in iter(lambda: bus.recv(0), None)}
        assert {0x701, 0x702, 0x703, 0x704, 0x705, 0x706} <= heard


@given(st.binary(max_size=64))
def test_an_emergency_of_any_length_can_be_shown(data: bytes) -> None:
    emergency = decode_emergency(data)
    assert emergency.code == int.from_bytes(data[:2], "little")
    assert f"{emergency.code:04X}" in str(emergency)


# Frames that the driver accepts as answers


class Scripted(can.BusABC):
    """Bus that answers every frame with the same frames."""

    lock_step = True

    def __init__(self, answers: list[can.Message]) -> None:
        super().__init__("scripted")
        self.channel_info = "scripted"
        self.answers, self.inbox = answers, deque[can.Message]()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.inbox += self.answers

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.inbox.popleft() if self.inbox else None), False


def answer(text: str, **flags: bool) -> can.Message:
    return can.Message(
        arbitration_id=0x581, data=bytes.fromhex(text), **{"is_extended_id": False, **flags}
    )


HONEST = answer("43 00 10 00 92 01 02 00")
IMPOSTORS = [
    answer("43 00 10 00 FF"),
    answer("43 01 10 00 FF FF FF FF"),
    answer("80 00 11 00 00 00 02 06"),
    answer("43 00 10 00 FF FF FF FF", is_extended_id=True),
    answer("43 00 10 00 FF FF FF FF", is_error_frame=True),
    answer(""),
]


def test_an_sdo_answer_of_another_length_or_object_is_not_taken_for_ours() -> None:
    with Scripted([*IMPOSTORS, HONEST]) as bus:
        server = server_of(PumpedNetwork(bus, synchronous=True), Place(1, "axis"))
        assert server.get(DEVICE_TYPE) == 0x00020192


def test_impostors_alone_are_no_answer() -> None:
    with Scripted(IMPOSTORS) as bus:
        server = server_of(PumpedNetwork(bus, synchronous=True), Place(1, "axis"))
        with pytest.raises(NodeSilent):
            server.get(DEVICE_TYPE)


class Babbling(Scripted):
    """Bus with an endless stream of frames."""

    lock_step = False

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return HONEST, False


def test_a_node_that_never_falls_silent_keeps_nobody_waiting_for_ever() -> None:
    with Babbling([]) as bus:
        assert not PumpedNetwork(bus, synchronous=False).pump(0.01, lambda: False)


@pytest.mark.parametrize("length", [0, 1])
def test_an_emergency_without_a_code_takes_no_other_back(length: int) -> None:
    with Scripted([]) as bus:
        network = PumpedNetwork(bus, synchronous=True)
        supervision = Supervision([server_of(network, Place(1, "axis"))])
        network.subscribe(0x81, lambda _, data, __: supervision.take_emergency(1, bytes(data)))
        network.notify(0x81, bytearray(b"\x10\x23"), 0.0)
        network.notify(0x81, bytearray(length), 0.0)
        assert "2310" in str(supervision.diagnose(server_of(network, Place(1, "axis")), 0x08))
