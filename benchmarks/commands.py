"""Processor time of the commands of a campaign, against an earlier commit of this repository.

Processor time (user and system) is that of whole processes, interpreter included. The earlier
commit is checked out into a temporary folder. Both versions take turns, so that other load affects
both; each measures, identifies and reports a separate campaign, since the format of run folders has
changed. The table has medians, their ratio and its bound, and for `hil run` the ratio of robot time
to wall time.

    python benchmarks/commands.py [--times 5] [--commit 43e224b5]
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from contextlib import contextmanager
from pathlib import Path
from statistics import median, pstdev
from typing import TYPE_CHECKING

from figures import Figure, keep
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Iterator

COMMIT = "43e224b5"
ROBOT = "manutec-r15"
PROMISED = {"dry-run": 0.25, "run": 0.35, "identify": 0.35, "report": 0.30}
"""Bound of the ratio of a command's processor time to that of the earlier commit."""
FIXED = {"OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
"""Environment of both versions: one thread, since threads would wait for each other on a busy
machine, and byte code written to disk.
"""
HERE = Path(__file__).resolve().parent.parent
ROBOT_TIME = re.compile(r"\((?:(\d+):)?(\d+):(\d+) of robot time")


class Version:
    """Checked-out commit, and the folder for the files of its commands."""

    def __init__(self, source: Path, place: Path) -> None:
        self._source = source
        self._plan = place / "plan.yaml"
        self._run = place / "run"
        place.mkdir()

    def command(self, name: str) -> list[str]:
        """Return the arguments of a command, with this version's own plan and run."""
        arguments: dict[str, list[str | Path]] = {
            "robot": [ROBOT],
            "plan": [ROBOT, "-o", self._plan],
            "dry-run": [self._plan],
            "run": [self._plan, "-o", self._run],
            "identify": [self._run],
            "report": [self._run],
        }
        return [name, *map(str, arguments[name])]

    def spent(self, name: str) -> tuple[float, str]:
        """Call a command; return its processor time [s] and its output."""
        if name == "plan":
            self._plan.unlink(missing_ok=True)
        if name == "run":
            shutil.rmtree(self._run, ignore_errors=True)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [sys.executable, "-P", "-m", "hil", *self.command(name)],
            cwd=self._source,
            env={**os.environ, **FIXED, "PYTHONPATH": str(self._source)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            sys.exit(f"hil {name} of {self._source}: {done.stderr}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


@contextmanager
def checked_out(commit: str, place: Path) -> Iterator[Path]:
    """Check a commit out into `place`; python-can finds only the buses of that commit."""
    git = ("git", "-C", str(HERE), "worktree")
    subprocess.run([*git, "add", "--quiet", "--detach", str(place), commit], check=True)
    try:
        _install(place)
        yield place
    finally:
        subprocess.run([*git, "remove", "--force", str(place)], check=True)


def _install(source: Path) -> None:
    """Write the metadata of entry points into the first folder of the module path."""
    project = tomllib.loads((source / "pyproject.toml").read_text())["project"]
    folder = source / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    lines = [
        line
        for group, entries in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {target}" for name, target in entries.items()))
    ]
    (folder / "entry_points.txt").write_text("\n".join(lines))


def main() -> None:
    """Measure in turns and print the table; exit status 1 for a broken bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--commit", default=COMMIT, help="what is compared with")
    asked = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as place,
        checked_out(asked.commit, Path(place) / "earlier") as earlier,
    ):
        versions = Version(earlier, Path(place) / "old"), Version(HERE, Path(place) / "new")
        spent = {
            name: time_in_turns(name, versions, asked.times)
            for name in ("robot", "plan", "dry-run")
        }
        runs = [[campaign(version) for version in versions] for _ in range(asked.times)]
        spent["run"] = [list(each) for each in zip(*runs, strict=True)]
        spent |= {
            name: time_in_turns(name, versions, asked.times) for name in ("identify", "report")
        }
    middle = {name: [median(each) for each in both] for name, both in spent.items()}
    show(middle, asked.commit)
    kept = {}
    for name, (before, now) in middle.items():
        scatter = pstdev(b / a for a, b in zip(*spent[name], strict=True)) or None
        kept[f"{name}-over-earlier"] = Figure(now / before, "times", scatter=scatter)
    depends = ("hil", "drivers", "sim_plant", "checked_files")
    command = f"python benchmarks/commands.py --times {asked.times} --commit {asked.commit}"
    keep("commands", kept, depends=depends, command=command)
    sys.exit(any(middle[name][1] > most * middle[name][0] for name, most in PROMISED.items()))


def time_in_turns(name: str, versions: tuple[Version, ...], times: int) -> list[list[float]]:
    """Return the processor times of a command by each version [s]."""
    spent: list[list[float]] = [[] for _ in versions]
    for turn in range(times + 1):  # the first call writes byte code and fills the disk's cache
        for version, each in zip(versions, spent, strict=True):
            seconds, _ = version.spent(name)
            if turn:
                each.append(seconds)
    return spent


def campaign(version: Version) -> float:
    """Measure the plan once, for identification and report; return its processor time [s]."""
    begun = time.perf_counter()
    seconds, printed = version.spent("run")
    wall = time.perf_counter() - begun
    hours, minutes, rest = (int(part or 0) for part in ROBOT_TIME.search(printed).groups())
    robot_time = 3600 * hours + 60 * minutes + rest
    print(f"hil run: {robot_time} s of robot time in {wall:.1f} s, {robot_time / wall:.0f} times")
    return seconds


def show(middle: dict[str, list[float]], commit: str) -> None:
    """Print medians and ratios beside their bounds."""
    table = Table("hil", f"{commit} [s]", "now [s]", "ratio", "promised at most")
    for name, (before, now) in middle.items():
        most = f"{PROMISED[name]:.3f}" if name in PROMISED else ""
        table.add_row(name, f"{before:.2f}", f"{now:.2f}", f"{now / before:.3f}", most)
    Console().print(table)


if __name__ == "__main__":
    main()
