"""Wake-up jitter of a computer, by a clock set by the test, and the resulting advice."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import can
import numpy as np
import pytest
from rich.console import Console

from drivers.canopen.bus import CanopenBus
from drivers.commissioning.verdict import Grade
from drivers.operator_tools.sync_period import (
    WakeUps,
    judge_period,
    judge_wake_ups,
    measure_wake_ups,
    wake_ups_on,
)
from drivers.sync_clock import TOO_LATE, WallClock
from hil import cli
from hil.cli import commissioning
from hil.planning.plan import Plan, dump_plan
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path


class Sleeper:
    """Clock that a wait advances to its end, plus a delay set by the test."""

    def __init__(self, late: Iterable[float]) -> None:
        self.now = 100.0
        self._late = iter(late)

    def clock(self) -> float:
        return self.now

    def wait(self, left: float) -> None:
        self.now += left + next(self._late)


def measured(late: Iterable[float], period: float = 0.004, count: int = 5) -> WakeUps:
    sleeper = Sleeper(late)
    return measure_wake_ups(period, count * period, sleeper.wait, sleeper.clock)


def test_every_deadline_has_its_lateness() -> None:
    found = measured([0.0001, 0.0, 0.0005, 0.0002, 0.0])
    assert found.late == pytest.approx([0.0001, 0.0, 0.0005, 0.0002, 0.0], abs=1e-9)
    assert found.longest == pytest.approx(0.0005)


def test_deadlines_that_passed_in_a_long_sleep_are_late_too() -> None:
    found = measured([0.0, 0.0095, 0.0])
    assert found.late == pytest.approx([0.0, 0.0095, 0.0055, 0.0015, 0.0], abs=1e-9)


def test_a_wait_that_a_frame_ends_early_is_gone_on_with() -> None:
    found = measured([-0.003, 0.0, -0.001, -0.002, 0.0, 0.0, 0.0, 0.0])
    assert found.late == pytest.approx([0.0] * 5, abs=1e-9)


def test_what_counts_as_missed_is_what_the_driver_leaves_out() -> None:
    for late in (TOO_LATE * 0.004 - 1e-6, TOO_LATE * 0.004 + 1e-6):
        now = [0.0]
        pacing = WallClock(0.004, clock=lambda now=now: now[0])
        pacing.note_sent()
        now[0] = 0.004 + late
        pacing.due()
        assert pacing.skipped == round(WakeUps(0.004, np.array([late])).missed)


@pytest.mark.parametrize(
    ("late", "rate"),
    [(0.0, 1000), (0.4e-3, 1000), (0.6e-3, 500), (1.5e-3, 250), (3.9e-3, 125), (0.03, None)],
)
def test_the_highest_usual_rate_that_is_kept_is_recommended(late: float, rate: float) -> None:
    rare = np.zeros(10_000)
    rare[:5] = 1.0  # a share of one in two thousand
    often = rare.copy()
    often[5:50] = late
    assert WakeUps(0.004, rare).recommended == 1000
    assert WakeUps(0.004, often).recommended == rate


def test_a_computer_that_keeps_the_wanted_rate_passes() -> None:
    verdict = judge_wake_ups(WakeUps(0.004, np.full(1000, 1e-4)), real_time=False)
    assert verdict.grade is Grade.OK
    assert verdict.found == "0.00% too late at 250 Hz; keeps 1000 Hz"


@pytest.mark.parametrize("real_time", [False, True])
def test_a_computer_that_does_not_is_told_what_to_do(real_time: bool) -> None:
    late = np.full(1000, 1e-4)
    late[:30] = 3e-3
    verdict = judge_wake_ups(WakeUps(0.004, late), real_time=real_time)
    assert verdict.grade is Grade.WARNING
    assert verdict.found == "3.00% too late at 250 Hz; keeps 125 Hz"
    assert verdict.bound == "at most 0.1% later than 0.5 of the period"
    assert "set sync_period to 0.008 s or more, or set up this computer" in verdict.remedy
    assert ("try --realtime" in verdict.remedy) is not real_time


def test_where_the_kernel_sends_sync_that_is_said() -> None:
    verdict = judge_wake_ups(WakeUps(0.004, np.zeros(9)), real_time=True, by_kernel=True)
    assert "SYNC is sent by the kernel" in verdict.found


class Timed:
    """Measurements of a bus under power."""

    def __init__(self, rate: float, slowest: float, jitter: float) -> None:
        self.achievable_rate = lambda: (rate, slowest)
        self.jitter = lambda _period: jitter


@pytest.mark.parametrize(
    ("timed", "late", "found", "remedy"),
    [
        ((809.0, 1e-3, 3e-4), 4e-4, "809 Hz, slowest answer 1 ms, SYNC jitter at most 0.4 ms", ""),
        ((809.0, 1e-3, 3e-4), 3e-3, "167 Hz", "set sync_period to 0.008 s: the jitter of SYNC by"),
        ((809.0, 1e-3, 4e-3), 3e-4, "125 Hz", "set sync_period to 0.01 s: the jitter of SYNC by"),
        ((90.0, 9e-3, 1e-3), 0.0, "90 Hz", "set sync_period to 0.02 s: bus load and the drives'"),
        ((10.0, 0.08, 1e-3), 0.0, "10 Hz", "no usual rate is achievable: bus load"),
        ((2154.0, 0.0, 0.0), 0.0, "2154 Hz, response times are not measured here", ""),
    ],
)
def test_the_period_is_that_which_computer_adapter_bus_and_drives_keep_together(
    timed: tuple[float, float, float], late: float, found: str, remedy: str
) -> None:
    verdict = judge_period(Timed(*timed), 0.004, late)
    assert verdict.found.startswith(found)
    assert verdict.remedy.startswith(remedy)
    assert (verdict.grade is Grade.OK) is not bool(remedy)


def test_in_lock_step_there_is_nothing_to_measure() -> None:
    with can.Bus("manutec-r15", "sim_plant", ignore_config=True) as bus:
        assert wake_ups_on(CanopenBus(bus), 0.004, 10.0) is None


def test_on_a_bus_that_waits_it_takes_the_time_that_was_asked_for() -> None:
    with can.Bus("wake-ups", "virtual", ignore_config=True) as bus:
        found = wake_ups_on(CanopenBus(bus), 0.004, 0.1)
    assert found is not None
    assert len(found.late) == 25
    assert np.all(found.late >= 0.0)


def test_quantiles_and_a_histogram_are_shown() -> None:
    console = Console(file=io.StringIO(), width=100)
    late = np.repeat([0.12e-3, 0.3e-3, 0.7e-3, 4.1e-3], [800, 100, 99, 1])
    commissioning.show_wake_ups(WakeUps(0.004, late), 0.85, console)
    lines = console.file.getvalue().splitlines()
    assert lines[0] == (
        "delay of 1000 wake-ups at 250 Hz: 50 % within 0.12 ms, 99 % within 0.7 ms, 85 % within "
        "0.3 ms, longest 4.1 ms"
    )
    rows = [line.split() for line in lines if "under" in line]
    assert rows[2] == ["under", "0.2", "ms", "800", "#" * 40]
    assert rows[-1] == ["under", "5", "ms", "1", "#"]


def test_a_run_notes_what_was_granted_of_real_time(
    small_plan: Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "plan.yaml").write_text(dump_plan(small_plan))
    with pytest.raises(SystemExit):
        cli.main(["run", str(tmp_path / "plan.yaml"), "-o", str(tmp_path / "run"), "--realtime"])
    left_out = "real time: ignored, since SYNC in lock-step has no deadlines"
    assert left_out in capsys.readouterr().out
    assert RunFolder.open(tmp_path / "run").journal.sessions[0].real_time == (left_out,)
