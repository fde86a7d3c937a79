#!/usr/bin/env bash
# MuJoCo 4.0.0, mujoco.sysid: a short recording counts as much as a long one.
#
# Input: two recordings of one axis, of 30 s and of 1 s, with the same sine as
# torque. The damping is 0.5 N m s/rad in the long one and 1.0 in the short one,
# as in a drive that is warm in one and cold in the other. Both are fitted
# together with one damping.
#
# Expected: a value near 0.5, since 30 of 31 s say so. Residuals are divided by
# the RMS of the measured signal, and the RMS of the two is nearly the same.
#
# Seen: 0.795; 0.519 if a residual function of one's own divides by the RMS. The
# divisor lacks the number of samples: it is the root of the sum of squares over
# sqrt(2), and grows with the length. So every recording has one vote, whatever
# its length, and one second of a bad recording outweighs half a minute of a good
# one. The same holds for recordings at different rates.
#
# Documentation: normalize_residual is "Divide by column-wise RMS of measured
# data" in the README and "by the standard deviation" in its docstring.
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


def record(duration, damping):
    """Return times, torques and states; one row is one instant."""
    model = mujoco.MjModel.from_xml_string(MJCF.format(step=STEP, damping=damping))
    data = mujoco.MjData(model)
    times = np.round(np.arange(round(duration / STEP)) * STEP, 9)
    torques = np.sin(2 * np.pi * 3 * times)[:, None]
    states = np.empty((len(times), 2))
    for row, torque in enumerate(torques):
        states[row] = data.qpos[0], data.qvel[0]
        data.ctrl[:] = torque
        mujoco.mj_step(model, data)
    return times, torques, states


def divide_by_rms(_, predicted, measured, *__, state, **___):
    """Return residuals over the RMS of the measured signal, and both signals."""
    times = measured.times[1:]
    columns = [np.interp(times, state[:, 0], column) for column in state[:, 1:].T]
    result = sysid.TimeSeries(times, np.column_stack(columns), measured.signal_mapping)
    kept = sysid.TimeSeries(times, measured.data[1:], measured.signal_mapping)
    rms = np.sqrt(np.mean(kept.data**2, axis=0))
    return (kept.data - result.data) / rms, result, kept


def write(spec, parameter):
    """Write the damping into the joint."""
    spec.joint("axis").damping[0] = parameter.value[0]


def identify(recordings, **options):
    """Return the one damping of all recordings [N m s/rad]."""
    spec = mujoco.MjSpec.from_string(MJCF.format(step=STEP, damping=0.4))
    model = spec.compile()
    packed = [
        sysid.ModelSequences(
            f"recording {number}",
            spec,
            f"recording {number}",
            sysid.create_initial_state(model, states[0, :1], states[0, 1:]),
            sysid.TimeSeries.from_control_names(times, torques, model),
            sysid.TimeSeries.from_names(times, states, model, ["axis_qpos", "axis_qvel"]),
        )
        for number, (times, torques, states) in enumerate(recordings)
    ]
    parameters = sysid.ParameterDict()
    parameters.add(sysid.Parameter("damping", 0.4, 0.01, 5.0, modifier=write))
    residual = sysid.build_residual_fn(models_sequences=packed, n_threads=1, **options)
    with contextlib.redirect_stdout(io.StringIO()):
        fitted, _ = sysid.optimize(parameters, residual, optimizer="scipy", verbose=False)
    return fitted["damping"].value[0]


warm, cold = record(30, 0.5), record(1, 1.0)
alone = identify([warm]), identify([cold])
together = identify([warm, cold])
by_rms = identify([warm, cold], modify_residual=divide_by_rms)
speeds = [states[:, 1:] for _, _, states in (warm, cold)]
rms = [np.sqrt(np.mean(speed**2)) for speed in speeds]
divisors = [1 / sysid.normalize_residual(np.ones((1, 1)), speed)[0, 0] for speed in speeds]
print(f"30 s alone: {alone[0]:.3f}, 1 s alone: {alone[1]:.3f} N m s/rad")
print(f"both together: {together:.3f}, residuals divided by the RMS: {by_rms:.3f} N m s/rad")
print(f"RMS of the speed: {rms[0]:.2f}, {rms[1]:.2f} rad/s; divisors {divisors[0]:.1f}, {divisors[1]:.1f}")

as_described = (
    np.allclose(alone, (0.5, 1.0), rtol=1e-5)
    and 0.77 < together < 0.83
    and 0.51 < by_rms < 0.55
    and divisors[0] / divisors[1] > 5 * rms[0] / rms[1]
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
