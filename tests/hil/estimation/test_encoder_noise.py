"""Predicted bias by encoder steps in tests of causes equals that of such recordings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import free_run
import numpy as np
import pytest
from free_run import arm, recorded, write_free_run

import hil
from hil.estimation.excluded.backlash import half_gap
from hil.estimation.excluded.battery import Battery
from hil.estimation.excluded.columns import columns
from hil.estimation.excluded.encoder_noise import EncoderNoise
from hil.estimation.excluded.evidence import measured
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot, parse_robot

if TYPE_CHECKING:
    from free_run import FreeRecorded

TRUTH = {"Izz1": 6.0, "sx1": 8.0, "Izz2": 1.2, "sx2": 2.0}
STEP = 1e-3
"""Quantisation step [rad], large enough to change sizes by more than their errors."""
OFFSETS = 6


@pytest.fixture(scope="module")
def robot() -> Robot:
    return parse_robot(arm().text.replace("  - sy\n", ""), "arm.yaml")


def battery(robot: Robot, data: FreeRecorded) -> Battery:
    p = np.array([TRUTH[head] for head in base_parameters(robot).heads])
    prepared = [(motion, signals(recording)) for motion, recording in data]
    evidence = measured(robot, SimultaneousFit(robot, prepared), prepared)
    noise = EncoderNoise(robot, p, evidence)
    return Battery(evidence, columns(robot, p, evidence), noise=noise)


def test_sizes_are_corrected_by_half_of_what_encoder_steps_add(robot: Robot) -> None:
    p = np.array([TRUTH[head] for head in base_parameters(robot).heads])
    rng, exact = np.random.default_rng(1), recorded(robot, p, n=3, duration=12.0)

    def stepped(offset: np.ndarray) -> Battery:
        return battery(robot, [
            (motion, replace(each, q=STEP * (np.round(each.q / STEP + offset) - offset)))
            for motion, each in exact
        ])  # fmt: skip

    without, batteries = battery(robot, exact), [stepped(rng.random(2)) for _ in range(OFFSETS)]
    seen = 0.0
    for key, at in without.columns.tests.items():
        if len(at) > 1 or not without.visible[at].all() or half_gap(robot, key) is not None:
            continue
        start = without.test(at)
        assert start is not None
        raw = [(b, test) for b in batteries if (test := b.test(at, itself=True))]
        pairs = [(test, b.confirm(test)) for b, test in raw]
        assert len(pairs) == OFFSETS
        shift = np.array([a.size[0] - start.size[0] for a, _ in pairs])
        expected = 2 * np.mean([a.size[0] - b.size[0] for a, b in pairs])
        scatter = shift.std(ddof=1) / np.sqrt(len(pairs))
        assert abs(shift.mean() - expected) < 4 * scatter + 0.15 * abs(expected), key
        assert all(b.error[0] > a.error[0] for a, b in pairs), key
        seen = max(seen, abs(expected) / pairs[0][0].error[0])
    assert seen > 1.0
    """Otherwise this test would hold without the correction."""


def test_exact_positions_need_no_correction(robot: Robot) -> None:
    p = np.array([TRUTH[head] for head in base_parameters(robot).heads])
    every = battery(robot, recorded(robot, p, n=3, duration=12.0))
    at = every.columns.tests["torque constant", 0]
    raw = every.test(at, itself=True)
    assert raw is not None
    corrected = every.confirm(raw)
    assert corrected.size == pytest.approx(raw.size, abs=0.01 * raw.error[0])
    assert corrected.error == pytest.approx(raw.error, rel=0.01)


@pytest.mark.parametrize("seed", [2, 4])
def test_accelerations_of_encoder_steps_explain_no_other_reading(monkeypatch, tmp_path, seed):
    """Slow motion at 1 kHz with 12 bits a turn: all accelerations within the window are steps."""
    monkeypatch.setattr(free_run, "PERIOD", 0.001)
    step, robot = 2.0 * np.pi / 2**12, arm()
    data = recorded(robot, free_run.TRUTH, n=1, duration=60.0, noise=0.1, pace=0.1, seed=seed)
    data = [(motion, replace(each, q=step * np.round(each.q / step))) for motion, each in data]
    model = hil.identify(write_free_run(tmp_path / "run", robot, data))
    assert model.excluded.found == ()
