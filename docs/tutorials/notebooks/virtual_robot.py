# %% [markdown]
# # A notebook: the virtual robot, from Python
#
# The tutorial [a virtual robot in ten minutes](../virtual-robot.md) once more, by calls instead of
# commands: plan, measure over CANopen, identify, and set the result against the truth. It is
# {download}`a Python file <virtual_robot.py>` whose cells begin with `# %%`, as JupyterLab (with
# jupytext), VS Code and Spyder open it as a notebook. A test carries it out; it takes a quarter of
# a minute.

# %%
from pathlib import Path

import numpy as np

import hil

robot = hil.Robot.load("manutec-r15")
base = hil.base_parameters(robot)
for name, unit, expression in zip(base.names, base.units, base.expressions, strict=True):
    print(f"{name:4} {unit:7} {expression}")

# %% [markdown]
# ## A plan
#
# Few measurements of each kind are enough here. A plan is data: it is looked at before anything
# moves.

# %%
from hil.planning.design.by_counts import design
from hil.planning.dry_run import dry_run

plan = design(robot, {"gravity": 9, "inertia": 20, "coupling": 3})
checked = dry_run(plan, robot)
assert not checked.problems
print(f"{len(plan.measurements)} measurements, {checked.duration / 60:.1f} min of robot time")

# %% [markdown]
# ## Measuring
#
# The six drives of the virtual plant answer on the channel `manutec-r15` of the python-can
# interface `sim_plant`, over frames as on a wire. A real robot is measured by `hil run`, which asks
# the operator, watches the keyboard and puts back what the drives held before.

# %%
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.measuring.campaign import run_campaign
from hil.model.robot import ROBOTS
from hil.runs.journal import BusName
from hil.runs.run_folder import RunFolder

drives_file = ROBOTS / "manutec-r15.drives.yaml"
drives = load_drives(drives_file)
bus = open_drive_bus(drives, "sim_plant", "manutec-r15")
folder = RunFolder.create(Path("runs/notebook"), plan, robot, drives_file.read_text())
for _ in run_campaign(folder, bus, BusName("sim_plant", "manutec-r15")):
    pass
run = hil.Run.open("runs/notebook")
run

# %% [markdown]
# ## The model

# %%
model = hil.identify(run)
print(model.outcome)
print(model.summary())

# %% [markdown]
# ## Is it true?
#
# Of the virtual plant the truth is known, which no estimator has seen. Of intervals of 95 % nearly
# all must hold it.

# %%
from hil.ground_truth.true_parameters import true_parameters

truth = true_parameters(robot, "manutec-r15")
low, high = model.interval(0.95).T
inside = (low <= truth) & (truth <= high)
print(f"{inside.sum()} of {len(truth)} intervals hold the truth")

# %% [markdown]
# ## Using it
#
# Torques, gravity and the mass matrix are a call away; arrays of samples go through at once.

# %%
q = np.array([0.0, -0.5, 1.0, 0.0, 0.5, 0.0])
print("to hold it   ", np.round(model.gravity(q), 1), "N m")
print("to accelerate", np.round(model.torque(q, 0.5, 1.0), 1), "N m")

# %% [markdown]
# `model.save("runs/notebook/model.yaml")` keeps it for `hil report`, `hil export` and all others.
# What else there is: [from Python and in notebooks](../../how-to/notebook.md).
