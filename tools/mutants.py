"""Mutation test of critical code: insert one mistake at a time, count those that no test detects.

::

    python tools/mutants.py [WORD ...] [--list]

Each mistake is inserted into a copy of the checkout. There the tests for the changed file run until
one fails; that test must pass without the mistake. WORDs choose mutants by file or text. At most 2
of the 40 mutants may survive, else the exit status is 1; write the missing test for every survivor.
Takes half an hour on two cores. A mutant whose text no longer occurs in the code is an error:
replace the mutant.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

ROOT = Path(__file__).parents[1]
BESIDE = {
    "drivers/": ("tests/drivers",),
    "hil/least_squares/": ("tests/hil/least_squares", "tests/hil/estimation"),
    "hil/estimation/": ("tests/hil/estimation",),
}
"""Folders of tests, by the folder of the tested code."""
MOST = 2
"""Maximum number of surviving mutants: some are equivalent to the code."""
TIME_LIMIT = 1200.0
"""Time limit for the tests of a mutant [s]; a mutant that hangs counts as found."""


class Mutant(NamedTuple):
    """Mistake: file, original text, and replacement."""

    file: str
    old: str
    new: str


_AXIS = "drivers/axis.py"
_PDO = "drivers/canopen/process_data.py"
_TRIPS = "drivers/safety/trips.py"
_STOP = "drivers/cia402/stop.py"
_LEAVING = "drivers/session/servo_axes.py"
_BEAT = "drivers/canopen/heartbeat.py"
_LEAST = "hil/least_squares/"
_UNCERTAIN = f"{_LEAST}uncertainty.py"
_LOCAL = "hil/estimation/local_fits.py"
_TWO_STEP = "hil/estimation/two_step_methods.py"

MUTANTS = (
    # units and signs
    Mutant(_AXIS, "ampere * math.sqrt(2) ** peaks", "ampere * math.sqrt(0.5) ** peaks"),
    Mutant(_AXIS, "return round(q / self.position) + self.zero",
           "return int(q / self.position) + self.zero"),
    Mutant(_AXIS, "math.floor(value * (1 + 1e-9))", "math.ceil(value)"),
    Mutant(_AXIS, "torque = axis.sign * axis.current.sign * axis.gear_ratio",
           "torque = axis.sign * axis.gear_ratio"),
    Mutant(_AXIS, "return torque / math.copysign(self.torque_limit, self.position)",
           "return torque / self.torque_limit"),
    Mutant(_AXIS, "return self.first + (position - self.first) % self.size",
           "return self.low + (position - self.low) % self.size"),
    Mutant("drivers/rate_units.py", "Fraction(1, 60_000)", "Fraction(1, 6_000)"),
    Mutant("drivers/rate_units.py", "unit.size * Fraction(gear_ratio) / Fraction(math.tau)",
           "unit.size / Fraction(math.tau)"),
    # process data
    Mutant("drivers/canopen/pdo_mapping.py", "AT_SYNC = range(241)", "AT_SYNC = range(256)"),
    Mutant(_PDO, "                or len(data) != sizes[slot]\n", ""),
    Mutant(_PDO, "                or frame.is_extended_id\n", ""),
    Mutant("drivers/cycle_data.py", "math.inf if flag & SampleFlag.MISSING or elapsed <= 0",
           "0.0 if flag & SampleFlag.MISSING or elapsed <= 0"),
    Mutant(_PDO, "self.feed_forward(axis, 0, 0)", "pass"),
    Mutant("drivers/axis.py", "self._inner.lead(axis, self._wrap(axis, target))",
           "self._inner.lead(axis, target)"),
    # what stops all axes
    Mutant(_TRIPS, "[2 * velocity * period", "[20 * velocity * period"),
    Mutant(_TRIPS, "if abs(current) <= bound", "if current <= bound"),
    Mutant(_TRIPS, "self._since.pop(axis.index, None)", "pass"),
    Mutant(_TRIPS, "min(low, self._lows[axis]) if moving else low", "low"),
    Mutant("drivers/safety/trips.py", "+ 1 if gone else 0",
           "+ 1 if gone else self._counts[axis.index]"),
    Mutant(_STOP, "(STOP_DELAY + age + braking / 2)", "(STOP_DELAY + braking / 2)"),
    Mutant(_STOP, "_ENDS | _UNUSED | {Shown.ENABLED: StopPhase.DISABLING}", "_ENDS | _UNUSED"),
    Mutant(_STOP, "OFF_TIME_MOVING if self.phase in _BRAKING else OFF_TIME", "OFF_TIME"),
    Mutant(_STOP, "if self._returns <= RETURNS:", "if self._returns:"),
    Mutant(_STOP, "way > self.bound.way", "way > 2 * self.bound.way"),
    # watchdogs
    Mutant(_LEAVING, "if server.node not in on and not over.passed", "if not over.passed"),
    Mutant(_LEAVING, "            connection.life_sign.cease()\n", ""),
    Mutant(_LEAVING, "set(connection.written) <= outcome.off", "bool(outcome.off)"),
    Mutant(_BEAT, "now - last >= self.timeout", "now - last >= 2 * self.timeout"),
    Mutant(_BEAT, "        if self.ceased:\n            return\n", ""),
    Mutant(_BEAT, "node in self.starting and self._now() <= self._start_ends",
           "node in self.starting"),
    Mutant("drivers/canopen/set_up.py", "if not least <= kept <= most",
           "if not least <= kept"),
    Mutant("drivers/cia402/supervision.py", "emergency.code & 0xFF00", "emergency.code & 0xFFFF"),
    # estimators
    Mutant(_UNCERTAIN, "/ squares - 1.0", "/ squares"),
    Mutant(_UNCERTAIN, "left = np.sqrt(np.clip(1.0 - H, _ALONE, 1.0))",
           "left = np.clip(1.0 - H, _ALONE, 1.0)"),
    Mutant(f"{_LEAST}solving.py", "return rows @ P.T, sides @ P.T - rows[:, :, n:] @ nuisance",
           "return rows @ P.T, sides @ P.T"),
    Mutant(f"{_LEAST}regression.py", "found = found + self._beyond_groups(cells, covariance, most)",
           "found = found * 1.0"),
    Mutant(_TWO_STEP, "1.0 / robot.torque_limit[self._axis]", "1.0 + 0.0 * self._axis"),
    Mutant(_TWO_STEP, "weight * (values[rows] - self._rows[rows] @ p)", "weight * values[rows]"),
    Mutant(_LOCAL, "torques.T @ torques / max(pairs - 1, 1)", "torques.T @ torques / pairs"),
    Mutant(_LOCAL, "left.T @ left / (len(W) - W.shape[1])", "left.T @ left / len(W)"),
)  # fmt: skip


def main() -> None:
    """Test the mutants and print the survivors."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("words", nargs="*", help="of the mutants that are tried; by default all")
    parser.add_argument("--list", action="store_true", help="the mutants, and try none")
    given = parser.parse_args()
    chosen = [m for m in MUTANTS if all(word in " ".join(m) for word in given.words)]
    survivors = [m for m in chosen if not given.list and survives(m)]
    if given.list:
        sys.stdout.writelines(f"{m.file}: {m.old.strip()!r} -> {m.new.strip()!r}\n" for m in chosen)
        return
    sys.stdout.write(f"{len(survivors)} of {len(chosen)} survive, at most {MOST} may\n")
    sys.exit(len(survivors) > MOST)


