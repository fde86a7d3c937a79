"""`hil try`: short complete run, interrupted run, and careless use."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import time
import webbrowser
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

import pytest
from live_page import PUSH, STOP, Served, events, watching
from unpacked import unpacked

from checked_files.yaml_file import load_yaml
from hil.cli import try_plans, trying
from hil.live.listener import Listener
from hil.results.model import Model
from hil.results.watch import NAME, Watched
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

    from hil.model.robot import Robot
    from hil.planning.plan import Plan

PUSHED = json.dumps({"torque": [0.0, 350.0, 0.0, 0.0, 0.0, 0.0], "lasts": 0.5})


class Visitor(Thread):
    """Client of the page that pushes axis 2 when asked."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.page = Served(Listener("", ""), url=f"http://127.0.0.1:{port}/")
        self.lines: list[dict[str, Any]] = []
        self.watches = Event()
        self.report: Any = None

    def run(self) -> None:
        while True:
            try:
                connection = watching(self.page.port)
                break
            except ConnectionRefusedError:
                time.sleep(0.05)
        with connection:
            for line in events(connection):
                self.lines.append(line)
                self.watches.set()
                if line["kind"] == "report":
                    self.report = self.page.ask("GET", "/report")
                    return  # the end of the process closes the page
                if line.get("text") == "Push the arm: drag a link":
                    Thread(target=self._push, daemon=True).start()

    def _push(self) -> None:
        time.sleep(2.0)
        while not any(line["kind"] in ("alarm", "report") for line in self.lines):
            self.page.ask("POST", "/push", PUSH, PUSHED)
            time.sleep(1.5)

    def select(self, kind: str) -> list[dict[str, Any]]:
        return [line for line in self.lines if line["kind"] == kind]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


