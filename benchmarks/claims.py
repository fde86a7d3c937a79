"""Errors of identification on many plants, each case with its target.

Every seed is another plant, measured by `hil run` with the designed plan; nothing was tuned on
these seeds. The share of runs in which the largest cause of error is named first is stated as well.
Cases::

    default    drift and asymmetry on
    half       default with half the measurements
    still      no drift, symmetric friction: the case of the published two-step method
    lag        each current read 0 to 8 ms late, another lag for each axis and seed
    bodies     a second plant, whose links are real bodies
    load       friction that grows with the load, mu = 0.05
    load-10    friction that grows with the load, mu = 0.10
    strong     symmetric friction that drifts three times as much
    gears      soft gears, 45 to 80 Hz with the motor held, another one for each axis and seed
    sync-8     a SYNC every 8 ms
    sync-12    a SYNC every 12 ms
    encoder    encoders of 1024 increments
    ten        ten minutes of strokes and trajectories
    asymmetry  friction that differs by 2 to 4 % between directions
    ripple     torque ripple of order 7, 5 % of peak torque, which no method here models
    weak       ten minutes of a trajectory that hardly moves the wrist
    payload    10.86 kg at 140 mm, against the default run of another seed
    offset     a centre of mass that moves the phase of Fig. 7 by 5 degrees

    python benchmarks/claims.py [CASE ...] [--seeds 20] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import math
import tempfile
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from accuracy import ROBOT, SIDE_BY_SIDE, hil, judge, rms
from drift_study.scenarios import SCENARIOS, Scenario, write_plant
from figures import Figure, keep
from rivals.cramer_rao import cramer_rao

from hil.commands.diagnose import diagnose
from hil.ground_truth.true_parameters import true_parameters
from hil.model.dependencies import GROUPS
from hil.model.robot import Robot
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.measurement import shows_element
from hil.results.advice import error_budget
from hil.results.problem import regression
from hil.runs.atomic_file import write_file
from hil.runs.pooling import recorded
from hil.runs.run import Run
from hil.tasks.measuring import packaged_drives
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.ground_truth.comparison import Comparison

DEPENDS = (
    "hil/estimation",
    "hil/least_squares",
    "hil/friction",
    "hil/planning",
    "sim_plant/physics",
)
FIRST_SEED = 101
MASS, DISTANCE = 10.86, 0.14
"""Mass of the load and its distance from the axis [kg], [m]."""
NATURAL = (45.0, 80.0)
"""Natural frequencies of soft gears with blocked motor [Hz]."""
WRIST = 0.02
"""Share of the wrist's motion in a trajectory of the case `weak`."""
OFFSET = 0.0165
"""First moment of link 4 across the forearm [kg m]."""


@dataclass(frozen=True)
class Case:
    """Case of plant and plan, with its targets.

    Attributes
    ----------
    plant : str
        Plant file from which the case is derived.
    plan : str
        Plan of `PLANS`.
    sync, increments : float, int
        Period [s] and increments of a revolution; those of the robot's drives file by default.
    change : Scenario
        Changes of the plant, the same for every seed.
    targets : dict
        Relative errors of the improved method, rms over seeds [%].
    cause : str, optional
        Cause expected as the first named one; none by default.
    """

    plant: str = ROBOT
    plan: str = "plan"
    change: Scenario = SCENARIOS["asymmetric"]
    targets: dict[str, float] = field(default_factory=dict)
    sync: float | None = None
    increments: int | None = None
    cause: str | None = None


