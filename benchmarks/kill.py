"""`hil run` killed with SIGKILL at random moments, and resumed until its campaigns are complete.

Every session is the program itself, forked from here with one addition: just before a recording is
written, its content goes into a pipe. Content of a pipe survives the writer, so this process knows
all measured data independently of the disk. Sessions are killed a random time after a random number
of recordings: a third within the milliseconds in which a file is written, some before the folder
exists. For every completed campaign:

- every measurement of the plan must have one recording, bit-identical to the data measured by the
  session named in the recording;
- no complete file may have changed or disappeared in between;
- the estimate and every figure of `hil accept` must be bit-identical to those of a folder into
  which the recordings were written without disturbance;
- the counts of each session in the journal must equal those of its recordings.

A resumed run of the virtual plant starts from another state of friction and noise than an
undisturbed run, like any robot. Therefore the comparison uses the data of one campaign, not two
campaigns::

    python benchmarks/kill.py
    python benchmarks/kill.py --kills 3 --counts 6 20 2
"""

from __future__ import annotations

import argparse
import hashlib
import os
import pickle
import random
import re
import select
import signal
import struct
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep

from drivers.session import servo_axes  # noqa: F401 - loaded once, before the sessions are forked
from hil.cli import main as hil
from hil.cli import plan_view, run_session  # noqa: F401 - likewise
from hil.commands.accept import accept, draft_limits
from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.planning.plan import Plan, dump_plan
from hil.results.identification import identify
from hil.results.model_file import NAME as MODEL
from hil.runs.journal import SyncTiming
from hil.runs.run_folder import RunFolder
from sim_plant.serving.bus import PlantBus

if TYPE_CHECKING:
    from hil.runs.recording_file import Measured

ROBOT = "manutec-r15"
MOST_RECORDINGS = 6
"""Maximum number of recordings before a session is killed."""
WRITING, MEASURING, STARTING = 0.005, 0.5, 1.0
"""Maximum delays of the kill after a recording during its write, in a measurement, and after the
start [s].
"""
BEGINNING = 0.2
"""Maximum delay for half of the sessions without a folder [s]."""

robot = Robot.load(ROBOT)


@dataclass
class Findings:
    """Errors found, and numbers of checked items."""

    kills: int = 0
    campaigns: int = 0
    recordings: int = 0
    lost: int = 0
    wrong: int = 0
    differing_estimates: int = 0
    differing_certificates: int = 0
    differing_sums: int = 0

    @property
    def good(self) -> bool:
        """True without errors and losses."""
        differing = self.differing_estimates + self.differing_certificates + self.differing_sums
        return not (self.lost or self.wrong or differing)


def session(arguments: list[str], pipe: int, output: Path) -> None:
    """Run `hil` with these arguments; never returns."""
    status: object = 1
    try:
        log = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(log, 1)
        os.dup2(log, 2)
        write = RunFolder.write

        def witnessed(folder: RunFolder, measured: Measured) -> None:
            content = memoryview(pickle.dumps(measured))
            message = memoryview(struct.pack("<Q", len(content)) + content)
            while message:
                message = message[os.write(pipe, message) :]
            write(folder, measured)

        RunFolder.write = witnessed  # type: ignore[method-assign]
        hil(arguments)
        status = 0
    except SystemExit as end:
        status = end.code
    finally:
        sys.stdout.flush()
        os._exit(status if isinstance(status, int) else 1)


def run_and_kill(
    arguments: list[str], output: Path, after: int, delay: float
) -> tuple[list[Measured], bool]:
    """Start a session, kill it `delay` seconds after its recording number `after`.

    Returns its measured recordings, and True if it was killed before its end.
    """
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(reading)
        session(arguments, writing, output)
    os.close(writing)
    heard, kill_at = bytearray(), None
    while True:
        if kill_at is None and count(heard) >= after:
            kill_at = time.monotonic() + delay
        left = None if kill_at is None else max(0.0, kill_at - time.monotonic())
        if select.select([reading], [], [], left)[0]:
            part = os.read(reading, 1 << 20)
            heard += part
            if not part:
                break
        elif left == 0.0:
            os.kill(process, signal.SIGKILL)
            while part := os.read(reading, 1 << 20):
                heard += part
            break
    os.close(reading)
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    assert status in {0, -signal.SIGKILL}, f"hil ended with {status}:\n{output.read_text()}"
    return witnesses(heard), status != 0


def count(heard: bytes | bytearray) -> int:
    """Return the number of completely received recordings."""
    return len(witnesses(heard, load=False))


def witnesses(heard: bytes | bytearray, *, load: bool = True) -> list[Measured]:
    """Return the completely received recordings; a kill may have cut the last one off."""
    found, place = [], 0
    while len(heard) >= place + 8:
        (size,) = struct.unpack_from("<Q", heard, place)
        content = heard[place + 8 : place + 8 + size]
        if len(content) < size:
            break
        found.append(pickle.loads(content) if load else None)  # noqa: S301 - our own
        place += 8 + size
    return found