def test_it_measures_identifies_predicts_and_is_pushed(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(try_plans, "SHARE", 0.26)
    monkeypatch.setattr(trying, "LEARNING", 8.0)
    monkeypatch.setattr(trying, "LONGEST", 0.0)  # no second motion
    folder, visitor = tmp_path / "all", Visitor(free_port())
    plan = try_plans.measured_plan

    def plan_once_watched(robot: Robot) -> Plan:
        assert visitor.watches.wait(30)  # a page opened later gets only the latest headline
        return plan(robot)

    monkeypatch.setattr(try_plans, "measured_plan", plan_once_watched)
    visitor.start()
    call = ("try", "--no-browser", "--live", visitor.page.port, "-o", folder)
    status, out, err = hil(*call, "--speed", 1000, "--push", 12)
    visitor.join(30)
    assert (status, err) == (0, "")
    assert f"continue with: hil report {folder / 'measured'}" in out

    heads = [line["text"] for line in visitor.select("headline")]
    asked = ["Planning", "Checking the drives", "Identifying", "Identified", "Learning", "Push the"]
    assert [each for each in asked if not any(head.startswith(each) for head in heads)] == []
    assert all(line["more"] for line in visitor.select("headline")[:3])
    assert any(re.match(r"Push found: axis 2, \d+ N m", head) for head in heads), heads
    assert heads[-1].startswith("Done: ")
    first, second = visitor.select("start")
    assert [each["watched"] for each in (first, second)] == [False, True]
    assert [each["hand"] for each in (first, second)] == [False, True]
    learned = next(k for k, line in enumerate(visitor.lines) if line.get("text", "")[:4] == "Push")
    closed = [line["closed"] for line in visitor.lines[:learned] if line["kind"] == "hand"]
    assert closed[0].startswith("The arm can be pushed once")
    assert closed[-2:] == ["Do not push yet: a push now would count as scatter of the torques", ""]
    status, _, text = visitor.report
    assert (status, (folder / "measured" / "report.html").read_text()) == (200, text)
    assert any(each.startswith("hil run") for each in visitor.select("report")[0]["commands"])
    assert visitor.select("off")

    estimates = [line["parameters"] for line in visitor.select("estimate")]
    assert len(estimates) > 2
    last = [row["share"] for row in estimates[-1]]
    assert all(share < 5e-3 for share in last)
    assert all(
        now <= (before or 1.0) * 2
        for now, before in zip(last, (row["share"] for row in estimates[0]), strict=True)
    )
    torques = [line for line in visitor.select("torque") if len(line["axes"]) == 6]
    times = [t for line in torques for t in unpacked(line["torque"][0]["time"])]
    assert times == sorted(times)
    assert times[-1] - times[0] > 15.0

    alarms = visitor.select("alarm")
    assert alarms[0]["axis"] == 1
    assert alarms[0]["threshold"] < alarms[0]["torque"] < 1.25 * 350
    found = load_yaml(folder / "pushed" / NAME, Watched)
    assert found.alarms[0].peak == pytest.approx(350, rel=0.25)
    assert [each.axis for each in found.alarms] == [each["axis"] + 1 for each in alarms]
    model = Model.load(folder / "measured")
    assert model.provenance.measurements == first["measurements"] < 47
    motions = Run.open(folder / "pushed" / "run")
    assert (motions.ids, len(motions.missing)) == (("motion-1",), 1)
    said = trying._confirm(model, next(iter(motions)))
    shares = re.fullmatch(
        r"residual (\S+) % of the torque on a new motion, (\S+) % on the earlier ones; ", said
    )
    assert shares
    assert float(shares[1]) > float(shares[2])  # the arm was pushed in the new motion
    assert not any("on a new motion" in head for head in heads)


class Tried:
    """`hil try` as a process, in a folder."""

    def __init__(self, where: Path, *options: str) -> None:
        self.process = subprocess.Popen(  # noqa: S603 - our own program
            [sys.executable, "-m", "hil", "try", "--no-browser", *options],
            cwd=where, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stdout
        said = self.process.stdout.readline()
        found = re.fullmatch(r"live page: (http://127\.0\.0\.1:\d+/)\n", said)
        assert found, said + self.process.communicate()[1]
        self.page = Served(Listener("", ""), url=found[1])

    def wait_for_recordings(self, folder: Path, number: int) -> None:
        while len(list(folder.glob("recordings/*.h5"))) < number:
            assert self.process.poll() is None, self.process.communicate()
            time.sleep(0.01)

    def ended(self) -> str:
        """Wait for the end; return the final message."""
        _, err = self.process.communicate(timeout=60)
        assert self.process.returncode == 130
        assert "Traceback" not in err
        return err


def test_it_is_stopped_from_the_page_and_by_ctrl_c_and_two_at_once_keep_apart(
    tmp_path: Path,
) -> None:
    one, other = Tried(tmp_path, "--speed", "200"), Tried(tmp_path, "--speed", "200")
    first, second = tmp_path / "runs" / "try", tmp_path / "runs" / "try-2"
    one.wait_for_recordings(first / "measured", 2)
    other.wait_for_recordings(second / "measured", 1)
    with watching(one.page.port) as page:
        assert one.page.ask("POST", "/stop", STOP)[0] == 202
        *_, last = events(page)
    other.process.send_signal(signal.SIGINT)
    assert (last["kind"], last["how"]) == ("end", "stopped")
    assert "the axes are off" in one.ended()
    assert "the axes are off" in other.ended()
    for folder in (first, second):
        session = Run.open(folder / "measured").journal.sessions[0]
        assert session.reason == "interrupted by the operator"


def test_it_ends_with_its_page(tmp_path: Path) -> None:
    tried = Tried(tmp_path)
    with watching(tried.page.port) as page:
        next(events(page))
    assert "the axes are off" in tried.ended()


def test_a_port_that_is_taken_and_a_folder_that_exists_are_refused(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        status, _, err = hil("try", "--no-browser", "--live", port)
    assert status == 1
    assert f"cannot be served on port {port}" in err
    assert "--live" in err
    assert list((tmp_path / "runs").iterdir()) == []
    (tmp_path / "mine").mkdir()
    status, _, err = hil("try", "--no-browser", "-o", "mine")
    assert (status, "mine" in err) == (1, True)
    (tmp_path / "file").write_text("")
    status, _, err = hil("try", "--no-browser", "-o", tmp_path / "file" / "run")
    assert status == 1
    for wrong in (("--live", "70000"), ("--speed", "0"), ("--push", "0"), ("plan.yaml",)):
        assert hil("try", "--no-browser", *wrong)[0] == 2


def test_a_browser_opens_where_there_is_a_screen_and_a_terminal_is_left_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert not trying._open_browser(["live page: http://127.0.0.1:1234/"])
    time.sleep(0.1)
    assert opened == []
    monkeypatch.setenv("DISPLAY", ":0")
    assert trying._open_browser(["live page: http://127.0.0.1:1234/"])
    while not opened:
        time.sleep(0.01)
    assert opened == ["http://127.0.0.1:1234/"]
