"""Hostile frames at the driver: every sample is compared with the drives' true answers.

A `hostile.storm_bus.StormBus` stands between the driver and the virtual plant. After every frame
that the driver sends, hostile frames are mixed into the drives' answers, before, between and behind
them. Conditions:

- an axis without forged TPDOs has exactly the drive's values and no flag, except LATE after a frame
  of its identifier with another length;
- an axis with a forged TPDO (right identifier, right length) is flagged DOUBLED or LATE;
- the driver offers no set-point but those of the caller;
- the driver ends a session only by a frame relevant to it: an EMCY, a heartbeat or a TPDO in a
  drive's name, or an SDO answer; then all axes are without power, and the next session can begin.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import can

from drivers.axis import AxisScale
from drivers.canopen.bus import CanopenBus
from drivers.drive_bus import DriveError, Move, SampleFlag
from drivers.drives_file import load_drives
from drivers.session.servo_axes import ServoAxes
from hil.model.robot import ROBOTS
from hostile.frames import NODES
from hostile.harm import Harm
from hostile.storm_bus import StormBus
from sim_plant.serving.bus import PlantBus

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drive_bus import Sample

ROBOT = "manutec-r15"
DISTURBED_SET_UP = 10
"""Interval of sessions with a storm from the first frame on, SDO answers included."""
DISTURBED = SampleFlag.MISSING | SampleFlag.DOUBLED | SampleFlag.LATE
_TPDO = struct.Struct("<Hih")


@dataclass(slots=True)
class DriverFigures:
    """Figures of a storm."""

    frames: int = 0
    samples: int = 0
    forged: int = 0
    """Number of samples of an axis with a competing forged TPDO, over all axes."""
    flagged: int = 0
    sessions: int = 0
    ended: dict[str, int] = field(default_factory=dict)
    """Number of sessions that ended with an error in a drive's name, by error."""


class DriverStorm:
    """Sequence of driver sessions in a storm.

    Parameters
    ----------
    seed : int
    session : list of can.Message
        See `hostile.frames.Hostile`.
    """

    def __init__(self, seed: int, session: list[can.Message]) -> None:
        self.figures = DriverFigures()
        self._drives = load_drives(ROBOTS / f"{ROBOT}.drives.yaml")
        self._scales = [AxisScale.derive(axis) for axis in self._drives.axes]
        self._seed, self._session = seed, session
        self._asked: dict[int, int] = {}

    def run(self, n_frames: int, progress: Callable[[int], None] = lambda _: None) -> DriverFigures:
        """Send `n_frames` hostile frames to the driver.

        Raises
        ------
        Harm
            A forbidden action of the driver.
        """
        with PlantBus(ROBOT) as plant, StormBus(plant, self._seed, self._session) as bus:
            while bus.injected < n_frames:
                begun = bus.injected
                self._run_session(bus, n_frames)
                self._check_off(plant)
                progress(bus.injected - begun)
            self.figures.frames = bus.injected
        return self.figures

    def _run_session(self, bus: StormBus, n_frames: int) -> None:
        figures = self.figures
        figures.sessions += 1
        bus.suspect = False
        disturbed = figures.sessions % DISTURBED_SET_UP == 0
        bus.raging = disturbed
        try:
            with ServoAxes(CanopenBus(bus), self._drives, reset_faults=True) as axes:
                bus.raging = True
                while bus.injected < n_frames:
                    self._sample(bus, axes)
        except DriveError as error:
            if not (bus.suspect or disturbed):
                raise Harm(f"a session ended without a reason: {error}") from error
            name = type(error).__name__
            figures.ended[name] = figures.ended.get(name, 0) + 1
        finally:
            bus.raging = False

    def _sample(self, bus: StormBus, axes: ServoAxes) -> None:
        sample = axes.sample()
        self.figures.samples += 1
        self._judge(bus, sample)
        if sample.reached:
            self._move(bus, axes)

    def _move(self, bus: StormBus, axes: ServoAxes) -> None:
        axis = self.figures.samples % len(self._drives.axes)
        target = 0.02 if self.figures.samples % 4 < 2 else -0.02
        self._asked = {axis + 1: self._scales[axis].position_to_counts(target)}
        bus.targets.clear()
        axes.move({axis: Move(target, 0.5, 5.0)})

    def _judge(self, bus: StormBus, sample: Sample) -> None:
        if not bus.targets.items() <= self._asked.items():
            raise Harm(f"set-points {bus.targets} were offered, asked for were {self._asked}")
        for axis, scale in enumerate(self._scales):
            node, flags = axis + 1, sample.flags[axis] & DISTURBED
            if node in bus.forged:
                self.figures.forged += 1
                self.figures.flagged += bool(flags)
                if not flags & (SampleFlag.DOUBLED | SampleFlag.LATE):
                    raise Harm(f"axis {node}: a forged TPDO went unflagged")
                continue
            _, position, current = _TPDO.unpack(bus.truth[node])
            true = (scale.position * (position - scale.zero), scale.torque * current)
            if (sample.q[axis], sample.tau[axis]) != true:
                raise Harm(f"axis {node}: sample {sample.q[axis], sample.tau[axis]} is not {true}")
            if flags and not (flags == SampleFlag.LATE and node in bus.misshapen):
                raise Harm(f"axis {node}: flagged {flags} without a reason")

    def _check_off(self, plant: PlantBus) -> None:
        while plant.recv(0) is not None:
            pass
        for node in NODES:
            data = [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]
            plant.send(can.Message(arbitration_id=0x600 + node, data=data, is_extended_id=False))
            answers = iter(lambda: plant.recv(0), None)
            word = next(a.data[4] for a in answers if a.arbitration_id == 0x580 + node)
            if word & 0x6F in (0x27, 0x07, 0x0F):
                raise Harm(f"node {node} still has power after the session: statusword {word:02X}h")
