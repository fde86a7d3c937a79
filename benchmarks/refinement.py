"""Refinement by simulation: a six-axis minute beside MuJoCo's method, and the EMPS benchmark.

    OPENBLAS_NUM_THREADS=1 python benchmarks/refinement.py six [SEED ...]
    python benchmarks/refinement.py runs

The folder holds the runs ``emps``, identified, and ``pulses`` (docs/tutorials/recording.md).

Six axes: a minute of periodic motion at 500 Hz of an arm of random bodies with Coulomb and viscous
friction, 1 % of noise on the torques, 0.02 mrad on the positions. `hil.simulation.refine` starts
from the regression. So does the algorithm of `mujoco.sysid`: `mujoco.minimize.least_squares`
(Gauss-Newton with finite differences) of rollouts from the recorded states of the same stretches,
over bodies by the Cholesky factors of their pseudo-inertias, damping, friction loss and bias, with
MuJoCo's step of one sample. The held-out error is the position error in stretches of 0.5 s of
another minute without noise, each model in its own simulator (MuJoCo at 1 ms), as a share of each
axis's range, rms.

EMPS: a model of ``emps`` simulates ``pulses`` from the recorded voltage and the first 20 samples.
The level of friction in ``pulses`` is the factor of the model's friction of sign, speed and knee
that fits the torque of that record in the mean (up to 30 Hz, above 8 mm/s).
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
from figures import Figure, keep

import hil
from hil.friction.terms import DIRECTED
from hil.runs.pooling import Pooled
from hil.simulation.mujoco_arm import MujocoArm
from hil.simulation.refine import HELD_OUT, SHORT, refine
from hil.simulation.replay import Lanes, Replay, replay

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from possible_models import model_of, possible

SEEDS = (1, 2, 3)
RATE, MINUTE = 500.0, 60.0
SLOW = 0.008
"""Slowest speed of the level of friction [m/s]."""


def motion(seed: int) -> tuple[np.ndarray, ...]:
    """Return time, positions, velocities and accelerations of a period of 10 s, repeated."""
    rng, order = np.random.default_rng(seed), np.arange(1, 7)
    time, w = np.arange(0.0, MINUTE, 1.0 / RATE), 2 * np.pi * order / 10.0
    a = 0.35 * rng.normal(size=(2, 6, 6)) / order[:, None] * [1.0, 0.6, 0.8, 1.0, 1.0, 1.0]
    cos, sin = np.cos(w * time[:, None]), np.sin(w * time[:, None])
    q, qd = sin @ a[0] + cos @ a[1], (w * cos) @ a[0] - (w * sin) @ a[1]
    return time, q, qd, -(w**2 * sin) @ a[0] - (w**2 * cos) @ a[1]


def recorded(truth: hil.Model, seed: int, noise: float) -> hil.Run:
    """Return a recording of the true arm, `noise` relative to each axis's torque."""
    time, q, qd, qdd = motion(seed)
    tau, rng = truth.predict(q, qd, qdd), np.random.default_rng(seed + 1000)
    tau = tau + noise * np.sqrt(np.mean(tau**2, axis=0)) * rng.normal(size=tau.shape)
    q = q + 2e-3 * noise * rng.normal(size=q.shape)
    return hil.Run.import_arrays(truth.robot, time, q, tau, accept=["friction", "range"])


def share(found: Replay) -> float:
    """Return the position error as a share of each axis's range, rms [%]."""
    return 100.0 * float(np.sqrt(np.mean((found.rms / found.covered) ** 2)))


