"""The virtual plant's bus in a storm: hostile frames among the answers."""

from __future__ import annotations

import random
import struct
from collections import deque

import can

from hostile.frames import NODES, Hostile, plain

BURST = 12
"""Mean number of hostile frames per frame of the driver."""
FORGED = 0.02
"""Share of frames that are TPDOs in a drive's name, with its true state and other values."""
TROUBLE = 1e-4
"""Share of frames that report, in a drive's name, a reason to end the session."""
SYNC, TPDO, RPDO, NEW_SET_POINT = 0x80, 0x180, 0x200, 0x10
TPDO_SIZE = 8
OUR_HEARTBEAT = 0x77F
"""Our heartbeat: sent by another master it would keep the drives running without us."""
_CONTENT = struct.Struct("<Hih")


class StormBus(can.BusABC):
    """The plant's bus with hostile frames among the drives' answers.

    Attributes
    ----------
    raging : bool
        True if hostile frames are mixed in.
    truth, forged, misshapen : dict, set, set
        After the last SYNC: the drive's TPDO by node, nodes with a forged TPDO of the right length,
        and nodes with one of a wrong length.
    suspect : bool
        True after a frame in a drive's name that may end the session.
    targets : dict of int to int
        By node, the target of the last set-point offered.
    """

    lock_step = True

    def __init__(self, plant: can.BusABC, seed: int, session: list[can.Message]) -> None:
        super().__init__("storm")
        self.channel_info = "a storm"
        self.raging = self.suspect = False
        self.injected = 0
        self.truth: dict[int, bytes] = {}
        self.forged: set[int] = set()
        self.misshapen: set[int] = set()
        self.targets: dict[int, int] = {}
        self._pending: tuple[set[int], set[int]] = (set(), set())
        """`forged` and `misshapen` for the next SYNC: forged TPDOs since the last answered SYNC."""
        self._plant = plant
        self._random = random.Random(seed)
        self._frames = iter(Hostile(seed, session))
        self._inbox: deque[can.Message] = deque()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Forward a frame to the plant, and its answers back among hostile frames."""
        self._plant.send(msg, timeout)
        answers = []
        while (answer := self._plant.recv(0)) is not None:
            answers.append(answer)
        if msg.arbitration_id == SYNC:
            self.forged, self.misshapen, self._pending = *self._pending, (set(), set())
            self.truth = {a.arbitration_id - TPDO: bytes(a.data) for a in answers}
        if RPDO < msg.arbitration_id < RPDO + 0x80 and msg.data[4] & NEW_SET_POINT:
            self.targets[msg.arbitration_id - RPDO] = struct.unpack_from("<i", msg.data)[0]
        if self.raging:
            sync = msg.arbitration_id == SYNC
            marks = (self.forged, self.misshapen) if sync else self._pending
            for _ in range(self._random.randrange(2 * BURST + 1)):
                self._mix_in(answers, self._draw(), *marks)
        self._inbox += answers

    def _recv_internal(
        self,
        timeout: float | None,
    ) -> tuple[can.Message | None, bool]:
        return (self._inbox.popleft() if self._inbox else None), False

    def _mix_in(
        self,
        answers: list[can.Message],
        frame: can.Message,
        forged: set[int],
        misshapen: set[int],
    ) -> None:
        self.injected += 1
        answers.insert(self._random.randrange(len(answers) + 1), frame)
        node = frame.arbitration_id - TPDO
        if plain(frame) and node in NODES:
            (forged if len(frame.data) == TPDO_SIZE else misshapen).add(node)

    def _draw(self) -> can.Message:
        """Draw a frame; rarely one that would end the session in a drive's name."""
        chance = self._random.random()
        if chance < TROUBLE:
            self.suspect = True
            return self._trouble()
        if chance < FORGED:
            return self._forge()
        return next(frame for frame in self._frames if not ends_session(frame))

    def _trouble(self) -> can.Message:
        """Return an EMCY, a heartbeat or a TPDO that reports a drive in trouble, of odd length."""
        service, size = self._random.choice([(0x80, 2), (0x80, 8), (TPDO, TPDO_SIZE), (0x700, 1)])
        data = self._random.randbytes(size - 1) + self._random.choice([b"\x10", b"\x81", b"\xff"])
        node = self._random.choice(NODES)
        return can.Message(arbitration_id=service + node, data=data, is_extended_id=False)

    def _forge(self) -> can.Message:
        """Return a TPDO with the drive's state and values close to its own."""
        node = self._random.choice(NODES)
        word, position, current = _CONTENT.unpack(self.truth.get(node, bytes(TPDO_SIZE)))
        near = self._random.randint
        data = _CONTENT.pack(word, position + near(1, 50), current // 2 + near(-50, 50))
        return can.Message(arbitration_id=TPDO + node, data=data, is_extended_id=False)


def ends_session(frame: can.Message) -> bool:
    """Return True if a frame reports a drive in trouble, commands drives, or is our heartbeat."""
    if not plain(frame):
        return False
    if frame.arbitration_id == OUR_HEARTBEAT or _commands(frame):
        return True
    service, node = frame.arbitration_id & 0x780, frame.arbitration_id & 0x7F
    if node not in NODES:
        return False
    if service == 0x80:
        return len(frame.data) >= 2 and frame.data[1] != 0
    if service == 0x180:
        return len(frame.data) == TPDO_SIZE  # another state, or a position that trips the driver
    return service == 0x700 and len(frame.data) > 0 and frame.data[0] & 0x7F != 5


def _commands(frame: can.Message) -> bool:
    """Return True if a frame commands drives, as a second master or a configuration tool does."""
    service, node = frame.arbitration_id & 0x780, frame.arbitration_id & 0x7F
    if frame.arbitration_id == 0x080:  # SYNC
        return True
    if frame.arbitration_id == 0x000:  # NMT
        data = frame.data
        return len(data) > 1 and data[1] in {0, *NODES} and data[0] != 1
    if node not in NODES:
        return False
    if service == 0x600:  # SDO request that starts a download
        return len(frame.data) > 3 and frame.data[0] >> 5 in {1, 6}
    return service in {0x200, 0x300, 0x400, 0x500}  # RPDOs
