"""Regression test of identified values for recorded runs of every kind, to the last digits.

Missing runs are recorded into a folder: campaigns, trajectories and friction on sound and flawed
virtual plants; imports of simulated recordings (twins), with strokes, loads and unknown gains; and
public recordings, if a folder is named. Each result is a file written by a command: its figures and
words are kept in ``benchmarks/golden/``, one file per result. ``check`` compares the kept figures
with the present output of the commands and lists differences, ``keep`` replaces the kept figures::

    python benchmarks/golden.py [check|keep] [RESULT ...] [--runs FOLDER] [--public FOLDER]

Square matrices are reduced to diagonal and norm. Figures count as equal within `SAME` times the
largest figure of the same list in the file, which tolerates other linear algebra libraries.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from back_and_forth import exported, strokes
from foreign_recordings import ROBOTS, record
from loads import write as write_loads

from hil.model.robot import Robot
from hil.planning.plan import dump_plan
from hil.runs.run import Run
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Iterator

MANUTEC = "manutec-r15"
ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "golden"
SAME = 1e-9
"""Relative difference between equal figures: rounding, times condition numbers of 1e4 and some
hundred operations.
"""
SHOWN = 12
"""Maximum number of listed differences of a result."""
NOT_COMPARED = {
    "provenance", "robot_file", "validations", "validated", "run", "model", "hil", "written",
    "made",
}  # fmt: skip
"""Keys of dates, versions and paths, excluded from the comparison."""
ROUGH = ("--gravity", 12, "--inertia", 16, "--coupling", 5)
PLANS: dict[str, tuple[object, ...]] = {
    "rough": ("plan", MANUTEC, *ROUGH),
    "whole": ("plan", MANUTEC),
    "mixed": ("plan", MANUTEC, "--minutes", 10, "--with-trajectories"),
    "periodic": ("plan", MANUTEC, "--kind", "trajectory", "--minutes", 3),
    "sweep": ("plan", MANUTEC, "--kind", "friction"),
    "stops": ("plan", MANUTEC, "--kind", "friction", "--experiment", "stops", "--axis", 2),
}
LOAD = {"mass": 10.86, "centre": [0, 0, 0.14], "Ixx": 0.0259, "Iyy": 0.0259, "Izz": 0.047}
"""Load of the paper."""
LIGHT = {"mass": 4.0, "centre": [0, 0, 0.14], "Ixx": 0.01, "Iyy": 0.01, "Izz": 0.02}
"""Load within the capacity of the drives on the trajectory."""
END = {"mass": 5.0, "centre": [0.05, 0.0, 0.12], "Ixx": 0.02, "Iyy": 0.02, "Izz": 0.02}
LEANING = [0.0, 9.81 * math.sin(math.radians(10)), -9.81 * math.cos(math.radians(10))]
"""Gravity vector at a tilt of 10 degrees [m/s^2]."""
CAMPAIGNS: dict[str, tuple[str, int, dict[str, Any]]] = {
    "strokes": ("rough", 731, {}),
    "strokes-loaded": ("rough", 732, {"payload": LOAD}),
    "strokes-strong-drift": ("rough", 733, {"drift_strength": 3.0}),
    "strokes-torque-constant": ("rough", 734, {}),
    "strokes-gravity": ("rough", 735, {"gravity": LEANING}),
    "strokes-end-load": ("rough", 736, {"payload": END}),
    "campaign": ("whole", 737, {}),
    "mixed": ("mixed", 738, {}),
    "trajectory": ("periodic", 739, {}),
    "trajectory-loaded": ("periodic", 740, {"payload": LIGHT}),
    "sweep": ("sweep", 741, {}),
    "stops": ("stops", 742, {}),
}
"""Plan, seed, and further keys of the plant."""
GREATER = {"strokes-torque-constant": (2, 1.3)}
"""Axis with a wrong torque constant, and its ratio to the torque constant in the robot file."""
TWINS = {
    "scara": ("250 Hz", 751), "ur10e": ("250 Hz", 752), "panda": ("100 Hz", 753),
    "cartesian": ("20 s", 754), "manutec-r15": ("16 bit", 755),
}  # fmt: skip
PUBLIC = {"lwr4": ("m1",), "kr300": ("A", "B"), "rokae": ("motor_train", "sensor_train")}
IDENTIFIED: dict[str, tuple[str, tuple[object, ...]]] = {
    **{name: (name, ()) for name in CAMPAIGNS if name not in ("sweep", "stops")},
    "strokes-published": ("strokes", ("--method", "published")),
    "strokes-two-runs": ("strokes", ("--with", "strokes-strong-drift")),
    "strokes-consistent": ("strokes", ("--consistent",)),
    "pan-tilt": ("pan-tilt", ()),
    "pan-tilt-plain": ("pan-tilt", ("--method", "least squares")),
    "pan-tilt-instruments": ("pan-tilt", ("--method", "instrumental variables")),
    "pan-tilt-gain": ("pan-tilt-gain", ()),
    **{f"twin-{name}": (f"twin-{name}", ()) for name in TWINS},
    "back-and-forth-trapezoids": ("back-and-forth-trapezoids", ()),
    "back-and-forth-improved": ("back-and-forth-trapezoids", ("--method", "improved")),
    "back-and-forth-smooth": ("back-and-forth-smooth", ()),
    "lwr4": ("lwr4-m1", ()),
    "rokae-motor": ("rokae-motor_train", ()),
    "rokae-sensor": ("rokae-sensor_train", ()),
    "kr300": ("kr300-A", ("--with", "kr300-B")),
}
"""Results of ``hil identify``: run and options."""
BY_RIVALS: dict[str, tuple[str, tuple[object, ...]]] = {
    "trajectory-strongest": ("trajectory", ("--method", "strongest")),
    "trajectory-by-period": ("trajectory-loaded", ("--method", "friction by period")),
}
"""Results of ``python -m benchmarks.rivals``: run and options."""
OTHERS: dict[str, tuple[tuple[object, ...], str]] = {
    "friction-sweep": (("friction", "sweep", "--model", "campaign"), "sweep/friction.yaml"),
    "load-strokes": (("payload", "strokes", "strokes-loaded"), "strokes-loaded/load.yaml"),
    "load-imported": (
        ("payload", "scara-bare", "scara-loaded", "--mass", 2.805, "--gains"),
        "scara-loaded/load.yaml",
    ),
    "diagnosis": (
        ("diagnose", "strokes-torque-constant"),
        "strokes-torque-constant/diagnosis.yaml",
    ),
}
"""Results of other commands, with the output files."""


def hil(folder: Path, *arguments: object, program: str = "hil") -> str:
    """Call a command line in a folder; return the message of a refusal or failure."""
    command = [sys.executable, "-m", program, *map(str, arguments)]
    done = subprocess.run(
        command, cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.stderr if done.returncode else ""


def must(folder: Path, *arguments: object) -> None:
    """Call the command line; a failure is an error."""
    if said := hil(folder, *arguments):
        sys.exit(said)


def record_all(folder: Path, public: Path | None) -> None:
    """Record missing runs."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (command, *rest) in PLANS.items():
        if not (folder / f"{name}.yaml").exists():
            must(folder, command, *rest, "-o", f"{name}.yaml")
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda name: _campaign(folder, name), CAMPAIGNS))
    _imports(folder)
    _back_and_forth(folder)
    if not (folder / "scara-bare").exists():
        write_loads(folder / "loads")
        for name in ("bare", "loaded"):
            (folder / "loads" / name).rename(folder / f"scara-{name}")
    for machine, names in PUBLIC.items() if public else ():
        for name in names:
            if not (folder / f"{machine}-{name}").exists():
                must(folder, "import", public / machine / f"{name}.map.yaml", "-o",
                     f"{machine}-{name}")  # fmt: skip


