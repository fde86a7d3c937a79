"""A tree is identified from recordings that MuJoCo made: two arms on a torso that turns."""

from pathlib import Path

import numpy as np
import pytest
from possible_models import possible
from small_run import SIMULATED
from trajectory_run import recorded

import hil
from hil.planning.design.trajectories import Search, design_trajectory
from hil.planning.plan import make_plan
from hil.runs.recording_file import Measured
from hil.runs.run_folder import RunFolder

mujoco = pytest.importorskip("mujoco")
pytestmark = pytest.mark.usefixtures("skip_causes")

ARM = """<body name="{side}_upper" pos="0 {y} 0.4" euler="{turn} 0 0">
  <joint name="{side}_shoulder" axis="0 0 1"/>
  <inertial pos="0.12 0.01 {z}" mass="2.5" fullinertia="0.01 0.03 0.03 0.001 0.002 0.001"/>
  <body name="{side}_fore" pos="0.3 0 0"><joint name="{side}_elbow" axis="0 0 1"/>
   <inertial pos="0.1 0.02 0.03" mass="1.6" fullinertia="0.005 0.015 0.014 0.001 0.001 0.0005"/>
   <body name="{side}_hand" pos="0.25 0 0" euler="0 1.5707963267948966 0">
    <joint name="{side}_wrist" axis="0 0 1"/>
    <inertial pos="0.03 0.02 0.05" mass="0.7"
     fullinertia="0.003 0.0025 0.0015 0.0002 0.0001 0.0003"/></body></body></body>"""
TEXT = f"""<mujoco model="two-arms"><compiler angle="radian" autolimits="true"/>
<option timestep="0.001" integrator="implicitfast"/>
<default><joint damping="1.5" frictionloss="0.8" armature="0.05" range="-2.5 2.5"
 solreffriction="0 -999" solimpfriction="0.999 0.999 0.001 0.5 2"/></default><worldbody>
<body name="torso" pos="0 0 1"><joint name="waist" axis="0 0 1"/>
 <inertial pos="0.01 0.02 0.2" mass="8" fullinertia="0.2 0.25 0.15 0.01 0.01 0.02"/>
 {ARM.format(side="left", y=0.2, turn=1.5707963267948966, z=-0.05)}
 {ARM.format(side="right", y=-0.2, turn=-1.5707963267948966, z=0.05)}</body></worldbody></mujoco>"""


def reference(rng, n):
    """Return instants, and positions and velocities of sums of sines, within limits."""
    t = np.arange(0.0, 40.0, 0.001)
    w = 0.1 * np.pi * np.arange(1, 15)[:, None]
    a, b = rng.normal(size=(2, 14, n)) / (1.0 + 0.25 * np.arange(1, 15)[:, None])
    q = np.sin(t[:, None] * w.T) @ a + (np.cos(t[:, None] * w.T) - 1.0) @ b
    steps = [q, np.gradient(q, t, axis=0)]
    steps.append(np.gradient(steps[1], t, axis=0))
    most = [np.abs(x).max(axis=0) / bound for x, bound in zip(steps, (1.6, 3.0, 12.0), strict=True)]
    q = q / np.max(most, axis=0) * np.clip(t, 0.0, 1.0)[:, None] ** 2
    return t, q, np.gradient(q, t, axis=0)


def record(model, seed):
    """Return a recording of arms moved by a PD controller, with noise of encoder and torque."""
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    t, wanted, speed = reference(rng, model.nv)
    q, tau = np.empty_like(wanted), np.empty_like(wanted)
    for k in range(len(t)):
        data.qfrc_applied[:] = 800.0 * (wanted[k] - data.qpos) + 40.0 * (speed[k] - data.qvel)
        q[k], tau[k] = data.qpos, data.qfrc_applied
        mujoco.mj_step(model, data)
    tau[1:] = (tau[1:] + tau[:-1]) / 2  # held over a step: the mean acts at the sample
    q, tau = q + rng.normal(0.0, 2e-5, q.shape), tau + rng.normal(0.0, 0.05, q.shape)
    return t[::2], q[::2], tau[::2]


def truth(model, robot):
    """Return the true base parameters, from torques without friction."""
    model.dof_damping[:], model.dof_frictionloss[:] = 0.0, 0.0
    data = mujoco.MjData(model)
    q, qd, qdd = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 300, model.nv))
    torque = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        torque[k] = data.qfrc_inverse
    A = hil.regressor(robot, q, qd, qdd).reshape(torque.size, -1)
    p, _, rank, _ = np.linalg.lstsq(A, torque.ravel(), rcond=None)
    assert rank == A.shape[1]
    np.testing.assert_allclose(A @ p, torque.ravel(), atol=1e-10)
    return p


def test_intervals_hold_the_truth_as_often_as_they_state(tmp_path):
    (path := tmp_path / "two.xml").write_text(TEXT)
    robot = hil.Robot.load(path)
    assert robot.parents == (-1, 0, 1, 2, 0, 4, 5)
    p = truth(mujoco.MjModel.from_xml_string(TEXT), robot)
    held = []
    for seed in range(4):
        recorded = record(mujoco.MjModel.from_xml_string(TEXT), seed)
        model = hil.identify(hil.Run.import_arrays(robot, *recorded))
        low, high = model.interval().T
        held.append((low <= p) & (p <= high))
    # 95 % of 188 intervals, with four standard deviations of a binomial
    assert 0.886 <= np.mean(held) <= 1.0
    other = hil.Run.import_arrays(robot, *record(mujoco.MjModel.from_xml_string(TEXT), 9))
    assert hil.validate(model, other).word == "good"


def test_trajectories_of_one_branch_after_another_identify_the_tree(tmp_path):
    robot = hil.Robot.load(Path(__file__).parents[2] / "robots" / "two-arms.yaml")
    p, search = possible(robot, 3)[0], Search(random=20, refined=1, steps=8)
    waves = [design_trajectory(robot, cycles=6, search=search, branch=k) for k in (0, 1)]
    folder = RunFolder.create(tmp_path / "run", make_plan(robot, waves), robot)
    with folder.session(SIMULATED) as session:
        for wave in waves:
            ((_, recording),) = recorded(robot, wave, noise=0.002, p=p)
            folder.write(Measured(wave, recording, session=session))
    model = hil.identify(hil.Run.open(tmp_path / "run"))
    low, high = model.interval().T
    assert np.mean((low <= p) & (p <= high)) > 0.85
    A = hil.regressor(robot, *np.random.default_rng(0).uniform(-1.0, 1.0, (3, 200, 6)))
    size = np.sqrt(np.mean((A @ p) ** 2, axis=0))
    assert (np.sqrt(np.mean((A @ (model.values - p)) ** 2, axis=0)) < 0.001 * size).all()