PLANS = {
    "plan": (),
    "half": ("--gravity", 32, "--inertia", 46, "--coupling", 5),
    "ten": ("--minutes", 10, "--with-trajectories"),
}
"""Options of `hil plan` for each plan."""
CASES = {
    "default": Case(
        targets={"gravity": 0.006, "diagonal": 0.015, "off_diagonal": 0.06, "torque": 0.08}
    ),
    "half": Case(plan="half", targets={"diagonal": 0.1}),
    "still": Case(change=SCENARIOS["off"]),
    "lag": Case(targets={"diagonal": 0.1}),
    "bodies": Case(plant=f"{ROBOT}-bodies", targets={"diagonal": 0.1}),
    "load": Case(change=SCENARIOS["load"], targets={"torque": 0.1}, cause="friction of the load"),
    "load-10": Case(
        change=Scenario("10 % of load as friction", {"drift": True}, {"load": 0.1}),
        targets={"torque": 0.1},
        cause="friction of the load",
    ),
    "strong": Case(change=SCENARIOS["strong"], targets={"torque": 0.15}),
    "gears": Case(targets={"torque": 0.12}, cause="soft gears"),
    "sync-8": Case(sync=0.008, targets={"torque": 0.12}, cause="slow SYNC"),
    "sync-12": Case(sync=0.012, targets={"torque": 0.12}, cause="slow SYNC"),
    "encoder": Case(increments=1024, targets={"torque": 0.12}, cause="coarse encoders"),
    "ten": Case(plan="ten", targets={"diagonal": 0.015, "torque": 0.05}),
    "asymmetry": Case(
        change=Scenario("asymmetric", {"drift": True}, asymmetry=5),
        cause="friction that differs by direction",
    ),
    "ripple": Case(cause="torque ripple of further orders"),
    "weak": Case(plan="weak", cause="weak excitation"),
    "payload": Case(
        change=Scenario(
            "a load",
            {
                "payload": {
                    "mass": MASS, "centre": [0, 0, DISTANCE],
                    "Ixx": 0.0259, "Iyy": 0.0259, "Izz": 0.047,
                }
            },
        )
    ),
    "offset": Case(change=Scenario("an offset", {"drift": True}, offset=OFFSET)),
}  # fmt: skip


def make_plan(name: str, path: Path) -> None:
    """Write a plan, unless the file exists."""
    if path.exists():
        return
    if name in PLANS:
        hil("plan", ROBOT, "-o", path, *PLANS[name])
        return
    hil("plan", ROBOT, "--kind", "trajectory", "-o", path, "--minutes", 10)
    content = yaml.safe_load(path.read_text())
    (trajectory,) = content["measurements"]
    for wave in (trajectory["sine"], trajectory["cosine"]):
        wave[3:] = [[WRIST * each for each in joint] for joint in wave[3:]]
    path.write_text(yaml.safe_dump(content, sort_keys=False))


def make_plant(name: str, seed: int, path: Path) -> Path:
    """Write the plant file of a case."""
    case = CASES[name]
    write_plant(case.change, case.plant, path)
    content = yaml.safe_load(path.read_text())
    random = np.random.default_rng(seed)
    for axis in content["axes"]:
        if name == "lag":
            axis["drive"]["current_lag"] = round(float(random.uniform(0, 0.008)), 5)
        if name == "gears":
            wave = math.tau * float(random.uniform(*NATURAL))
            axis["drive"]["stiffness"] = axis["drive"]["load_inertia"] * wave**2
        if case.increments is not None:
            axis["drive"]["increments"] = case.increments
    if name == "gears":
        content["step"] = 0.0005
    if name == "ripple":
        content["noise"] = {"other_ripple": {"order": 7, "amplitude": 0.05}}
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


def measure(folder: Path, name: str, seed: int) -> Path:
    """Run the campaign of one case and seed, unless the run exists."""
    run = folder / name / f"seed-{seed}"
    if run.exists() and not Run.open(run).missing:
        return run
    run.parent.mkdir(exist_ok=True)
    plan, drives = settings(folder, name)
    plant = make_plant(name, seed, run.with_suffix(".yaml"))
    resume = ("--resume",) if run.exists() else ()
    options = ("--channel", plant, "--bus-option", f"seed={seed}", "--drives", drives)
    hil("run", plan, "-o", run, *options, *resume)
    return run