def _campaign(folder: Path, name: str) -> None:
    if (folder / name).exists():
        return
    plan, seed, differs = CAMPAIGNS[name]
    content = load_plant_file(MANUTEC).model_dump(mode="json")
    content |= differs
    if name in GREATER:
        axis, factor = GREATER[name]
        content["axes"][axis - 1]["drive"]["torque_constant"] *= factor
    plant = folder / f"{name}.plant.yaml"
    plant.write_text(yaml.safe_dump(content, sort_keys=False))
    must(folder, "run", f"{plan}.yaml", "-o", name, "--channel", plant, "--bus-option",
         f"seed={seed}")  # fmt: skip


def _imports(folder: Path) -> None:
    """Import recordings of twins, and the example with a known and an unknown gain."""
    for name, (case, seed) in TWINS.items():
        if not (folder / f"twin-{name}").exists():
            recorded = record(folder / "recorded", name, case, seed)
            must(folder, "import", recorded / "seen.yaml", "--files", ROBOTS, "-o", f"twin-{name}")
    example = ROOT / "examples" / "pan_tilt"
    if not (folder / "pan-tilt").exists():
        must(folder, "import", example / "excitation.yaml", "-o", "pan-tilt")
        content = yaml.safe_load((example / "excitation.yaml").read_text())
        content["robot"] = str(example / content["robot"])
        content["files"] = [str(example / each) for each in content["files"]]
        content["joints"][1]["torque"]["gain"] = "unknown"
        (folder / "gain.yaml").write_text(yaml.safe_dump(content))
        must(folder, "import", "gain.yaml", "--files", example, "-o", "pan-tilt-gain")


