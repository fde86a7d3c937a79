"""Ctrl-C, SIGTERM and a closed terminal, with real processes."""

from __future__ import annotations

import importlib
import os
import pty
import select
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import can
import pytest
import typer
from two_processes import open_bus, plant_process, wake

from hil.planning.plan import Plan, dump_plan
from hil.runs.run_folder import RunFolder
from hil.terminal.keys import Keys, interruptible

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PLACE = ("local", f"signals-{os.getpid()}")
ON_PLANT = ("--interface", PLACE[0], "--channel", PLACE[1])
OPERATION_ENABLED = 0x27
HIL = (sys.executable, "-m", "hil")
WITHOUT_HANG_UP = "trap '' HUP; exec \"$@\""
WITHOUT_CTRL_C = "trap '' INT; exec \"$@\""
ON_OWN_TERMINAL = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""
SAYS_WHEN_IT_TAKES_INTERRUPTS = """
import os, signal
from hil.__main__ import main
take = signal.signal
def say(*handler):
    signal.signal = take
    take(*handler)
    os.write(1, b"up")
signal.signal = say
main()
"""
INTERRUPTED_IN_GENERATED_CODE = """
import signal
from hil import __main__ as program, cli
from hil.terminal.keys import interruptible
def command_line():
    try:
        with interruptible(lambda: ""):
            exec("signal.raise_signal(signal.SIGINT)")
    except RuntimeError as error:
        raise SystemExit(error.exit_code)
cli.main = command_line
program.main()
"""


@pytest.fixture(scope="module")
def plant() -> Iterator[None]:
    """Plant in another process: SYNC advances its time, so no heartbeat is missed without SYNC."""
    with plant_process(PLACE):
        wake(PLACE)
        yield


@pytest.fixture
def plan_file(tmp_path: Path, small_plan: Plan) -> Path:
    """Plan of ten rounds of the small plan."""
    measurements = tuple(
        m.model_copy(update={"id": f"{m.id}-{k}"})
        for k in range(10)
        for m in small_plan.measurements
    )
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan.model_copy(update={"measurements": measurements})))
    return path


class Terminal:
    """A program in its own terminal, which can be closed."""

    def __init__(self, *command: str) -> None:
        self.master, slave = pty.openpty()
        self.shown = b""
        self.process = subprocess.Popen(  # noqa: S603 - our own program
            (sys.executable, "-c", ON_OWN_TERMINAL, *command),
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
        )
        os.close(slave)

    def read(self) -> None:
        """Read the output, so that the program can continue."""
        while select.select([self.master], [], [], 0.005)[0]:
            try:
                self.shown += os.read(self.master, 4096)
            except OSError as error:  # the program has ended
                raise AssertionError(self.shown.decode()) from error

    def await_text(self, text: bytes) -> None:
        while text not in self.shown:
            assert self.process.poll() is None, self.shown
            self.read()

    def close(self) -> int:
        """Close the terminal; return how the program ended."""
        os.close(self.master)
        return self.process.wait(60)


def await_recordings(folder: Path, terminal: Terminal) -> None:
    while len(list(folder.glob("recordings/*.h5"))) < 2:
        assert terminal.process.poll() is None, terminal.shown
        terminal.read()


def states() -> list[int]:
    """Read every drive's state (6041) after the end of the master."""
    found = []
    with open_bus(PLACE) as bus:
        for node in range(1, 7):
            request = bytes.fromhex("4041600000000000")
            bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
            while (frame := bus.recv(10.0)) is not None and frame.arbitration_id != 0x580 + node:
                pass
            assert frame is not None, f"node {node} does not answer"
            found.append(int.from_bytes(frame.data[4:6], "little") & 0x6F)
    return found


@pytest.mark.usefixtures("plant")
def test_a_closed_terminal_ends_a_run_with_the_axes_switched_off_by_us(
    plan_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    terminal = Terminal(
        *HIL, "run", str(plan_file), "-o", str(folder), "--pacing", "lock-step", *ON_PLANT
    )
    await_recordings(folder, terminal)
    status = terminal.close()
    assert OPERATION_ENABLED not in states()
    assert status == 130
    run = RunFolder.open(folder)
    assert run.journal.sessions[0].reason == "interrupted by the operator"
    assert run.missing


@pytest.mark.usefixtures("plant")
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM, signal.SIGINT])
def test_output_into_a_pipe_that_nobody_reads_does_not_keep_axes_on(
    plan_file: Path, tmp_path: Path, number: int
) -> None:
    folder = tmp_path / "run"
    command = (*HIL, "run", str(plan_file), "-o", str(folder), "--pacing", "lock-step", *ON_PLANT)
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)  # noqa: S603
    while len(list(folder.glob("recordings/*.h5"))) < 2:
        assert run.poll() is None
        time.sleep(0.005)
    assert run.stdout is not None
    assert run.stderr is not None
    run.stdout.close()
    run.stderr.close()
    run.send_signal(number)
    assert run.wait(60) == 130
    assert OPERATION_ENABLED not in states()


