"""Count the work of whole commands and compare it with bounds: a gate for speed without a clock.

Commands run in fresh processes, on a small plan and a small foreign recording. Apart from effects
of rounding, each count is equal in every run, on every machine and under every Python:

    regressor rows    samples times joints for which columns of base parameters are calculated
    torque samples    samples for which inverse dynamics are calculated
    filtered samples  samples times columns through the low-pass and its derivatives
    CAN messages      created message objects of python-can
    compiled          loaded functions of Numba
    bytes read        bytes of data sets and of files in the folder of the commands
    peak memory       memory of Python and NumPy without imported modules [bytes]
    own calls         calls of functions in this repository's packages

A count may differ by `TOLERANCE` from the kept count in ``tools/counts.json``. That file also has
the calls of each function, so that a failure names the functions with the largest increase. Counts
do not show a slower kernel. Therefore kernels and a fixed NumPy operation are timed in turns; on
the processor of the kept ratios, a ratio may be at most `SLOWER` times the kept one::

    python tools/counts.py          compare; exit status 1 if a count is out of bounds
    python tools/counts.py --keep   write tools/counts.json anew; the commit states why
"""

from __future__ import annotations

import _frozen_importlib
import argparse
import cProfile
import json
import math
import os
import platform
import pstats
import shutil
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

if TYPE_CHECKING:
    from collections.abc import Callable


def processor() -> str:
    """Return name, family and model of the processor."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.exists() else []
    stated = dict(reversed([[part.strip() for part in line.partition(":")[::2]] for line in lines]))
    named = [stated[key] for key in ("model name", "cpu family", "model") if key in stated]
    return ", ".join(named) or platform.processor() or platform.machine()


HERE = Path(__file__).resolve().parents[1]
KEPT = Path(__file__).with_suffix(".json")
OWN = ("hil", "drivers", "sim_plant", "checked_files")
COMMANDS = {
    "plan": ("plan", "manutec-r15", "-o", "plan.yaml", "--gravity", "4", "--inertia", "14",
             "--coupling", "3"),
    "dry-run": ("dry-run", "plan.yaml"),
    "run": ("run", "plan.yaml", "-o", "run"),
    "short run": ("run", "short.yaml", "-o", "short"),
    "identify": ("identify", "run"),
    "report": ("report", "run"),
    "import": ("import", "map.yaml", "-o", "imported"),
    "identify import": ("identify", "imported"),
}  # fmt: skip
SHORT = 3
"""Number of measurements of the short run, the only run with traced memory: tracing makes a run 2.5
times as long."""
INDEPENDENT = ("run", "dry-run", "import", "short run")
FOLLOWING = {"identify import": "import", "identify": "run", "report": "identify"}
"""Commands that need the files of another command."""
KERNELS = "kernels"
BEGIN = "counted: "
"""Separator between the output of a command and its counts."""
TOLERANCE = 0.02
OBJECTS = 1_000_000
"""Tolerance of the peak memory: difference between versions of Python [bytes]."""
PYTHON = "{}.{}".format(*sys.version_info)
"""Version of Python; own calls are compared only under the version of the kept counts."""
PROCESSOR = processor()
"""Processor; kernels are compared only on the processor of the kept ratios."""
SLOWER = 1.3
LISTED = 1e-3
"""Minimum share of a function in a command's own calls, for the list of kept calls."""
TURNS = 25
"""Number of timings of a kernel and of its NumPy operation; the shortest ones count."""
ATTEMPTS = 8
"""Attempts before a kernel is judged too slow: other processes disturb some attempts."""
SHOWN = 5
"""Maximum number of functions named by a failure."""
LIBRARIES = {
    ("can", "message.py", "__init__"): "CAN messages",
    ("core", "caching.py", "load_overload"): "compiled",
    ("core", "caching.py", "save_overload"): "compiled anew",
}
"""Counted calls of other packages: name of the count by folder, file and function."""
NO_FUNCTIONS = ("<listcomp>", "<dictcomp>", "<setcomp>", "<module>")
"""Names of code objects that are functions only in some versions of Python, or module bodies."""