def campaign(place: Path, plan: Plan, kills: int, dice: random.Random, found: Findings) -> Counter:
    """Carry out one campaign with at most `kills` kills; return the moments of the kills."""
    plan_file, folder = place / "plan.yaml", place / "run"
    plan_file.write_text(dump_plan(plan))
    known: dict[str, str] = {}
    seen: dict[tuple[str, int], Measured] = {}
    moments: Counter = Counter()
    killed = True
    while killed:
        arguments = ["run", str(plan_file), "-o", str(folder)]
        if folder.exists():
            arguments.append("--resume")
        after = dice.randint(0, MOST_RECORDINGS)
        delay = dice.uniform(0, STARTING if after == 0 else dice.choice([WRITING, MEASURING]))
        if not (folder / "run.json").exists() and dice.random() < 0.5:
            after, delay = 0, dice.uniform(0, BEGINNING)
        if kills == 0:
            after = len(plan.measurements) + 1
        measured, killed = run_and_kill(arguments, place / "output.txt", after, delay)
        seen |= {(each.measurement.id, each.session): each for each in measured}
        moments[moment(folder)] += killed
        kills -= killed
        found.kills += killed
        present = files(folder)
        found.lost += sum(present.get(name) != digest for name, digest in known.items())
        known = present
    judge(place, folder, plan, seen, found)
    return moments


def moment(folder: Path) -> str:
    """Return the interrupted activity, from the files left by a kill."""
    if not (folder / "run.json").exists():
        return "before run.json"
    if list(folder.rglob("*.part")):
        return "while a file was written"
    return "at other times"


def files(folder: Path) -> dict[str, str]:
    """Return the digests of all complete recordings."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.glob("recordings/*.h5")
    }


def judge(
    place: Path,
    folder: Path,
    plan: Plan,
    seen: dict[tuple[str, int], Measured],
    found: Findings,
) -> None:
    """Compare a finished campaign with the data measured by its sessions."""
    run = RunFolder.open(folder)
    found.lost += len(run.missing) + len(list(folder.rglob("*.part*")))
    fresh = RunFolder.create(place / "undisturbed", plan, robot)
    for each in run:
        truth = seen.get((each.measurement.id, each.session))
        found.recordings += 1
        if truth is None or not alike(each, truth):
            found.wrong += 1
        else:
            fresh.write(truth)
    ours, undisturbed = identify(run), identify(fresh)
    same = np.array_equal(ours.values, undisturbed.values)
    same &= np.array_equal(ours.covariance, undisturbed.covariance)
    found.differing_estimates += not same
    ours.save(folder / MODEL)
    undisturbed.save(fresh.path / MODEL)
    limits = draft_limits(fresh)
    found.differing_certificates += accept(run, limits).checks != accept(fresh, limits).checks
    for number, session in enumerate(run.journal.sessions):
        truth = SyncTiming()
        for each in run:
            truth = truth.add_recording(each.recording) if each.session == number else truth
        found.differing_sums += session.sync != truth
    found.campaigns += 1


def alike(one: Measured, other: Measured) -> bool:
    """Return True for recordings equal bit by bit."""
    same = all(
        getattr(one.recording, name).tobytes() == getattr(other.recording, name).tobytes()
        for name in one.recording.units
    )
    return same and (one.measurement, one.attempts, one.findings) == (
        other.measurement,
        other.attempts,
        other.findings,
    )


def main() -> None:
    """Kill, resume, judge, print and keep."""
    parser = argparse.ArgumentParser(description="Kill hil run at random moments.")
    parser.add_argument("--kills", type=int, default=60)
    parser.add_argument("--counts", type=int, nargs=3, default=(12, 24, 3))
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    counts = zip(("gravity", "inertia", "coupling"), options.counts, strict=True)
    plan = design(robot, dict(counts))
    PlantBus(ROBOT).shutdown()  # compiled code is loaded once, before the fork of the sessions
    dice, found = random.Random(options.seed), Findings()
    moments: Counter = Counter()
    while found.kills < options.kills:
        with tempfile.TemporaryDirectory() as place:
            moments += campaign(Path(place), plan, options.kills - found.kills, dice, found)
    print(f"{found.kills} kills: {', '.join(f'{n} {when}' for when, n in moments.items())}")
    print(f"{found.campaigns} campaigns of {len(plan.measurements)}, {found.recordings} recordings")
    print(f"measurements lost: {found.lost}, wrong: {found.wrong}")
    print(f"estimates that differ from those of undisturbed folders: {found.differing_estimates}")
    print(f"certificates that do: {found.differing_certificates}")
    print(f"sessions whose counts are not those of their recordings: {found.differing_sums}")
    counted = asdict(found) | moments
    kept = {re.sub(r"\W|_", "-", name): Figure.count(n) for name, n in counted.items()}
    stated = f"--kills {options.kills} --seed {options.seed} --counts"
    command = " ".join(["python benchmarks/kill.py", stated, *map(str, options.counts)])
    depends = ("hil/runs", "hil/measuring")
    keep("kill", kept, depends=depends, command=command, seeds=[options.seed])
    sys.exit(not found.good)


if __name__ == "__main__":
    main()
