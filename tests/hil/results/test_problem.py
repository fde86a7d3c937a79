"""Regression of recordings of any kind: options, names, torque parts, mixtures."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from free_run import write_free_run
from small_run import write_run
from synthetic import TABLE_3_A
from trajectory_run import recorded, some_trajectory

import hil
from hil.errors import Mismatch, NotEnoughData, NotIdentifiable, UnknownName
from hil.estimation.identify import estimate
from hil.estimation.options import Options
from hil.estimation.prior import Prior
from hil.model.load import MASS, load_columns
from hil.planning.free_motion import FreeMotion
from hil.results.problem import RegressionProblem
from hil.results.recorded_torque import predict_recording
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from hil.least_squares.regression import Covariance
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.identification import ModelFit
    from hil.runs.recording import Recording

pytestmark = pytest.mark.usefixtures("skip_causes")


@pytest.fixture(scope="module")
def strokes(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Strokes of one axis at a time."""
    path: Path = tmp_path_factory.mktemp("problem") / "strokes"
    write_run(path, manutec)
    return Run.open(path)


def free_motion(
    robot: Robot, moving: int = 6, noise: float = 0.002
) -> tuple[FreeMotion, Recording]:
    """Return an externally recorded motion of the first axes."""
    every, still = some_trajectory(robot), (0.0,) * 15
    amplitudes = {
        name: tuple(row if k < moving else still for k, row in enumerate(getattr(every, name)))
        for name in ("sine", "cosine")
    }
    ((motion, recording),) = recorded(robot, every.model_copy(update=amplitudes), noise=noise)
    duration = float(np.ptp(recording.time))
    return FreeMotion(id="csv", q=motion.q, duration=duration, cycles=2, source="made"), recording


def both_of(run: Run) -> list[tuple[RecordedMotion, Recording]]:
    """Return measurements of a run with their recordings."""
    return [(each.measurement, each.recording) for each in run]


def select_axis_1(run: Run, robot: Robot) -> list[tuple[RecordedMotion, Recording]]:
    """Return strokes of axis 1, and an import in which all other axes rest."""
    strokes = [each for each in both_of(run) if each[0].moved == (0,)]
    return [*strokes, free_motion(robot, moving=1)]