class Work:
    """Counters of the work in this process, filled by wrappers of functions."""

    def __init__(self, folder: Path) -> None:
        self.counts: Counter[str] = Counter()
        self._folder = folder.resolve()
        self._before = 0

    def watch_memory(self) -> None:
        """Trace allocations, except during the import of modules."""
        find = _frozen_importlib._find_and_load

        def importing(*arguments: Any) -> Any:
            if not tracemalloc.is_tracing():
                return find(*arguments)
            self._before = self.highest()
            tracemalloc.stop()  # tracing imports would take longer than the whole command
            try:
                return find(*arguments)
            finally:
                tracemalloc.start()

        _frozen_importlib._find_and_load = importing
        tracemalloc.start()

    def highest(self) -> int:
        """Update the count by the peak since the last import; return the allocated memory."""
        now, peak = (self._before + size for size in tracemalloc.get_traced_memory())
        self.counts["peak memory"] = max(self.counts["peak memory"], peak)
        return now

    def watch_calls(self) -> None:
        """Wrap the counted functions for calculating, filtering and reading."""
        from h5py._hl.dataset import Dataset  # noqa: PLC0415 - traced as what commands import

        from hil.least_squares import window  # noqa: PLC0415
        from hil.model import dynamics  # noqa: PLC0415

        self._count(dynamics, "regressors", "regressor rows", lambda made: sum(
            A[..., 0].size for A in made))  # fmt: skip
        self._count(dynamics, "_torques", "torque samples", lambda made: sum(
            tau[..., 0].size for tau in made))  # fmt: skip
        self._count(window, "correlate", "filtered samples", lambda made: made.size)
        self._count(window, "smooth_at", "filtered samples", lambda made: made.size)
        self._count(Dataset, "__getitem__", "bytes read", lambda made: getattr(made, "nbytes", 0))
        sys.addaudithook(self._opened)

    def _count(self, owner: Any, name: str, what: str, size: Callable[[Any], int]) -> None:
        plain = getattr(owner, name)

        def counting(*arguments: Any, **named: Any) -> Any:
            made = plain(*arguments, **named)
            self.counts[what] += size(made)
            return made

        setattr(owner, name, counting)

    def _opened(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str) and "r" in (arguments[1] or ""):
            path = Path(arguments[0]).resolve()
            if path.is_relative_to(self._folder) and path.is_file():
                self.counts["bytes read"] += path.stat().st_size


def count(command: str) -> dict[str, Any]:
    """Run a command of `hil` in this process, in the current folder; return its counts."""
    work = Work(Path.cwd())
    if command != "run":
        work.watch_memory()
    work.watch_calls()
    from hil.__main__ import main  # noqa: PLC0415 - after the functions are wrapped

    sys.argv = ["hil", *COMMANDS[command]]
    profile = cProfile.Profile(builtins=False)
    try:
        profile.enable()
        main()
    except SystemExit as ended:
        if ended.code not in (None, 0):
            raise
    finally:
        profile.disable()
    if tracemalloc.is_tracing():
        work.highest()
    calls: Counter[str] = Counter()
    for (file, _, name), (_, n, *_) in pstats.Stats(profile).stats.items():
        path = Path(file)
        if what := LIBRARIES.get((path.parent.name, path.name, name)):
            work.counts[what] += n
        elif path.is_relative_to(HERE) and name not in NO_FUNCTIONS:
            part = path.relative_to(HERE)
            if part.parts[0] in OWN:
                calls[f"{part}:{name}"] += n
    work.counts["own calls"] = calls.total()
    return {"counts": dict(work.counts), "calls": dict(calls)}


def count_all() -> dict[str, Any]:
    """Count every command in a separate process, two at a time."""
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        folder = Path(name)
        write_recording(folder)
        found = {"plan": _counted(folder, "plan")}
        write_short_plan(folder)
        begun = {each: pool.submit(_counted, folder, each) for each in INDEPENDENT}
        for each, needed in FOLLOWING.items():
            begun[needed].result()
            begun[each] = pool.submit(_counted, folder, each)
        found |= {each: counted.result() for each, counted in begun.items()}
    return {each: found[each] for each in COMMANDS}


def _counted(folder: Path, name: str) -> dict[str, Any]:
    """Count a command; repeat the count if the first call has compiled functions."""
    found, arguments = _count_in_process(folder, name), COMMANDS[name]
    if found["counts"].pop("compiled anew", 0):
        if "-o" in arguments:
            made = folder / arguments[arguments.index("-o") + 1]
            shutil.rmtree(made) if made.is_dir() else made.unlink()
        found = _count_in_process(folder, name)
    return found


def write_short_plan(folder: Path) -> None:
    """Write a plan of the first measurements of the plan."""
    plan = yaml.safe_load((folder / "plan.yaml").read_text())
    plan["measurements"] = plan["measurements"][:SHORT]
    (folder / "short.yaml").write_text(yaml.safe_dump(plan, sort_keys=False))


def write_recording(folder: Path) -> None:
    """Write a foreign recording of two axes, with its map and robot."""
    sys.path.insert(0, str(HERE / "tests" / "support"))
    import small_recording  # noqa: PLC0415 - of the tests

    small_recording.write_csv(folder / "data.csv", small_recording.table(duration=20.0))
    small_recording.write_map(folder, small_recording.a_map())


def _count_in_process(folder: Path, name: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, __file__, "--command", name],
        cwd=folder, env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(HERE)},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"{name}: ends with {done.returncode}: {done.stderr}")
    counted: dict[str, Any] = json.loads(done.stdout[done.stdout.rindex(BEGIN) + len(BEGIN) :])
    return counted


