"""One campaign judged: what the paper's method makes of it, as plain figures that a file can keep.

The method is the published one, section 6 as it stands. The plant's truth is used for errors alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np
from scipy import signal

from hil.estimation.friction import symmetry
from hil.estimation.local_fits import local_fit
from hil.estimation.signals import CUTOFF, Signals, signals
from hil.estimation.two_step import TwoStep
from hil.estimation.two_step_methods import TWO_STEP_METHODS, estimates, local_fits, prepare
from hil.ground_truth.comparison import comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import gravity_torque, inverse_dynamics
from hil.planning.measurement import ELEMENT_KINDS, shows_element
from hil.results.diagnosis import PhaseRecord, diagnose
from hil.results.friction import evaluate
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.estimation.local_values import LocalFit
    from hil.estimation.two_step_methods import Prepared
    from hil.model.robot import Robot
    from hil.runs.run import Run

    Figures = dict[str, Any]


def of_strokes(run: Run, plant: Path, *, whole: bool) -> Figures:
    """Errors of a campaign of strokes, and what its claims rest on; `whole`: of all methods."""
    robot, measured = run.robot, list(recorded(run))
    truth = true_parameters(robot, plant)
    found = estimates(robot, measured, TWO_STEP_METHODS if whole else TWO_STEP_METHODS[1:])
    raw, _ = prepare(measured)
    fits, _ = local_fits(robot, raw)
    published = found["published"]
    figures: Figures = {
        "minutes": measured[-1][1].time[-1] / 60,
        "known_gravity": _error(robot, _with_known_gravity(robot, fits, truth), truth),
        "coriolis": _coriolis(robot, raw, published.p, fits),
        "bound": _bound(robot, fits, published.p, truth),
        "elements": elements(robot, fits, published.p),
        "asymmetry": {
            axis + 1: [each.asymmetry, each.passed]
            for axis, each in symmetry.of_local_values(next(iter(found.values())).local).items()
        },
    }
    for name, each in found.items():
        judged = comparison(each, robot, truth)
        figures[name] = {
            "p": each.p, "standard_error": each.standard_error, **judged.group_error,
            "torque": judged.mean_torque_error, "inside": judged.inside,
        }  # fmt: skip
    return figures


def _error(robot: Robot, p: Array, truth: Array) -> dict[str, float]:
    """Relative error of each group in its norm."""
    groups = base_parameters(robot).groups
    parts = {group: list(k) for group, k in groups.items()}
    return {
        group: float(np.linalg.norm((p - truth)[k]) / np.linalg.norm(truth[k]))
        for group, k in parts.items()
    }


def _with_known_gravity(robot: Robot, fits: Sequence[LocalFit], truth: Array) -> Array:
    """Eq. (17) with the true p_g in place of the estimated one."""
    known = np.zeros_like(truth)
    known[list(base_parameters(robot).groups["gravity"])] = 1.0
    changed = []
    for f in fits:
        if f.kind != "gravity":
            sides = f.sides.copy()
            sides[0] -= (f.row + f.sides[2:]) @ (known * truth)
            sides[2:] *= 1 - known
            f = replace(f, sides=sides, row=f.row * (1 - known))  # noqa: PLW2901
        changed.append(f)
    return TwoStep(robot, changed).solve()


def _coriolis(robot: Robot, raw: Prepared, p: Array, fits: Sequence[LocalFit]) -> Figures:
    """What c(q, qd) of the recorded motion puts onto the elements: shares of the largest of each.

    Each measurement is evaluated with c alone in the torque's place. Of the couplings also what the
    estimate of p3 moves by.
    """
    share: dict[str, list[float]] = {kind: [] for kind in ELEMENT_KINDS}
    changed = []
    largest = {
        kind: max(abs(float(f.at(p).value)) for f in fits if f.kind == kind)
        for kind in ELEMENT_KINDS
    }
    prepared = {m.id: (m, s) for m, s in raw}
    for f in fits:
        m, s = prepared[f.id]
        assert shows_element(m)
        c = inverse_dynamics(robot, p, s.q, s.qd, 0 * s.qd) - gravity_torque(robot, p, s.q)
        put = float(local_fit(robot, m, replace(s, tau=c)).sides[0])
        share[f.kind].append(abs(put) / largest[f.kind])
        sides = f.sides.copy()
        sides[0] -= put
        changed.append(replace(f, sides=sides))
    moved = TwoStep(robot, changed).solve() - p
    return {kind: max(each) for kind, each in share.items()} | {"moved": moved}


def _bound(robot: Robot, fits: Sequence[LocalFit], p: Array, truth: Array) -> Figures:
    """Both sides of eq. (13), group by group: what it allows and what the error was."""
    found = {}
    groups = base_parameters(robot).groups
    for kind in ELEMENT_KINDS.values():
        own, k = [f for f in fits if f.kind == kind.name], list(groups[kind.group])
        weight = 1 / robot.torque_limit[[f.axis for f in own]]
        rows = np.array([f.row + f.sides[2:] for f in own]) * weight[:, None]
        others = p.copy()
        others[k] = 0
        Q = np.array([f.sides[0] - f.sides[1] for f in own]) * weight - rows @ others
        W = rows[:, k]
        e = np.linalg.norm(Q - W @ truth[k])
        error = np.linalg.norm(p[k] - truth[k]) / np.linalg.norm(truth[k])
        condition = np.linalg.cond(W)
        found[kind.group] = {
            "condition": condition, "bound": condition * e / np.linalg.norm(Q), "error": error,
            "bound_of_exact": condition * e / np.linalg.norm(W @ truth[k]),
        }  # fmt: skip
    return found


def elements(robot: Robot, fits: Sequence[LocalFit], p: Array) -> list[Figures]:
    """Each measured element of g and M, its model, and what p_g gives of it."""
    gravity = np.zeros(len(p))
    gravity[list(base_parameters(robot).groups["gravity"])] = 1.0
    found = []
    for f in fits:
        value = f.at(p)
        found.append(
            {"kind": f.kind, "axis": f.axis + 1, "q": np.degrees(f.q), "value": value.value,
             "model": value.model, "of_gravity": f.row @ (gravity * p)}
        )  # fmt: skip
    return found


def of_friction(run: Run, model: Path) -> Figures:
    """Points of a friction run, its models (1) to (3), its symmetry."""
    found = evaluate(run, list(recorded(run)), model)
    return {
        "points": [
            [p.axis + 1, p.time / 60, p.velocity, p.forward, p.backward] for p in found.points
        ],
        "models": {
            fit.axis + 1: {kind: [m.error, *m.a] for kind, m in fit.models.items()}
            for fit in found.axes
        },
        "asymmetry": {axis + 1: each.asymmetry for axis, each in found.symmetry.items()},
    }


def of_offset(run: Run) -> Figures:
    """Fig. 7: what was ranked first among parameters left out, its value, and the phase."""
    found, fits = diagnose(run), local_fits(run.robot, prepare(recorded(run))[0])[0]
    first = found.errors.found[0] if found.errors.found else None
    return {
        "names": first.names if first else (),
        "value": first.value if first else 0.0,
        "error": first.standard_error if first else 0.0,
        "elements": elements(run.robot, fits, found.estimate.p),
        "phase": PhaseRecord.of(found.phase).model_dump() if found.phase else None,
        "degrees": np.degrees(found.phase.shift) if found.phase else 0.0,
    }


def of_filters(run: Run, plant: Path) -> Figures:
    """Errors of the published method by the low-pass: its order, its way, what passes it."""
    truth = true_parameters(run.robot, plant)
    found = {}
    for name, (order, way, torque_alone) in LOW_PASSES.items():

        def passed(s: Signals, x: Array, order: int = order, way: Any = way) -> Array:
            sos = signal.butter(order, CUTOFF, fs=1 / s.period, output="sos")
            return np.asarray(way(sos, x - x[0], axis=0) + x[0])

        raw, _ = prepare(recorded(run))
        if torque_alone:
            raw = [(m, replace(s, tau=passed(s, s.tau))) for m, s in raw]
        with patch.object(Signals, "filtered", Signals.filtered if torque_alone else passed):
            fits, _ = local_fits(run.robot, raw)
        found[name] = _error(run.robot, TwoStep(run.robot, fits).solve(), truth)
    return found


LOW_PASSES = {
    "order 4, forth and back, on both sides": (4, signal.sosfiltfilt, False),
    "order 8, forth and back, on both sides": (8, signal.sosfiltfilt, False),
    "order 8, forth, on both sides": (8, signal.sosfilt, False),
    "order 8, forth and back, on the torque alone": (8, signal.sosfiltfilt, True),
    "order 8, forth, on the torque alone": (8, signal.sosfilt, True),
}
"""What "non-causal, phase-neutral eighth-order" may mean, and what it is not."""


def course(run: Run, name: str) -> Figures:
    """One measurement as it was recorded: time, and velocity and torque of its axis."""
    m, recording = next(each for each in recorded(run) if each[0].id == name)
    s, axis = signals(recording), m.moved[0]
    columns = s.time - s.time[0], s.smoothed(s.qd)[:, axis], s.smoothed(s.tau)[:, axis]
    return dict(zip("tvQ", (c[::5] for c in columns), strict=True))
