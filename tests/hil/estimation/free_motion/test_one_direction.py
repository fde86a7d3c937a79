"""Motion in one direction only: Coulomb friction and offset cannot be distinguished."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import PERIOD, write_free_run

from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.solution import refit_friction
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.identify import estimate
from hil.model.robot import Robot
from hil.planning.free_motion import FreeMotion
from hil.results.identification import identified
from hil.runs.recording import Recording

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

INERTIA, OFFSET, COULOMB, VISCOUS = 0.5, 0.3, 1.0, 1.0
SPEEDS = 0.1 * np.arange(1, 11)
"""Successive speeds of the drive [rad/s]."""
HELD, RAMP = 2.5, 0.5
"""Duration of each speed [s], and the acceleration in between [rad/s^2]."""
ROBOT = Robot.create(
    "drive",
    [
        {
            "frame": {"alpha": 0}, "parameters": ["Izz"], "q_min": -19.0, "q_max": 19.0,
            "velocity_limit": 2.0, "acceleration_limit": 20.0, "torque_limit": 90.0,
            "drive": {"gear_ratio": 50.0, "rotor_inertia": "unknown", "torque_constant": 0.1},
        }
    ],
    gravity=(0.0, 0.0, -9.81),
)  # fmt: skip


def driven(speeds: Array, rest: float = 0.0) -> tuple[FreeMotion, Recording]:
    """Return a drive's motion through several constant speeds, with rest before and after."""
    parts, last = [np.zeros(round(rest / PERIOD))], 0.0
    for speed in (*speeds, 0.0):
        ramp = np.linspace(last, speed, round(abs(speed - last) / RAMP / PERIOD), endpoint=False)
        parts += [ramp, np.full(round(HELD / PERIOD) if speed else 0, speed)]
        last = speed
    qd = np.concatenate([*parts, parts[0]])
    rng = np.random.default_rng(1)
    torque = INERTIA * np.gradient(qd, PERIOD) + OFFSET + COULOMB * np.sign(qd) + VISCOUS * qd
    tau = torque + 0.05 * rng.standard_normal(len(qd))
    q = (PERIOD * np.cumsum(qd))[:, np.newaxis]
    still = np.full(len(qd), -1, np.int16)
    motion = FreeMotion(id="r", q=(float(q.mean()),), duration=PERIOD * len(qd), source="made")
    recording = Recording(
        PERIOD * np.arange(len(qd)), q, tau[:, np.newaxis], np.zeros(q.shape, np.uint8), still,
        still, group=0 * still,
    )  # fmt: skip
    return motion, recording


def model_of(folder: Path, speeds: Array, rest: float = 0.0) -> Model:
    return identified(write_free_run(folder / "run", ROBOT, [driven(speeds, rest)])).model


def test_friction_of_all_samples_leaves_such_an_axis_as_it_is() -> None:
    gathered = gather(ROBOT, [driven(SPEEDS)], VARIANTS[DEFAULT])
    fit = gathered.choice.fitted(gathered.products).fit("CR2")
    assert refit_friction(gathered.products, fit, "CR2", np.array([0])) is fit


@pytest.mark.parametrize(
    ("direction", "rest"), [(1, 0.0), (1, 3.0), (-1, 0.0)], ids=["forward", "rests", "back"]
)
def test_offset_and_coulomb_friction_are_stated_together(
    tmp_path: Path, direction: int, rest: float
) -> None:
    model = model_of(tmp_path, direction * SPEEDS, rest)
    (axis,) = model.details.axes
    assert axis.one_way is not None
    assert axis.one_way.direction == direction
    together = axis.one_way.together
    assert together.value == pytest.approx(OFFSET + direction * COULOMB, abs=0.02)
    assert together.standard_error < 0.1
    for terms in (axis.terms, axis.plain):
        for name, truth in (("offset", OFFSET), ("Coulomb", COULOMB)):
            assert abs(terms[name].value - truth) < 1.96 * terms[name].standard_error
    assert axis.terms["viscous"].value == pytest.approx(VISCOUS, rel=0.02)
    assert any(
        "Coulomb friction and an offset cannot be separated" in each
        for each in model.details.remarks
    )


@pytest.mark.parametrize("cut_off", [20.0, 40.0, 62.5])
def test_their_sum_is_certain_however_wide_the_band_is(cut_off: float) -> None:
    """Other laws only divide the sum differently, which is no error of the sum."""
    motion, recording = driven(SPEEDS, rest=3.0)
    found = estimate(ROBOT, [(motion.model_copy(update={"cut_off": cut_off}), recording)], DEFAULT)
    one_way = found.details.axes[0].one_way
    assert one_way is not None
    assert one_way.together.standard_error < 0.1


def test_such_a_model_is_doubtful_and_says_to_move_in_both_directions(tmp_path: Path) -> None:
    outcome = model_of(tmp_path, SPEEDS).verdict
    assert outcome is not None
    assert outcome.word == "doubtful"
    assert outcome.reason.startswith(
        "axis 1 moves beyond its dead zone in one direction only, so Coulomb friction and"
    )
    assert re.search(r"together they are 1\.3 ± 0\.\d+ N m$", outcome.reason)
    assert outcome.remedy == "add recordings of faster motion in both directions"


def test_strokes_back_shorter_than_the_reach_of_the_low_pass_count() -> None:
    """No sample of the way back is farther from a reversal than the low-pass reaches."""
    motion, recording = driven(np.array([0.3, 0.9, 0.5, 0.7, -0.2, 0.8, 0.4, 1.0, 0.6, -0.1] * 3))
    found = estimate(ROBOT, [(motion.model_copy(update={"cut_off": 1.5}), recording)], DEFAULT)
    axis = found.details.axes[0]
    assert axis.one_way is None
    assert axis.terms["Coulomb"].value == pytest.approx(COULOMB, abs=0.05)


def test_a_drive_that_moves_in_both_directions_is_good_and_both_are_found(tmp_path: Path) -> None:
    model = model_of(tmp_path, np.concatenate([SPEEDS, -SPEEDS]))
    assert model.verdict is not None
    assert model.verdict.word == "good"
    (axis,) = model.details.axes
    assert axis.one_way is None
    assert axis.terms["offset"].value == pytest.approx(OFFSET, abs=0.01)
    assert axis.terms["Coulomb"].value == pytest.approx(COULOMB, abs=0.01)
    assert axis.terms["Coulomb"].standard_error < 0.01