def timed() -> dict[str, float]:
    """Return the ratio of each kernel's shortest time to that of a fixed NumPy operation.

    Kernel and operation are similar in kind and size, so that other load on memory, caches and
    cores slows both alike. On a second machine with an equal processor name, the ratio of a filter
    with many short calls to square roots of a long array was 1.7 times as large.
    """
    from hil import Robot, regressor  # noqa: PLC0415 - commands import what they need
    from hil.estimation.free_motion.accumulation import Groups  # noqa: PLC0415
    from hil.least_squares.window import smooth, weights  # noqa: PLC0415
    from sim_plant.plant import load_plant  # noqa: PLC0415

    robot, random = Robot.load("manutec-r15"), np.random.default_rng(0)
    q, qd, qdd = random.uniform(-2.0, 2.0, (3, 1024, robot.n_joints))  # fits a core's cache
    rows = regressor(robot, q, qd, qdd).reshape(-1, 14)
    groups, n = Groups.empty(8, 1, 14), len(rows)
    of, speed = random.integers(8, size=n), random.integers(len(groups.counts), size=n)
    plant, x = load_plant("manutec-r15"), np.linspace(0.0, 1.0, 1 << 16)
    period, ones = 0.004, np.ones(14)
    tasks: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
        "regressor": (
            lambda: regressor(robot, q, qd, qdd),
            lambda: np.multiply.outer(np.sin(q), ones),
        ),
        "low-pass": (
            lambda: smooth(qd, period),
            lambda: np.correlate(qd.ravel(), weights(period), mode="valid"),
        ),
        "inner products": (
            lambda: groups.add(0, rows, of, speed),
            lambda: rows.T @ rows[np.argsort(of, kind="stable")],
        ),
        "plant step": (lambda: plant.advance(0.4), lambda: np.sin(x)),
    }
    return {name: round(_ratio(*both), 3) for name, both in tasks.items()}


def _ratio(task: Callable[[], object], fixed: Callable[[], object]) -> float:
    least = [math.inf, math.inf]
    for _ in range(TURNS):
        for which, each in enumerate((task, fixed)):
            begun = time.perf_counter()
            each()
            least[which] = min(least[which], time.perf_counter() - begun)
    return least[0] / least[1]


def compare(found: dict[str, Any], kept: dict[str, Any], python: str = PYTHON) -> list[str]:
    """Return a line for each command with counts out of bounds, with the most increased calls."""
    failures = []
    for name in COMMANDS:
        before, now = kept[name], found[name]
        off = []
        for what in sorted({*before["counts"], *now["counts"]}):
            is_, was = now["counts"].get(what, 0), before["counts"].get(what, 0)
            slack = max(TOLERANCE * was, OBJECTS if what == "peak memory" else 0.0)
            if abs(is_ - was) > slack and not (what == "own calls" and python != PYTHON):
                low, high = was - slack, was + slack
                off.append(f"{what} {is_:,}, must be {low:,.0f} to {high:,.0f}")
        if off:
            rare = round(LISTED * before["counts"]["own calls"])
            grown = {key: n - before["calls"].get(key, rare) for key, n in now["calls"].items()}
            most = sorted(grown, key=grown.__getitem__, reverse=True)[:SHOWN]
            shown = ", ".join(f"{key} {grown[key]:+,}" for key in most if grown[key] > 0)
            failures.append(
                f"hil {name}: {'; '.join(off)}; calls that grew most: {shown or 'none'}"
            )
    return failures


def too_slow() -> list[str]:
    """Return a line for each kernel slower than its bound in all `ATTEMPTS`."""
    stated, least = json.loads(KEPT.read_text()), dict[str, float]()
    kept = stated["kernels"]
    if stated["processor"] != PROCESSOR:
        sys.stdout.write(f"kernels were timed on another processor, {stated['processor']}\n")
        return []
    for _ in range(ATTEMPTS):
        found = _count_in_process(HERE, KERNELS)
        least = {name: min(ratio, least.get(name, ratio)) for name, ratio in found.items()}
        if all(least[name] <= SLOWER * kept[name] for name in kept):
            return []
    return [
        f"{name}: {least[name]:.2f} times its NumPy operation, at most {SLOWER * kept[name]:.2f}"
        for name in kept if least[name] > SLOWER * kept[name]
    ]  # fmt: skip


def main() -> None:
    """Compare the counts with the kept counts, or keep the present counts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--keep", action="store_true", help="write tools/counts.json anew")
    parser.add_argument("--command", choices=(*COMMANDS, KERNELS), help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.command:
        kernels = asked.command == KERNELS
        found = timed() if kernels else count(asked.command)
        sys.stdout.write(BEGIN + json.dumps(found))
        return
    found = count_all()
    if asked.keep:
        for counted in found.values():
            total = counted["counts"]["own calls"]
            calls = sorted(counted["calls"].items())
            counted["calls"] = {key: n for key, n in calls if n > LISTED * total}
        kernels = _count_in_process(HERE, KERNELS)
        kept = {"python": PYTHON, "processor": PROCESSOR, "commands": found, "kernels": kernels}
        KEPT.write_text(json.dumps(kept, indent=1) + "\n")
        return
    before = json.loads(KEPT.read_text())
    failures = compare(found, before["commands"], before["python"]) + too_slow()
    if failures:
        remedy = "make it cheaper, or keep the new counts and state why in the commit:"
        sys.exit("\n".join([*failures, f"{remedy} python tools/counts.py --keep"]))


if __name__ == "__main__":
    main()
