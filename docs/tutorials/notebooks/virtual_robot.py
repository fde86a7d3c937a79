# %% [markdown]
# # A notebook: the virtual robot, from Python
#
# The tutorial [a virtual robot in ten minutes](../virtual-robot.md) once more, by calls instead of
# commands: plan, measure over CANopen, identify, and set the result against the truth. It is
# {download}`a notebook <virtual_robot.ipynb>`, and
# {download}`a Python file <virtual_robot.py>` whose cells begin with `# %%`, as VS Code and Spyder
# open it. It takes a quarter of a minute.

# %%
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
plan = hil.plan(robot, gravity=9, inertia=20, coupling=3)
checked = hil.dry_run(plan)
assert not checked.problems
print(f"{len(plan.measurements)} measurements, {checked.duration / 60:.1f} min of robot time")

# %% [markdown]
# ## Measuring
#
# The six drives of the virtual plant answer on the channel `manutec-r15` of the python-can
# interface `sim_plant`, over frames as on a wire. A real robot is better measured by `hil run`,
# where any key stops it.

# %%
run = hil.measure(plan, "runs/notebook")
run

# %% [markdown]
# ## The model

# %%
model = hil.identify(run)
print(model.verdict)
model

# %% [markdown]
# ## Is it true?
#
# Of the virtual plant the truth is known, which no estimator has seen. Of intervals of 95 % nearly
# all must hold it.

# %%
comparison = hil.compare(model, "manutec-r15")
low, high = model.interval(0.95).T
inside = (low <= comparison.others) & (comparison.others <= high)
print(f"{inside.sum()} of {len(inside)} intervals hold the truth")
comparison

# %% [markdown]
# ## A look at it
#
# Figures are those of the report. Friction over the speed of each axis:

# %%
hil.plot_friction(model)

# %% [markdown]
# and the torque of one measurement, as measured and as predicted:

# %%
hil.plot_torque(model, run)

# %% [markdown]
# ## Using it
#
# Torques, gravity and the mass matrix are a call away; arrays of samples go through at once.

# %%
q = np.array([0.0, -0.5, 1.0, 0.0, 0.5, 0.0])
print("to hold it   ", np.round(model.gravity(q), 1), "N m")
print("to accelerate", np.round(model.predict(q, 0.5, 1.0), 1), "N m")

# %% [markdown]
# `model.save("runs/notebook/model.yaml")` keeps it for `hil report`, `hil export` and all others.
# What else there is: [from Python and in notebooks](../../how-to/notebook.md).
