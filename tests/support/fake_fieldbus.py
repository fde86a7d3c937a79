"""Fieldbus without CAN: CiA 402 drives in memory with objects and `ProcessData`.

Each drive is a state machine, a position that goes to its target at constant velocity, and a
dictionary. SYNC moves time on by one period; commands take effect at the next SYNC.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

from drivers.axis import Axis
from drivers.cia402 import objects
from drivers.cia402.set_point import ENABLED
from drivers.cia402.states import Control, Mode, State, Status
from drivers.drive_bus import BusUnavailable, DriveRefused, NodeSilent, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drive_bus import DriveError
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

PERIOD = 0.004
STEP = 40
"""Distance of an axis in one period [increments]."""

_WORDS = {
    State.SWITCH_ON_DISABLED: 0x40,
    State.READY_TO_SWITCH_ON: 0x21,
    State.SWITCHED_ON: 0x23,
    State.OPERATION_ENABLED: 0x27,
    State.QUICK_STOP_ACTIVE: 0x07,
    State.FAULT: 0x08,
}


class FakeDrive:
    """One drive, with its object dictionary as seen by the profile (`RemoteDictionary`).

    Attributes
    ----------
    deaf : bool
        True if the drive ignores commands by process data.
    unplugged : bool
        True if the drive answers nothing.
    takes_no_orders : bool
        True if the bus loses orders to the object dictionary.
    history : list of State
        Past states.
    """

    def __init__(self, node: int) -> None:
        self.node, self.label = node, f"axis {node}"
        self.missing: set[Entry] = set()
        self.state = State.SWITCH_ON_DISABLED
        self.history: list[State] = []
        self.position = self.target = 0
        self.acknowledging = self.deaf = self.unplugged = self.takes_no_orders = False
        self._values: dict[Entry, int] = {}

    @property
    def word(self) -> int:
        """Return the statusword."""
        reached = Status.TARGET_REACHED if self.position == self.target else 0
        acknowledge = Status.SET_POINT_ACKNOWLEDGE if self.acknowledging else 0
        return _WORDS[self.state] | reached | acknowledge

    def get(self, entry: Entry) -> int:
        """Read a number."""
        self._answer()
        match entry:
            case objects.STATUSWORD:
                return self.word
            case objects.POSITION:
                return self.position
            case objects.MODE_DISPLAY:
                return self._values.get(objects.MODE, 1)
        if entry not in self._values:
            raise DriveRefused(f"{self.label}: no object {entry}")
        return self._values[entry]

    def find(self, entry: Entry) -> int | None:
        """Read a number; return None if it is missing."""
        try:
            return self.get(entry)
        except DriveRefused:
            return None

    def put(self, entry: Entry, value: int) -> None:
        """Write a number."""
        self._answer()
        self._values[entry] = value
        if entry == objects.CONTROLWORD:
            self.control(value, self.target)

    def order(self, entry: Entry, value: int) -> None:
        """Write a number without an answer."""
        if self.takes_no_orders:
            raise BusUnavailable("no such mailbox")
        self.put(entry, value)

    def set_if_present(self, entry: Entry, value: int, consequence: str) -> None:
        """Write a number if the object exists."""
        self.put(entry, value)

    def _answer(self) -> None:
        if self.unplugged:
            raise NodeSilent(f"{self.label}: no answer")

    def control(self, word: int, target: int) -> None:
        """Accept a controlword and its target."""
        if not word & 0x02:
            self.state = State.SWITCH_ON_DISABLED
        elif not word & 0x04:
            if self.state is State.OPERATION_ENABLED:
                self.state, self.target = State.QUICK_STOP_ACTIVE, self.position
        elif self.state is not State.QUICK_STOP_ACTIVE:
            self._switch_on(word)
        if self._values.get(objects.MODE) == Mode.CYCLIC_POSITION:
            self.target = target
        new = bool(word & Control.NEW_SET_POINT) and self.state is State.OPERATION_ENABLED
        if new and not self.acknowledging:
            self.target = target
        self.acknowledging = new

    def _switch_on(self, word: int) -> None:
        steps = {
            (State.SWITCH_ON_DISABLED, 0x06): State.READY_TO_SWITCH_ON,
            (State.READY_TO_SWITCH_ON, 0x07): State.SWITCHED_ON,
            (State.SWITCHED_ON, 0x0F): State.OPERATION_ENABLED,
        }
        self.state = steps.get((self.state, word & 0x0F), self.state)

    def step(self) -> None:
        """Advance by one period."""
        self.history.append(self.state)
        if self.state is State.OPERATION_ENABLED:
            way = self.target - self.position
            self.position += max(-STEP, min(STEP, way))


class FakeFieldbus:
    """Process data of all axes (`drivers.cycle_data.ProcessData`), and a sign of life.

    Attributes
    ----------
    silent : set of int
        Axes without telegrams.
    alive : bool
        True while the master's sign of life continues.
    commanded : Counter of (int, int)
        Number of times that a controlword was sent to an axis, by axis and controlword.
    fed : list of (int, int, int)
        Axis, and the offsets of velocity and torque sent to it.
    """

    def __init__(self, axes: int) -> None:
        self.drives = tuple(FakeDrive(node) for node in range(1, axes + 1))
        self.words: tuple[int, ...] = tuple(drive.word for drive in self.drives)
        self.positions: tuple[int, ...] = (0,) * axes
        self.currents: tuple[float, ...] = (0,) * axes
        self.flags: tuple[int, ...] = (0,) * axes
        self.misfits: dict[int, str] = {}
        self.irregular = self.untimed = False
        self.on_arrival: tuple[int, ...] = ()
        self.time = 0.0
        self.skipped = 0
        self.name, self.timeout, self.due = "our heartbeat", 0.5, math.inf
        self.trouble: DriveError | None = None
        self.silent: set[int] = set()
        self.alive = True
        self.commanded: Counter[tuple[int, int]] = Counter()
        self.fed: list[tuple[int, int, int]] = []

    def now(self) -> float:
        """Return the time [s]."""
        return self.time

    def command(self, axis: int, target: int, controlword: int) -> None:
        """Send target and controlword to one axis."""
        self._carry()
        self.commanded[axis, controlword] += 1
        drive = self.drives[axis]
        if not drive.deaf:
            drive.control(controlword, target)

    def lead(self, axis: int, target: int) -> None:
        """Send a set-point to one axis; it is valid from the next SYNC on, like all sent data."""
        self.command(axis, target, ENABLED)

    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        """Send offsets to one axis."""
        self._carry()
        self.fed.append((axis, velocity, torque))

    def withdraw(self, axis: int) -> None:
        """Send zero offsets to one axis."""
        self.feed_forward(axis, 0, 0)

    def sync(self) -> float:
        """Advance by one period; latch the values of all axes."""
        self.miss()
        self._carry()
        seen = [axis not in self.silent for axis in range(len(self.drives))]
        old = zip(seen, self.drives, self.words, self.positions, strict=True)
        latched = [(d.word, d.position) if here else (w, p) for here, d, w, p in old]
        self.words, self.positions = zip(*latched, strict=True)
        self.flags = tuple(0 if here else SampleFlag.MISSING.value for here in seen)
        self.irregular = not all(seen)
        return self.time

    def unplug(self) -> None:
        """Disconnect all drives."""
        for drive in self.drives:
            drive.unplugged = True

    def _carry(self) -> None:
        if any(drive.unplugged for drive in self.drives):
            raise BusUnavailable("cable unplugged")

    def tick(self) -> None:
        """Advance by one period."""
        self.miss()

    def miss(self) -> None:
        """Advance by one period."""
        self.time += PERIOD
        for drive in self.drives:
            drive.step()

    def hurry(self, hurried: bool) -> None:
        """Do nothing: there are no waits here."""

    def speeds(self) -> list[float]:
        """Return no speeds."""
        return [math.inf] * len(self.drives)

    def watch(self) -> None:
        """Do nothing: all drives are present."""

    def service(self) -> None:
        """Do nothing: `alive` is the sign of life."""

    def beat(self) -> None:
        """Do nothing: `alive` is the sign of life."""

    def cease(self) -> None:
        """Stop the sign of life: all drives switch off."""
        self.alive = False
        for drive in self.drives:
            drive.state = State.SWITCH_ON_DISABLED


def axes_of(drives: Sequence[AxisDrive]) -> tuple[Axis, ...]:
    """Return axes of a session with fake drives."""
    return Axis.all(drives, FakeFieldbus(len(drives)).drives)
