"""A model predicts friction at a stated warmth of the gears, and warmth along a motion."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from stated_model import WARMTH, stated_model

from hil.errors import InvalidArray, NotEnoughData
from hil.friction.law import FrictionLaw
from hil.model.robot import Robot
from hil.results.model import Model

if TYPE_CHECKING:
    from pathlib import Path

QD = np.full(6, 0.7)


@pytest.fixture(scope="module")
def model() -> Model:
    return stated_model(Robot.load("manutec-r15"), friction=("offset", "Coulomb"), warm=True)


def friction(model: Model, warmth: object = None) -> np.ndarray:
    return model.predict(0.0, QD, 0.0, ["friction"], warmth=warmth)  # type: ignore[arg-type]


def test_without_a_warmth_friction_is_that_of_the_law(model: Model) -> None:
    assert friction(model) == pytest.approx(friction(model, WARMTH.reference))


def test_a_cold_gear_has_more_friction_and_a_warm_one_less(model: Model) -> None:
    cold, mean, warm = friction(model, 0.0), friction(model), friction(model, 1.0)
    assert (cold[:5] > mean[:5]).all()
    assert (mean[:5] > warm[:5]).all()
    assert cold[5] == mean[5] == warm[5]  # no warmth identified on this axis


def test_warmth_scales_the_level_and_not_the_offset(model: Model) -> None:
    back = model.predict(0.0, -QD, 0.0, ["friction"], warmth=0.0)
    offset = (friction(model, 0.0) + back) / 2
    assert offset == pytest.approx((friction(model) + model.predict(0, -QD, 0, ["friction"])) / 2)


def test_at_a_stated_warmth_the_interval_holds_what_is_left_of_the_wander(model: Model) -> None:
    def width(**stated: float) -> np.ndarray:
        found = model.torque_interval(0.0, QD, 0.0, parts=["friction"], **stated)  # type: ignore[arg-type]
        return found[:, 1] - found[:, 0]

    assert (width(warmth=WARMTH.reference)[:5] < width()[:5]).all()
    assert width(warmth=WARMTH.reference)[5] == pytest.approx(width()[5])


def test_warmth_along_a_motion_is_what_torque_takes(model: Model) -> None:
    time = np.linspace(0.0, 60.0, 600)
    warmth = model.warmth(time, np.tile(QD, (600, 1)))
    assert (np.diff(warmth[:, :5], axis=0) > 0).all()
    assert np.isnan(warmth[:, 5]).all()
    tau = model.predict(0.0, np.tile(QD, (600, 1)), 0.0, ["friction"], warmth=warmth)
    assert np.isfinite(tau).all()
    assert (tau[0, :5] > tau[-1, :5]).all()
    seen = WARMTH.seen[0] < warmth[-1, 0] < WARMTH.seen[1]
    assert seen


def test_the_file_of_a_model_keeps_warmth(model: Model, tmp_path: Path) -> None:
    model.save(tmp_path / "model.yaml")
    assert friction(Model.load(tmp_path / "model.yaml"), 0.0) == pytest.approx(friction(model, 0.0))


@pytest.mark.parametrize(
    ("warmth", "message"),
    [(1.2, "0 cold, 1 warmed"), (np.nan, "0 cold, 1 warmed"), ([0.1, 0.2], "shape")],
)
def test_a_warmth_that_cannot_be_is_refused(model: Model, warmth: object, message: str) -> None:
    with pytest.raises(InvalidArray, match=message):
        friction(model, warmth)


def test_times_that_do_not_ascend_are_refused(model: Model) -> None:
    with pytest.raises(InvalidArray, match="must ascend"):
        model.warmth([0.0, 0.0], np.zeros((2, 6)))


def test_a_model_that_knows_of_no_warmth_says_so() -> None:
    cold = stated_model(Robot.load("manutec-r15"))
    with pytest.raises(NotEnoughData, match="omit warmth"):
        friction(cold, 0.5)
    with pytest.raises(NotEnoughData):
        friction(replace(cold, friction_law=FrictionLaw.absent(6)), 0.5)
