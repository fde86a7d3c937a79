"""What constant parameters can simulate of EMPS: direct fits to the position of its records.

    OPENBLAS_NUM_THREADS=1 python benchmarks/emps_position.py runs

The folder holds the runs ``emps``, identified, and ``pulses`` (docs/tutorials/recording.md).

Mass and friction are fitted to the simulated position of a record by least squares, from several
starts and without the torque: four parameters (mass, offset, Coulomb, viscous), five (viscous
friction by direction), and six (arc tangent: the law that `hil identify` chooses). The lag of the
force is that of `hil identify`, the seventh. Drive, initial states and scored samples are those of
`hil replay`. Five parameters are also fitted to halves of ``estimation``, to ``estimation`` with an
offset that drifts linearly in time, to ``pulses``, and to ``pulses`` with two values alone, its
offset and the level of its friction.

Quarters of the records show offset and level without a simulation: least squares of the force (up
to 30 Hz, above 8 mm/s) with mass and friction of ``estimation``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from figures import Figure, keep
from numba import njit
from refinement import SLOW
from scipy import optimize, signal

import hil
from hil.friction.terms import BEND
from hil.runs.pooling import Pooled
from hil.simulation.replay import INITIAL, Lanes

NAMES = ("mass", "offset", "Coulomb", "viscous", "asymmetric", "arc tangent", "drift")
"""Parameters [kg, N, N, N s/m, N s/m, N, N over the record]."""
SCALES = np.array([3.0, 1.0, 2.0, 10.0, 10.0, 2.0, 0.3])
FIVE = NAMES[:5]
STARTS, SEED, EVERY = 4, 0, 10
SKIP = INITIAL - INITIAL // 2
"""Samples from the start to the scored ones."""
SPEED = 0.12
"""Speed of the fast strokes, at which the knee of the arc tangent is stated [m/s]."""


class Record(NamedTuple):
    """Forces in the middle of steps and positions, from the state of `hil replay`."""

    force: np.ndarray
    q: np.ndarray
    start: tuple[float, float]
    period: float

    @classmethod
    def create(cls, model: hil.Model, run: hil.Run) -> Record:
        """Take a recording."""
        lanes = Lanes.create(Pooled([run]), model)
        (start,), (q,) = lanes.starts, lanes.recorded
        middle = (start.time[1:] + start.time[:-1]) / 2
        force = np.interp(middle, lanes.drive.time, lanes.drive.torque[:, 0])
        h = float(np.median(np.diff(start.time)))
        return cls(force, q[:, 0], (float(start.q[0]), float(start.qd[0])), h)

    def halves(self) -> list[Record]:
        """Return the halves of a record."""
        n, h, middle = len(self.q) // 2, self.period, INITIAL // 2
        steps = np.arange(INITIAL) - middle
        _, speed, q = np.polyfit(h * steps, self.q[n : n + INITIAL], 2).tolist()
        late = Record(self.force[n + middle + SKIP :], self.q[n + INITIAL :], (q, speed), h)
        return [self._replace(force=self.force[: n + SKIP - 1], q=self.q[:n]), late]

    def error(self, p: np.ndarray) -> np.ndarray:
        """Return simulated less recorded positions [m]."""
        found = simulated(self.force, *self.start, p, self.period, SPEED * BEND)
        return found[SKIP:] - self.q

    def rms(self, p: np.ndarray) -> float:
        """Return the rms position error [mm]."""
        return 1e3 * float(np.sqrt(np.mean(self.error(p) ** 2)))

    def fitted(self, names: tuple[str, ...], begin: np.ndarray) -> np.ndarray:
        """Return the parameters of least error; those without a name stay."""
        moved = np.array([NAMES.index(name) for name in names])
        rng, found = np.random.default_rng(SEED), []

        def parameters(x: np.ndarray) -> np.ndarray:
            p = begin.copy()
            p[moved] += SCALES[moved] * (x - 1.0)
            return p

        def left(x: np.ndarray) -> np.ndarray:
            return 1e3 * self.error(parameters(x))[::EVERY]

        for k in range(STARTS):
            x = 1.0 + (0.7 * rng.normal(size=len(moved)) if k else np.zeros(len(moved)))
            for step in (1e-2, 1e-3):  # errors have kinks where stops begin or end
                x = optimize.least_squares(left, x, diff_step=step, max_nfev=60).x
            found.append(parameters(x))
        return min(found, key=self.rms)


@njit
def simulated(force, q, v, p, h, knee):
    """Return positions; a step ends at a reversal, an axis at rest stays within its friction."""
    mass, offset, coulomb, viscous, asymmetric, bent, drift = p
    found = np.empty(len(force) + 1)
    found[0] = q
    for k in range(len(force)):
        f, left = force[k] - offset - drift * ((k + 0.5) / len(force) - 0.5), h
        for _ in range(3):
            s = np.sign(v)
            if s == 0:
                if abs(f) <= coulomb:
                    break
                s = np.sign(f)
            middle = v
            for _ in range(2):  # midpoint rule
                friction = s * coulomb + viscous * middle + asymmetric * abs(middle)
                a = (f - friction - bent * np.arctan(middle / knee)) / mass
                middle = max(0.0, s * (v + left / 2 * a)) * s
            if s * (v + left * a) >= 0:
                q += left * (v + left / 2 * a)
                v += left * a
                break
            q -= v * v / a / 2
            left += v / a
            v = 0.0
        found[k + 1] = q
    return found


def levels(model: hil.Model, runs: list[hil.Run]) -> list[tuple[float, float]]:
    """Return level [1] and offset [N] of friction in the quarters of each record."""
    p, found = np.zeros(0), []
    for run in runs:
        ((motion, recording),) = Pooled([run])
        force = Lanes.create([(motion, recording)], model).drive
        b, a = signal.butter(4, 2 * 30.0 * recording.period)
        low = [signal.filtfilt(b, a, x) for x in (recording.q[:, 0], force.torque[:, 0])]
        qd = np.gradient(low[0], recording.period)
        still = np.zeros_like(qd)
        A = np.column_stack(
            [np.gradient(qd, recording.period), np.abs(qd), np.sign(qd), qd, still + 1.0]
        )
        shifted = np.interp(recording.time, force.time - force.time[0], low[1])
        moves = np.flatnonzero(np.abs(qd) > SLOW)
        if not len(p):
            p = np.linalg.lstsq(A[moves], shifted[moves], rcond=None)[0]
        for quarter in np.array_split(np.arange(len(qd)), 4):  # a cycle of the motion each
            part = np.intersect1d(quarter, moves)
            own = np.column_stack([A[part, 2:4] @ p[2:4], still[part] + 1.0])
            level, offset = np.linalg.lstsq(own, shifted[part] - A[part, :2] @ p[:2], rcond=None)[0]
            found.append((float(level), float(offset)))
    return found


def main() -> None:
    """Fit, print and keep."""
    runs = [hil.Run.open(Path(sys.argv[1]) / name) for name in ("emps", "pulses")]
    model = hil.identify(runs[0])
    seen, other = (Record.create(model, run) for run in runs)
    begin = np.array([95.0, -0.3, 20.0, 200.0, -37.0, 0.0, 0.0])
    four = begin * [1, 10, 1, 1, 0, 0, 0]
    figures: dict[str, Figure] = {}

    def note(name: str, value: float, unit: str = "mm", digits: int = 2) -> None:
        figures[name] = Figure(value, unit, digits)
        print(f"{name}: {value:.4g} {unit}", flush=True)

    for name, names, start in (
        ("four", NAMES[:4], four), ("five", FIVE, begin), ("six", NAMES[:6], begin),
    ):  # fmt: skip
        p = seen.fitted(names, start)
        note(f"{name}-own", seen.rms(p))
        note(f"{name}-test", other.rms(p))
        print(dict(zip(NAMES, p.round(3).tolist(), strict=True)))
    best = other.fitted(FIVE, begin)
    note("test-own", other.rms(best))
    note("drift-own", seen.rms(drifting := seen.fitted((*FIVE, "drift"), begin)))
    note("drift", float(drifting[-1]), "N")
    for name, record in zip(("first", "second"), seen.halves(), strict=True):
        p = record.fitted(FIVE, begin)
        note(f"{name}-half-own", record.rms(p))
        note(f"{name}-half-whole", seen.rms(p))
        note(f"{name}-half-test", other.rms(p))
    p = seen.fitted(FIVE, begin)

    def shift(x: np.ndarray) -> np.ndarray:
        offset = 0.1 * (x[0] - 1.0) * (np.arange(len(NAMES)) == 1)
        return p * [1.0, 1.0, x[1], x[1], 1.0, 1.0, 1.0] + offset

    found = optimize.least_squares(
        lambda x: 1e3 * other.error(shift(x)), np.ones(2), diff_step=1e-3
    )
    note("two-test", other.rms(shift(found.x)))
    note("two-level", 100 * (found.x[1] - 1.0), "%")
    note("two-offset", 0.1 * (found.x[0] - 1.0), "N")
    note("per-offset", other.rms(best + 0.1 * (np.arange(len(NAMES)) == 1)))
    note("per-level", other.rms(best * [1.0, 1.0, 1.01, 1.01, 1.0, 1.0, 1.0]))
    for number, (level, offset) in enumerate(levels(model, runs)):
        name = f"{('estimation', 'pulses')[number // 4]}-{number % 4 + 1}"
        note(f"{name}-level", 100 * (level - 1.0), "%")
        note(f"{name}-offset", offset, "N")
    keep(
        "emps-position", figures, depends=("hil/simulation", "hil/estimation"),
        command="python benchmarks/emps_position.py runs", seeds=(SEED,),
    )  # fmt: skip


if __name__ == "__main__":
    main()
