"""Public recordings of real machines: the default method against least squares.

    python benchmarks/real_machines.py TRAIN... -- TEST...

takes run folders of one machine. Residual torques of the default method are compared with those of
weighted least squares, for the recordings of the fit and for held-out ones, by axis and overall.
The bounds of the ratio are 1.05 overall and 1.2 on any axis. Intervals (95 %) are those of a
bootstrap over pieces of ten periods of the cut-off; for held-out recordings they also contain the
scatter by the recordings of the fit, a jackknife over a twelfth of these with laws and presliding
unchanged. No ratio above the bounds is distinguishable from 1: trained on 10 s, UR10 has 1.26
overall (0.19 to 8.6) and KR300 2.45 on axis 6 (0.7 to 8.7); the Rokae has 1.15 on axis 3 (motors,
0.6 to 2.3) and 1.29 on axis 5 (sensors, 0.9 to 1.8). They come mainly from presliding, which other
recordings of these robots need: without it KR300 has 1.06 in place of 0.89 overall.

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

from hil.estimation.free_motion.accumulation import division, recorded_products
from hil.estimation.free_motion.gathering import free_motions, gather
from hil.estimation.free_motion.motion import filtered_motion
from hil.estimation.free_motion.scaling import Scaling
from hil.estimation.free_motion.survey import survey
from hil.estimation.free_motion.variants import VARIANTS
from hil.least_squares.choice import folds
from hil.least_squares.uncertainty import TWICE
from hil.model.dynamics import regressor
from hil.results.identification import identified
from hil.results.model import Model
from hil.results.predicted_torques import predicted_torques
from hil.results.recorded_torque import processing_of
from hil.runs.pooling import Pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.model.robot import Robot

METHODS = ("free motion", "weighted least squares")
PERIODS = 10.0
"""Length of the pieces of the bootstrap, in periods of the cut-off."""
CUT_OFF = 100.0
EVERY = 10
ENDS = 20
"""Number of samples dropped at either end."""


def compare(train: Sequence[str], test: Sequence[str]) -> None:
    """Print the ratio of residual torques of the default method to those of least squares."""
    first, *more = map(Run.open, train)
    ours, plain = (identified(first, name, more).model for name in METHODS)
    print(ours.verdict)
    length = PERIODS / processing_of(ours).cut_off
    for what, folders in (("fitted", train), ("held out", test)):
        runs = [Run.open(folder) for folder in folders]
        (left, torque), (other, _) = (_squares(model, runs, length) for model in (ours, plain))
        drawn = np.random.default_rng(1).multinomial(len(left), [1 / len(left)] * len(left), 4000)
        variance = np.var(_log_ratios(drawn @ left, drawn @ other), axis=0)
        if what == "held out":
            parts = [_parts_held_out([first, *more], runs, method) for method in METHODS]
            ratios = _log_ratios(*parts)
            variance += (len(ratios) - 1) * np.var(ratios, axis=0)
        overall, *axes = (
            f"{np.exp(x):.2f} ({np.exp(x - half):.2f} to {np.exp(x + half):.2f})"
            for x, half in zip(
                _log_ratios(left.sum(axis=0), other.sum(axis=0)),
                TWICE * np.sqrt(variance),
                strict=True,
            )
        )
        print(
            f"{what}: {np.sqrt(left.sum() / torque.sum()):.2%} against"
            f" {np.sqrt(other.sum() / torque.sum()):.2%}: {overall} times as much; by axis",
            ", ".join(axes),
        )


def _squares(model: Model, runs: Sequence[Run], length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return sums of squares of residuals and torques by piece and axis, pieces `length` [s]."""
    found: dict[int, list[np.ndarray]] = {}
    for each in predicted_torques(model, Pooled(runs)):
        piece = ((each.time - each.time[0]) / length).astype(int)
        piece = np.minimum(piece, max(piece[-1] - 1, 0))  # the last one is at least as long
        rows = (each.measured - each.predicted) ** 2, each.measured**2
        found.setdefault(each.axis, []).append(np.array([np.bincount(piece, row) for row in rows]))
    left, torque = np.transpose([np.hstack(found[axis]) for axis in sorted(found)], (1, 2, 0))
    return left, torque


def _log_ratios(left: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return logarithms of ratios of residuals, overall and by axis, from squares (..., n_axes)."""
    both = (np.concatenate([x.sum(axis=-1, keepdims=True), x], axis=-1) for x in (left, other))
    return np.log(next(both) / next(both)) / 2


def _parts_held_out(train: Sequence[Run], test: Sequence[Run], method: str) -> np.ndarray:
    """Return held-out squares (n_parts, n_axes) of estimates without parts of the recordings."""
    robot, variant = train[0].robot, VARIANTS[method]
    known = Scaling.known(np.ones(robot.n_joints))
    fitted = gather(robot, Pooled(train), variant)
    products = fitted.drift.applied(known.applied(fitted.recorded))
    of_test = survey(free_motions(Pooled(test)))
    motions = [filtered_motion(each, fitted.processing) for each in of_test.stretches]
    divided = division(fitted.processing, of_test.duration)
    held = recorded_products(robot, motions, divided, fitted.first, soft=fitted.processing.soft)
    scored = known.applied(held).pieces[0].total
    regression, found = fitted.choice.fitted(products), []
    for out in folds(len(regression.blocks)):
        kept = np.ones(len(regression.blocks), dtype=bool)
        kept[out] = False
        rest = regression.transfer(regression.blocks.where(kept))
        found.append(scored.squares_left(rest.solution)[0])
    return np.array(found)


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
