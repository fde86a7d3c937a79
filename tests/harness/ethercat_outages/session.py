"""Session of fast moves of all six axes over EtherCAT, in lock-step, with an outage.

Moves and promises are those over CAN (`outage_sweep.session`). The plant's time passes even if no
frame arrives.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from fault_table.logged_cable import WatchedSegment
from fault_table.stopping_way import reaction_time
from fault_table.trial import drives
from fault_table.witness import Witness
from outage_sweep.session import SHARES, Verdict, judged, moves
from plant_wire import PlantWire

from drivers.drive_bus import DriveError, MoveFailed
from drivers.ethercat.bus import EthercatBus
from drivers.ethercat.line import START, Command
from drivers.session.servo_axes import ServoAxes
from sim_plant.ethercat.al_states import AlState
from sim_plant.ethercat.segment import Segment
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Self

AXES = 6
SHORTEST, LONGEST = 0.005, 0.250
"""Shortest and longest outage [s]."""
KINDS = ("transmit", "receive", "both", "cut", "lost", "error")
"""Lost frames to the drives, from the drives, or both; a cut cable; some lost frames; a drive in
SAFEOP with an error.
"""
AFTERWARDS = 3.0
"""Time without a master at the end [s]."""
LOST_MOST = 0.2
"""Largest share of lost frames."""


@dataclass(frozen=True)
class Outage:
    """Outage in one session.

    Attributes
    ----------
    number : int
        Number of the outage in the draw.
    cycle : int
        Number of the first frame with process data in the outage, from 1.
    length : float
        Duration of the outage [s].
    kind : str
        One of `KINDS`.
    axis : int
        Axis, from 1, whose drive falls to SAFEOP, or in front of whose drive the cable is cut.
    share : float
        Share of lost frames.
    interrupted : bool
        True if Ctrl-C is pressed at the begin of the outage.
    """

    number: int
    cycle: int
    length: float
    kind: str
    axis: int
    share: float
    interrupted: bool


def draw(seed: int, number: int, cycles: int) -> Outage:
    """Draw an outage that begins in one of this number of cycles."""
    rng = np.random.default_rng([seed, number])
    return Outage(
        number,
        int(rng.integers(1, cycles + 1)),
        float(rng.uniform(SHORTEST, LONGEST)),
        str(rng.choice(KINDS)),
        int(rng.integers(1, AXES + 1)),
        float(rng.uniform(0.01, LOST_MOST)),
        bool(rng.integers(2)),
    )


class OutageWire(PlantWire):
    """Wire with an outage, and a witness of the machine.

    Parameters
    ----------
    outage : Outage or None
        None for an undisturbed session.
    """

    def __init__(self, outage: Outage | None) -> None:
        segment = Segment(load_machine("manutec-r15", 5))
        segment.power_on()
        super().__init__(segment)
        self.plant = segment._machine
        length = outage.length if outage else 0.0
        self.witness = Witness(WatchedSegment(segment, self.plant), reaction_time(length, drives))  # type: ignore[arg-type]
        self.cycles = 0
        self._outage, self._ends, self._begun = outage, 0.0, False
        self._random = np.random.default_rng(outage.number if outage else 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: there is nothing to close."""

    def send(self, frame: bytes | bytearray) -> bool:
        cyclic = frame[START] in {Command.LRW, Command.LRD}
        self.cycles += cyclic
        outage = self._outage
        if outage is not None and not self._begun and self.cycles == outage.cycle:
            self._begin(outage)
        kind = outage.kind if outage and self._begun and self._now < self._ends else ""
        self.segment.cuts.clear()
        if kind == "cut" and outage is not None:
            self.segment.cuts.add(outage.axis - 1)
        if kind == "lost" and outage is not None and self._random.random() < outage.share:
            kind = "transmit" if self._random.random() < 0.5 else "receive"
        before = self.segment.time
        self.on_the_way = _dropped if kind in {"transmit", "both"} else bytes
        self.on_the_way_back = _dropped if kind in {"receive", "both"} else bytes
        taken = super().send(frame)
        if cyclic and self.segment.time == before:
            self.segment.elapse(drives.sync_period)
        self.witness.look()
        return taken

    @property
    def _now(self) -> float:
        return self.segment.time

    def _begin(self, outage: Outage) -> None:
        self._begun, self._ends = True, self._now + outage.length
        self.witness.begin()
        if outage.kind == "error":
            self.segment.nodes[outage.axis - 1].states.fall(AlState.SAFEOP, 0x1A)
        if outage.interrupted:
            signal.raise_signal(signal.SIGINT)

    def leave_alone(self) -> None:
        """Let time pass for the drives without a master."""
        ends = self._now + AFTERWARDS
        while self._now < ends:
            self.segment.elapse(drives.sync_period)
            self.witness.look()


def _dropped(frame: bytes) -> None:
    del frame


def move_about(wire: OutageWire) -> None:
    """Power up, move, power down.

    Raises
    ------
    DriveError, KeyboardInterrupt
        Error of the driver after an outage, or Ctrl-C.
    """
    with ServoAxes(EthercatBus(wire, "lock-step"), quick) as axes:
        try:
            for side, share in SHARES:
                axes.move(moves(side, share))
                while not axes.sample().reached:
                    pass
        except MoveFailed:
            wire.witness.begin()  # see `outage_sweep.session.move_about`
            raise


quick = drives.model_copy(update={"sdo_timeout": 0.05})
"""Short time-out: here an answer comes at once or never."""


def cycles_of_a_session() -> int:
    """Return the number of frames with process data in an undisturbed session."""
    wire = OutageWire(None)
    move_about(wire)
    return wire.cycles


def happen(outage: Outage) -> Verdict:
    """Run a session with an outage and judge the result."""
    ended, wire = "", OutageWire(outage)
    try:
        move_about(wire)
    except (DriveError, KeyboardInterrupt) as error:
        ended = type(error).__name__
    wire.leave_alone()
    state = wire.plant.state  # type: ignore[attr-defined]
    return judged(ended, state, wire.witness, outage.length)


def results(seed: int, numbers: Sequence[int]) -> list[tuple[Outage, Verdict]]:
    """Run and judge the outages of these numbers."""
    cycles = cycles_of_a_session()
    drawn = [draw(seed, number, cycles) for number in numbers]
    return [(outage, happen(outage)) for outage in drawn]
