"""False alarms and marked changes of `hil history`, on campaigns of the virtual plant.

    python benchmarks/history.py [FOLDER] [--runs N] [--changed M]

N campaigns of 39 measurements of the manutec-r15 differ only by the plant's seed (noise, drift of
the friction, lubricant). Half of them begin on a warm machine: 25 K above the surroundings instead
of 5 K, with stirred lubricant. Three sets of M campaigns have 15 % more Coulomb friction of axis 3,
p5 smaller by 2 %, and a torque constant of axis 5 greater by 4 %. All campaigns are in FOLDER
(runs/history); existing campaigns are reused. The output states the number of runs of the unchanged
machine with any marked quantity, each compared with the first and the previous run; the number for
all pairs of these runs, which are not independent; and the first named cause of each change.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from itertools import combinations
from pathlib import Path

from figures import ROOT, Figure, keep

from hil.commands.history import history_of, read_history
from hil.results.model import Model

PLANT = Path(__file__).parents[1] / "sim_plant" / "plants" / "manutec-r15.yaml"
COUNTS = ("--gravity", "12", "--inertia", "24", "--coupling", "3")
CHANGES = {
    "unchanged": (),
    "friction": (("creep: 42, full_speed: 71,", "creep: 48.3, full_speed: 77.3,"),),
    "p5": (("sx: 48.491", "sx: 47.5212"),),
    "drive": (("torque_constant: 0.2608", "torque_constant: 0.27123"),),
    "warm": ((r"(friction: {[^}]*)}", r"\1, temperature: 25, lubricant: 0.1}"),),
}
FOLDER = ROOT / "runs" / "history"
"""Folder of the campaigns, kept for further calls."""
JUDGED_FAILED = 3
"""Exit status of `hil identify` for a written model with a failed judgement."""
FIRST_SEED = 210
UNCHANGED_FROM = 300
NAMED = {"friction": "friction of axis 3", "p5": "(p5)", "drive": "drive of axis 5"}
"""Changes, with their words in the output."""


def main() -> None:
    """Make missing campaigns, and judge all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    parser.add_argument("--runs", type=int, default=54)
    parser.add_argument("--changed", type=int, default=5)
    given = parser.parse_args()
    changed = {
        name: [made(given.folder, name, FIRST_SEED + k) for k in range(given.changed)]
        for name in NAMED
    }
    unchanged = [
        made(given.folder, ("unchanged", "warm")[k % 2], UNCHANGED_FROM + k)
        for k in range(given.runs)
    ]
    keep(
        "history",
        {name: Figure.count(number) for name, number in judge(unchanged, changed).items()},
        depends=("hil/results", "hil/estimation", "hil/friction"),
        command=f"python benchmarks/history.py --runs {given.runs} --changed"
        f" {given.changed}",
        seeds=[*range(FIRST_SEED, FIRST_SEED + given.changed),
               *range(UNCHANGED_FROM, UNCHANGED_FROM + given.runs)],
    )  # fmt: skip


def made(folder: Path, change: str, seed: int) -> Path:
    """Return the folder of an identified campaign on a plant with a seed and a change."""
    run, plant = folder / f"{change}-{seed}", folder / f"{change}-{seed}.yaml"
    if (run / "model.yaml").exists():
        return run
    if not (plan := folder / "plan.yaml").exists():
        folder.mkdir(parents=True, exist_ok=True)
        hil("plan", "manutec-r15", *COUNTS, "-o", plan)
    text = PLANT.read_text().replace("\nseed: 1\n", f"\nseed: {seed}\n")
    for before, after in CHANGES[change]:
        text, times = re.subn(before if change == "warm" else re.escape(before), after, text)
        assert times == (6 if change == "warm" else 1), before
    plant.write_text(text)
    hil("run", plan, "-o", run, "--channel", plant)
    hil("identify", run)
    return run


def hil(*arguments: object) -> None:
    """Call the command line without output; an exchanged drive may well be judged failed."""
    command = [sys.executable, "-m", "hil", *map(str, arguments)]
    done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
    if done.returncode != JUDGED_FAILED:
        done.check_returncode()


def judge(unchanged: list[Path], changed: dict[str, list[Path]]) -> dict[str, int]:
    """Print and count false alarms, and the first named cause of each change."""
    found = read_history(unchanged)
    alarms = {each.run: each for each in found.changes if each.marked}
    print(f"unchanged: {len(alarms)} of {len(unchanged) - 1} new runs marked")
    for each in found.changes:
        if each.marked:
            print(f"    {each.sentence}")
    models = [(str(path), Model.load(path)) for path in unchanged]
    pairs = [bool(history_of(pair).marked) for pair in combinations(models, 2)]
    print(f"unchanged: {sum(pairs)} of {len(pairs)} pairs marked")
    kept = {"new-runs": len(unchanged) - 1, "new-runs-marked": len(alarms)}
    kept |= {"pairs": len(pairs), "pairs-marked": sum(pairs)}
    for name, runs in changed.items():
        kept |= {f"{name}-runs": len(runs), f"{name}-named-first": 0}
        for run in runs:
            after = read_history([*unchanged[:3:2], run], reference=unchanged[0])
            own = next(each for each in after.runs if each.label == str(run))
            first = next(iter(after.sentences(own)), "nothing marked")
            print(f"{name}: {first}")
            kept[f"{name}-named-first"] += NAMED[name] in first
    return kept


if __name__ == "__main__":
    main()
