"""Watched run from the command line: stopped from the page, otherwise undisturbed."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, NamedTuple

import pytest
from live_page import STOP, Served, events, watching

from hil.live.listener import Listener
from hil.planning.plan import dump_plan, repeat_measurements
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    import socket

    from hil.planning.plan import Plan

PAGES = 50
ROUNDS = 5


class Run(NamedTuple):
    """Running process of a run, and its page."""

    process: subprocess.Popen[str]
    page: Served

    def server(self) -> int:
        """Return the process that serves the page."""
        return self.find_process("hil.live.page_server")

    def find_process(self, module: str) -> int:
        """Return the process that executes a module beside the run."""
        number = self.process.pid
        children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
        found = [each for each in children if module in Path(f"/proc/{each}/cmdline").read_text()]
        assert len(found) == 1
        return int(found[0])


@pytest.fixture
def plan_file(tmp_path: Path, small_plan: Plan) -> Path:
    """Plan of some rounds of the small plan."""
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(repeat_measurements(small_plan, ROUNDS)))
    return path


def start(plan_file: Path, folder: Path, *options: str, before: tuple[str, ...] = ()) -> Run:
    command = (sys.executable, "-m", "hil", "run", plan_file, "-o", folder, "--live", "0")
    run = subprocess.Popen(  # noqa: S603 - our own program
        [*before, *command, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert run.stdout
    said = run.stdout.readline()
    found = re.fullmatch(r"live page: (http://127\.0\.0\.1:\d+/)\n", said)
    assert found, said
    return Run(run, Served(Listener("", ""), url=found[1]))


def wait_for_recordings(folder: Path, number: int, run: Run) -> None:
    while len(list(folder.glob("recordings/*.h5"))) < number:
        assert run.process.poll() is None, run.process.communicate()
        time.sleep(0.005)


def read_all(connection: socket.socket, ends: list[str]) -> None:
    *_, last = events(connection)
    ends.append(f"{last['kind']} {last.get('how')}")


def test_a_stop_from_the_page_is_that_of_the_operator_and_the_run_is_resumed(
    plan_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    run = start(plan_file, folder)
    wait_for_recordings(folder, 3, run)
    with watching(run.page.port) as page:
        assert run.page.ask("POST", "/stop", STOP)[0] == 202
        *_, last = events(page)
    _, err = run.process.communicate(timeout=60)
    assert run.process.returncode == 130
    assert f"stopped, the axes are off; recordings so far are in {folder}" in err
    assert (last["kind"], last["how"]) == ("end", "stopped")
    broken = RunFolder.open(folder)
    assert 3 <= len(list(broken)) < 3 * ROUNDS
    assert broken.journal.sessions[0].reason == "interrupted by the operator"

    again = start(plan_file, folder, "--resume")
    _, err = again.process.communicate(timeout=120)
    assert (again.process.returncode, err) == (0, "")
    assert RunFolder.open(folder).missing == ()


def test_a_stop_from_the_page_works_where_ctrl_c_is_ignored(
    plan_file: Path, tmp_path: Path
) -> None:
    """Background jobs of a script ignore Ctrl-C."""
    ignoring = ("sh", "-c", "trap '' INT; exec \"$@\"", "sh")
    run = start(plan_file, tmp_path / "run", before=ignoring)
    wait_for_recordings(tmp_path / "run", 1, run)
    assert run.page.ask("POST", "/stop", STOP)[0] == 202
    _, err = run.process.communicate(timeout=60)
    assert run.process.returncode == 130
    assert "stopped, the axes are off" in err


def test_fifty_pages_one_that_never_reads_and_a_killed_server_disturb_nothing(
    plan_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    run = start(plan_file, folder)
    pages = [watching(run.page.port) for _ in range(PAGES)]
    deaf = watching(run.page.port)
    ends: list[str] = []
    threads = [Thread(target=read_all, args=(page, ends)) for page in pages]
    for thread in threads:
        thread.start()
    wait_for_recordings(folder, 2 * ROUNDS, run)
    os.kill(run.server(), signal.SIGKILL)
    out, err = run.process.communicate(timeout=120)
    for thread in threads:
        thread.join()
    for page in (*pages, deaf):
        page.close()
    assert (run.process.returncode, err) == (0, "")
    assert out.count("the live page has ended; the run continues without it") == 1
    assert len(ends) == PAGES
    finished = RunFolder.open(folder)
    assert finished.missing == ()
    assert [session.reason for session in finished.journal.sessions] == ["finished"]


def test_a_run_is_identified_beside_it_to_its_last_recording(
    plan_file: Path, tmp_path: Path
) -> None:
    run = start(plan_file, tmp_path / "run")
    with watching(run.page.port) as page:
        *lines, last = events(page)
    out, err = run.process.communicate(timeout=120)
    assert (run.process.returncode, err) == (0, "")
    assert "by itself" not in out
    estimates = [line for line in lines if line["kind"] == "estimate"]
    assert estimates[-1]["recordings"] == 3 * ROUNDS
    assert len(estimates[-1]["parameters"]) == 14
    assert (last["kind"], last["how"]) == ("end", "finished")


def test_a_killed_estimate_disturbs_nothing(plan_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run = start(plan_file, folder)
    wait_for_recordings(folder, 1, run)
    os.kill(run.find_process("hil.live.estimator"), signal.SIGKILL)
    out, err = run.process.communicate(timeout=120)
    assert (run.process.returncode, err) == (0, "")
    assert out.count("the estimation during the run has ended") == 1
    assert RunFolder.open(folder).missing == ()


def test_a_server_that_hangs_disturbs_nothing(plan_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run = start(plan_file, folder)
    os.kill(run.server(), signal.SIGSTOP)
    _, err = run.process.communicate(timeout=120)
    assert (run.process.returncode, err) == (0, "")
    assert RunFolder.open(folder).missing == ()


def test_the_page_ends_with_a_run_that_is_killed(plan_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run = start(plan_file, folder)
    wait_for_recordings(folder, 1, run)
    with watching(run.page.port) as page:
        got = events(page)
        next(got)
        run.process.kill()
        run.process.communicate(timeout=60)
        *_, last = got
    assert (last["kind"], last["how"]) == ("end", "lost")
