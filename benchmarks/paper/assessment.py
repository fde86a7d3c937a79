"""Assessment of one campaign by the paper's method, as plain figures for a file.

The method is that of section 6, without changes. The plant's truth is used for errors only.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np
from scipy import signal

from hil.commands.diagnose import diagnose
from hil.commands.friction import fit_friction
from hil.estimation.friction.points import judge_local_values
from hil.estimation.identify import estimate
from hil.estimation.signals import CUTOFF, Signals, signals
from hil.estimation.two_step_methods import TwoStep, local_fits, prepare
from hil.ground_truth.comparison import Comparison
from hil.ground_truth.true_parameters import true_parameters
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import gravity_torque, inverse_dynamics
from hil.planning.measurement import ELEMENT_KINDS
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.estimation.local_fits import LocalFit
    from hil.estimation.signals import Prepared
    from hil.model.robot import Robot
    from hil.runs.run import Run

    Figures = dict[str, Any]


def assess_strokes(run: Run, plant: Path, *, both: bool) -> Figures:
    """Return errors of a campaign of strokes; with `both`, also those of the improved method."""
    robot, measured = run.robot, list(recorded(run))
    truth = true_parameters(robot, plant)
    methods = ("improved", "published") if both else ("published",)
    found = {method: estimate(robot, measured, method) for method in methods}
    raw, _ = prepare(measured)
    fits, _ = local_fits(robot, raw)
    p = found["published"].values
    judged = {name: Comparison(each, truth) for name, each in found.items()}
    wrong = [
        (f.sides[0] - f.sides[1] - f.row @ truth) * (f.measurement.kind == "gravity") for f in fits
    ]
    tests = judge_local_values(found["improved"].local) if both else {}
    return {
        "minutes": measured[-1][1].time[-1] / 60,
        "known_gravity": errors(robot, _remove_torque(robot, fits, wrong), truth),
        "neglected": _neglected(robot, raw, fits, p, truth),
        "bound": _bound(robot, fits, p, truth),
        "elements": _elements(robot, fits, p),
        "asymmetric": {axis + 1: int(not each.passed) for axis, each in tests.items()},
        **{
            name: {"p": each.values, "torque": each.mean_torque_error, **each.group_error}
            for name, each in judged.items()
        },
    }


def errors(robot: Robot, p: Array, truth: Array) -> dict[str, float]:
    """Return the relative error of each group in its norm."""
    groups = {name: list(k) for name, k in base_parameters(robot).groups.items()}
    size = np.linalg.norm
    return {name: float(size((p - truth)[k]) / size(truth[k])) for name, k in groups.items()}


def _remove_torque(robot: Robot, fits: Sequence[LocalFit], torques: Sequence[float]) -> Array:
    """Return the parameters after removal of a torque from each measured element."""
    pairs = zip(fits, torques, strict=True)
    less = [replace(f, sides=np.r_[f.sides[0] - put, f.sides[1:]]) for f, put in pairs]
    return TwoStep(robot, less).solve()


def _neglected(
    robot: Robot, raw: Prepared, fits: Sequence[LocalFit], p: Array, truth: Array
) -> Figures:
    """Return the effect of a neglected torque on the elements and the parameters.

    Each measurement is evaluated with the neglected torque in place of the measured one: c(q, qd),
    and the torque by small motion of the held axes. Shares are relative to the largest element of
    each kind. Errors and p3 are those after subtraction of the torque.
    """
    found = {}
    for name, torque in NEGLECTED.items():
        alone = [(m, replace(s, tau=torque(robot, p, s, list(m.moved)))) for m, s in raw]
        put = [f.sides[0] for f in local_fits(robot, alone)[0]]
        without, share = _remove_torque(robot, fits, put), {}
        for kind in ELEMENT_KINDS:
            own = [k for k, f in enumerate(fits) if f.measurement.kind == kind]
            largest = np.abs([(put[k], fits[k].evaluate(p).value) for k in own]).max(axis=0)
            share[kind] = largest[0] / largest[1]
        found[name] = {"share": share, "p3": without[2] - p[2], **errors(robot, without, truth)}
    return found


def _coriolis(robot: Robot, p: Array, s: Signals, _: list[int]) -> Array:
    return inverse_dynamics(robot, p, s.q, s.qd, 0 * s.qd) - gravity_torque(robot, p, s.q)


def _rest_torque(robot: Robot, p: Array, s: Signals, moved: list[int]) -> Array:
    wanted = np.isin(np.arange(robot.n_joints), moved)
    alone = inverse_dynamics(robot, p, s.q, s.qd * wanted, s.qdd * wanted)
    return inverse_dynamics(robot, p, s.q, s.qd, s.qdd) - alone


NEGLECTED = {"coriolis": _coriolis, "at_rest": _rest_torque}


def _bound(robot: Robot, fits: Sequence[LocalFit], p: Array, truth: Array) -> Figures:
    """Return the error of each group relative to eq. (13), with Q measured and with W p."""
    found, size = {}, np.linalg.norm
    for kind in ELEMENT_KINDS.values():
        own = [f for f in fits if f.measurement.kind == kind.name]
        k = base_parameters(robot).groups[kind.group]
        weight = 1 / robot.torque_limit[[f.measurement.index for f in own]]
        rows = np.array([f.row + f.sides[2:] for f in own]) * weight[:, None]
        others = np.where(np.isin(np.arange(len(p)), k), 0.0, p)
        Q = np.array([f.sides[0] - f.sides[1] for f in own]) * weight - rows @ others
        W, true = rows[:, list(k)], truth[list(k)]
        error = size(p[list(k)] - true) / size(true) / np.linalg.cond(W)
        e = size(Q - W @ true)
        found[kind.group] = {"used": error * size(Q) / e, "exact": error * size(W @ true) / e}
    return found


def _elements(robot: Robot, fits: Sequence[LocalFit], p: Array) -> list[Figures]:
    """Return each measured element of g and M, its model, and the part of p_g in it."""
    gravity = np.isin(np.arange(len(p)), base_parameters(robot).groups["gravity"])
    return [
        {
            "kind": f.measurement.kind, "axis": f.measurement.axis, "q": np.degrees(f.q),
            "value": f.evaluate(p).value, "model": f.evaluate(p).model,
            "of_gravity": f.row @ (gravity * p),
        }
        for f in fits
    ]  # fmt: skip


def assess_friction(run: Run, model: Path) -> Figures:
    """Return points of a friction run (axis, minutes, speed, both torques) and errors of models."""
    found = fit_friction(run, model)
    return {
        "points": [
            [p.axis + 1, p.time / 60, p.velocity, p.forward, p.backward] for p in found.points
        ],
        "models": {
            fit.axis + 1: {kind: [m.error, *m.a] for kind, m in fit.models.items()}
            for fit in found.axes
        },
    }


def assess_offset(run: Run) -> Figures:
    """Return the result of Fig. 7: first-ranked omitted parameter, its value, and the phase.

    Configurations 10 to 24 begin at different motor angles; the model corrects the differences.
    """
    found = diagnose(run)
    first, phase = found.errors.found[0], found.phase
    assert phase
    return {
        "names": first.names, "value": first.value, "error": first.standard_error,
        "degrees": np.degrees(phase.shift), "stated": tuple(phase.stated),
        "extended": tuple(phase.extended),
        "q": np.degrees(phase.angle[:15]), "torque": phase.torque[:15],
    }  # fmt: skip


LOW_PASSES = {
    "order 4, forth and back": (4, signal.sosfiltfilt, False),
    "order 8, forth and back": (8, signal.sosfiltfilt, False),
    "order 8, causal": (8, signal.sosfilt, False),
    "order 8, causal, torque alone": (8, signal.sosfilt, True),
}
"""Interpretations of "non-causal, phase-neutral eighth-order" low-passes, and others."""


def assess_filters(run: Run, plant: Path) -> Figures:
    """Return errors of the published method for each interpretation of the low-pass."""
    truth, found = true_parameters(run.robot, plant), {}
    for name, (order, way, torque_alone) in LOW_PASSES.items():

        def passed(s: Signals, x: Array, order: int = order, way: Any = way) -> Array:
            sos = signal.butter(order, CUTOFF, fs=1 / s.period, output="sos")
            return np.asarray(way(sos, x - x[0], axis=0) + x[0])

        raw, _ = prepare(recorded(run))
        if torque_alone:
            raw = [(m, replace(s, tau=passed(s, s.tau))) for m, s in raw]
        with patch.object(Signals, "filtered", Signals.filtered if torque_alone else passed):
            fits, _ = local_fits(run.robot, raw)
        found[name] = errors(run.robot, TwoStep(run.robot, fits).solve(), truth)
    return found


def course(run: Run, name: str) -> Figures:
    """Return one recorded measurement: time, and velocity and torque of its axis."""
    m, recording = next(each for each in recorded(run) if each[0].id == name)
    s, axis = signals(recording), m.moved[0]
    columns = s.time - s.time[0], s.smoothed(s.qd)[:, axis], s.smoothed(s.tau)[:, axis]
    return dict(zip("tvQ", (c[::5] for c in columns), strict=True))