def settings(folder: Path, name: str) -> tuple[Path, Path]:
    """Return plan and drives file of a case, written if missing."""
    case, own = CASES[name], folder / f"{name}-drives.yaml"
    text = packaged_drives(Robot.load(ROBOT)).read_text()
    plan = folder / f"{case.plan}.yaml"
    if case.sync is not None:
        text = text.replace("sync_period: 0.004", f"sync_period: {case.sync}")
        content = yaml.safe_load(plan.read_text()) | {"sample_period": case.sync}
        plan = folder / f"{name}-plan.yaml"
        write_file(plan, yaml.safe_dump(content, sort_keys=False).encode())
    if case.increments is not None:
        text = text.replace("revolution: 4096", f"revolution: {case.increments}")
    write_file(own, text.encode())  # atomic, because seeds read the file in parallel
    return plan, own


def assess(run: Path) -> tuple[dict[str, Comparison], list[str]]:
    """Return the errors of each method, and the named causes of error."""
    folder = Run.open(run)
    strokes = any(shows_element(m) for m in folder.plan.measurements)
    methods = ("improved", "published") if strokes else ("improved",)
    judged = judge(folder, methods, run.with_suffix(".yaml"))
    budget = error_budget(judged["improved"][0])
    return {method: each for method, (_, each) in judged.items()}, [term.cause for term in budget]


def print_errors(name: str, runs: Sequence[Path]) -> None:
    """Print the errors of one case, and the frequency of its cause among the named ones."""
    with ProcessPoolExecutor(SIDE_BY_SIDE) as pool:
        judged, named = zip(*pool.map(assess, runs), strict=True)
    kept: dict[str, Figure] = {}
    for method in judged[0]:
        found = [each[method] for each in judged]
        percents = {g: [100 * c.group_error[g] for c in found] for g in GROUPS}
        percents["torque"] = [100 * c.mean_torque_error for c in found]
        errors = {what: rms(each) for what, each in percents.items()}
        targets = CASES[name].targets if method == "improved" else {}
        figures = ", ".join(
            f"{what} {error:.3f}" + (f" ({targets[what]:g})" if what in targets else "")
            for what, error in errors.items()
        )
        inside = 100 * np.mean([c.inside for c in found])
        print(f"{name}, {method}, {len(runs)} seeds: {figures} %; {inside:.1f} % in 95 % intervals")
        scatter = {what: float(np.std(each)) for what, each in percents.items()}
        kept |= {f"{method}-{k}": Figure(x, "%", scatter=scatter[k]) for k, x in errors.items()}
        kept[f"{method}-inside"] = Figure(inside, "%", 3)
    cause = CASES[name].cause
    first = sum((causes[0] if causes else None) == cause for causes in named)
    print(f"{name}: {cause or 'nothing'} named first in {first} of {len(runs)}")
    kept["seeds"], kept["named-first"] = Figure(len(runs)), Figure(first)
    if name == "default":
        ratio = print_efficiency(runs[0], [each["improved"] for each in judged])
        kept["over-cramer-rao"] = Figure(ratio, digits=3)
    command = f"python benchmarks/claims.py {name}"
    seeds = [int(run.name.removeprefix("seed-")) for run in runs]
    keep(f"claims-{name}", kept, depends=DEPENDS, command=command, seeds=seeds)


def print_efficiency(run: Path, found: Sequence[Comparison]) -> float:
    """Print the ratio of scatter to the Cramer-Rao bound; return its median."""
    folder = Run.open(run)
    variance = noise(run.with_suffix(".yaml"))
    scatter = np.sqrt(np.mean([c.difference**2 for c in found], axis=0))
    for known in (False, True):
        least = cramer_rao(folder.robot, recorded(folder), variance, friction_known=known)
        ratio = scatter / np.sqrt(np.diag(least))
        print(
            f"error over Cramer-Rao bound, friction {'known' if known else 'unknown'}: median"
            f" {np.median(ratio):.2f} (1.2), worst {ratio.max():.2f} (1.8), each"
            f" {np.array2string(ratio, precision=2)}"
        )
    return float(np.median(ratio))


