"""Hostile frames at the plant, through python-can's interface, with real physics."""

from __future__ import annotations

import math
import time
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING
from unittest import mock

import can

from drivers.canopen.bus import CanopenBus
from drivers.drive_bus import Move
from drivers.drives_file import load_drives
from drivers.session.servo_axes import ServoAxes
from hil.model.robot import ROBOTS
from hostile.frames import Hostile
from hostile.harm import Harm
from hostile.plant_audit import SLACK, PlantAudit, watched
from sim_plant.physics import state as st
from sim_plant.plant import load_plant
from sim_plant.serving import plant_channel
from sim_plant.serving.bus import PlantBus
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from sim_plant.plant import Plant

ROBOT = "manutec-r15"
ROUND = 20_000
"""Number of frames between two power cycles of the plant."""
RESTORED = 2_000
"""Number of frames between repetitions of a session's set-up, so that drives are operational."""
ALIVE = can.Message(
    arbitration_id=0x601, data=[0x40, 0x00, 0x10, 0, 0, 0, 0, 0], is_extended_id=False
)
START_ALL = can.Message(arbitration_id=0, data=[1, 0], is_extended_id=False)
ABORT = can.Message(arbitration_id=0x601, data=[0x80, *bytes(7)], is_extended_id=False)
DEVICE_TYPE = bytes([0x43, 0x00, 0x10, 0x00, 0x92, 0x01, 0x02, 0x00])


@dataclass(slots=True)
class PlantFigures:
    """Figures of a storm."""

    frames: int = 0
    answers: int = 0
    controlwords: int = 0
    enabled: int = 0
    moved: int = 0
    slowest: float = 0.0
    """Longest processing time of one frame [s]."""
    most: int = 0
    """Largest number of answers to one frame."""


def recorded_session() -> list[can.Message]:
    """Return frames of the driver from set-up to the end of a move of axes 1 and 2."""
    sent: list[can.Message] = []
    drives = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")
    with PlantBus(ROBOT) as bus:
        send = bus.send

        def noted(frame: can.Message, timeout: float | None = None) -> None:
            sent.append(frame)
            send(frame, timeout)

        bus.send = noted  # type: ignore[method-assign]
        with ServoAxes(CanopenBus(bus), drives) as axes:
            axes.move({axis: Move(0.02, 0.5, 2.0) for axis in (0, 1)})
            while not axes.sample().reached:
                pass
            return [*sent]


def storm(
    n_frames: int,
    seed: int,
    session: list[can.Message],
    progress: Callable[[int], None] = lambda _: None,
) -> PlantFigures:
    """Send `n_frames` hostile frames to plants and judge each.

    Raises
    ------
    Harm
        A forbidden effect of a frame.
    """
    figures = PlantFigures()
    frames = iter(Hostile(seed, session))
    while figures.frames < n_frames:
        n = min(ROUND, n_frames - figures.frames)
        with _observed_plant() as (bus, plant, audit):
            _round(bus, plant, audit, islice(frames, n), session, figures)
            figures.controlwords += audit.controlwords
            figures.enabled += audit.enabled
            figures.moved += audit.moved
        progress(n)
    return figures


@contextmanager
def _observed_plant() -> Iterator[tuple[PlantBus, Plant, PlantAudit]]:
    plant, networks = load_plant(ROBOT), list[SlaveNetwork]()
    calls = watched(plant)

    class Observed(SlaveNetwork):
        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)  # type: ignore[arg-type]
            networks.append(self)

    with (
        mock.patch.object(plant_channel, "load_machine", return_value=plant),
        mock.patch.object(plant_channel, "SlaveNetwork", Observed),
        PlantBus(ROBOT) as bus,
    ):
        yield bus, plant, PlantAudit(networks[0], calls)


def _round(
    bus: PlantBus,
    plant: Plant,
    audit: PlantAudit,
    frames: Iterator[can.Message],
    session: list[can.Message],
    figures: PlantFigures,
) -> None:
    still = Stillness(plant)
    for number, frame in enumerate(frames):
        if number % RESTORED == 0:
            for legal in session:
                _pass(bus, audit, legal)
        begin = time.perf_counter()
        answers = _pass(bus, audit, frame)
        figures.slowest = max(figures.slowest, time.perf_counter() - begin)
        figures.most = max(figures.most, answers)
        figures.answers += answers
        figures.frames += 1
        if number % 100 == 0:
            still.check()
    for frame in (START_ALL, ABORT):
        _pass(bus, audit, frame)
    if not any(answer.data == DEVICE_TYPE for answer in _exchange(bus, ALIVE)):
        raise Harm("the plant does not answer any more")


def _pass(bus: PlantBus, audit: PlantAudit, frame: can.Message) -> int:
    audit.expect(frame)
    answers = _exchange(bus, frame)
    audit.judge(frame, answers)
    return len(answers)


def _exchange(bus: PlantBus, frame: can.Message) -> list[can.Message]:
    bus.send(frame)
    answers = []
    while (answer := bus.recv(0)) is not None:
        answers.append(answer)
    return answers


class Stillness:
    """Check that no axis moves without power between two looks."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._rest = [math.nan] * len(plant.axes)

    def check(self) -> None:
        """Compare positions with those of the last look.

        Raises
        ------
        Harm
        """
        state = self._plant.state
        for axis, (q, qd, on) in enumerate(state[:, [st.Q, st.QD, st.ENABLED]]):
            before = self._rest[axis]
            if not on and abs(q - before) > SLACK:
                raise Harm(f"axis {axis + 1} without power went from {before:.5f} to {q:.5f} rad")
            self._rest[axis] = q if not on and qd == 0 else math.nan