@pytest.mark.usefixtures("plant")
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_run_that_a_script_started_in_the_background_ends_with_the_axes_switched_off(
    plan_file: Path, tmp_path: Path, number: int
) -> None:
    folder = tmp_path / "run"
    command = (*HIL, "run", str(plan_file), "-o", str(folder), "--pacing", "lock-step", *ON_PLANT)
    run = subprocess.Popen(  # noqa: S603 - our own program
        ("/bin/sh", "-c", WITHOUT_CTRL_C, "sh", *command),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    for recordings in (2, 4):
        while len(list(folder.glob("recordings/*.h5"))) < recordings:
            assert run.poll() is None
            time.sleep(0.005)
        run.send_signal(signal.SIGINT if recordings == 2 else number)
    assert run.wait(60) == 130
    assert OPERATION_ENABLED not in states()


@pytest.mark.usefixtures("plant")
def test_a_closed_terminal_ends_a_check_with_the_axes_switched_off_by_us() -> None:
    terminal = Terminal(
        *HIL, "drives", "check", "manutec-r15", "--jitter-time", "0", "--yes", *ON_PLANT
    )
    terminal.await_text(b"TPDOs at each SYNC")
    status = terminal.close()
    assert OPERATION_ENABLED not in states()
    assert status == 130


def test_what_nohup_ignores_stays_ignored(plan_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run = subprocess.Popen(  # noqa: S603 - our own program
        ("/bin/sh", "-c", WITHOUT_HANG_UP, "sh", *HIL, "run", str(plan_file), "-o", str(folder)),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    while len(list(folder.glob("recordings/*.h5"))) < 2:
        assert run.poll() is None
        time.sleep(0.005)
    run.send_signal(signal.SIGHUP)
    _, err = run.communicate(timeout=120)
    assert (run.returncode, err) == (0, b"")


@pytest.mark.parametrize("delay", [0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9, 1.2, 1.5])
def test_an_interrupt_at_any_moment_of_the_start_leaves_one_line_at_most(
    plan_file: Path, tmp_path: Path, delay: float
) -> None:
    run = subprocess.Popen(  # noqa: S603 - our own program
        (
            sys.executable,
            "-c",
            SAYS_WHEN_IT_TAKES_INTERRUPTS,
            "run",
            plan_file,
            "-o",
            tmp_path / "r",
        ),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert run.stdout is not None
    assert run.stdout.read(2) == b"up"
    time.sleep(delay)
    run.send_signal(signal.SIGINT)
    _, err = run.communicate(timeout=60)
    assert run.returncode == 130
    assert len(err.splitlines()) <= 1


def test_an_interrupt_of_generated_code_ends_with_the_same_status(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(INTERRUPTED_IN_GENERATED_CODE)
    run = subprocess.run((sys.executable, "-m", "program"), cwd=tmp_path, check=False)
    assert run.returncode == 130


class Finalised:
    """Object with an interrupt during its finalisation."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_that_python_drops_ends_the_block_all_the_same(
    capsys: pytest.CaptureFixture[str],
) -> None:
    passed = []

    def work() -> None:
        with interruptible(lambda: "stopped") as refuse_lost:
            Finalised()
            passed.append("the exception was dropped")
            refuse_lost()
            passed.append("never")

    with pytest.raises(typer.Exit) as left:
        work()
    assert passed == ["the exception was dropped"]
    assert left.value.exit_code == 130
    assert capsys.readouterr().err.endswith("stopped\n")


def test_an_interrupt_waits_for_a_module_that_is_being_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An interrupt during the import of a compiled module caused a crash or a failed import."""
    source = "import signal\nsignal.raise_signal(signal.SIGINT)\nloaded = True\n"
    (tmp_path / "interrupted_module.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    loaded = []

    def work() -> None:
        with interruptible(lambda: ""):
            loaded.append(importlib.import_module("interrupted_module").loaded)
            time.sleep(60.0)

    with pytest.raises(typer.Exit) as left:
        work()
    assert loaded == [True]
    assert left.value.exit_code == 130


def test_handlers_are_as_before_afterwards() -> None:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    with interruptible(lambda: ""):
        assert [signal.getsignal(number) for number in numbers] != before
    assert [signal.getsignal(number) for number in numbers] == before


def test_keys_of_a_closed_terminal_are_listened_to_no_more() -> None:
    with closed_terminal() as stream, Keys(stream) as keys:
        keys.listening = True
        assert keys.awaited(1.0) == ""
        assert not keys.listening


@contextmanager
def closed_terminal() -> Iterator[object]:
    master, slave = pty.openpty()
    with os.fdopen(slave, "r") as stream:
        os.close(master)
        yield stream