def noise(plant: Path) -> NDArray[np.float64]:
    """Return the variance of each axis's torque reading, white noise and quantisation [(N m)^2]."""
    file = load_plant_file(str(plant))
    drives = [axis.drive for axis in file.axes]
    step = [d.gear_ratio * d.torque_constant * d.rated_current_mA * 1e-6 for d in drives]
    white = [file.noise.torque * d.peak_torque for d in drives]
    return np.array(white) ** 2 + np.array(step) ** 2 / 12


def print_payload(folder: Path, seeds: Sequence[int]) -> None:
    """Print errors and coverage of the identified load."""
    robot = Robot.load(ROBOT)
    bare = true_parameters(robot, folder / "default" / f"seed-{seeds[0]}.yaml")
    change, mass, distance, inside = [], [], [], []
    for k, seed in enumerate(seeds):
        loaded = folder / "payload" / f"seed-{seed}"
        bare_run = Run.open(folder / "default" / f"seed-{seeds[k - 1]}")
        whole = regression(bare_run, loaded=[Run.open(loaded)]).fit()
        assert whole.before is not None
        assert whole.after is not None
        found, changed = whole.load, whole.after.values - whole.before.values
        variance = whole.before.scatter_covariance + whole.after.scatter_covariance
        error = np.sqrt(np.diag(variance))
        truth = true_parameters(robot, loaded.with_suffix(".yaml")) - bare
        change.append(100 * float(np.linalg.norm(changed - truth) / np.linalg.norm(truth)))
        load = dict(zip(LINK_PARAMETERS, found.phi, strict=True))
        mass.append(100 * (load["m"] / MASS - 1))
        distance.append(1e3 * (load["sz"] / load["m"] - DISTANCE))
        inside.append(np.abs(changed - truth) < 1.96 * error)
    print(
        f"payload, {len(seeds)} seeds: dp {rms(change):.3f} % of its norm (0.3), mass"
        f" {rms(mass):.3f} % (0.2), distance {rms(distance):.3f} mm (0.5);"
        f" {100 * np.mean(inside):.0f} % within 1.96 standard errors"
    )


def print_offset(runs: Sequence[Path]) -> None:
    """Print the share of runs that rank the offset of link 4 first."""
    errors = [diagnose(Run.open(run)).errors for run in runs]
    found = [next(c for c in each.alone if "sy4" in c.names) for each in errors]
    first = sum(
        c is each.alone[0] and any("sy4" in one.names for one in each.found)
        for c, each in zip(found, errors, strict=True)
    )
    values = np.array([each.value for each in found])
    print(
        f"offset, {len(runs)} seeds: ranked first and significant in {first} (19 of 20), t from"
        f" {min(abs(e.t) for e in found):.1f} to {max(abs(e.t) for e in found):.1f}, value"
        f" {values.mean():.4f} +- {values.std():.4f} kg m ({OFFSET})"
    )


def main() -> None:
    """Measure, estimate, compare, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("cases", nargs="*", help=", ".join(CASES))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--keep", type=Path, help="folder for plans and runs; reused if there")
    given = parser.parse_args()
    cases = given.cases or list(CASES)
    if unknown := set(cases) - set(CASES):
        parser.error(f"no such case: {', '.join(unknown)}")
    seeds = range(FIRST_SEED, FIRST_SEED + given.seeds)
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name in {"plan", *(CASES[case].plan for case in cases)}:
            make_plan(name, folder / f"{name}.yaml")
        for name in cases:
            with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
                runs = list(pool.map(lambda seed, name=name: measure(folder, name, seed), seeds))
            if name == "payload":
                for seed in seeds:
                    measure(folder, "default", seed)
                print_payload(folder, seeds)
            elif name == "offset":
                print_offset(runs)
            else:
                print_errors(name, runs)


if __name__ == "__main__":
    main()
