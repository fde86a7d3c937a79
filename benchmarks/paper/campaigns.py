"""Campaigns for the paper: plans by its own rule, plants, and runs by `hil run`.

Configurations follow section 6.2: for each element, the angles that influence the element are
varied one at a time in steps of 25 degrees, with the counts of section 8. Nothing is optimised. A
folder keeps every campaign, so that it is measured once.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from benchmarks.drift_study.cell import Cell
from benchmarks.drift_study.cell import measure as measure_cell
from benchmarks.drift_study.scenarios import Scenario, write_plant
from hil.model.base_parameters import base_parameters
from hil.planning.design.by_counts import design
from hil.planning.design.friction import operation, stops, sweep
from hil.planning.design.measurable_elements import ELEMENTS
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.plan import dump_plan, make_plan
from hil.tasks.measuring import packaged_drives

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan

ARTICLE: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("article.yaml").read_text())
"""Printed values of the paper."""
ROBOT, SEEDS = "manutec-r15", range(201, 221)
STEP = 25
"""Step of a varied angle, section 6.2 [degrees]."""
ELSEWHERE = (0, -30, 60, 40, 90, 0)
"""Angles of joints without variation, chosen such that each dependence is visible [degrees]."""
RULE = {
    "gravity": ((2, 2, 100), (3, 4, 175), (2, 3, 125), (3, 3, 125), (4, 4, 100), (5, 5, 100)),
    "inertia": (
        *((1, 2, 100), (1, 3, 125), (1, 4, 100), (1, 5, 100), (2, 3, 125), (2, 4, 100)),
        *((2, 5, 100), (3, 5, 100), (4, 5, 100), (5, 5, 25), (6, 6, 37.5)),
    ),
    "coupling": ((1, 2, 100),),
}
"""Rule by kind: measured axis, varied joint, and ranges in both directions [degrees]. The paper
states M44 over q5 and 15 values of g3 over q4 (Fig. 7); the others complete the paper's counts.
"""


def rule_measurements(robot: Robot) -> Iterator[Measurement]:
    """Yield the measurements of section 6.2, 64 + 92 + 9."""
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
                turned = elements[axis].turn_motors(robot, q, number)
                yield elements[axis].measure(f"{kind.letter}{number:02d}", turned, number)


PLANS: dict[str, Callable[[Robot], Plan]] = {
    "rule": lambda robot: make_plan(robot, rule_measurements(robot)),
    "short": lambda robot: make_plan(robot, list(rule_measurements(robot))[::3]),
    "glance": lambda robot: make_plan(robot, list(rule_measurements(robot))[:64:8]),
    "chosen": lambda robot: design(robot, ARTICLE["counts"]),
    "sweep": sweep,
    "stops": lambda robot: stops(robot, 1),
    "operation": lambda robot: operation(robot, 1),
}
"""Plans by the paper's rule, by parts of it, by our greedy choice, and for friction."""


DISC = {
    "mass": ARTICLE["mass"], "centre": [0, 0, ARTICLE["distance"]],
    "Ixx": 0.0259, "Iyy": 0.0259, "Izz": 0.047,
}  # fmt: skip
"""Steel disc with the paper's mass, distance and Izz [kg, m, kg m2]."""
LOAD = {"payload": DISC}
FIG_7 = 0.1885 * math.tan(math.radians(ARTICLE["offset"]))
"""First moment of link 4 for the phase of g3 over q4 in Fig. 7: p13 tan 30."""
STIFF = {"position": 50.0, "velocity": 240.0, "integral": 40.0}
"""Bandwidths of the drives' loops, twice those of the built-in plant [1/s]."""
CASES = {
    "bare": ("rule", Scenario("as it comes along")),
    "loaded": ("rule", Scenario("with the load", LOAD)),
    "sweep": ("sweep", Scenario("as it comes along")),
    "stops": ("stops", Scenario("as it comes along")),
    "operation": ("operation", Scenario("as it comes along")),
    "offset": ("rule", Scenario("centre of mass off the forearm", offset=FIG_7)),
    "default": ("short", Scenario("as it comes along")),
    "default-loaded": ("short", Scenario("with the load", LOAD)),
    "still": ("short", Scenario("no drift, symmetric", {"drift": False, "symmetric": True})),
    "threefold": ("short", Scenario("symmetric", {"drift_strength": 3.0, "symmetric": True})),
    "uneven": ("short", Scenario("asymmetry of 2 to 4 %", asymmetry=5)),
    "load-friction": ("short", Scenario("friction of the load", {}, {"load": 0.05})),
    "stiff": ("short", Scenario("loops of twice the bandwidth", {"loops": STIFF})),
    "gears-80": ("short", Scenario("gears of 80 Hz", gears=80)),
    "gears-45": ("short", Scenario("gears of 45 Hz", gears=45)),
    "gears-20": ("short", Scenario("gears of 20 Hz", gears=20)),
}
"""Plan and plant by case name."""


def measure(folder: Path, robot: Robot, plan: str, plant: Scenario, name: str, seed: int) -> Cell:
    """Return a campaign with its run, measured over the bus if missing."""
    cell = Cell(folder.resolve(), name, plan, seed, seed)
    cell.plant.parent.mkdir(parents=True, exist_ok=True)
    write_plant(plant, ROBOT, cell.plant)
    if not cell.plan.exists():
        cell.plan.write_text(dump_plan(PLANS[plan](robot)))
        (folder / "robot.yaml").write_text(robot.text)
        (folder / "drives.yaml").write_text(packaged_drives(robot).read_text())
    measure_cell(cell)
    return cell
