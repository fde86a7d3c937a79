"""Models of free motions: saved, displayed, and predicting torques with friction."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run
from urdf_robots import ROBOTS, urdf

import hil
from hil.errors import NotEnoughData
from hil.estimation.estimate import NO_DETAILS
from hil.friction.law import FrictionLaw
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot
from hil.results.model import Model
from hil.results.predicted_torques import predicted_torques
from hil.results.recorded_torque import predict_recording
from hil.results.verdict import verdict

if TYPE_CHECKING:
    from pathlib import Path

    from hil.runs.run import Run


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    robot = arm()
    return write_free_run(tmp_path_factory.mktemp("free") / "run", robot, recorded(robot, TRUTH))


@pytest.fixture(scope="module")
def model(run: Run) -> Model:
    return hil.identify(run)


def test_an_imported_run_is_identified_by_the_method_for_it(model: Model) -> None:
    assert model.method == "free motion"
    assert model.values == pytest.approx(TRUTH, abs=0.02)


def test_a_model_comes_back_from_its_file_with_its_friction(model: Model, tmp_path: Path) -> None:
    model.save(tmp_path / "model.yaml")
    again = Model.load(tmp_path / "model.yaml")
    assert again.details == model.details
    q, qd, qdd = np.random.default_rng(0).standard_normal((3, 10, 2))
    ours, theirs = (each.predict(q, qd, qdd) for each in (model, again))
    assert theirs == pytest.approx(ours, rel=1e-12)


def test_intervals_hold_the_truth_where_a_cause_was_found(tmp_path: Path) -> None:
    robot = arm()
    misscaled = [
        (motion, replace(each, tau=each.tau * [1.0, 1.05]))
        for motion, each in recorded(robot, TRUTH)
    ]
    found = hil.identify(write_free_run(tmp_path / "run", robot, misscaled))
    assert found.excluded is not None
    assert found.excluded.found
    error = np.abs(found.values - TRUTH)
    assert (error / np.sqrt(np.diag(found.scatter_covariance))).max() > 5.0
    low, high = found.interval().T
    assert ((low <= TRUTH) & (high >= TRUTH)).all()


def test_the_torque_is_what_the_drives_gave(model: Model) -> None:
    (_, recording), *_ = recorded(arm(), TRUTH, noise=0.0, seed=50)
    found = predict_recording(model, recording)
    assert found.overall < 0.01
    assert found.residual.shape == found.measured.shape == (len(found.time), 2)


def test_intervals_of_another_recording_hold_its_torques(model: Model) -> None:
    (_, recording), *_ = recorded(arm(), TRUTH, seed=60)
    inside = predict_recording(model, recording).inside(0.95)
    assert (inside > 0.9).all()
    assert (inside < 0.99).all()


def test_a_recording_of_another_load_is_predicted_worse(model: Model) -> None:
    (_, loaded), *_ = recorded(arm(), TRUTH + np.array([0, 0, 0, 0.5, 1.0, 0.0]), seed=60)
    (_, same), *_ = recorded(arm(), TRUTH, seed=60)
    assert predict_recording(model, loaded).overall > 3 * predict_recording(model, same).overall


def test_validation_takes_the_law_of_friction_instead_of_fitting_one(model: Model) -> None:
    data = recorded(arm(), TRUTH, n=1, seed=70)
    data[0][1].tau[:] += 5.0 * np.sign(np.gradient(data[0][1].q, axis=0))
    parts = list(predicted_torques(model, data))
    assert [part.axis for part in parts] == [0, 1]
    for part in parts:
        assert np.abs(part.measured - part.predicted).mean() > 3.0


def test_a_model_without_friction_says_so(model: Model) -> None:
    bare = replace(model, details=NO_DETAILS, friction_law=FrictionLaw.absent(2))
    with pytest.raises(NotEnoughData, match="no law of friction"):
        bare.predict(0.0, 0.0, 0.0)
    with pytest.raises(NotEnoughData, match=r"no filter settings .* use model\.torque"):
        predict_recording(bare, recorded(arm(), TRUTH, n=1)[0][1])


def test_the_summary_states_friction_residuals_and_what_was_chosen(model: Model) -> None:
    text = str(model.summary())
    for word in ("Friction", "viscous", "all samples", "cut-off", "dead zone", "Hausman"):
        assert word in text


def test_several_axes_that_are_not_excited_are_axes(model: Model) -> None:
    loose = model.scatter_covariance + 1e4 * np.eye(len(model.scatter_covariance))
    reasons = verdict(replace(model, scatter_covariance=loose)).reasons
    (doubt,) = (each for each in reasons if "torque on motions" in each.reason)
    assert "axes 1, 2: torque on motions through" in doubt.reason


@pytest.mark.parametrize(
    ("parameter", "lacking"), [(0, "with greater acceleration"), (1, "over a wider range")]
)
def test_axes_that_are_not_excited_are_named_with_what_is_lacking(
    model: Model, parameter: int, lacking: str
) -> None:
    loose = model.scatter_covariance.copy()
    loose[parameter, parameter] += 100.0
    found = verdict(replace(model, scatter_covariance=loose))
    (doubt,) = (each for each in found.reasons if "torque on motions" in each.reason)
    assert doubt.reason.startswith("axis 1: torque on motions")
    assert lacking in doubt.remedy


def test_a_wider_range_is_no_remedy_for_a_slide_with_constant_weight(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(urdf("gantry", ROBOTS["Cartesian"]))
    gantry = Robot.load(tmp_path / "robot.urdf")
    t = np.arange(4000)[:, np.newaxis] * 0.01
    rates = 2 * np.pi * np.array([0.31, 0.43, 0.23])
    q, qd = 0.2 * np.sin(rates * t), 0.2 * rates * np.cos(rates * t)
    p = np.linspace(30.0, 10.0, len(base_parameters(gantry)))
    tau = inverse_dynamics(gantry, p, q, qd, -(rates**2) * q) + 2.0 * np.sign(qd) + 3.0 * qd
    tau += 0.05 * np.random.default_rng(1).standard_normal(tau.shape)
    model = hil.identify(gantry, t=t[:, 0], q=q, tau=tau)
    assert model.details.not_identified == ()
    loose = model.scatter_covariance + 100.0 * np.eye(len(p))
    reasons = verdict(replace(model, scatter_covariance=loose)).reasons
    doubts = [each for each in reasons if "torque on motions" in each.reason]
    assert {each.remedy.split(";")[0] for each in doubts} == {
        "add recordings with greater acceleration"
    }
