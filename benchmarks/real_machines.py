"""Public recordings of real machines: the default method against least squares.

    python benchmarks/real_machines.py TRAIN... -- TEST...

takes run folders of one machine. Residual torques of the default method are compared with those of
weighted least squares, for the recordings of the fit and for held-out ones, by axis and overall.
The bounds of the ratio are 1.05 overall and 1.2 on any axis.

    python benchmarks/real_machines.py figures FOLDER

keeps the figures of EMPS and TX40: FOLDER holds the runs ``emps`` and ``tx40``, identified, and
``pulses`` (docs/tutorials/recording.md).

    python benchmarks/real_machines.py RUN

compares the model of `hil` and plain least squares on the same samples of the Staubli TX40. RUN is
the folder of `hil import examples/tx40/tx40.yaml`, identified. The preprocessing is that of the
literature on this recording: positions pass a Butterworth filter of order four forth and back at
100 Hz and are differentiated numerically, 20 samples at either end are dropped, and every tenth
sample is used. Least squares fits 61 unknowns to exactly these samples: base parameters; Coulomb
and viscous friction and an offset of each axis; Coulomb and viscous friction of the coupled motor.
The model of `hil` was fitted below 20 Hz.

The samples are decimated in two ways. `scipy.signal.decimate` first applies a low-pass of 200 Hz
(Chebyshev, order eight, forth and back) to the torque and to each column of the regressor; usually
quoted figures are based on this way. Alternatively, the torque passes the filter of the positions
and nine of ten samples are dropped: signs of velocities then keep frequencies that the filtered
torque lacks.
"""

from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
from figures import Figure, keep
from scipy import signal

from hil.model.dynamics import regressor
from hil.results.identification import identified
from hil.results.model import Model
from hil.results.predicted_torques import predicted_torques
from hil.runs.pooling import Pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.model.robot import Robot

CUT_OFF = 100.0
EVERY = 10
ENDS = 20
"""Number of samples dropped at either end."""


def compare(train: Sequence[str], test: Sequence[str]) -> None:
    """Print the ratio of residual torques of the default method to those of least squares."""
    first, *more = map(Run.open, train)
    ours, plain = (
        identified(first, name, more).model for name in ("free motion", "weighted least squares")
    )
    print(ours.verdict)
    for what, folders in (("fitted", train), ("held out", test)):
        runs = [Run.open(folder) for folder in folders]
        (left, torque), (other, _) = (_squares(model, runs) for model in (ours, plain))
        ratios = " ".join(f"{x:.2f}" for x in np.sqrt(left / other))
        print(
            f"{what}: {np.sqrt(left.sum() / torque.sum()):.2%} against"
            f" {np.sqrt(other.sum() / torque.sum()):.2%}: {np.sqrt(left.sum() / other.sum()):.3f}"
            f" times as much; by axis {ratios}"
        )


def _squares(model: Model, runs: Sequence[Run]) -> tuple[np.ndarray, np.ndarray]:
    """Return sums of squares of a model's residuals, and of the torques, of each axis."""
    found = {}
    for each in predicted_torques(model, Pooled(runs)):
        pair = np.array([np.sum((each.measured - each.predicted) ** 2), np.sum(each.measured**2)])
        found[each.axis] = found.get(each.axis, 0.0) + pair
    left, torque = np.array([found[axis] for axis in sorted(found)]).T
    return left, torque


def keep_figures(folder: Path) -> None:
    """Keep the residual torques of the models of two machines."""

    def left(model: str, run: str) -> Figure:
        squares, torque = _squares(Model.load(folder / model), [Run.open(folder / run)])
        return Figure(100 * float(np.sqrt(squares.sum() / torque.sum())), "%")

    carriage, shares = Model.load(folder / "emps"), main(folder / "tx40")
    low, high = carriage.interval(0.95)[0]
    kept = {
        "emps-left": left("emps", "emps"),
        "emps-other-left": left("emps", "pulses"),
        "emps-mass": Figure(float(carriage.values[0]), "kg", 3),
        "emps-mass-interval": Figure((high - low) / 2, "kg", 1),
        "tx40-left-20-hz": left("tx40", "tx40"),
        "tx40-left-200-hz": Figure(shares["hil identify"], "%"),
        "tx40-least-squares": Figure(shares["least squares"], "%", 3),
    }
    command = "python benchmarks/real_machines.py figures runs"
    keep("real-machines", kept, depends=("hil/estimation", "hil/imports"), command=command)


def main(folder: Path | str) -> dict[str, float]:
    """Print both models' residual torques for both ways of sampling; return those of `decimate`."""
    run, model = Run.open(folder), Model.load(folder)
    (recording,) = [measured.recording for measured in run]
    period = recording.period
    q, filtered = _low_passed(recording.q, period), _low_passed(recording.tau, period)
    qd = np.gradient(q, period, axis=0)
    qdd = np.gradient(qd, period, axis=0)
    own = slice(ENDS, -ENDS)
    motion = q[own], qd[own], qdd[own]
    columns, ours = _columns(run, *motion), model.predict(*motion)
    shares: dict[str, float] = {}
    for way, take, tau in (
        ("decimated", _decimated, recording.tau),
        ("left out", _every, filtered),
    ):
        print(f"samples between {way}:")
        y, W = take(tau[own]), take(columns)
        x, *_ = np.linalg.lstsq(W.reshape(-1, W.shape[-1]), y.ravel(), rcond=None)
        plain = _show(f"least squares, {len(x)} unknowns", y - W @ x, y)
        _show_figaroh(run.robot, motion, y, take)
        best = _show(f"hil identify, {model.method} method", y - take(ours), y)
        shares = shares or {"least squares": plain, "hil identify": best}
    return shares