def _back_and_forth(folder: Path) -> None:
    """Import strokes of the pan-tilt head's twin from CSV files."""
    robot_file, twin = ROBOTS / "pan-tilt.yaml", folder / "pan-tilt-twin"
    if not twin.exists():
        subprocess.run(
            [sys.executable, "-m", "sim_plant", "twin", str(robot_file), "-o", str(twin)],
            check=True,
        )
    for kind in ("trapezoids", "smooth"):
        name = f"back-and-forth-{kind}"
        if (folder / name).exists():
            continue
        measured = folder / f"{name}-measured"
        chosen = strokes(Robot.load(str(robot_file)), kind)
        own = chosen.robot.model_copy(update={"file": str(robot_file)})
        (folder / f"{name}.yaml").write_text(dump_plan(chosen.model_copy(update={"robot": own})))
        must(folder, "run", f"{name}.yaml", "-o", measured, "--channel", twin / "plant.yaml",
             "--drives", twin / "drives.yaml", "--bus-option", "seed=761")  # fmt: skip
        exported(Run.open(measured), folder / f"{name}-csv")
        (folder / f"{name}-csv" / "run").rename(folder / name)


def results(folder: Path, chosen: list[str]) -> Iterator[tuple[str, Any]]:
    """Yield each result, in order, as written by its command at present."""
    for name, (run, options) in (IDENTIFIED | BY_RIVALS).items():
        if (not chosen or name in chosen) and (folder / run).exists():
            (folder / run / "model.yaml").unlink(missing_ok=True)
            if name in BY_RIVALS:
                said = hil(folder, run, *options, program="benchmarks.rivals")
            else:
                said = hil(folder, "identify", run, *options)
            yield name, _content(folder / run / "model.yaml", said)
    for name, (command, path) in OTHERS.items():
        if (not chosen or name in chosen) and (folder / path).parent.exists():
            (folder / path).unlink(missing_ok=True)
            yield name, _content(folder / path, hil(folder, *command))


def _content(path: Path, said: str) -> Any:
    return _compact(yaml.safe_load(path.read_text())) if path.exists() else {"refused": said}


def _compact(value: Any) -> Any:
    """Reduce a result to compared values; square matrices to diagonal and norm."""
    if isinstance(value, dict):
        return {k: _compact(v) for k, v in value.items() if k not in NOT_COMPARED}
    if isinstance(value, list):
        if len(value) > 2 and all(
            isinstance(row, list) and len(row) == len(value) for row in value
        ):
            matrix = np.array(value, dtype=float)
            return [*np.diag(matrix).tolist(), float(np.linalg.norm(matrix))]
        return [_compact(each) for each in value]
    return value


def differences(was: Any, now: Any, place: str = "", scale: float = 0.0) -> Iterator[str]:
    """Return the places of differences between two results."""
    if isinstance(was, dict) and isinstance(now, dict):
        largest = _largest(was.values())
        for key in was | now:
            if key not in was or key not in now:
                yield f"{place}.{key}: {'new' if key in now else 'gone'}"
            else:
                yield from differences(was[key], now[key], f"{place}.{key}", largest)
    elif isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        largest = _largest(was)
        for k, (a, b) in enumerate(zip(was, now, strict=True)):
            yield from differences(a, b, f"{place}[{k}]", largest)
    elif _is_number(was) and _is_number(now):
        if not math.isclose(was, now, rel_tol=SAME, abs_tol=SAME * scale) and was != now:
            yield f"{place}: {was:.12g} -> {now:.12g}"
    elif was != now:
        yield f"{place}: {was} -> {now}"


def _largest(values: Any) -> float:
    return max((abs(v) for v in values if _is_number(v) and math.isfinite(v)), default=0.0)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def main() -> None:
    """Check or keep the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("what", nargs="?", choices=("check", "keep"), default="check")
    parser.add_argument("result", nargs="*", help="all by default")
    parser.add_argument("--runs", type=Path, default=Path("build/golden"), help="of runs")
    parser.add_argument("--public", type=Path, help="folder of public recordings")
    given = parser.parse_args()
    folder = given.runs.resolve()
    record_all(folder, given.public and given.public.resolve())
    KEPT.mkdir(exist_ok=True)
    changed = 0
    for name, now in results(folder, given.result):
        path = KEPT / f"{name}.json"
        if given.what == "keep":
            path.write_text(json.dumps(now, indent=0) + "\n")
            print(name, flush=True)
            continue
        found = differences(json.loads(path.read_text()), json.loads(json.dumps(now)))
        listed = list(islice(found, SHOWN + 1))
        changed += bool(listed)
        print(f"{name}: {'changed' if listed else 'the same'}", flush=True)
        print("".join(f"    {each}\n" for each in listed[:SHOWN]), end="")
        print("    ...\n" if len(listed) > SHOWN else "", end="")
    sys.exit(1 if changed else 0)


if __name__ == "__main__":
    main()
