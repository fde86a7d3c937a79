"""SYNC sent by another sender, and frames queued until their SYNC."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can_bus.kernel_sync import SILENCE, KernelSync
from drivers.canopen.sync_clock import KernelClock, kernel_sync
from drivers.drive_bus import BusUnavailable
from drivers.sync_clock import PAUSE

if TYPE_CHECKING:
    from collections.abc import Callable

PERIOD = 0.01
START = 1000.0
SYNC = can.Message(arbitration_id=0x80, is_extended_id=False)
ANSWERS = (0x181, 0x182)


class Task:
    stopped = False

    def stop(self) -> None:
        self.stopped = True


class KernelBus(can.BusABC):
    """Bus with frames at instants set by a test; a wait advances the clock to the next frame."""

    channel_info = "vcan9"

    def __init__(self) -> None:
        super().__init__("vcan9")
        self.now = START
        self.arrivals: deque[can.Message] = deque()
        self.sent: list[can.Message] = []
        self.task = Task()

    def clock(self) -> float:
        return self.now

    def arrive(self, instant: float, identifier: int, *, foreign: bool = False) -> None:
        self.arrivals.append(
            can.Message(
                timestamp=START + instant,
                arbitration_id=identifier,
                data=[round(instant / PERIOD) % 256],
                is_extended_id=False,
                is_rx=foreign,
            )
        )

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg)

    def send_periodic(self, *args: object, **kwargs: object) -> Task:  # type: ignore[override]
        return self.task

    def recv(self, timeout: float | None = None) -> can.Message | None:
        limit = self.now + (timeout or 0.0)
        if not self.arrivals or self.arrivals[0].timestamp > limit:
            self.now = limit
            return None
        frame = self.arrivals.popleft()
        self.now = max(self.now, frame.timestamp)
        return frame


@pytest.fixture
def kernel() -> KernelBus:
    bus = KernelBus()
    yield bus
    bus.shutdown()


def synced(kernel: KernelBus, wall: Callable[[], float] | None = None) -> KernelSync:
    wall = wall or kernel.clock
    return KernelSync(kernel, PERIOD, ANSWERS, pause=PAUSE, clock=kernel.clock, wall=wall)


def received(bus: KernelSync) -> list[int]:
    frames = []
    while frame := bus.recv(0.0):
        frames.append(frame.arbitration_id)
    return frames


def test_sending_sync_waits_for_the_kernel_s_and_takes_its_time_stamp(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        kernel.arrive(0.0071, 0x80)
        bus.send(SYNC)
        assert bus.instant == pytest.approx(START + 0.0071)
        assert not kernel.sent


def test_all_other_frames_are_sent_as_they_are(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        bus.send(can.Message(arbitration_id=0x201, is_extended_id=False))
    assert [frame.arbitration_id for frame in kernel.sent] == [0x201]


def test_whoever_was_busy_gets_every_sync_with_its_own_answers(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        for number in range(3):
            for identifier in (0x80, *ANSWERS):
                kernel.arrive((number + 1) * PERIOD, identifier)
        bus.send(SYNC)
        kernel.now = START + 4 * PERIOD
        kernel.arrive(4 * PERIOD, 0x581)
        assert received(bus) == [*ANSWERS, 0x581]
        for number in (2, 3):
            bus.send(SYNC)
            assert bus.instant == pytest.approx(START + number * PERIOD)
            assert [frame.data[0] for frame in iter(lambda: bus.recv(0.0), None)] == [number] * 2
        assert bus.skipped == 0


def test_an_answer_behind_the_next_sync_is_left_to_that_one(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        clock = KernelClock(bus, PERIOD, clock=kernel.clock)
        for instant, identifier in ((0.01, 0x80), (0.02, 0x80), (0.021, 0x181)):
            kernel.arrive(instant, identifier)
        bus.send(SYNC)
        assert clock.window() >= PERIOD
        kernel.now = START + 0.022
        assert bus.recv(0.0) is None
        assert clock.window() == 0.0
        bus.send(SYNC)
        assert received(bus) == [0x181]


def test_frames_before_the_next_sync_are_delivered_while_it_is_waited_for(
    kernel: KernelBus,
) -> None:
    delivered: list[int] = []
    with synced(kernel) as bus:
        bus.deliver = lambda frame: delivered.append(frame.arbitration_id)
        kernel.arrive(0.01, 0x80)
        bus.send(SYNC)
        for instant, identifier in ((0.015, 0x181), (0.016, 0x701), (0.02, 0x80)):
            kernel.arrive(instant, identifier)
        bus.send(SYNC)
    assert delivered == [0x181, 0x701]


@given(st.lists(st.integers(1, 9), min_size=1, max_size=20))
def test_syncs_that_the_kernel_left_out_are_counted(steps: list[int]) -> None:
    with KernelBus() as kernel, synced(kernel) as bus:
        instant = PERIOD
        for step in (0, *steps):
            instant += step * PERIOD
            kernel.arrive(instant, 0x80)
            bus.send(SYNC)
        assert bus.skipped == sum(steps) - len(steps)


def test_after_a_pause_the_past_is_dropped_and_nothing_counts_as_skipped(
    kernel: KernelBus,
) -> None:
    delivered: list[int] = []
    with synced(kernel) as bus:
        bus.deliver = lambda frame: delivered.append(frame.arbitration_id)
        kernel.arrive(0.01, 0x80)
        bus.send(SYNC)
        for instant, identifier in ((0.02, 0x80), (0.021, 0x181), (0.1, 0x701), (0.5, 0x80)):
            kernel.arrive(instant, identifier)
        kernel.now = START + 0.4
        bus.send(SYNC)
        assert bus.instant == pytest.approx(START + 0.5)
        assert (bus.skipped, delivered) == (0, [0x701])


@pytest.mark.parametrize("share", [1.25, 1.9, 3.4, 10.0])
def test_a_caller_slower_than_sync_judges_the_present_and_knows_what_was_passed_over(
    kernel: KernelBus, share: float
) -> None:
    passed_over, ages, taken = 0, [], []
    with synced(kernel) as bus:
        for number in range(1, 2001):
            for identifier in (0x80, *ANSWERS):
                kernel.arrive(number * PERIOD, identifier)
        while len(kernel.arrivals) > 60:
            bus.send(SYNC)
            ages.append(kernel.now - bus.instant)
            passed_over += bus.passed_over
            number = round((bus.instant - START) / PERIOD)
            taken.append(number)
            answers = [bus.recv(0.0) for _ in ANSWERS]
            assert [(f.arbitration_id, f.data[0]) for f in answers if f] == [
                (identifier, number % 256) for identifier in ANSWERS
            ]
            kernel.now += share * PERIOD
    assert max(ages) <= 2 * PERIOD
    assert passed_over == bus.skipped == taken[-1] - len(taken)


def test_a_queue_that_was_full_is_left_behind_for_the_next_sync(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        for number in (1, 2, 3, 30):  # frames in between were lost in a full queue
            for identifier in (0x80, *ANSWERS):
                kernel.arrive(number * PERIOD, identifier)
        bus.send(SYNC)
        assert [bus.recv(0.0) is not None for _ in ANSWERS] == [True, True]
        kernel.now = START + 20 * PERIOD
        bus.send(SYNC)
        assert bus.instant == pytest.approx(START + 30 * PERIOD)
        assert (bus.passed_over, bus.skipped) == (2, 28)


def test_while_axes_are_stopped_nobody_waits_long_for_the_kernel(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        clock = KernelClock(bus, PERIOD, clock=kernel.clock)
        clock.hurry(True)
        with pytest.raises(BusUnavailable):
            bus.send(SYNC)
        assert kernel.now == pytest.approx(START + 2 * PERIOD)
        clock.hurry(False)
        assert bus.silence is None


def test_another_master_s_sync_is_not_taken_for_ours(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        kernel.arrive(0.004, 0x80, foreign=True)
        kernel.arrive(0.01, 0x80)
        bus.send(SYNC)
        assert bus.instant == pytest.approx(START + 0.01)


def test_a_kernel_without_sync_means_that_the_bus_is_down(kernel: KernelBus) -> None:
    with synced(kernel) as bus:
        with pytest.raises(BusUnavailable, match="no SYNC received from the kernel"):
            bus.send(SYNC)
        assert kernel.now == pytest.approx(START + 3 * PERIOD + SILENCE)


def test_when_it_is_shut_down_sync_ends_and_the_bus_below_stays_open(kernel: KernelBus) -> None:
    bus = synced(kernel)
    kernel.arrive(0.01, 0x80)
    bus.send(SYNC)
    bus.shutdown()
    assert kernel.task.stopped
    bus.send(can.Message(arbitration_id=0x201, is_extended_id=False))


def test_a_clock_that_is_set_in_the_middle_does_not_move_the_samples(
    kernel: KernelBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_forward = [0.0]
    with synced(kernel, wall=lambda: kernel.now + set_forward[0]) as bus:
        kernel.arrive(0.01, 0x80)
        bus.send(SYNC)
        set_forward[0] = 3600.0
        kernel.arrive(0.02, 0x80)
        kernel.arrivals[-1].timestamp += 3600.0
        kernel.now = START + 0.02
        waiting = iter([*kernel.arrivals, None])
        monkeypatch.setattr(kernel, "recv", lambda _timeout: next(waiting))
        bus.send(SYNC)
        assert bus.instant == pytest.approx(START + 0.02)
        assert bus.skipped == 0


@pytest.mark.parametrize("step", [-3600.0, -0.4, -0.05, 0.05, 0.4, 3600.0])
@pytest.mark.parametrize("late", [0.0, 0.3 * PERIOD, 1.5 * PERIOD])
def test_a_clock_that_is_set_between_stamp_and_reading_does_not_move_the_samples(
    kernel: KernelBus, step: float, late: float
) -> None:
    """Two SYNCs are stamped, then the wall clock is set, then they are read `late` seconds on."""
    shift = [0.0]
    with synced(kernel, wall=lambda: kernel.now + shift[0]) as bus:
        kernel.arrive(PERIOD, 0x80)
        bus.send(SYNC)
        kernel.arrive(2 * PERIOD, 0x80)
        kernel.now = START + 2 * PERIOD + late
        shift[0] = step
        bus.send(SYNC)
        assert bus.instant == pytest.approx(START + 2 * PERIOD)
        number = 4 + round(late / PERIOD)
        kernel.arrivals.append(
            can.Message(
                timestamp=START + number * PERIOD + step, arbitration_id=0x80, is_extended_id=False
            )
        )
        kernel.arrivals[-1].is_rx = False
        kernel.now = START + number * PERIOD
        waiting = iter([kernel.arrivals.pop(), None])
        kernel.recv = lambda _timeout=None: next(waiting)  # type: ignore[method-assign]
        bus.send(SYNC)
        assert bus.instant == pytest.approx(START + number * PERIOD)


def test_buses_whose_kernel_has_no_sync_are_left_as_they_are(kernel: KernelBus) -> None:
    assert kernel_sync(kernel, "auto", PERIOD, ANSWERS) is None
