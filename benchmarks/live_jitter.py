"""SYNC of `hil run` without a live page, with one, with 50, and with 200 hostile connections.

Plant, run, page and observers are separate processes, on a local channel, at 250 Hz. The plant
represents drives, which are never late, so it has the real-time class. The cases are measured in
turn, because the load of a computer varies. The last lines state the time from a stop by the page,
and from Ctrl-C, until the axes are off. Options go to `hil run`, as --realtime::

    python benchmarks/live_jitter.py [TURNS] [OPTION ...]
"""

from __future__ import annotations

import http.client
import multiprocessing
import os
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlsplit

import numpy as np
from figures import Figure, keep
from plant_process import plant

from hil.model.robot import ROBOTS, Robot
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, PlannedRobot, dump_plan
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

INTERFACE, CHANNEL = "local", f"live-jitter-{os.getpid()}"
PAGES, HOSTILE = 50, 200
PERIOD = 0.004
HEARTBEAT = "heartbeat_timeout: 0.5"
BY_PAGE, BESIDE, CTRL_C = "stop-from-page", "stop-beside-200-hostile", "stop-by-ctrl-c"
MOTION = 2.0
"""Duration of the motion before a stop [s]."""
KEPT = {
    "rms": ("ms", 2), "99-percent": ("ms", 2), "99-9-percent": ("ms", 2), "worst": ("ms", 2),
    "left-out": ("", 2), "syncs": ("", 4),
}  # fmt: skip
"""Units and digits of the values of `_figures`."""


class Case(NamedTuple):
    """Options of `hil run`, and a function that opens browsers at the address of its page."""

    options: tuple[str, ...] = ()
    follow: Callable[[str], None] | None = None


def make_plan() -> Plan:
    """Return a plan of about 25 s of strokes."""
    robot = Robot.load("manutec-r15")
    place = (0.0, -0.3, 0.2, 0.0, 0.5, 0.0)
    strokes = {"axis": 2, "q": place, "stroke": 0.4, "velocity": 0.4, "acceleration": 8.0}
    return Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        sample_period=PERIOD,
        attempts=1,
        measurements=tuple(Gravity(id=f"g{k}", cycles=3, **strokes) for k in range(3)),
    )


def patient_drives(path: Path) -> Path:
    """Write the robot's drives file with a heartbeat slow enough for a busy computer."""
    text = (ROBOTS / "manutec-r15.drives.yaml").read_text(encoding="utf-8")
    assert HEARTBEAT in text
    path.write_text(text.replace(HEARTBEAT, "heartbeat_timeout: 2.0\nsdo_timeout: 5.0"))
    return path


