#!/usr/bin/env bash
# MuJoCo 4.0.0, mujoco.sysid: the last digit of the time stamps decides whether
# the torques are played back at the right rate.
#
# Input: a recording of 2 s at 2 ms, the timestep of the model, simulated by
# MuJoCo itself; its time stamps are the data.time of the simulation. Then the
# same recording with the stamps rounded to nanoseconds, a change of 1.6e-15 s.
#
# Expected: the true damping, 1 N m s/rad, from both. The torques are resampled
# to the timestep before they drive the model, TimeSeries.resample(target_dt=
# 0.002), which leaves torques at 2 ms as they are.
#
# Seen: 1.0085 from the original stamps, with an interval of +- 0.0009; 1.0000
# from the rounded ones. The duration, 2.0000000000000013 s, is divided by the
# timestep and rounded up, and one sample more is spread over the same duration:
# the interval becomes 1.998 ms. The model takes these samples at 2 ms, so the
# torques lag more and more, by one timestep at the end. The same happens with
# every recording whose duration is not a whole number of timesteps: 2000 samples
# of 1 ms become 1.999 ms.
#
# Documentation: "target_dt: Optional time interval for regular resampling".
# That the returned interval is a different one is not said.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check "mujoco[sysid]==4.0.0" numpy==2.4.6 scipy==1.17.1
venv/bin/python -W ignore - <<'EOF'
import contextlib
import io
import sys

import mujoco
import numpy as np
from mujoco import sysid

STEP = 0.002
MJCF = """
<mujoco>
  <option timestep="{step}" gravity="0 0 0"/>
  <worldbody>
    <body>
      <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
      <joint name="axis" axis="0 0 1" damping="{damping}"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="axis"/></actuator>
  <sensor>
    <jointpos name="encoder" joint="axis"/>
    <jointvel name="tacho" joint="axis"/>
  </sensor>
</mujoco>
"""


def record(samples):
    """Return times, torques and states; one row is one instant."""
    model = mujoco.MjModel.from_xml_string(MJCF.format(step=STEP, damping=1.0))
    data = mujoco.MjData(model)
    times, torques, states = [], [], []
    for _ in range(samples):
        data.ctrl[0] = np.sin(2 * np.pi * 3 * data.time)
        times.append(data.time)
        torques.append(data.ctrl.copy())
        states.append([data.qpos[0], data.qvel[0]])
        mujoco.mj_step(model, data)
    return np.array(times), np.array(torques), np.array(states)


def write(spec, parameter):
    """Write the damping into the joint."""
    spec.joint("axis").damping[0] = parameter.value[0]


def identify(times, torques, states):
    """Return the damping and the half width of its interval [N m s/rad]."""
    spec = mujoco.MjSpec.from_string(MJCF.format(step=STEP, damping=0.4))
    model = spec.compile()
    recording = sysid.ModelSequences(
        "axis",
        spec,
        "recording",
        sysid.create_initial_state(model, states[0, :1], states[0, 1:]),
        sysid.TimeSeries.from_control_names(times, torques, model),
        sysid.TimeSeries.from_names(times, states, model, ["axis_qpos", "axis_qvel"]),
    )
    parameters = sysid.ParameterDict()
    parameters.add(sysid.Parameter("damping", 0.4, 0.01, 5.0, modifier=write))
    residual = sysid.build_residual_fn(models_sequences=[recording], n_threads=1)
    with contextlib.redirect_stdout(io.StringIO()):
        fitted, result = sysid.optimize(parameters, residual, optimizer="scipy", verbose=False)
    _, widths = sysid.calculate_intervals(residual(result.x, fitted)[0], result.jac)
    return fitted["damping"].value[0], widths[0]


def resampled(times, torques):
    """Return number and interval of the resampled torques."""
    series = sysid.TimeSeries(times, torques).resample(target_dt=STEP)
    return len(series), series.times[1] - series.times[0]


times, torques, states = record(1001)
rounded = np.round(times, 9)
count, interval = resampled(times, torques)
count_rounded, interval_rounded = resampled(rounded, torques)
damping, width = identify(times, torques, states)
damping_rounded, _ = identify(rounded, torques, states)
_, odd = resampled(np.arange(2000) / 1000, np.zeros((2000, 1)))
print(f"largest change of a time stamp by rounding: {np.max(np.abs(times - rounded)):.1e} s")
print(f"samples of the recording: {len(times)}, resampled {count}, after rounding {count_rounded}")
print(f"interval: {interval * 1e3:.6f} ms, after rounding {interval_rounded * 1e3:.6f} ms")
print(f"damping: {damping:.4f} +- {width:.4f} N m s/rad, after rounding {damping_rounded:.4f}")
print(f"interval from 2000 samples of 1 ms: {odd * 1e3:.6f} ms")

as_described = (
    np.max(np.abs(times - rounded)) < 1e-14
    and (count, count_rounded) == (1002, 1001)
    and np.isclose(interval, 0.001998, atol=1e-7)
    and np.isclose(interval_rounded, STEP, rtol=1e-9)
    and 1.007 < damping < 1.010
    and damping - 1 > 5 * width
    and np.isclose(damping_rounded, 1, rtol=1e-6)
    and np.isclose(odd, 0.001999, atol=1e-7)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
