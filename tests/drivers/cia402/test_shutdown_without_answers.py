"""Shutdown where telegrams stay away or SYNCs hardly pass: bounded, and with the present reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from fake_fieldbus import PERIOD, FakeFieldbus
from local_bench import drives_file

from drivers.cia402 import shutdown as shutdown_module
from drivers.cia402.power import Power
from drivers.cia402.shutdown import LONGEST, Shutdown
from drivers.cia402.states import State
from drivers.cia402.supervision import Supervision
from drivers.drive_bus import BusUnavailable

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive


class Clock:
    """Real time that passes with each SYNC and not otherwise [s]."""

    def __init__(self, per_sync: float) -> None:
        self.now, self._per_sync = 0.0, per_sync

    def __call__(self) -> float:
        return self.now

    def tick(self) -> None:
        self.now += self._per_sync


class Bus(FakeFieldbus):
    """Three axes under power, whose commands may be refused for a while."""

    def __init__(self, clock: Clock | None = None) -> None:
        super().__init__(3)
        self.refusals = 0
        self._clock = clock
        for drive in self.drives:
            drive.state = State.OPERATION_ENABLED

    def command(self, axis: int, target: int, controlword: int) -> None:
        if axis == 1 and self.refusals:
            self.refusals -= 1
            raise BusUnavailable("no such mailbox")
        super().command(axis, target, controlword)

    def miss(self) -> None:
        super().miss()
        if self._clock is not None:
            self._clock.tick()

    def cease(self) -> None:
        self.alive = False


def shut_down(bus: Bus, axes: tuple[AxisDrive, ...]) -> Shutdown:
    off = Power(bus, bus.drives, Supervision(bus.drives)).switch_off
    shutdown = Shutdown(bus, bus, bus.drives, axes, PERIOD, 0.5, off)
    shutdown.begin([1.0] * 3, [10.0] * 3)
    shutdown.switch_off()
    return shutdown


@pytest.mark.parametrize("brake_delay", [0.0, 2.0])
def test_a_stop_whose_syncs_hardly_pass_is_given_up_later_where_brakes_close_slowly(
    monkeypatch: pytest.MonkeyPatch, brake_delay: float
) -> None:
    clock = Clock(per_sync=0.5)
    monkeypatch.setattr(shutdown_module, "monotonic", clock)
    bus = Bus(clock)
    bus.silent = {0, 1, 2}
    shut_down(bus, tuple(drives_file(brake_delay=brake_delay).axes))
    assert clock.now == pytest.approx(LONGEST + brake_delay, abs=1.0)


def test_a_refusal_that_is_over_is_not_the_reason_why_a_drive_stays_on() -> None:
    axes = tuple(drives_file().axes)
    bus = Bus()
    bus.drives[1].deaf, bus.refusals = True, 3
    shutdown = shut_down(bus, axes)
    shutdown.conclude()
    assert shutdown.problems[0] == (
        "axis 2: does not switch off, it shows OPERATION ENABLED; its watchdog stays armed and our "
        "heartbeat has ceased"
    )


def test_a_refusal_that_lasts_is_the_reason_why_a_drive_stays_on() -> None:
    axes = tuple(drives_file().axes)
    bus = Bus()
    bus.refusals = 100_000
    shutdown = shut_down(bus, axes)
    shutdown.conclude()
    assert "axis 2: does not switch off" in shutdown.problems[0]
    assert "(no such mailbox)" in shutdown.problems[0]
