"""Messages about 60 mistakes in maps and files, and about clean files, on several robots.

A recording of a robot's twin, with velocities, is written as a CSV with one mistake and imported.
The first message must name the mistake. Clean files, half of them with joints at rest, must be
accepted without doubts::

    python benchmarks/wrong_files.py [--robots ROBOT ...] [--seed 21] [--only WORDS]

Checks were tuned on ur10e, seed 1, and panda, seed 21; ur10e-on-a-wall and manutec-r15 are held
out.
"""

# ruff: noqa: E501 - one line per mistake
from __future__ import annotations

import argparse
import re
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from figures import Figure, keep

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from twin_recordings import TwinRecorder, robot_path

from hil.errors import HilError
from hil.imports.importing import import_recordings
from hil.model.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Columns = dict[str, Array]
    Change = Callable[[Columns, np.random.Generator], Columns]

PERIOD, DURATION, NOISE = 0.004, 20.0, 1e-5
"""Sampling period and duration of the recording [s]; noise of positions [rad]."""
CLEAN = 20
"""Number of clean files of each robot."""


@dataclass(frozen=True)
class Mistake:
    """Mistake: its name, a pattern of the first message, and its generation."""

    name: str
    says: str
    change: Change = lambda columns, _: columns
    stated: dict[str, Any] = field(default_factory=dict)
    joints: tuple[tuple[int, str, dict[str, Any]], ...] = ()
    robot: Callable[[str], str] = lambda text: text
    motor: tuple[str, int] = ("", 0)
    """Columns on the motor side, and the power of the gear ratio in the conversion."""


def column(name: str, function: Callable[[Array], Array]) -> Change:
    """Return a change of one column, or of all of a kind: `q`, `v` or `m`."""

    def change(columns: Columns, _: np.random.Generator) -> Columns:
        hit = [key for key in columns if key == name or (name in "qvm" and key[0] == name)]
        return columns | {key: function(columns[key]) for key in hit}

    return change


def swapped(*pairs: tuple[str, str]) -> Change:
    """Return an exchange of columns."""

    def change(columns: Columns, _: np.random.Generator) -> Columns:
        found = dict(columns)
        for a, b in pairs:
            found[a], found[b] = found[b], found[a]
        return found

    return change


def rows(pick: Callable[[int, np.random.Generator], Array], *, stamps: bool) -> Change:
    """Return a selection of rows, with their own or with equidistant time stamps."""

    def change(columns: Columns, rng: np.random.Generator) -> Columns:
        at = pick(len(columns["t"]), rng)
        found = {key: x[at] for key, x in columns.items()}
        return found if stamps else found | {"t": columns["t"][0] + PERIOD * np.arange(len(at))}

    return change


def repeated(share: float) -> Callable[[int, np.random.Generator], Array]:
    """Return a change in which a share of rows repeats the previous row."""

    def pick(n: int, rng: np.random.Generator) -> Array:
        hit = rng.random(n) < share
        hit[0] = False
        return np.maximum.accumulate(np.where(hit, 0, np.arange(n)))

    return pick


def dropped(share: float) -> Callable[[int, np.random.Generator], Array]:
    """Return a change without a share of the rows."""
    return lambda n, rng: np.flatnonzero(rng.random(n) >= share)


def late(kind: str, seconds: float) -> Change:
    """Return a delay of the columns of a kind."""
    return column(
        kind, lambda x: np.interp(np.arange(len(x)) - seconds / PERIOD, np.arange(len(x)), x)
    )


def drifting(kind: str, share: float) -> Change:
    """Return columns of a kind with the stamps of another clock."""
    return column(kind, lambda x: np.interp(np.arange(len(x)) * (1 + share), np.arange(len(x)), x))