def _low_passed(x: np.ndarray, period: float) -> np.ndarray:
    b, a = signal.butter(4, 2.0 * CUT_OFF * period)
    return np.asarray(signal.filtfilt(b, a, x, axis=0))


def _decimated(x: np.ndarray) -> np.ndarray:
    """Return every tenth sample after a low-pass."""
    return np.asarray(signal.decimate(x, EVERY, axis=0, zero_phase=True))


def _every(x: np.ndarray) -> np.ndarray:
    return x[::EVERY]


def _columns(run: Run, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Return base parameters, then three friction terms per axis, then two per coupled motor."""
    robot = run.robot
    n, terms = robot.n_joints, [np.sign(qd), qd, np.ones_like(qd)]
    friction = [t[:, :, None] * np.eye(n) for t in terms]
    return np.concatenate([regressor(robot, q, qd, qdd), *friction, _coupled(robot, qd)], axis=-1)


def _coupled(robot: Robot, qd: np.ndarray) -> np.ndarray:
    """Return viscous and Coulomb friction of each coupled motor at its two joints."""
    coupled = np.zeros((*qd.shape, 2 * len(robot.couplings)))
    for k, (motor, joint, ratio) in enumerate(robot.couplings):
        turning = np.sign(ratio * qd[:, joint] + qd[:, motor])
        coupled[:, joint, 2 * k], coupled[:, motor, 2 * k] = (
            ratio * qd[:, motor],
            ratio * qd[:, joint],
        )
        coupled[:, joint, 2 * k + 1], coupled[:, motor, 2 * k + 1] = ratio * turning, turning
    return coupled


def _show_figaroh(
    robot: Robot,
    motion: tuple[np.ndarray, np.ndarray, np.ndarray],
    tau: np.ndarray,
    take: Callable[[np.ndarray], np.ndarray],
) -> None:
    """Print the residual torques by figaroh, if installed."""
    try:
        import pinocchio as pin
        from figaroh.tools.qrdecomposition import QRDecomposer
        from figaroh.tools.regressor import build_regressor_basic, get_index_eliminate
    except ImportError:
        print("figaroh: not installed")
        return
    q, qd, qdd = motion
    model = pin.Model()
    model.gravity.linear = np.array(robot.gravity)
    for joint in range(robot.n_joints):
        pose = pin.SE3(robot.link_pose(joint))
        number = model.addJoint(joint, pin.JointModelRZ(), pose, f"joint {joint + 1}")
        model.appendBodyToJoint(number, pin.Inertia.Random(), pin.SE3.Identity())
    options = dict.fromkeys(("has_friction", "has_actuator_inertia", "has_joint_offset"), True)
    W = build_regressor_basic(
        SimpleNamespace(model=model, data=model.createData()),
        q + robot.theta, qd, qdd, options | {"act_idxv": list(range(robot.n_joints))},
    )  # fmt: skip
    inertia = _coupled(robot, qdd)[..., 0::2]
    extra = np.concatenate([_coupled(robot, qd), inertia], axis=-1)
    # rows of figaroh are ordered by joint: all samples of a joint in sequence
    W = np.hstack([W, extra.transpose(1, 0, 2).reshape(len(W), -1)])
    n = robot.n_joints
    W = np.vstack([take(own) for own in W.reshape(n, len(q), -1)])
    names = {f"x{k}": 0.0 for k in range(W.shape[1])}
    left_out, kept = get_index_eliminate(W, names)
    y = tau.T.ravel()
    base, _, _, found = QRDecomposer().double_decomposition(y, np.delete(W, left_out, 1), kept)
    left = (y - base @ found).reshape(tau.T.shape).T
    _show(f"figaroh {version('figaroh')}, {len(found)} unknowns", left, tau)


def _show(name: str, left: np.ndarray, tau: np.ndarray) -> float:
    rms = " ".join(f"{x:.2f}" for x in np.sqrt(np.mean(left**2, axis=0)))
    share = 100 * float(np.linalg.norm(left) / np.linalg.norm(tau))
    print(f"{name}: rms {rms} N m, {share:.1f}% of all torques")
    return share


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if "--" in arguments:
        end = arguments.index("--")
        compare(arguments[:end], arguments[end + 1 :])
    elif arguments[:1] == ["figures"]:
        keep_figures(Path(arguments[1]))
    elif len(arguments) == 1:
        main(*arguments)
    else:
        print("skipped: needs the folder with the recordings, see docs/explanation/free-motions.md")