class Rollouts:
    """MuJoCo's arm as a function of bodies, friction and bias, in stretches of a recording."""

    def __init__(self, model: hil.Model, run: hil.Run) -> None:
        import mujoco

        every = Lanes.create(Pooled([run]), model, None, SHORT)
        lanes = range(len(every.starts) - len(every.starts) // HELD_OUT)
        self.arm, self.mujoco = MujocoArm(model), mujoco
        self.model, self.data = self.arm._model, mujoco.MjData(self.arm._model)
        self.model.opt.timestep = 1.0 / RATE
        starts = [every.starts[lane] for lane in lanes]
        steps = min(len(each.time) for each in starts) - 1
        zero = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self.states = np.zeros((len(starts), zero))
        self.states[:, 1:13] = [np.concatenate([each.q, each.qd]) for each in starts]
        self.torque = np.stack(
            [
                every.drive(each.time[:steps] + 0.5 / RATE, *np.zeros((2, steps, 6)))
                for each in starts
            ]
        )
        self.wanted = np.stack([every.recorded[lane][: steps - 9] for lane in lanes])
        self.bias = -self.model.actuator_biasprm[:, 0] if self.model.nu else np.zeros(6)
        self.start = np.concatenate(
            [*(self._factor(body) for body in range(1, 7)), self.model.dof_damping,
             self.model.dof_frictionloss, np.zeros(6)]
        )  # fmt: skip
        self.weights = 1.0 / self._errors(self.start).std(axis=(0, 1))

    def _factor(self, body: int) -> np.ndarray:
        """Return the Cholesky factor of a body's pseudo-inertia, ten numbers."""
        m, turned = self.model, np.zeros(9)
        self.mujoco.mju_quat2Mat(turned, m.body_iquat[body])
        R, mass, at = turned.reshape(3, 3), m.body_mass[body], m.body_ipos[body]
        moment = R @ np.diag(m.body_inertia[body]) @ R.T
        second = np.trace(moment) / 2 * np.eye(3) - moment + mass * np.outer(at, at)
        whole = np.block([[second, mass * at[:, None]], [mass * at[None], np.array([[mass]])]])
        return np.linalg.cholesky(whole + 1e-12 * np.eye(4))[np.tril_indices(4)]

    def _set(self, x: np.ndarray) -> None:
        m = self.model
        for body in range(1, 7):
            L = np.zeros((4, 4))
            L[np.tril_indices(4)] = x[10 * (body - 1) : 10 * body]
            whole = L @ L.T
            mass = whole[3, 3]
            at = whole[:3, 3] / mass
            second = whole[:3, :3] - mass * np.outer(at, at)
            values, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
            axes[:, 0] *= np.sign(np.linalg.det(axes))
            m.body_mass[body], m.body_ipos[body], m.body_inertia[body] = mass, at, values
            self.mujoco.mju_mat2Quat(m.body_iquat[body], axes.ravel())
        m.dof_damping[:], m.dof_frictionloss[:] = np.maximum(x[60:72].reshape(2, 6), 0.0)
        self.mujoco.mj_setConst(m, self.data)

    def _errors(self, x: np.ndarray) -> np.ndarray:
        from mujoco import rollout

        self._set(x)
        state, _ = rollout.rollout(
            self.model, self.data, self.states, self.torque - x[72:],
            control_spec=self.mujoco.mjtState.mjSTATE_QFRC_APPLIED.value,
        )  # fmt: skip
        return state[:, 9:, 1:7] - self.wanted

    def fitted(self) -> MujocoArm:
        """Return the arm of least error."""
        from mujoco import minimize

        scale = 0.1 * np.maximum(np.abs(self.start), 0.1)

        def residuals(x: np.ndarray) -> np.ndarray:
            columns = [
                np.nan_to_num(self._errors(self.start + scale * each) * self.weights).ravel()
                for each in x.T
            ]
            return np.column_stack(columns)

        found, _ = minimize.least_squares(
            np.zeros(len(self.start)), residuals, verbose=0, max_iter=15, eps=1e-4
        )
        best = self.start + scale * found.ravel()
        self._set(best)
        self.bias = self.bias + best[72:]
        return self.arm


def six_axes(seeds: tuple[int, ...]) -> dict[str, Figure]:
    """Return time and held-out errors of the regression, the refinement, and MuJoCo's method."""
    robot = hil.Robot.load(Path(__file__).parents[1] / "tests/robots/ur10e.yaml")
    rows = []
    for seed in seeds:
        truth = model_of(robot, *possible(robot, seed))
        run, other = recorded(truth, seed, 0.01), recorded(truth, seed + 50, 0.0)
        start = hil.identify(run)
        begun = process_time()
        refined = refine(start, Pooled([run]))
        took = process_time() - begun
        errors = [share(replay(other, each, restart=SHORT)) for each in (start, refined)]
        begun = process_time()
        rollouts = Rollouts(start, run)
        arm = rollouts.fitted()
        theirs = process_time() - begun
        lanes = Lanes.create(Pooled([other]), start, None, SHORT)
        drive = replace(lanes.drive, torque=lanes.drive.torque - rollouts.bias)
        simulated = replace(lanes, drive=drive).simulated(arm)
        errors.append(share(Replay(robot, simulated, "")))
        rows.append([took, theirs, *errors])
        print(seed, refined.refinement, [round(x, 4) for x in rows[-1]], flush=True)
    mean = np.mean(rows, axis=0)
    spread = np.std(rows, axis=0, ddof=1) if len(rows) > 1 else [None] * len(mean)
    names = ("seconds", "mujoco-seconds", "regression-error", "error", "mujoco-error")
    units = ("s", "s", "%", "%", "%")
    return {
        name: Figure(float(m), unit, 2, s)
        for name, unit, m, s in zip(names, units, mean, spread, strict=True)
    }


def level_of(model: hil.Model, run: hil.Run) -> float:
    """Return the level of friction in a recording relative to the model's."""
    from scipy import signal

    law = model.friction_law.axes[0]
    ((_, recording),) = Pooled([run])
    b, a = signal.butter(4, 2 * 30.0 * recording.period)

    def low(x: np.ndarray) -> np.ndarray:
        return np.asarray(signal.filtfilt(b, a, x, axis=0))

    q = low(recording.q)
    qd = np.gradient(q, recording.period, axis=0)
    qdd = np.gradient(qd, recording.period, axis=0)
    whole = low(model.predict(q, qd, qdd))
    none = {name: each.model_copy(update={"value": 0.0 if name in DIRECTED else each.value})
            for name, each in law.terms.items()}  # fmt: skip
    without = model.friction_law.model_copy(
        update={"axes": (law.model_copy(update={"terms": none}),)}
    )
    rest = low(replace(model, friction_law=without).predict(q, qd, qdd))
    moves = np.abs(qd[:, 0]) > SLOW
    directed, left = (whole - rest)[moves, 0], (low(recording.tau) - rest)[moves, 0]
    return float(directed @ left / (directed @ directed))


def set_level(model: hil.Model, level: float) -> hil.Model:
    """Return the model with another level of friction."""
    law = model.friction_law.axes[0]
    terms = {
        name: each.model_copy(update={"value": each.value * (level if name in DIRECTED else 1.0)})
        for name, each in law.terms.items()
    }
    axes = (law.model_copy(update={"terms": terms}),)
    return replace(model, friction_law=model.friction_law.model_copy(update={"axes": axes}))


def emps(folder: Path) -> dict[str, Figure]:
    """Return the errors of EMPS by friction, with and without its level in the test record."""
    run, pulses = (hil.Run.open(folder / name) for name in ("emps", "pulses"))
    model = hil.identify(run)
    whole, short = (refine(model, Pooled([run]), restart=each) for each in (None, 2.0))
    level, own = (level_of(short, each) for each in (pulses, run))
    print(whole.refinement, short.refinement, level, own, sep="\n")

    def error(model: hil.Model, **options: str) -> Figure:
        return Figure(1e3 * float(replay(pulses, model, **options).rms[0]), "mm", 3)

    return {
        "law": error(model),
        "plain": error(model, friction="plain"),
        "kept": Figure(float(whole.refinement.kept), ""),
        "refined-short": error(short),
        "at-level": error(set_level(short, level)),
        "level": Figure(100 * (level - 1), "%", 2),
        "own-level": Figure(100 * (own - 1), "%", 1),
    }


if __name__ == "__main__":
    if sys.argv[1] == "six":
        seeds = tuple(map(int, sys.argv[2:])) or SEEDS
        name, figures = "refinement-six-axes", six_axes(seeds)
    else:
        name, figures, seeds = "refinement-emps", emps(Path(sys.argv[1])), ()
    for each, figure in figures.items():
        print(each, figure.value, figure.unit)
    keep(
        name, figures, depends=("hil/simulation", "hil/estimation"),
        command=f"python benchmarks/refinement.py {sys.argv[1]}", seeds=seeds,
    )  # fmt: skip