@pytest.fixture(scope="module")
def imported(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Externally recorded motion of all axes."""
    path: Path = tmp_path_factory.mktemp("problem") / "imported"
    return write_free_run(path, manutec, [free_motion(manutec)])


@pytest.fixture(scope="module")
def measured(strokes: Run) -> ModelFit:
    """Regression of the strokes alone."""
    return hil.regression(strokes).fit()


@pytest.fixture(scope="module")
def free(imported: Run) -> ModelFit:
    """Regression of the import alone."""
    return hil.regression(imported).fit()


@pytest.fixture(scope="module")
def both(strokes: Run, imported: Run) -> ModelFit:
    """Regression of both kinds."""
    return hil.regression(strokes, imported).fit()


@pytest.fixture(scope="module")
def plain(strokes: Run) -> ModelFit:
    """Regression of the strokes without unknowns of the drive train."""
    return hil.regression(strokes, nuisance=()).fit()


def variances(fit: ModelFit) -> np.ndarray:
    """Return variances of the base parameters."""
    return np.diag(fit.estimate.scatter_covariance)


def test_what_recordings_call_for_is_stated(strokes: Run, imported: Run) -> None:
    assert hil.regression(strokes).method == "improved"
    assert hil.regression(imported).method == "free motion"
    assert hil.regression(strokes, imported).method == "joint"


def test_a_mixture_finds_the_parameters_that_both_share(both: ModelFit) -> None:
    z = (both.estimate.values - TABLE_3_A) / both.estimate.standard_errors
    # 14 of Student's t with few degrees of freedom
    assert np.abs(z).max() < 6.0
    inside = [
        low <= truth <= high
        for (low, high), truth in zip(both.conf_int().values(), TABLE_3_A, strict=False)
    ]
    assert np.mean(inside) >= 0.85


def test_a_mixture_knows_more_than_either_part(
    both: ModelFit, measured: ModelFit, free: ModelFit
) -> None:
    for part in (measured, free):
        assert np.mean(np.log(variances(both) / variances(part))) < 0.0


def test_what_an_import_does_not_show_is_as_uncertain_as_without_it(
    measured: ModelFit, strokes: Run, manutec: Robot
) -> None:
    alone = np.sqrt(variances(measured))
    recordings = [*both_of(strokes), free_motion(manutec, moving=3)]
    beside = estimate(manutec, recordings, "joint").standard_errors
    of_the_wrist = slice(8, 14)
    # lags, encoder steps and compliances count with any additional recordings
    assert (beside[of_the_wrist] > 0.9 * alone[of_the_wrist]).all()


def test_lags_leave_base_parameters_as_uncertain_beside_a_load(
    measured: ModelFit, strokes: Run, manutec: Robot, tmp_path: Path
) -> None:
    with_load = TABLE_3_A + load_columns(manutec).K[:, MASS] * 4.0
    write_run(tmp_path, manutec, truth=(manutec, with_load), seed=101)
    fit = hil.regression(strokes, loaded=[Run.open(tmp_path)]).fit()
    of_lags = np.sqrt(np.diag(measured.estimate.drive_train.covariance))
    assert (np.array(list(fit.bse.values()))[: len(of_lags)] > of_lags).all()


def test_an_error_of_a_torque_constant_does_to_a_mixture_what_is_stated(
    both: ModelFit, strokes: Run, manutec: Robot
) -> None:
    axis, share = 2, 2e-4  # weights of the axes are unchanged
    scaled = []
    for motion, recording in [*both_of(strokes), free_motion(manutec)]:
        tau = recording.tau.copy()
        tau[:, axis] *= 1.0 + share
        scaled.append((motion, replace(recording, tau=tau)))
    change = (estimate(manutec, scaled, "joint").values - both.estimate.values) / share
    effect = both.estimate.effect[:, axis]
    assert np.linalg.norm(change - effect) < 0.05 * np.linalg.norm(effect)


def test_a_mixture_that_leaves_parameters_open_is_refused(strokes: Run, manutec: Robot) -> None:
    with pytest.raises(NotIdentifiable, match="together with the imports do not identify p4, p5"):
        estimate(manutec, select_axis_1(strokes, manutec), "joint")


def test_a_prior_completes_a_mixture(strokes: Run, manutec: Robot) -> None:
    sphere = [0.4, 0.0, 0.0, 0.4, 0.0, 0.4, 0.0, 0.0, 1.0, 10.0]
    options = Options(prior=Prior(np.tile(sphere, (6, 1)), 0.3))
    found = estimate(manutec, select_axis_1(strokes, manutec), "joint", options)
    assert (found.prior_share[[3, 4, 6]] > 0.9).all()
    assert abs(found.values[0] - TABLE_3_A[0]) < 4 * found.standard_errors[0]


def test_all_that_was_found_has_a_name(both: ModelFit, manutec: Robot) -> None:
    assert both.names[:3] == ("p1", "p2", "p3")
    assert "axis 2 Coulomb" in both.params
    assert "axis 2 lag" in both.params
    assert set(both.params) == set(both.conf_int()) == set(both.bse)
    assert both.model.robot == manutec
    assert "p1" in str(both.summary())


@pytest.mark.parametrize("kind", ["both", "free"])
def test_parts_of_the_torque_add_up(
    kind: str, imported: Run, request: pytest.FixtureRequest
) -> None:
    (recording,) = [each.recording for each in imported]
    parts = request.getfixturevalue(kind).torque_parts(recording)
    names = ("gravity", "inertia", "velocity", "rotors", "friction")
    total = np.sum([parts[name] for name in names], axis=0)
    np.testing.assert_allclose(parts["measured"] - total, parts["left"])
    # strokes and import have different friction
    most = 0.05 if kind == "free" else 0.3
    assert np.linalg.norm(parts["left"]) < most * np.linalg.norm(parts["measured"])
    assert len(parts["time"]) == len(total)


def test_parts_of_the_torque_add_up_to_the_prediction(free: ModelFit, imported: Run) -> None:
    (recording,) = [each.recording for each in imported]
    left = predict_recording(free.model, recording).residual
    np.testing.assert_allclose(free.torque_parts(recording)["left"], left, atol=1e-9)


def test_what_is_not_looked_for_is_not_found(plain: ModelFit) -> None:
    assert not plain.estimate.drive_train.lag.any()
    assert not plain.estimate.drive_train.soft.any()


def test_a_law_may_be_stated(imported: Run) -> None:
    fit = hil.regression(imported, friction="arc tangent", nuisance=()).fit()
    assert {law.law for law in fit.model.friction_law.axes} == {"arc tangent"}
    assert not any(lag.value for lag in fit.estimate.details.lag)


@pytest.mark.parametrize("covariance", ["jackknife", "clusters", "white"])
@pytest.mark.parametrize("kind", ["measured", "free"])
def test_errors_are_stated_as_asked(
    kind: str, covariance: Covariance, strokes: Run, imported: Run, request: pytest.FixtureRequest
) -> None:
    as_usual, run = request.getfixturevalue(kind), strokes if kind == "measured" else imported
    other = hil.regression(run, covariance=covariance).fit()
    np.testing.assert_array_equal(as_usual.estimate.values, other.estimate.values)
    assert not np.allclose(variances(as_usual), variances(other), rtol=1e-3)


@pytest.mark.parametrize("option", [{"friction": "Coulomb"}, {"nuisance": ("presliding",)}])
def test_an_option_for_the_import_with_a_load_leaves_the_strokes_without_it_alone(
    option: dict[str, Any], strokes: Run, imported: Run, measured: ModelFit, plain: ModelFit
) -> None:
    asked = hil.regression(strokes, loaded=[imported], **option)
    alone = measured if "friction" in option else plain
    np.testing.assert_array_equal(asked.bare.estimate.values, alone.estimate.values)


def test_what_cannot_be_asked_is_refused(strokes: Run) -> None:
    with pytest.raises(NotEnoughData, match="0 runs"):
        hil.regression()
    with pytest.raises(Mismatch, match="named twice"):
        hil.regression(strokes, strokes)
    for lags in ("lags", ("lags",)):
        with pytest.raises(UnknownName, match="nuisance 'lags' must be one of: lag"):
            hil.regression(strokes, nuisance=lags)
    with pytest.raises(UnknownName, match="covariance 'HC3' must be one of: jackknife"):
        hil.regression(strokes, covariance="HC3")
    with pytest.raises(UnknownName, match="friction 'Stribeck' must be"):
        hil.regression(strokes, friction="Stribeck")
    with pytest.raises(Mismatch, match=r"friction 'arc tangent' has no effect .*effect: auto\)"):
        hil.regression(strokes, friction="arc tangent")
    with pytest.raises(Mismatch, match=r"'presliding' has no effect .*\(with an effect: lag"):
        hil.regression(strokes, nuisance="presliding")
    with pytest.raises(Mismatch, match="covariance 'white' has no effect on method 'published'"):
        hil.regression(strokes, covariance="white", method="published")
    with pytest.raises(NotEnoughData, match="0 runs with a load"):
        hil.regression(strokes, mass=2.0)
    with pytest.raises(Mismatch, match="not applicable to a load"):
        hil.regression(strokes, loaded=[strokes], method="improved")
    assert isinstance(hil.regression(strokes), RegressionProblem)