def jumping(kind: str, seconds: float) -> Change:
    """Return a delay of the columns of a kind from the middle of the recording on."""
    return column(
        kind,
        lambda x: np.where(np.arange(len(x)) > len(x) // 2, np.roll(x, round(seconds / PERIOD)), x),
    )


def hold(name: str, every: int) -> Change:
    """Return a change with held values of columns."""
    return column(name, lambda x: np.repeat(x[::every], every)[: len(x)])


def change_map(
    joint: int, part: str, **changes: Any
) -> tuple[tuple[int, str, dict[str, Any]], ...]:
    """Return a change of one joint in the map, or of all for 0."""
    return tuple((k, part, changes) for k in (range(1, 9) if joint == 0 else (joint,)))


def gravity(turns: int, sign: float = 1.0) -> Callable[[str], str]:
    """Return a robot file with another gravity: components exchanged in turn, or in reverse."""

    def changed(text: str) -> str:
        stated = yaml.safe_load(text)["gravity"]
        vector = [sign * stated[(k - turns) % 3] for k in range(3)]
        return re.sub(r"^gravity: .*$", f"gravity: {vector}", text, flags=re.MULTILINE)

    return changed


RATED, P, V, M = "time", "position", "velocity", "torque"
RATE = {"rate": 1 / PERIOD}
DEGREES, RPM = np.degrees, lambda x: x * 30 / np.pi
MISTAKES = (
    *(Mistake(f"degrees as rad, axis {k}", rf"joints\.{k - 1}.*deg", column(f"q{k}", DEGREES))
      for k in (1, 2, 3)),
    Mistake("rad as degrees, all axes", "velocit|unit", joints=change_map(0, P, unit="deg")),
    Mistake("rad as degrees, axis 2", r"joints\.1\.(velocity|position).*deg|unit",
            joints=change_map(2, P, unit="deg")),
    *(Mistake(f"deg/s as rad/s, axis {k}", rf"joints\.{k - 1}\.velocity.*deg",
              column(f"v{k}", DEGREES)) for k in (1, 3)),
    Mistake("rpm as rad/s, axis 2", r"joints\.1\.velocity.*rpm", column("v2", RPM)),
    Mistake("rpm as rad/s, all axes", r"velocity.*rpm", column("v", RPM)),
    *(Mistake(f"mN m as N m, axis {k}", rf"joints\.{k - 1}\.torque.*limited",
              column(f"m{k}", lambda x: 1e3 * x)) for k in (1, 3)),
    Mistake("angles of motors as of joints", "motor", motor=("q", 1)),
    Mistake("velocities of motors as of joints", "motor", motor=("v", 1)),
    Mistake("torques of motors as of joints", "torque_side|motor", motor=("m", -1)),
    *(Mistake(f"position of axis {k} has the other sign", rf"joints\.{k - 1}\.(velocity|position).*sign",
              column(f"q{k}", np.negative)) for k in (2, 3)),
    *(Mistake(f"torque of axis {k} has the other sign", rf"joints\.{k - 1}\.torque.*sign",
              column(f"m{k}", np.negative)) for k in (1, 2, 3)),
    *(Mistake(f"velocity of axis {k} has the other sign", rf"joints\.{k - 1}\.velocity.*sign",
              joints=change_map(k, V, sign=-1)) for k in (1, 2)),
    Mistake("sizes of torques without sign", "sign", column("m", np.abs)),
    *(Mistake(f"{name} of axes {a} and {b} exchanged", f"({a} and {b}|position of joint)",
              swapped((f"{key}{a}", f"{key}{b}")))
      for name, key in (("positions", "q"), ("velocities", "v"), ("torques", "m"))
      for a, b in ((1, 2), (2, 3))),
    Mistake("axes 2 and 3 exchanged", "2 and 3", swapped(("q2", "q3"), ("v2", "v3"), ("m2", "m3"))),
    *(Mistake(f"rate {rate} for 250", r"^time.*rate", stated={"time": {"rate": rate}})
      for rate in (125, 200, 240, 260, 500)),
    Mistake("ms as s", "unit of time", column("t", lambda x: 1e3 * x)),
    Mistake("us as ms", "unit of time|rate", stated={"time": {"column": "t", "unit": "ms"}}),
    Mistake("velocity of axis 2 times 1.2", r"joints\.1\.velocity.* 1\.(2|19)", column("v2", lambda x: 1.2 * x)),
    Mistake("velocities of all axes times 0.8", r"time.*0\.8", column("v", lambda x: 0.8 * x)),
    Mistake("torque of axis 2 times 20", r"joints\.1\.torque.*limited", column("m2", lambda x: 20 * x)),
    *(Mistake(f"torques {1e3 * s:.0f} ms {'late' if s > 0 else 'early'}", "delay|lead", late("m", s))
      for s in (0.1, 0.05, 0.02, -0.05)),
    Mistake("positions 100 ms late", "follow|delay|lead", late("q", 0.1)),
    *(Mistake(f"{100 * s:.0f} % of the rows repeat the row before", "repeat", rows(repeated(s), stamps=False),
              {"time": RATE}) for s in (0.02, 0.12)),
    Mistake("12 % of the rows repeat the row before, with stamps", "repeat",
            rows(repeated(0.12), stamps=False)),
    Mistake("each row four times", "repeat", rows(lambda n, _: np.arange(n) // 4, stamps=False)),
    *(Mistake(f"{100 * s:.0f} % of the rows dropped, with a rate", "time.*not even|rate",
              rows(dropped(s), stamps=False), {"time": RATE}) for s in (0.05, 0.2)),
    *(Mistake(f"torque of axis {k} held for {n} rows", rf"joints\.{k - 1}\.torque.*held",
              hold(f"m{k}", n)) for k, n in ((2, 4), (1, 10))),
    Mistake("all torques held for 8 rows", r"torque.*held", hold("m", 8)),
    Mistake("position of axis 3 held for 3 rows", r"joints\.2\.position.*held", hold("q3", 3)),
    *(Mistake(f"torques by a clock {100 * s:g} % fast", "clock", drifting("m", s)) for s in (0.02, 0.005)),
    *(Mistake(f"torques jump by {1e3 * s:g} ms", "clock", jumping("m", s)) for s in (0.1, -0.3)),
    Mistake("velocities by a clock 1 % fast", "clock", drifting("v", 0.01)),
    Mistake("velocities jump by 100 ms", "clock", jumping("v", 0.1)),
    # a rotation of gravity about axis 1 equals an offset of that axis
    Mistake("gravity sideways", "gravity|axis 1: joint offset", robot=gravity(2)),
    Mistake("from another link: tilted by 90 degrees", "gravity|axis 1: joint offset", robot=gravity(1)),
    Mistake("gravity points up", "gravity|sign|axis 1: joint offset", robot=gravity(0, -1.0)),
    Mistake("zero of axis 3 off by 90 degrees", r"joints\.2\.position.*zero",
            joints=change_map(3, P, offset=np.pi / 2)),
    Mistake("constant torque of axis 3", "throughout", column("m3", lambda x: 0 * x + 7.3)),
    Mistake("torque of axis 2 in axis 3, too", "same", lambda c, _: c | {"m3": c["m2"]}),
    Mistake("velocities as torques", "velocit", lambda c, _: c | {
        f"m{k}": c[f"v{k}"] for k in range(1, 9) if f"v{k}" in c}),
)  # fmt: skip


@lru_cache(maxsize=2)
def recorded(name: str, seed: int) -> Columns:
    """Return the columns of a correct recording."""
    twin, rng = TwinRecorder(name), np.random.default_rng(1000 + seed)
    ((_, found),) = twin.recorded(seed, n=1, duration=DURATION)
    q = found.q + NOISE * rng.standard_normal(found.q.shape)
    qd = np.gradient(found.q, found.time, axis=0)
    columns = {"t": found.time}
    for key, values in (("q", q), ("v", qd), ("m", found.tau)):
        columns |= {f"{key}{k}": x for k, x in enumerate(values.T, start=1)}
    return columns


def add_rest(columns: Columns, number: int, rng: np.random.Generator) -> Columns:
    """Return a clean file with joints at rest: flickering counts, dead bands, noise.

    Torques at rest are constant apart from noise and do not obey mechanics, so only the checks of
    columns are tested.
    """
    n = max(int(key[1:]) for key in columns if key[0] == "q")
    rests, found = 1 + (number + np.arange(1 + number % 2)) % n, dict(columns)
    size = len(columns["t"])
    for k in rests:
        count = 10.0 ** rng.uniform(-5, -3)
        found[f"q{k}"] = columns[f"q{k}"].mean() + count * np.round(
            rng.standard_normal(size) / rng.uniform(2, 6)
        )
        found[f"v{k}"] = 0.02 * np.round(rng.standard_normal(size) / rng.uniform(2, 6))
        found[f"m{k}"] = columns[f"m{k}"].mean() + 0.1 * rng.standard_normal(size)
    return found


def imported(
    folder: Path, robot: str, columns: Columns, mistake: Mistake, accept: list[str]
) -> str:
    """Return all messages about a file and its map, the refusal first; empty without any."""
    folder.mkdir(parents=True)
    n = max(int(key[1:]) for key in columns if key[0] == "q")
    np.savetxt(folder / "data.csv", np.column_stack(list(columns.values())), "%.9g", ",",
               header=",".join(columns), comments="")  # fmt: skip
    (folder / "robot.yaml").write_text(mistake.robot(robot_path(robot).read_text()))
    joints: list[dict[str, Any]] = [
        {P: {"column": f"q{k}", "unit": "rad"}, V: {"column": f"v{k}", "unit": "rad/s"},
         M: {"column": f"m{k}", "unit": "N m"}} for k in range(1, n + 1)
    ]  # fmt: skip
    for joint, part, changes in mistake.joints:
        if joint <= n:
            joints[joint - 1][part] |= changes
    content = {"robot": "robot.yaml", "files": ["data.csv"], "time": {"column": "t"}}
    content |= mistake.stated | {"joints": joints, "accept": accept}
    (folder / "map.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    stated: list[Any] = []
    try:
        import_recordings([folder / "map.yaml"], folder / "run", stated.append)
    except HilError as error:
        return "refused: " + re.sub(r"\S*map\.yaml:\d+: ", "", str(error).splitlines()[0])
    lines = [line for line in stated[0].lines() if " repeat" in line]
    said = [f"{'.'.join(map(str, s.location))}: {s.message}" for s in stated[0].suspicions]
    return "\n".join(lines + said)


def one(folder: Path, seed: int, job: tuple[str, int]) -> tuple[str, int, str]:
    """Return the messages about one case of one robot; clean files have numbers below 0."""
    robot, number = job
    columns, own = recorded(robot, seed), folder / f"{robot}{number}"
    rng = np.random.default_rng([seed, abs(number)])
    if number >= 0:
        mistake = MISTAKES[number]
        kind, power = mistake.motor
        gears = Robot.load(str(robot_path(robot))).gear_ratio ** power
        columns = {
            key: x * gears[int(key[1:]) - 1] if key[0] == kind else x for key, x in columns.items()
        }
        return robot, number, imported(own, robot, mistake.change(columns, rng), mistake, [])
    if number % 2:
        columns = add_rest(columns, -number, rng)
    accept = ["shape"] if number % 2 else []
    said = imported(own, robot, columns, Mistake("clean", ""), accept)
    kept = [line for line in said.splitlines() if "and its torque is used only" not in line]
    if number % 2:  # torques at rest are artificial
        kept = [
            line for line in kept if not re.search("leaves|friction would|delay of|lead of", line)
        ]
    return robot, number, "\n".join(kept)


def main() -> None:
    """Try all mistakes and clean files, print the first messages, and keep the sums."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("--robots", nargs="+", default=["panda", "ur10e-on-a-wall", "manutec-r15"])
    parser.add_argument("--seed", type=int, default=23)
    parser.add_argument("--only", default="", help="mistakes whose name has these words")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    numbers = [k for k, mistake in enumerate(MISTAKES) if given.only in mistake.name]
    clean = [] if given.only else [-k for k in range(1, CLEAN + 1)]
    jobs = [(robot, number) for robot in given.robots for number in (*numbers, *clean)]
    named, wronged = dict.fromkeys(numbers, 0), 0
    with tempfile.TemporaryDirectory() as temporary, ProcessPoolExecutor(given.workers) as pool:
        for robot, number, said in pool.map(
            partial(one, Path(temporary), given.seed), jobs, chunksize=8
        ):
            first = said.splitlines()[0] if said else "nothing"
            if number >= 0:
                right = bool(re.search(MISTAKES[number].says, first.removeprefix("refused: ")))
                named[number] += right
                name = MISTAKES[number].name
            else:
                right, name = not said, f"clean {-number}"
                wronged += not right
            print(f"{'ok  ' if right else 'MISS'} {robot} {name}: {first[:160]}", flush=True)
    n = len(given.robots)
    all_named = sum(times == n for times in named.values())
    print(f"named first on all robots: {all_named} of {len(numbers)} mistakes,"
          f" {sum(named.values())} of {n * len(numbers)} files; clean files doubted: {wronged} of"
          f" {n * len(clean)}")  # fmt: skip
    if not given.only:
        keep(
            "wrong-files",
            {"mistakes": Figure.count(len(numbers)), "named": Figure.count(all_named),
             "files": Figure.count(n * len(numbers)), "named-files": Figure.count(sum(named.values())),
             "clean": Figure.count(n * len(clean)), "doubted": Figure.count(wronged)},
            depends=("hil/imports",), seeds=[given.seed],
            command=f"python benchmarks/wrong_files.py --robots {' '.join(given.robots)}"
            f" --seed {given.seed}",
        )  # fmt: skip


if __name__ == "__main__":
    main()
