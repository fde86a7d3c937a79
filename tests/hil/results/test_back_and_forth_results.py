"""Model of axes that move back and forth: saved, loaded, validated, reported."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run
from stroke_run import campaign, strokes

from hil.estimation.back_and_forth import NAME
from hil.model.robot import parse_robot
from hil.report.page import report
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.predicted_torques import predicted_torques
from hil.results.tables.parameters import parameters
from hil.results.validation import scored
from hil.runs.pooling import recorded as of_run

if TYPE_CHECKING:
    from pathlib import Path

    from hil.runs.run import Run

ROBOT = arm()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_free_run(tmp_path_factory.mktemp("strokes") / "run", ROBOT, campaign(ROBOT, TRUTH))


@pytest.fixture(scope="module")
def partial(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Strokes of one axis at one configuration."""
    data = [
        strokes(ROBOT, TRUTH, 0, (0.3, 0.5), way=0.8, period=period, name=name)
        for name, period in (("fast", 1.6), ("slow", 4.0))
    ]
    return write_free_run(tmp_path_factory.mktemp("partial") / "run", ROBOT, data)


def test_it_states_the_same_after_it_was_kept(run: Run, tmp_path: Path) -> None:
    model = identify(run)
    model.save(tmp_path / "model.yaml")
    loaded = Model.load(tmp_path / "model.yaml")
    assert loaded.method == NAME
    assert loaded.details == model.details
    assert str(loaded.summary()) == str(model.summary())


def test_what_was_not_identified_has_no_error_and_no_interval(partial: Run, tmp_path: Path) -> None:
    model = identify(partial)
    lost = ~model.identified
    assert lost.any()
    assert np.isnan(model.standard_errors[lost]).all()
    assert np.isnan(model.interval()[lost]).all()
    assert np.isfinite(model.interval()[~lost]).all()
    rigid = {"parts": ("rigid bodies",)}
    assert np.isfinite(model.torque_interval([0.3, 0.5], [0.1, 0.0], [1.0, 0.0], **rigid)).all()
    text = str(model.summary())
    assert "not identified" in text
    model.save(tmp_path / "model.yaml")
    np.testing.assert_array_equal(Model.load(tmp_path / "model.yaml").identified, ~lost)


def test_a_sum_of_parameters_is_no_plain_row(partial: Run) -> None:
    model = identify(partial)
    sums = {each.name: each.stands_for for each in model.details.combinations}
    assert sums
    rows = {str(row[0]): str(row[-1]) for part in parameters(model).parts for row in part.rows}
    for name, total in sums.items():
        assert name not in rows
        assert rows[f"{name} + …"] == total


@pytest.mark.parametrize("unknown", ["acceleration_limit", "velocity_limit"])
def test_strokes_of_a_robot_whose_limits_are_unknown_are_validated(
    tmp_path: Path, unknown: str
) -> None:
    robot = parse_robot(re.sub(rf"{unknown}: \S+", f"{unknown}: unknown", ROBOT.text), "arm.yaml")
    assert np.isnan(getattr(robot, unknown)).all()
    data = campaign(robot, TRUTH)
    model = identify(write_free_run(tmp_path / "run", robot, data))
    found = scored(model, predicted_torques(model, data))
    known = scored(model, predicted_torques(replace(model, robot=ROBOT), data))
    assert [each.axis for each in found.axes] == [1, 2]
    for one, other in zip(found.axes, known.axes, strict=True):
        assert one.samples > 0.7 * other.samples
        assert one.relative < 0.05


def test_its_bodies_hold_on_a_machine_whose_friction_is_another(run: Run, tmp_path: Path) -> None:
    other = write_free_run(tmp_path / "other", ROBOT, recorded(ROBOT, TRUTH, n=1, seed=9))
    found = scored(identify(run), predicted_torques(identify(run), of_run(other)))
    assert all(each.refitted is not None and each.refitted < 0.05 for each in found.axes)
    assert found.word == "failed"
    assert "; with friction fitted to this recording the error is" in found.reason
    assert "rigid bodies are confirmed, the model's friction is not" in found.reason


def test_a_whole_and_a_partial_estimate_are_reported(run: Run, partial: Run) -> None:
    whole, part = (report(each).read_text() for each in (run, partial))
    assert "Torque of friction over the speed" in whole
    assert whole.count("<figure") == 4
    assert "not identified" in part
    assert "not identified" not in whole
