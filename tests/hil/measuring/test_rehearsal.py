"""Rehearsal of a plan, and the keyboard during a run."""

import os
import pty
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from drivers import opening
from hil import cli
from hil.measuring.campaign import rehearse
from hil.measuring.sequencer import Finished, Paused, Rehearsed, Started, Travelled, measure
from hil.measuring.travel import travel
from hil.model.robot import Robot
from hil.planning.plan import Plan, dump_plan
from hil.runs.run_folder import RunFolder
from hil.terminal.keys import KeyboardStop, Keys


def passed(bus, drive: Callable[[], object]) -> np.ndarray:
    """Return configurations passed by `drive`, shape (n, 6)."""
    seen: list[tuple[float, ...]] = []

    def note(sample):
        seen.append(sample.q)
        return sample

    bus.tamper = note
    drive()
    return np.array(seen)


def test_a_rehearsal_passes_every_measurement_in_order(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    with ideal_bus:
        events = list(rehearse(small_plan, manutec, ideal_bus))
    assert [type(e) for e in events] == [Started, *[Travelled, Rehearsed] * 3, Finished]
    assert [e.measurement.id for e in events if isinstance(e, Rehearsed)] == ["g1", "i1", "c1"]
    assert events[0].remaining == pytest.approx(events[-1].time, rel=0.15)
    assert events[-2].remaining == 0.0


def test_no_axis_is_faster_than_asked_for(small_plan: Plan, manutec: Robot, ideal_bus) -> None:
    with ideal_bus:
        list(rehearse(small_plan, manutec, ideal_bus, 0.1))
    assert all(
        move.velocity <= 0.1 * manutec.velocity_limit[axis] * (1 + 1e-9)
        for _, axis, move in ideal_bus.moves
    )


def test_what_is_slow_anyway_is_not_slowed_further(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    with ideal_bus:
        list(rehearse(small_plan, manutec, ideal_bus, 1.0))
    for measurement in small_plan.measurements:
        profile = (measurement.velocity, measurement.acceleration)
        strokes = [m for _, axis, m in ideal_bus.moves if axis == measurement.index]
        assert profile in {(move.velocity, move.acceleration) for move in strokes}


def test_all_that_is_measured_lies_within_what_was_rehearsed(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    with ideal_bus:
        slow = passed(ideal_bus, lambda: list(rehearse(small_plan, manutec, ideal_bus)))
        fast = passed(ideal_bus, lambda: list(measure(small_plan, manutec, ideal_bus)))
    assert np.all(fast.min(axis=0) >= slow.min(axis=0) - 1e-3)
    assert np.all(fast.max(axis=0) <= slow.max(axis=0) + 1e-3)


def test_a_slow_travel_takes_the_same_path(small_plan: Plan, manutec: Robot, ideal_bus) -> None:
    target = small_plan.measurements[0].start
    with ideal_bus:
        fast = passed(ideal_bus, lambda: travel(ideal_bus, manutec, target, 0.3))
        travel(ideal_bus, manutec, (0.0,) * 6, 1.0)
        slow = passed(ideal_bus, lambda: travel(ideal_bus, manutec, target, 0.3, None, 0.25))
    assert len(slow) > 3 * len(fast)
    nearest = [np.abs(slow - q).max(axis=1).min() for q in fast]
    assert max(nearest) < 2e-3


# The folder


@pytest.fixture
def plan_file(tmp_path: Path, small_plan: Plan) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan))
    return path


def test_the_folder_remembers_the_rehearsal_and_measures_the_same_plan_only(
    plan_file: Path,
    tmp_path: Path,
    ideal_bus,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    wide_console: None,
) -> None:
    def hil(*arguments: object) -> tuple[int, str]:
        with pytest.raises(SystemExit) as left:
            cli.main(["run", *map(str, arguments)])
        printed = capsys.readouterr()
        return int(left.value.code or 0), printed.out + printed.err

    monkeypatch.setattr(opening, "open_drive_bus", lambda *_, **__: ideal_bus)
    folder = tmp_path / "first"
    status, printed = hil(plan_file, "-o", folder, "--rehearse", "--speed", "0.5")
    assert (status, len(RunFolder.open(folder).missing)) == (0, 3)
    assert "all paths of the plan rehearsed at 50% of the speed limits" in printed
    assert RunFolder.open(folder).journal.rehearsed == 0.5

    other = tmp_path / "other.yaml"
    other.write_text(plan_file.read_text().replace("velocity: 0.4", "velocity: 0.5", 1))
    status, printed = hil(other, "-o", folder)
    assert status == 1
    assert "the plan differs from that of the run's start" in printed

    assert hil(plan_file, "-o", folder)[0] == 0
    assert RunFolder.open(folder).missing == ()
    assert RunFolder.open(folder).journal.rehearsed == 0.5


# Keys


@pytest.fixture
def terminal() -> Iterator[tuple[int, Keys]]:
    """Writing end of a pseudo terminal, and the keys read from it."""
    hand, ours = pty.openpty()
    with os.fdopen(ours) as stream:
        yield hand, Keys(stream)
    os.close(hand)


def wait_until(holds: Callable[[], bool]) -> None:
    ends = time.monotonic() + 20
    while not holds():
        assert time.monotonic() < ends
        time.sleep(0.001)


def listens() -> bool:
    return any(thread.name == "keyboard" for thread in threading.enumerate())


@pytest.mark.parametrize("key", [b"s", b"S", b" "])
def test_a_stop_key_interrupts_the_main_thread_wherever_it_is(terminal, key: bytes) -> None:
    hand, keys = terminal
    with KeyboardStop(keys) as keyboard:
        assert keyboard.listening
        threading.Timer(0.05, os.write, (hand, key)).start()
        with pytest.raises(KeyboardInterrupt):
            time.sleep(20)
    assert not listens()


def test_a_stop_key_works_where_interrupts_were_ignored_before(terminal) -> None:
    hand, keys = terminal
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with KeyboardStop(keys):
            threading.Timer(0.05, os.write, (hand, b"s")).start()
            with pytest.raises(KeyboardInterrupt):
                time.sleep(20)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_p_pauses_and_any_key_goes_on(terminal) -> None:
    hand, keys = terminal
    with KeyboardStop(keys) as keyboard:
        assert not keyboard.pause()
        os.write(hand, b"p")
        wait_until(keyboard.pause)
        os.write(hand, b"r")
        wait_until(lambda: not keyboard.pause())


def test_where_there_is_no_terminal_no_key_is_waited_for() -> None:
    with open(os.devnull) as stream, KeyboardStop(Keys(stream)) as keyboard:  # noqa: PTH123 - a device
        assert not keyboard.listening
        assert not keyboard.pause()
        assert not listens()


def test_in_a_pause_the_axes_are_sampled_and_stand_still(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    answers = iter([True, *[True] * 500, False])
    with ideal_bus:
        events = list(measure(small_plan, manutec, ideal_bus, pause=lambda: next(answers, False)))
    paused = next(k for k, e in enumerate(events) if isinstance(e, Paused))
    before, after = events[paused - 1], events[paused + 1]
    assert isinstance(after, Travelled)
    begin, end = events[paused].time, events[paused].time + 500 * ideal_bus.period
    assert after.time > end
    assert not any(begin < at < end for at, _, _ in ideal_bus.moves)
    assert events[paused].remaining == pytest.approx(before.remaining, rel=0.05)
    assert all(a.remaining >= b.remaining - 2.0 for a, b in pairwise(events))


@pytest.mark.long
def test_s_ends_a_real_run_with_all_axes_off(plan_file: Path, tmp_path: Path) -> None:
    hand, theirs = pty.openpty()
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "hil", "run", str(plan_file), "-o", str(folder)]
    run = subprocess.Popen(  # noqa: S603 - our own program
        command,
        stdin=theirs,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    os.close(theirs)
    try:
        wait_until(lambda: run.poll() is not None or any(folder.glob("recordings/g1.h5")))
        os.write(hand, b"s")
        out, err = run.communicate(timeout=60)
    finally:
        os.close(hand)
    assert run.returncode == 130, err
    assert "s or space: stop all axes and end" in out
    assert f"stopped, the axes are off; recordings so far are in {folder}" in err
    assert RunFolder.open(folder).journal.sessions[0].reason == "interrupted by the operator"
