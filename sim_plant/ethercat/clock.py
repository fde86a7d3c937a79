"""Distributed clock of a slave (ETG.1000.4 clause 6.8 f.): local time, system time, SYNC0.

Every slave has its own crystal, so its local time drifts. The system time is the local time plus an
offset written by the master (0920h). When the reference time passes (a write to 0910h), a slave
compares its own time, less the delay of the cable (0928h), and corrects its clock by a proportional
and integral loop. The filter depths of hardware (0930h ff.) are stored and not modelled.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.ethercat import registers as reg

if TYPE_CHECKING:
    from sim_plant.ethercat.controller import Controller

HOP = 300
"""Delay from slave to slave: forwarding and 10 m of cable [ns]."""
_SECOND = 1e9
_WRAP = 1 << 64
_SHARE = 0.25
"""Share of the difference corrected by a comparison."""
_STEP_MAX = 100_000.0
"""Maximum correction of a comparison [ns]; a master writes larger offsets to 0920h."""
_SPEED_SHARE = 0.05
"""Gain of the speed correction per speed difference since the last comparison."""
_SPEED_MAX = 1e-3
"""Maximum speed correction; a crystal deviates by a tenth of it at most."""
_CYCLIC = 0x03
"""Activation 0981h: cyclic operation and SYNC0."""


class Clock:
    """Time of a slave [ns].

    Parameters
    ----------
    controller : Controller
        Controller with the registers of offset, delay and SYNC0.

    Attributes
    ----------
    drift : float
        Relative speed error of the crystal.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.drift = 0.0
        self.reset(0.0)

    def reset(self, now: float) -> None:
        """Start at zero, as at power-on, at `now` [s]."""
        self._since, self._at = now, 0.0
        self._correction = 0.0
        self._compared: float | None = None

    def set_drift(self, drift: float, now: float) -> None:
        """Set the relative speed error of the crystal from `now` [s] on."""
        self._rebase(now, 0.0)
        self.drift = drift

    @property
    def speed(self) -> float:
        """Nanoseconds of the clock per nanosecond of true time."""
        return 1 + self.drift + self._correction

    def local(self, now: float) -> int:
        """Return the local time at the instant `now` [s] of true time."""
        return round(self._at + (now - self._since) * _SECOND * self.speed) % _WRAP

    def system(self, now: float) -> int:
        """Return the system time at an instant."""
        return (self.local(now) + self._register(reg.TIME_OFFSET, 8)) % _WRAP

    def show(self, now: float, delay: int) -> None:
        """Show in the registers the time of a passing frame, `delay` [ns] after `now`."""
        self._controller.put(reg.SYSTEM_TIME, 8, self.passing(now, delay))

    def passing(self, now: float, delay: int) -> int:
        """Return the system time of a passing frame, `delay` [ns] after `now`."""
        return (self.system(now) + delay) % _WRAP

    def latch(self, now: float, forward: int, back: int | None) -> None:
        """Latch the receive times of a frame at port 0 and, if port 1 is open, at port 1 [ns]."""
        controller, local = self._controller, self.local(now)
        controller.put(reg.RECEIVE_TIMES, 4, (local + forward) % (1 << 32))
        controller.put(reg.RECEIVE_TIME, 8, (local + forward) % _WRAP)
        if back is not None:
            controller.put(reg.RECEIVE_TIMES + 4, 4, (local + back) % (1 << 32))

    def compare(self, received: int, now: float, delay: int) -> None:
        """Correct the clock by the reference time in a frame passing `delay` [ns] after `now`."""
        own = self.system(now) + delay
        reference = received + self._register(reg.TIME_DELAY, 4)
        difference = (own - reference + _WRAP // 2) % _WRAP - _WRAP // 2
        size = min(abs(difference), 0x7FFF_FFFF)
        self._controller.put(reg.TIME_DIFFERENCE, 4, size | (difference < 0) << 31)
        self._rebase(now, min(max(_SHARE * difference, -_STEP_MAX), _STEP_MAX))
        if self._compared is not None and now > self._compared:
            change = _SPEED_SHARE * difference / ((now - self._compared) * _SECOND)
            self._correction = min(max(self._correction - change, -_SPEED_MAX), _SPEED_MAX)
        self._compared = now

    @property
    def cycle(self) -> int:
        """SYNC0 cycle [ns], 0 while SYNC0 is not activated."""
        return self._register(reg.SYNC0_CYCLE, 4) if self.is_cyclic else 0

    @property
    def is_cyclic(self) -> bool:
        """True if SYNC0 is activated, with a cycle or without."""
        return self._controller.memory[reg.ACTIVATION] & _CYCLIC == _CYCLIC

    def until_sync0(self, now: float, least: int) -> float:
        """Return the time from `now` to the next SYNC0 [s] further ahead than `least` [ns].

        After the start time, SYNC0 keeps its phase.
        """
        system, start = self.system(now), self._register(reg.START_TIME, 8)
        ahead = (start - system + _WRAP // 2) % _WRAP - _WRAP // 2
        if ahead <= least:
            ahead = least + 1 + (ahead - least - 1) % self.cycle
        return ahead / _SECOND / self.speed

    def _register(self, place: int, size: int) -> int:
        return int.from_bytes(self._controller.memory[place : place + size], "little")

    def _rebase(self, now: float, taken: float) -> None:
        self._at += (now - self._since) * _SECOND * self.speed - taken
        self._since = now
