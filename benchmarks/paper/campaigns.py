"""What is measured for the paper: plans by its own rule, plants, and campaigns by `hil run`.

Configurations follow section 6.2: of each element one angle after another that it depends on is
varied in steps of 25 degrees, at the counts of section 8. Nothing is optimised. A folder keeps
every campaign, so that it is measured once.
"""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from benchmarks.drift_study.scenarios import Scenario, write_plant
from hil.model.base_parameters import base_parameters
from hil.planning.design.by_counts import design
from hil.planning.design.friction import operation, stops, sweep
from hil.planning.design.measurable_elements import ELEMENTS
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.plan import as_plan, dump_plan
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan

ARTICLE: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("article.yaml").read_text())
"""What the paper says, as printed."""
ROBOT, FIRST_SEED = "manutec-r15", 201
STEP = 25
"""Of a varied angle, section 6.2 [degrees]."""
ELSEWHERE = (0, -30, 60, 40, 90, 0)
"""Angles of joints that are not varied, at which each dependence shows [degrees]."""
RULE = {
    "gravity": ((2, 2, 100), (3, 4, 175), (2, 3, 125), (3, 3, 125), (4, 4, 100), (5, 5, 100)),
    "inertia": (
        *((1, 2, 100), (1, 3, 125), (1, 4, 100), (1, 5, 100), (2, 3, 125), (2, 4, 100)),
        *((2, 5, 100), (3, 5, 100), (4, 5, 100), (5, 5, 25), (6, 6, 37.5)),
    ),
    "coupling": ((1, 2, 100),),
}
"""By kind: axis that is read, joint that is varied, and how far to both sides [degrees]. M44 over
q5 is the paper's own, and so are 15 values of g3 over q4 (Fig. 7); the rest fills its counts."""


def by_rule(robot: Robot) -> Plan:
    """Return the plan of section 6.2, 64 + 92 + 9 measurements."""
    return as_plan(robot, _by_rule(robot))


def _by_rule(robot: Robot) -> Iterator[Measurement]:
    sought = base_parameters(robot).dependencies.sought()
    for name, rows in RULE.items():
        kind, number = ELEMENT_KINDS[name], 0
        elements = {e.axis + 1: e for e in ELEMENTS[name](robot, list(sought[kind.group]))}
        for axis, over, widest in rows:
            for angle in np.arange(-widest, widest + 1, STEP):
                number += 1
                q = np.radians(ELSEWHERE)
                q[over - 1] = math.radians(angle)
                for i, stroke in elements[axis].strokes.items():
                    room = stroke / 2 + math.tau / float(robot.gear_ratio[i])
                    q[i] = np.clip(q[i], robot.q_min[i] + room, robot.q_max[i] - room)
                turned = elements[axis].turned(robot, q, number)
                yield elements[axis].measure(f"{kind.letter}{number:02d}", turned, number)


PLANS: dict[str, Callable[[Robot], Plan]] = {
    "rule": by_rule,
    "short": lambda robot: as_plan(robot, by_rule(robot).measurements[::3]),
    "glance": lambda robot: as_plan(robot, by_rule(robot).measurements[:64:8]),
    "chosen": lambda robot: design(robot, ARTICLE["counts"]),
    "sweep": sweep,
    "stops": lambda robot: stops(robot, 1),
    "operation": lambda robot: operation(robot, 1),
}
"""By the paper's rule, parts of that, by our greedy choice, and of friction."""


@dataclass(frozen=True)
class Case:
    """A plan and what differs of the plant from the one that comes along.

    Attributes
    ----------
    plan : str
    plant, friction : dict
        Keys of the plant, and of the friction of all axes.
    asymmetry : float
        Factor of the axes' asymmetries.
    gears : float
        Natural frequency of every gear with its motor held; 0 for rigid ones [Hz].
    offset : float
        First moment of link 4 across the forearm [kg m].
    """

    plan: str = "rule"
    plant: dict[str, Any] = field(default_factory=dict)
    friction: dict[str, Any] = field(default_factory=dict)
    asymmetry: float = 1.0
    gears: float = 0.0
    offset: float = 0.0


DISC = {
    "mass": ARTICLE["mass"], "centre": [0, 0, ARTICLE["distance"]],
    "Ixx": 0.0259, "Iyy": 0.0259, "Izz": 0.047,
}  # fmt: skip
"""A steel disc of the paper's mass, distance and Izz [kg, m, kg m2]."""
LOAD = {"payload": DISC}
FIG_7 = 0.1885 * math.tan(math.radians(ARTICLE["offset"]))
"""sy4 that shifts the phase of g3 over q4 as Fig. 7 has it: p13 tan 30 degrees [kg m]."""
CASES = {
    "bare": Case(),
    "loaded": Case(plant=LOAD),
    "sweep": Case("sweep"),
    "stops": Case("stops"),
    "operation": Case("operation"),
    "offset": Case(offset=FIG_7),
    "chosen": Case("chosen"),
    "default": Case("short"),
    "default-loaded": Case("short", LOAD),
    "still": Case("short", {"drift": False, "symmetric": True}),
    "threefold": Case("short", {"drift_strength": 3.0, "symmetric": True}),
    "uneven": Case("short", asymmetry=5.0),
    "load-friction": Case("short", friction={"load": 0.05}),
    "gears-80": Case("short", gears=80.0),
    "gears-45": Case("short", gears=45.0),
    "gears-20": Case("short", gears=20.0),
}


def write_case(case: Case, path: Path) -> None:
    """Write the plant file of a case."""
    path.unlink(missing_ok=True)
    write_plant(Scenario("", case.plant, case.friction), ROBOT, path)
    content = yaml.safe_load(path.read_text())
    for axis in content["axes"]:
        axis["friction"]["asymmetry"] *= case.asymmetry
        if case.gears:
            inertia, content["step"] = axis["drive"]["load_inertia"], 0.0005
            axis["drive"]["stiffness"] = inertia * (math.tau * case.gears) ** 2
    if case.offset:
        content["axes"][3]["link"]["sy"] = case.offset
    path.write_text(yaml.safe_dump(content, sort_keys=False))


def measure(folder: Path, robot: Robot, name: str, case: Case, seed: int) -> Run:
    """Return the run of a case and seed, measured over the bus unless it is there."""
    run, plan = folder / name / f"seed-{seed}", folder / f"{case.plan}.yaml"
    if not (run / "run.json").exists() or Run.open(run).missing:
        run.parent.mkdir(parents=True, exist_ok=True)
        if not plan.exists():
            plan.write_text(dump_plan(PLANS[case.plan](robot)))
        write_case(case, run.with_suffix(".yaml"))
        options = ("--channel", run.with_suffix(".yaml"), "--bus-option", f"seed={seed}")
        hil("run", plan, "-o", run, *options, *(("--resume",) if run.exists() else ()))
    return Run.open(run)


def hil(*arguments: object) -> None:
    """Call the command line; its own message says what went wrong."""
    command = [sys.executable, "-m", "hil", *map(str, arguments)]
    streams: dict[str, Any] = {"stdin": subprocess.DEVNULL, "capture_output": True, "text": True}
    done = subprocess.run(command, **streams, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
