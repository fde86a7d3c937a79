"""Frames of a whole session, decoded from python-can's log.

A second bus on the plant's channel listens, as candump would; the log is written to a file, read
back and decoded here by hand, without the driver's or the plant's code.
"""

import struct
from collections import defaultdict
from itertools import pairwise

import can
import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus

from drivers.drive_bus import Move
from drivers.drives_file import load_drives
from hil.model.robot import ROBOTS

NODES = range(1, 7)
MOVE = Move(target=0.2, velocity=1.0, acceleration=5.0)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Frames of a session with one move of axis 5, and the samples of the driver."""
    path = tmp_path_factory.mktemp("log") / "session.log"
    drives = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    samples = []
    with (
        can.Bus(interface="sim_plant", channel="manutec-r15") as listener,
        can.Bus(interface="sim_plant", channel="manutec-r15") as can_bus,
    ):
        with CanopenDriveBus(can_bus, drives) as bus:
            bus.move({4: MOVE})
            while not samples or not samples[-1].reached:
                samples.append(bus.sample())
        with can.Logger(path) as log:
            while (frame := listener.recv(0)) is not None:
                log(frame)
    with can.LogReader(path) as reader:
        return list(reader), samples


def select(frames, cob_id):
    return [bytes(frame.data) for frame in frames if frame.arbitration_id == cob_id]


def writes(frames, node):
    """Return expedited SDO downloads to a node: (index, subindex, value)."""
    found = []
    for data in select(frames, 0x600 + node):
        if data[0] & 0xE3 == 0x23:
            length = 4 - (data[0] >> 2 & 3)
            index, sub = struct.unpack_from("<HB", data, 1)
            found.append((index, sub, int.from_bytes(data[4 : 4 + length], "little")))
    return found


def test_every_frame_is_a_standard_one_of_at_most_eight_bytes(session):
    frames, _ = session
    assert len(frames) > 500
    assert not any(frame.is_extended_id or frame.is_error_frame for frame in frames)
    assert max(frame.dlc for frame in frames) == 8


def test_each_sdo_request_has_one_answer_and_none_is_an_abort(session):
    frames, _ = session
    for node in NODES:
        requests, answers = select(frames, 0x600 + node), select(frames, 0x580 + node)
        assert len(requests) == len(answers) > 20
        aborts = [a.hex() for a in answers if a[0] == 0x80]
        looked_for = {struct.unpack_from("<HB", bytes.fromhex(a), 1)[0] for a in aborts}
        absent = {code.to_bytes(4, "little") for code in (0x06020000, 0x06090011)}
        assert {bytes.fromhex(a)[4:] for a in aborts} <= absent
        assert looked_for <= {
            0x1016,  # up to its last entry
            0x607B,
            0x6093,
            0x6096,
            0x6097,
            0x60A8,
            0x60A9,
            0x60AA,
            0x60F2,
        }  # missing optional objects, which are read


def test_a_tpdo_is_mapped_in_the_order_that_the_standard_demands(session):
    frames, _ = session
    for node in NODES:
        steps = [w for w in writes(frames, node) if w[0] in (0x1800, 0x1A00)]
        entries = [(0x1A00, 1, 0x60410010), (0x1A00, 2, 0x60640020), (0x1A00, 3, 0x60780010)]
        first = steps.index((0x1A00, 0, 0))
        assert steps[first + 1 : first + 5] == [*entries, (0x1A00, 0, 3)]
        disabled = [w for w in steps[:first] if w[:2] == (0x1800, 1)]
        enabled = [w for w in steps[first:] if w[:2] == (0x1800, 1)]
        assert disabled[-1][2] >> 31 == 1
        assert enabled[0][2] & 0x3FFFFFFF == 0x180 + node


def test_every_sync_is_answered_by_six_tpdos_before_the_next(session):
    frames, samples = session
    syncs = [k for k, frame in enumerate(frames) if frame.arbitration_id == 0x80]
    answers = [
        {f.arbitration_id for f in frames[a:b] if 0x180 < f.arbitration_id < 0x200}
        for a, b in pairwise(syncs)
    ]
    full = {0x180 + node for node in NODES}
    assert sum(a == full for a in answers) >= len(samples) - 1


def test_the_samples_are_what_the_tpdos_said(session):
    frames, samples = session
    tpdos = [struct.unpack("<Hih", data) for data in select(frames, 0x185)]
    q = -(np.array([t[1] for t in tpdos]) - 5000) / (79.2 * 4096) * 2 * np.pi
    tau = -np.array([t[2] for t in tpdos]) / 1000 * 3.002 * 0.2608 * 79.2
    heard = {(round(a, 9), round(b, 6)) for a, b in zip(q, tau, strict=True)}
    stated = [(round(s.q[4], 9), round(s.tau[4], 6)) for s in samples]
    assert all(pair in heard for pair in stated)
    assert samples[-1].q[4] == pytest.approx(MOVE.target, abs=2e-3)


def test_the_handshake_raises_and_drops_new_set_point_once_for_the_move(session):
    frames, _ = session
    words = [struct.unpack_from("<H", data, 4)[0] for data in select(frames, 0x205)]
    raised = [b for a, b in pairwise([0, *words]) if b & 0x10 and not a & 0x10]
    assert len(raised) == 1
    acknowledged = [data[1] & 0x10 for data in select(frames, 0x185)]
    assert sum(b > a for a, b in pairwise(acknowledged)) == 1


def test_no_drive_is_energised_before_all_are_ready_and_none_at_the_end(session):
    frames, _ = session
    state = dict.fromkeys(NODES, 0)
    history = defaultdict(list)
    for frame in frames:
        if 0x180 < frame.arbitration_id < 0x187 and frame.dlc >= 2:
            node = frame.arbitration_id - 0x180
            state[node] = struct.unpack_from("<H", frame.data)[0] & 0x6F
            history[node].append(state[node])
            if state[node] == 0x27:
                assert all(word in (0x23, 0x27) for word in state.values())
    assert all(0x27 in words for words in history.values())
    last = {node: [w for n, w in _controlwords(frames) if n == node][-1] for node in NODES}
    assert all(word & 0x0F in (0x00, 0x06) for word in last.values())


def _controlwords(frames):
    for frame in frames:
        node = frame.arbitration_id & 0x7F
        by_pdo = frame.arbitration_id >> 7 == 4
        by_sdo = frame.arbitration_id >> 7 == 12 and frame.data[:4] == b"\x2b\x40\x60\x00"
        if by_pdo or by_sdo:
            yield node, struct.unpack_from("<H", frame.data, 4)[0]


def test_our_heartbeat_and_the_drives_are_there_all_the_time(session):
    frames, _ = session
    ours = [f.timestamp for f in frames if f.arbitration_id == 0x77F]
    assert len(ours) > 2
    assert max(b - a for a, b in pairwise(ours)) < 0.5
    for node in NODES:
        assert len(select(frames, 0x700 + node)) > 2
