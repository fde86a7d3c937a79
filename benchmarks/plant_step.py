"""Time of a step of the plant's physics, against one `mj_step` of MuJoCo for the same arm.

A step of the plant contains six cascaded loops with profiles and saturation, ripple, drifting
friction with presliding, and forward dynamics with motor inertias, all axes in motion. A step of
MuJoCo contains only the arm with armatures and viscous damping, without contacts and constraints.
Both programs are called from compiled code for many steps at once. The arm consists of physically
possible bodies with the manutec-r15's frames, as required by MuJoCo; both programs must compute
equal accelerations before the measurement. They run in turn, so that a busy machine slows both, and
the ratio is the median over the turns::

    python benchmarks/plant_step.py
"""

from __future__ import annotations

import math
import time
from statistics import median
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from figures import Figure, keep
from rich.console import Console
from rich.table import Table

from sim_plant.physics import machine_step, rigid_body
from sim_plant.physics.state import QD, VELOCITY_MAX
from sim_plant.plant import Plant
from sim_plant.plant_file import Payload, load_plant_file

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from sim_plant.plant_file import PlantFile

KEYS = ("ours", "euler", "implicitfast")
STEPS = 1000
REPEATS = 200
DAMPING = 20.0
LINKS = (
    # mass [kg], centre of mass [m], principal inertias about the centre [kg m^2]
    (120.0, (0.0, 0.0, -0.20), (5.0, 5.0, 4.0)),
    (65.0, (0.20, 0.0, 0.15), (0.8, 3.0, 3.0)),
    (45.0, (0.05, -0.10, 0.0), (1.2, 1.0, 1.2)),
    (20.0, (0.0, 0.0, -0.15), (0.5, 0.5, 0.1)),
    (8.0, (0.0, -0.02, 0.0), (0.06, 0.04, 0.06)),
    (3.0, (0.0, 0.0, 0.05), (0.02, 0.02, 0.02)),
)


def real_arm() -> PlantFile:
    """Return the manutec-r15 with links possible in steel."""
    file = load_plant_file("manutec-r15")
    axes = []
    for axis, (mass, centre, (ixx, iyy, izz)) in zip(file.axes, LINKS, strict=True):
        link = Payload(mass=mass, centre=centre, Ixx=ixx, Iyy=iyy, Izz=izz).body()
        axes.append(axis.model_copy(update={"link": link}))
    return file.model_copy(update={"axes": tuple(axes)})


def mjcf(file: PlantFile, integrator: str) -> str:
    """Return the same arm in MuJoCo's format."""
    bodies = ""
    for axis, (m, centre, inertia) in zip(file.axes, LINKS, strict=True):
        alpha, r = math.radians(axis.frame.alpha_deg), axis.frame.r
        place = f"{axis.frame.d} {-math.sin(alpha) * r} {math.cos(alpha) * r}"
        armature = axis.drive.rotor_inertia * axis.drive.gear_ratio**2
        bodies += (
            f'<body pos="{place}" quat="{math.cos(alpha / 2)} {math.sin(alpha / 2)} 0 0">'
            f'<inertial mass="{m}" pos="{_row(centre)}" diaginertia="{_row(inertia)}"/>'
            f'<joint axis="0 0 1" armature="{armature}" damping="{DAMPING}"/>'
        )
    return (
        f'<mujoco><option timestep="{file.step}" gravity="{_row(file.gravity)}"'
        f' integrator="{integrator}"><flag contact="disable" constraint="disable"/></option>'
        f"<worldbody>{bodies}{'</body>' * len(file.axes)}</worldbody></mujoco>"
    )


def _row(numbers: tuple[float, ...]) -> str:
    return " ".join(map(repr, numbers))


def check_same_arm(plant: Plant, model: mujoco.MjModel) -> None:
    """Raise unless both find the same accelerations."""
    data = mujoco.MjData(model)
    data.qpos, data.qvel, data.qfrc_applied = np.random.default_rng(1).normal(size=(3, 6))
    mujoco.mj_forward(model, data)
    torque = data.qfrc_applied - DAMPING * data.qvel
    motors = np.array([a.drive.rotor_inertia * a.drive.gear_ratio**2 for a in plant.file.axes])
    ours = rigid_body.forward_dynamics(*plant._arm, motors, data.qpos, data.qvel, torque)
    assert np.allclose(ours, data.qacc, rtol=1e-9), (ours, data.qacc)


def plant_task(plant: Plant) -> Callable[[], None]:
    """Return a function for `STEPS` steps with all axes in motion, without Python in between."""
    for servo, axis in zip(plant.axes, plant.file.axes, strict=True):
        drive = axis.drive
        per_rad = drive.gear_ratio * drive.increments / math.tau
        way = drive.direction * 0.9 * math.radians(drive.range_deg)
        servo.enable()
        servo.move(
            drive.zero + way * per_rad,
            0.2 * drive.velocity_max * per_rad,
            drive.acceleration_max * per_rad,
            drive.acceleration_max * per_rad,
        )
    plant.advance(0.5)  # beyond the ramps: in steady motion no event ends the run
    number = round(plant.time / plant.file.step)
    state, profile = plant.state.copy(), plant.profile.copy()

    def task() -> None:
        plant.state[:], plant.profile[:] = state, profile
        done = machine_step.run(
            STEPS, number, plant.file.step, *plant._arm,
            plant.const, plant.state, plant.profile, plant._normal,
        )  # fmt: skip
        assert done == STEPS, f"an event ended the run after {-done} steps"
        assert np.abs(plant.state[:, QD] / plant.const[:, VELOCITY_MAX]).min() > 0.1

    return task


def mujoco_task(model: mujoco.MjModel) -> Callable[[], None]:
    """Return a function for `STEPS` steps of the moving arm, without Python in between."""
    data = mujoco.MjData(model)
    rest = np.zeros(6), np.full(6, 0.5)

    def task() -> None:
        data.qpos, data.qvel = rest
        mujoco.mj_step(model, data, nstep=STEPS)

    return task


def time_in_turns(tasks: Mapping[str, Callable[[], None]]) -> dict[str, list[float]]:
    """Time all tasks in turn, `REPEATS` times; return the costs of one step [us]."""
    costs: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(REPEATS):
        for name, task in tasks.items():
            begin = time.perf_counter()
            task()
            costs[name].append((time.perf_counter() - begin) / STEPS * 1e6)
    return costs


def main() -> None:
    """Check the equality of both arms, time both, print the table and keep it."""
    plant = Plant(real_arm())
    ours = "sim_plant: arm, friction, servos"
    tasks = {ours: plant_task(plant)}
    for integrator in ("Euler", "implicitfast"):
        model = mujoco.MjModel.from_xml_string(mjcf(plant.file, integrator))
        check_same_arm(plant, model)
        tasks[f"MuJoCo {mujoco.__version__}: arm, {integrator}"] = mujoco_task(model)
    costs = time_in_turns(tasks)
    table = Table("", "us per step", "least", "times ours", title="One step, six axes")
    kept: dict[str, Figure] = {}
    for key, (name, values) in zip(KEYS, costs.items(), strict=True):
        ratios = [value / our for value, our in zip(values, costs[ours], strict=True)]
        table.add_row(name, f"{median(values):.2f}", f"{min(values):.2f}", f"{median(ratios):.2f}")
        if name != ours:
            kept[f"{key}-over-ours"] = Figure.median(ratios)
        kept[f"{key}-step"] = Figure.median(values, "us")
    Console().print(table)
    command = "python benchmarks/plant_step.py"
    keep("plant-step", kept, depends=("sim_plant/physics",), command=command)


if __name__ == "__main__":
    main()