@contextmanager
def run(plan: Path, folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Start a run on a fresh plant; yields the process and the address of the live page."""
    place = ("--interface", INTERFACE, "--channel", CHANNEL)
    command = (sys.executable, "-m", "hil", "run", plan, "-o", folder, *place, *options)
    pipe = subprocess.PIPE
    shown = {"--live", "--foxglove"} & {*options}
    with (
        plant(INTERFACE, CHANNEL),
        subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process,
    ):
        yield process, said(process, r"\w+://\S+") if shown else ""


def said(process: subprocess.Popen[str], what: str) -> str:
    """Wait for a printed text of a run; return it."""
    assert process.stdout is not None
    for line in process.stdout:
        if found := re.search(what, line):
            return found[0]
    raise AssertionError(process.communicate()[1])


def watch(url: str, pages: int) -> None:
    """Read the events of a run to its end, as a number of pages."""
    parts = urlsplit(url)
    request = f"GET /events HTTP/1.0\r\nHost: {parts.netloc}\r\n\r\n".encode()
    readers = []
    for _ in range(pages):
        reader = socket.create_connection((parts.hostname, parts.port))
        reader.sendall(request)
        readers.append(reader)
    while readers:
        for reader in select.select(readers, [], [])[0]:
            if not reader.recv(65536):
                readers.remove(reader)


def drip(url: str, connections: int) -> None:
    """Hold connections; send a byte of a request on each ten times a second, without end."""
    parts = urlsplit(url)
    address, held = (parts.hostname or "", parts.port or 80), list[socket.socket]()
    while True:
        try:
            while len(held) < connections:
                held.append(socket.create_connection(address))
        except ConnectionRefusedError:
            return
        for each in list(held):
            try:
                each.send(b"X")
            except OSError:  # connection closed in favour of a newer one
                held.remove(each)
                each.close()
        time.sleep(0.1)


LIVE = ("--live", "0")
CASES = {
    "no page": Case(),
    "one page": Case(LIVE, partial(watch, pages=1)),
    f"{PAGES} pages": Case(LIVE, partial(watch, pages=PAGES)),
    f"{HOSTILE} hostile": Case(LIVE, partial(drip, connections=HOSTILE)),
}


def measured(plan: Path, folder: Path, case: Case, options: Sequence[str]) -> Array:
    """Return the errors of the SYNC periods, NaN for omitted SYNCs [s]."""
    with run(plan, folder, *case.options, *options) as (process, url):
        follower = None
        if case.follow is not None:
            spawn = multiprocessing.get_context("spawn")
            follower = spawn.Process(target=case.follow, args=(url,))
            follower.start()
        _, errors = process.communicate()
        assert process.returncode == 0, errors
        if follower is not None:
            follower.join()
            assert follower.exitcode == 0, "who looked on has failed"
    steps = np.concatenate([np.diff(each.recording.time) for each in RunFolder.open(folder)])
    passed = np.maximum(1, np.rint(steps / PERIOD))
    left_out = np.full(int(passed.sum()) - len(steps), np.nan)
    return np.concatenate([np.abs(steps - passed * PERIOD), left_out])


@contextmanager
def prepared(*options: str) -> Iterator[tuple[Path, Path, tuple[str, ...]]]:
    """Make a plan; yields a folder, the plan's file, and the options of every run."""
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        os.environ["XDG_STATE_HOME"] = name  # folder with the drives' values before a run
        plan = scratch / "plan.yaml"
        plan.write_text(dump_plan(make_plan()))
        yield scratch, plan, ("--drives", str(patient_drives(scratch / "drives.yaml")), *options)


def show(jitter: Mapping[str, Sequence[Array]]) -> dict[str, Figure]:
    """Print and return the medians of all turns of each case; ratios are those to the first."""
    kept: dict[str, Figure] = {}
    first = np.array([_figures(off)[0] for off in next(iter(jitter.values()))])
    turns = len(next(iter(jitter.values())))
    print(f"SYNC off its period, median of {turns} turns [ms]")
    print(f"{'':<20}{'rms':>8}{'99 %':>8}{'99.9 %':>8}{'worst':>8}{'left out':>10}{'of SYNCs':>10}")
    for name, each in jitter.items():
        found = np.array([_figures(off) for off in each])
        figures = np.median(found, axis=0)
        cells = "".join(f"{figure:>8.2f}" for figure in figures[:4])
        print(f"{name:<20}{cells}{figures[4]:>10.0f}{figures[5]:>10.0f}")
        case = re.sub(r"\W+", "-", name)
        if kept:
            kept[f"{case}-rms-over-first"] = Figure.median(found[:, 0] / first)
        for (what, how), turn in zip(KEPT.items(), found.T, strict=True):
            kept[f"{case}-{what}"] = Figure.median(turn, *how)
    return kept


def stopped(plan: Path, folder: Path, options: Sequence[str], how: str) -> dict[str, float]:
    """Return the times from a stop in motion to the page's answer and to axes without power [s]."""
    took = dict[str, float]()
    with ExitStack() as open_until_off:
        process, url = open_until_off.enter_context(run(plan, folder, *LIVE, *options))
        parts = urlsplit(url)
        assert process.stderr is not None
        said(process, "measurements to do")
        if how == BESIDE:
            hostile = multiprocessing.get_context("spawn").Process(target=drip, args=(url, HOSTILE))
            hostile.start()
            open_until_off.callback(hostile.join)
        time.sleep(MOTION)
        begun = time.perf_counter()
        if how == CTRL_C:
            process.send_signal(signal.SIGINT)
        else:
            asked = http.client.HTTPConnection(parts.netloc)
            asked.request("POST", "/stop", headers={"X-Hil-Stop": "1"})
            assert asked.getresponse().status == http.client.ACCEPTED
            took[f"answer-to-{how}"] = time.perf_counter() - begun
        report = process.stderr.readline()
        assert "the axes are off" in report, (how, report, *process.communicate())
        return {how: time.perf_counter() - begun, **took}


def main(turns: int = 4, *options: str) -> None:
    """Measure in turns, then print and keep the figures."""
    jitter: dict[str, list[Array]] = {name: [] for name in CASES}
    stops = defaultdict[str, list[float]](list)
    with prepared(*options) as (scratch, plan, given):
        for turn in range(turns):
            for name, case in CASES.items():
                jitter[name].append(measured(plan, scratch / f"{turn}-{name}", case, given))
            for how in (BY_PAGE, BESIDE, CTRL_C):
                for name, took in stopped(plan, scratch / f"{turn}-{how}", given, how).items():
                    stops[name].append(took)
    kept = show(jitter)
    for name, took in stops.items():
        each = Figure.median(took, "s")
        print(f"{name}: {each.value:.3f} s (median of {turns}), {max(took):.3f} s at most")
        kept[name] = each
    keep(
        "live-jitter", kept, depends=("hil/live", "hil/measuring", "drivers/sync_clock.py"),
        command=" ".join(["python benchmarks/live_jitter.py", str(turns), *options]),
    )  # fmt: skip


def _figures(off: Array) -> tuple[float, ...]:
    """Return rms, two quantiles and maximum [ms]; numbers of omitted and of all SYNCs."""
    kept = 1e3 * off[np.isfinite(off)]
    rms = float(np.sqrt(np.mean(kept**2)))
    quantiles = map(float, np.quantile(kept, [0.99, 0.999, 1.0]))
    return rms, *quantiles, float(len(off) - len(kept)), float(len(off))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
