# %% [markdown]
# # A notebook: gravity compensation from a URDF and a CSV file
#
# A robot that is described by a URDF was moved by somebody else's controller, which logged angles
# and motor currents into a CSV file. From these two files comes a model, and from the model the
# torque that holds the robot against gravity: what a controller must add so that an arm can be
# led by hand. It is {download}`a notebook <gravity_compensation.ipynb>`, and
# {download}`a Python file <gravity_compensation.py>` whose cells begin with `# %%`. Called in a
# checkout, it finds the recordings of `examples/pan_tilt`, a head that pans and tilts; put your own
# in their place.

# %%
import os
from pathlib import Path

import numpy as np

import hil

EXAMPLES = Path(os.environ.get("EXAMPLES", "examples")) / "pan_tilt"
print((EXAMPLES / "excitation.yaml").read_text())

# %% [markdown]
# The map above states which column is what. `hil import --draft FILE` writes a first one.
#
# ## From the recording to a model

# %%
run = hil.import_recordings([EXAMPLES / "excitation.yaml"], "runs/head")
for note in run.journal.sessions[0].notes:
    print(note)

# %%
model = hil.identify(run)
print(model.verdict)
model

# %% [markdown]
# ## Judged by another recording
#
# A model is worth what it predicts of motions that it has not seen.

# %%
other = hil.import_recordings([EXAMPLES / "other.yaml"], "runs/other")
judgement = hil.validate(model, other)
print(judgement)
hil.plot_torque(model, other)

# %% [markdown]
# ## The torque that holds the head
#
# Panning turns about the vertical, so gravity is a matter of the second axis alone. Over the
# recording it is most of what that motor gives.

# %%
recording = next(iter(other)).recording
there = np.isfinite(recording.q).all(axis=1) & np.isfinite(recording.tau).all(axis=1)
q, tau = recording.q[there], recording.tau[there]
gravity = model.gravity(q)
left = tau - gravity
for axis, name in enumerate(["pan", "tilt"]):
    measured, rest = np.sqrt(np.mean(tau[:, axis] ** 2)), np.sqrt(np.mean(left[:, axis] ** 2))
    print(f"{name}: {measured:.2f} N m measured, {rest:.2f} N m left without gravity")

# %% [markdown]
# The interval states how well it is known; a controller that leaves friction to the hand that
# leads wants no more torque than this.

# %%
level = np.array([0.0, 0.4])
low, high = model.torque_interval(level, 0.0, 0.0, level=0.95)[1]
print(f"tilted by 0.4 rad: {model.gravity(level)[1]:.3f} N m")
print(f"with friction at rest, at 95 %: {low:.2f} to {high:.2f} N m")

# %% [markdown]
# ## Into a controller
#
# As C without any library, or as Python, URDF and more ([export](../../how-to/export.md)):

# %%
model.save("runs/head/model.yaml")
for path in hil.export("runs/head", "c", "exported"):
    print(path)
