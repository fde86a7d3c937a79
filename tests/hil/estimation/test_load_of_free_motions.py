"""Load from runs of free motions: intervals, gains by a known mass, strokes in either run."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import special
from synthetic import Friction, record
from twin_recordings import TwinRecorder, brick, scale_gains

from hil.estimation.free_motion.gathering import Gathered, gather
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.loads.evidence import free_motion_evidence, stroke_evidence
from hil.estimation.loads.joint import fit_load
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.model.load import load_columns
from hil.model.robot import parse_robot
from hil.planning.design.by_counts import design

MASS = 2.805
LOAD = brick(MASS, (0.03, -0.02, 0.05), 0.05)
SEEN = ["m", "sx", "sy", "Izz"]
"""Load parameters observable by a SCARA's motions."""


@pytest.fixture(scope="module")
def twin() -> TwinRecorder:
    return TwinRecorder("scara")


def gathered(twin: TwinRecorder, data, *, open_scale: bool = False) -> Gathered:
    return gather(twin.robot, data, VARIANTS[DEFAULT], open_scale=open_scale)


def fitted(robot, runs, *of_load, **gains):
    bare, loaded = free_motion_evidence(robot, runs)
    return fit_load(robot, [bare], lambda _: [loaded], *of_load, **gains)


@pytest.mark.long
def test_intervals_hold_the_load(twin: TwinRecorder) -> None:
    held = []
    for seed in range(6):
        pair = [twin.recorded(2 * seed + 50, n=1), twin.recorded(2 * seed + 51, LOAD, n=1)]
        found = fitted(twin.robot, [gathered(twin, data) for data in pair])
        error = np.sqrt(np.diag(found.covariance))
        assert (error > 0).sum() == len(SEEN)
        seen = error > 0
        half = special.stdtrit(found.degrees[seen], 0.975) * error[seen]
        held += (np.abs(found.phi - LOAD.phi())[seen] <= half).tolist()
        assert found.present.p_value < 1e-6
        assert found.rigid.p_value > 1e-3
    assert np.mean(held) >= 0.85


def test_what_scatters_more_over_states_than_over_time_counts(twin: TwinRecorder) -> None:
    pair = [
        gathered(twin, twin.recorded(seed, load, n=1)) for seed, load in ((50, None), (51, LOAD))
    ]
    bare, loaded = free_motion_evidence(twin.robot, pair)
    whole, in_time = (
        fit_load(twin.robot, [runs[0]], lambda _, runs=runs: [runs[1]])
        for runs in ((bare, loaded), [replace(run, cells=None) for run in (bare, loaded)])
    )
    assert whole.phi == pytest.approx(in_time.phi)
    seen = np.diag(in_time.covariance) > 0
    ratio = np.diag(whole.covariance)[seen] / np.diag(in_time.covariance)[seen]
    assert (ratio > 1.0 - 1e-9).all()
    assert ratio.max() > 1.01


def test_a_known_mass_fixes_the_gains_of_all_axes_though_nothing_else_does(
    twin: TwinRecorder,
) -> None:
    without_rotors = TwinRecorder("scara")
    text = re.sub(r"rotor_inertia: [0-9.e-]+", "rotor_inertia: 0", twin.robot.text)
    without_rotors.robot = parse_robot(text, "scara without rotors")
    gains = {1: 0.1, 2: 3.0, 3: 20.0, 4: 0.01}
    pair = [
        scale_gains(without_rotors.recorded(seed, load, n=2), gains)
        for seed, load in ((1, None), (2, LOAD))
    ]
    runs = [gathered(without_rotors, data, open_scale=True) for data in pair]
    assert all(len(run.scaling.unknown) < 4 for run in runs)  # a scale is open
    found = fitted(without_rotors.robot, runs, MASS, gains=True)
    relative = found.gains / np.array(list(gains.values())) - 1
    assert (np.abs(relative) < 4 * found.gain_errors).all()
    assert found.gain_errors[[0, 1, 3]].max() < 0.03
    error = np.sqrt(np.diag(found.covariance))
    seen = error > 0
    assert (np.abs(found.phi - LOAD.phi())[seen] < 4 * error[seen]).all()


def test_without_a_load_none_is_found_and_nothing_but_chance_is_left(twin: TwinRecorder) -> None:
    runs = [gathered(twin, twin.recorded(seed, n=1)) for seed in (80, 81)]
    found = fitted(twin.robot, runs)
    assert found.present.p_value > 0.01
    assert found.rigid.p_value > 0.01


def strokes(robot, p, seed: int):
    """Return evidence from strokes of a machine with base parameters `p`."""
    rng, friction = np.random.default_rng(seed), Friction(offset=np.zeros(robot.n_joints))
    plan = design(robot, {"gravity": 6, "inertia": 16, "coupling": 6})
    fit = SimultaneousFit(robot, [
        (m, signals(record(robot, m, p, friction, noise=0.002, rng=rng))) for m in plan.measurements
    ])  # fmt: skip
    return stroke_evidence(fit.recorded, fit.loaded)


@pytest.mark.parametrize("imported", ["loaded", "bare"])
def test_one_run_may_be_of_strokes_and_the_other_imported(twin: TwinRecorder, imported) -> None:
    robot, p = twin.robot, twin.truth
    load = LOAD if imported == "loaded" else None
    (free,) = free_motion_evidence(robot, [gathered(twin, twin.recorded(2, load, n=2))])
    if imported == "loaded":
        found = fit_load(robot, [strokes(robot, p, 1)], lambda _: [free])
    else:
        with_load = strokes(robot, p + load_columns(robot).K @ LOAD.phi(), 1)
        found = fit_load(robot, [free], lambda _: [with_load])
    error = np.sqrt(np.diag(found.covariance))
    assert (error > 0).sum() == len(SEEN)
    assert (np.abs(found.phi - LOAD.phi())[error > 0] < 4 * error[error > 0]).all()
    assert error[9] < 0.015 * MASS
    assert found.present.p_value < 1e-6


@pytest.mark.long
def test_runs_of_both_kinds_without_and_with_the_load_are_one_regression(
    twin: TwinRecorder,
) -> None:
    robot, p = twin.robot, twin.truth
    loaded_p = p + load_columns(robot).K @ LOAD.phi()
    free = free_motion_evidence(
        robot,
        [gathered(twin, twin.recorded(seed, load, n=2)) for seed, load in ((1, None), (2, LOAD))],
    )
    measured = strokes(robot, p, 1), strokes(robot, loaded_p, 2)
    apart = [
        fit_load(robot, [bare], lambda _, loaded=loaded: [loaded])
        for bare, loaded in (free, measured)
    ]
    found = fit_load(robot, [measured[0], free[0]], lambda _: [measured[1], free[1]])
    variances = np.diag(found.covariance)
    seen = variances > 0
    assert seen.sum() == len(SEEN)
    for each in apart:
        both = seen & (np.diag(each.covariance) > 0)
        assert np.mean(np.log(variances[both] / np.diag(each.covariance)[both])) < 0.0
    assert (np.abs(found.phi - LOAD.phi())[seen] < 4 * np.sqrt(variances[seen])).all()
    assert (np.abs(found.p - p) < 6 * np.sqrt(np.diag(found.p_covariance))).all()
