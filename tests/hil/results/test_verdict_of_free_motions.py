"""Verdict on imported recordings: columns other than torques of the motion have failed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, classical, recorded, write_free_run

from hil.estimation.free_motion.result import BiasTest
from hil.results.identification import identify
from hil.results.verdict import verdict as judged

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.results.judgement import Judgement
    from hil.results.model import Model

    Array = NDArray[np.float64]


def identified(path: Path, change: Callable[[Array], Array]) -> Model:
    """Identify recordings with changed torques."""
    data = recorded(arm(), TRUTH)
    for _, recording in data:
        recording.tau[:] = change(recording.tau)
    return identify(write_free_run(path / "run", arm(), data))


def verdict(path: Path, change: Callable[[Array], Array]) -> Judgement:
    found = identified(path, change).verdict
    assert found is not None
    return found


def noise(tau: Array) -> Array:
    return np.random.default_rng(0).normal(0.0, 10.0, tau.shape)


def constant(tau: Array) -> Array:
    return np.column_stack([tau[:, 0], np.full(len(tau), 7.0)])


@pytest.mark.parametrize("wrong", [noise, constant])
def test_what_the_mean_torque_explains_as_well_has_failed(
    wrong: Callable[[Array], Array], tmp_path: Path
) -> None:
    found = verdict(tmp_path, wrong)
    assert found.word == "failed"


def test_right_columns_are_good_and_how_good_is_stated(tmp_path: Path) -> None:
    found = verdict(tmp_path, lambda tau: tau)
    assert found.word == "good"
    assert "within" in found.reason


def test_friction_that_gives_power_is_doubted_by_its_axis(tmp_path: Path) -> None:
    data = recorded(arm(), TRUTH, lambda qd: classical(qd) * np.array([1.0, -1.0]))
    found = identify(write_free_run(tmp_path / "run", arm(), data)).details
    assert found.driving == (2,)


def test_a_torque_that_hardly_changes_is_a_doubt_and_no_failure(tmp_path: Path) -> None:
    model = identified(tmp_path, lambda tau: tau)
    constant = {"relative_residual": (0.01, 0.02), "naive_residual": (1.0, 0.02)}
    details = model.details.model_copy(update=constant)
    found = judged(replace(model, details=details, band_residual=None))
    assert found.word == "doubtful"
    assert "axis 2: the model leaves 2% of the torque" in str(found.reasons)


@pytest.mark.parametrize(("in_motion", "word"), [(0.23, "doubtful"), (0.7, "failed")])
def test_friction_held_at_rest_is_no_failure(tmp_path: Path, in_motion: float, word: str) -> None:
    model = identified(tmp_path, lambda tau: tau)
    held = {"relative_residual": (0.01, 0.58), "naive_residual": (1.0, 0.81)}
    left = model.band_residual
    assert left is not None
    smoothed = tuple(in_motion * (each or 0) for each in left.moving)
    details = model.details.model_copy(update=held)
    band = left.model_copy(update={"smoothed": smoothed})
    found = judged(replace(model, details=details, band_residual=band))
    assert found.word == word


def test_an_unusual_offset_that_passes_for_weight_is_doubted_by_its_axis(tmp_path: Path) -> None:
    model = identified(tmp_path, lambda tau: tau)
    unusual = model.details.model_copy(update={"unusual": (2,)})
    found = judged(replace(model, details=unusual))
    assert found.word == "doubtful"
    assert found.reason.startswith("axis 2: offset above 15% of friction")


def test_late_torques_are_named_and_before_a_residual_that_they_explain(tmp_path: Path) -> None:
    model = identified(tmp_path, lambda tau: np.roll(tau, 2, axis=0))
    found = judged(model)
    assert any("which the estimate compensates: axis 1" in each.reason for each in found.reasons)
    left = model.band_residual
    assert left is not None
    poor = left.model_copy(update={"smoothed": tuple(0.3 * (each or 0) for each in left.moving)})
    worse = judged(replace(model, band_residual=poor))
    assert worse.word == "doubtful"
    # errors of the model pass for lags of single axes, as in half a recording of a real TX40
    assert "ms late" in worse.reason
    assert "or the model lacks" in worse.reason
    assert "residual 30 %" in worse.further[0].reason


@pytest.mark.parametrize(("share", "word"), [(0.005, "good"), (0.05, "doubtful")])
def test_noise_of_positions_is_doubted_by_the_torque_that_it_shifts(
    tmp_path: Path, share: float, word: str
) -> None:
    model = identified(tmp_path, lambda tau: tau)
    change = tuple((share * model.values).tolist())
    biased = BiasTest(statistic=5.0, p_value=1e-3, shift=0.77, change=change)
    details = model.details.model_copy(update={"bias_test": biased})
    found = judged(replace(model, details=details))
    assert found.word == word
    shifts = "noise of the positions shifts the torque on a free motion by 5 %" in found.reason
    assert shifts == (word == "doubtful")