def mutated(mutant: Mutant) -> str:
    """Return the text of the file with the mistake.

    Raises
    ------
    ValueError
        The original text does not occur exactly once.
    """
    text = (ROOT / mutant.file).read_text(encoding="utf-8")
    if text.count(mutant.old) != 1:
        raise ValueError(f"{mutant.file} has {mutant.old!r} {text.count(mutant.old)} times; once")
    return text.replace(mutant.old, mutant.new)


def survives(mutant: Mutant) -> bool:
    """Run the tests for the changed file, nearest first; return True if all pass."""
    (folders,) = (folders for place, folders in BESIDE.items() if mutant.file.startswith(place))
    began, by = time.monotonic(), ""
    with tempfile.TemporaryDirectory() as place:
        _copy(place)
        (Path(place) / mutant.file).write_text(mutated(mutant), encoding="utf-8")
        for tests in (_nearest(mutant.file), folders):
            by = by or _failed(tests, place)
        shutil.copy(ROOT / mutant.file, Path(place) / mutant.file)
        test = by.removeprefix("FAILED ").removeprefix("ERROR ").split(" - ")[0]
        if test.startswith("tests/") and _failed([test], place):
            raise SystemExit(f"{test} fails without a mistake; mend that first")
    line = f"{'found' if by else 'SURVIVES':8} {mutant.file}: {mutant.new.strip()[:60]!r}"
    sys.stdout.write(f"{line} ({time.monotonic() - began:.0f} s) {by[:120]}\n")
    sys.stdout.flush()
    return not by


def _copy(place: str) -> None:
    """Copy the files of the checkout, tracked or new, without ignored ones."""
    command = ("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.split("\0")[:-1]:
        if (ROOT / name).is_file():
            (Path(place) / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, Path(place) / name)


def _nearest(file: str) -> list[str]:
    """Return the tests with the name of a module or importing it; else those of its folder."""
    module = file.removesuffix(".py").replace("/", ".")
    found = []
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        after = path.name == f"test_{Path(file).name}"
        if after or re.search(rf"\b{re.escape(module)}\b", path.read_text(encoding="utf-8")):
            found.append(str(path.relative_to(ROOT)))
    beside = Path("tests") / Path(file).parent
    return found or [str(beside)]


def _failed(tests: Sequence[Path | str], place: str) -> str:
    """Run tests in a folder until one fails; return its line, or "" if all pass."""
    command = (sys.executable, "-m", "pytest", "-qx", "-m", "not long", *map(str, tests))
    try:
        done = subprocess.run(
            command, cwd=place, env={**os.environ, "PYTHONPATH": place}, capture_output=True,
            text=True, timeout=TIME_LIMIT, check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "hangs"
    lines = done.stdout.splitlines()
    failed = next((line for line in lines if line.startswith(("FAILED", "ERROR"))), "ends")
    return failed if done.returncode else ""


if __name__ == "__main__":
    main()
