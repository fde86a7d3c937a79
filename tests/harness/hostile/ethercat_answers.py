"""Hostile answers of EtherCAT slaves at the driver.

Answers are changed on their way back: bytes, lengths, whole contents, answers of other frames. Some
carry the number and the address of the driver's own frames. Ethernet's checksum, which would reject
nearly all changes, is not simulated. Conditions: the driver raises no error but `DriveError`; after
its end, and some time without a master, no axis is energised.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from plant_wire import PlantWire

from drivers.drive_bus import DriveError, Move
from drivers.ethercat.bus import EthercatBus
from drivers.ethercat.line import INDEX, SOURCE, START
from drivers.session.servo_axes import ServoAxes
from hostile.harm import Harm
from sim_plant.ethercat.segment import Segment
from sim_plant.physics import state as st
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from drivers.drives_file import DrivesFile

QUIET = (0, 0, 400, 700, 1000)
"""Unchanged frames at the start of a session, which let it reach different stages."""
SHARES = (0.002, 0.02, 0.3, 1.0)
"""Shares of changed answers."""
SAMPLES = 60
AFTERWARDS = 3.0
"""Time without a master at the end [s]."""


@dataclass
class Figures:
    """Figures of a storm: hostile answers, sessions, and their errors."""

    answers: int = 0
    sessions: int = 0
    ended: dict[str, int] = field(default_factory=dict)


class HostileWire(PlantWire):
    """Wire that changes answers at random.

    Parameters
    ----------
    chance : random.Random
    """

    def __init__(self, chance: random.Random) -> None:
        segment = Segment(load_machine("manutec-r15", 5))
        segment.power_on()
        super().__init__(segment)
        self.plant = segment._machine
        self.answers = 0
        self._chance = chance
        self._quiet, self._share = chance.choice(QUIET), chance.choice(SHARES)
        self._earlier = [bytes(60)]
        self.on_the_way_back = self._changed

    def _changed(self, frame: bytes) -> bytes | None:
        chance = self._chance
        if self.sent <= self._quiet or chance.random() > self._share:
            if chance.random() < 0.05:
                self._earlier = [*self._earlier[-20:], frame]
            return frame
        self.answers += 1
        kind = chance.randrange(6)
        if kind == 0:
            return chance.randbytes(chance.randrange(200))
        changed = bytearray(chance.choice(self._earlier) if kind == 1 else frame)
        if kind == 2:
            del changed[chance.randrange(len(changed)) :]
        elif kind == 3:
            changed[START + 10 :] = chance.randbytes(max(0, len(changed) - START - 10))
        else:
            for _ in range(chance.choice((1, 2, 10))):
                changed[chance.randrange(len(changed))] = chance.randrange(256)
        if len(changed) > INDEX and chance.random() < 0.8:
            changed[INDEX], changed[SOURCE] = frame[INDEX], frame[SOURCE]
        return bytes(changed)


def storm(seed: int, answers: int, drives: DrivesFile) -> Figures:
    """Send this many hostile answers to sessions, one after the other.

    Raises
    ------
    Harm
        A forbidden action of the driver.
    """
    figures = Figures()
    drives = drives.model_copy(update={"sdo_timeout": 0.01})
    while figures.answers < answers:
        wire = HostileWire(random.Random(f"{seed} {figures.sessions}"))
        figures.sessions += 1
        name = _session(wire, drives)
        figures.ended[name] = figures.ended.get(name, 0) + 1
        figures.answers += wire.answers
        wire.segment.elapse(AFTERWARDS)
        energised = np.flatnonzero(wire.plant.state[:, st.ENABLED])  # type: ignore[attr-defined]
        if energised.size:
            raise Harm(f"axes {energised + 1} are energised after session {figures.sessions - 1}")
    return figures


def _session(wire: HostileWire, drives: DrivesFile) -> str:
    try:
        with ServoAxes(EthercatBus(wire, "lock-step"), drives) as axes:
            axes.move({0: Move(0.05, 0.5, 1.0)})
            for _ in range(SAMPLES):
                axes.sample()
    except DriveError as error:
        return type(error).__name__
    return ""
