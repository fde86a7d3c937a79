"""Validation of a model on recordings other than those of its identification."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy import special
from small_run import identified_model, write_run

from hil.commands.validate import ValidationRecord
from hil.estimation.signals import signals
from hil.friction.law import FrictionLaw
from hil.results.judgement import INSIDE, Judgement
from hil.results.predicted_torques import predicted_torques
from hil.results.validation import AxisScore, judged, scored
from hil.runs.pooling import pooled

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.results.model import Model
    from hil.results.recorded_torque import PredictedTorque
    from hil.runs.run import Run


@pytest.fixture(scope="module")
def model() -> Model:
    return identified_model()


@pytest.fixture(scope="module")
def other(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_run(tmp_path_factory.mktemp("other") / "run", manutec, seed=2)


def test_a_model_that_holds_passes(model: Model, other: Run) -> None:
    found = scored(model, predicted_torques(model, pooled([other])))
    assert found.word == "good"
    assert [score.axis for score in found.axes] == [1, 2, 3, 4, 5, 6]
    assert all(score.refitted < 0.02 for score in found.axes)
    assert all(score.inside > 0.9 for score in found.axes)
    assert all(score.gain == pytest.approx(1.0, abs=0.02) for score in found.axes)
    worst = max(s.relative for s in found.axes)
    shown = f"{100 * worst:.2g} %"
    assert found.reason.startswith(f"torque predicted within {shown} (rms), worst axis ")


def test_scores_are_those_of_measured_and_predicted_torque(model: Model, other: Run) -> None:
    every = list(predicted_torques(model, pooled([other])))
    (score, *_) = scored(model, every).axes
    own = [each for each in every if each.axis == 0]
    y, f, e = (
        np.concatenate([getattr(each, name) for each in own])
        for name in ("measured", "predicted", "standard_error")
    )
    assert score.samples == len(y)
    assert score.torque == pytest.approx(np.sqrt(np.mean(y**2)))
    assert score.residual == pytest.approx(np.sqrt(np.mean((y - f) ** 2)))
    assert score.naive == pytest.approx(y.std() / np.sqrt(np.mean(y**2)))
    assert score.inside == pytest.approx(np.mean(np.abs(y - f) <= 1.96 * e))


def test_the_prediction_is_the_model_s_own_and_what_fitted_friction_leaves_a_second_figure(
    model: Model, other: Run
) -> None:
    every = list(predicted_torques(model, pooled([other])))
    found = scored(model, every)
    recording = {motion.id: each for motion, each in pooled([other])}
    for each in every:
        s = signals(recording[each.measurement])
        at = np.searchsorted(s.time, each.time)
        own = model.predict(s.q, s.qd, s.qdd)[at, each.axis]
        # stroke rows are averages of a few samples, which matters where torques change
        assert np.median(np.abs(each.predicted - own)) < 0.02 * np.abs(own).max()
    for score in found.axes:
        assert score.own_friction
        assert score.refitted is not None
        assert score.refitted_inside is not None
        assert score.refitted <= score.relative < 0.2


def test_friction_that_changed_is_named_though_the_bodies_hold(model: Model, other: Run) -> None:
    def warmer(each: PredictedTorque) -> PredictedTorque:
        level = 0.3 * float(np.abs(each.measured).mean()) * np.sign(each.qd)
        return replace(each, predicted=each.predicted + level)

    found = scored(model, map(warmer, predicted_torques(model, pooled([other]))))
    assert found.word == "doubtful"
    assert "the model's friction is not" in found.reason


def test_a_model_without_a_law_is_judged_by_its_bodies_alone(model: Model, other: Run) -> None:
    bare = replace(model, friction_law=FrictionLaw.absent(6))
    found = scored(bare, predicted_torques(bare, pooled([other])))
    assert found.word == "doubtful"
    assert "axis 1, 2, 3, 4, 5, 6: the model has no friction" in found.reason
    assert not any(score.own_friction for score in found.axes)
    assert all(score.relative == score.refitted < 0.02 for score in found.axes)


def test_an_identification_that_failed_is_refused_however_well_it_predicts(
    model: Model, other: Run
) -> None:
    failed = replace(model, verdict=Judgement(word="failed", reason="axes 2 and 3 exchanged"))
    found = scored(failed, predicted_torques(failed, pooled([other])))
    assert found.word == "failed"
    assert found.reason == "the model's identification failed: axes 2 and 3 exchanged"


@pytest.mark.parametrize(
    ("inside", "word"), [(0.69, "doubtful"), (0.78, "doubtful"), (0.9, "good")]
)
def test_intervals_that_hold_far_fewer_samples_than_they_say_do_not_pass(
    inside: float, word: str
) -> None:
    score = AxisScore(
        axis=1, unit="N m", samples=999, torque=1.0, residual=0.03, relative=0.03, naive=1.0,
        inside=inside, gain=1.0, gain_error=0.0, asymmetry=0.1, limited=0.0, identified=0.03,
    )  # fmt: skip
    found = judged([score], 1)
    assert found.word == word
    assert (f"{inside:.0%} of the samples" in found.reason) == (word != "good")


@pytest.mark.parametrize("uncovered", ["", "11% of the samples are faster than 1.6 rad/s"])
@pytest.mark.parametrize(("relative", "word"), [(0.004, "good"), (0.02, "doubtful")])
def test_intervals_narrower_than_any_notable_error_raise_no_doubt(
    relative: float, word: str, uncovered: str
) -> None:
    score = AxisScore(
        axis=1, unit="N m", samples=999, torque=1.0, residual=relative, relative=relative,
        naive=1.0, inside=0.6, gain=1.0, gain_error=0.0, asymmetry=0.1, limited=0.0,
        identified=relative / 2, uncovered=uncovered,
    )  # fmt: skip
    found = judged([score], 1)
    assert found.word == word
    assert all(uncovered in each.reason for each in found.reasons[-1:])


def test_the_least_share_inside_is_that_of_an_error_which_all_samples_share() -> None:
    # half of the variance is shared; the shared error is at the end of its 95 % interval
    level, share = 1.96, np.sqrt(0.5)
    ends = (np.array([1.0, -1.0]) - share) * level / np.sqrt(1 - share**2)
    above, below = special.ndtr(ends)
    assert above - below == pytest.approx(INSIDE, abs=0.005)


def test_another_arm_is_refused(model: Model, other: Run) -> None:
    wrong = replace(model, values=-model.values)
    found = scored(wrong, predicted_torques(wrong, pooled([other])))
    assert found.word == "failed"
    assert "a constant torque" in found.reason


def test_a_torque_constant_that_changed_is_named(model: Model, other: Run) -> None:
    wrong = replace(model, values=model.values / 1.2)
    found = scored(wrong, predicted_torques(wrong, pooled([other])))
    assert found.word == "doubtful"
    assert "1.2" in found.reason
    assert "torque constant" in found.remedy


def test_a_gain_that_errors_of_the_parameters_explain_is_not_named(
    model: Model, other: Run
) -> None:
    wrong = replace(model, values=model.values / 1.2)
    every = [
        replace(each, parameter_error=np.full_like(each.stated, 0.2 * np.std(each.stated)))
        for each in predicted_torques(wrong, pooled([other]))
    ]
    found = scored(wrong, every)
    assert found.word == "doubtful"
    assert not any("gain" in each.reason for each in found.reasons)


def clipped(every: list[PredictedTorque]) -> list[PredictedTorque]:
    greatest = [
        max(float(np.abs(each.measured).max()) for each in every if each.axis == axis)
        for axis in range(6)
    ]
    bounds = 0.6 * np.array(greatest)
    return [
        replace(each, measured=each.measured.clip(-bounds[each.axis], bounds[each.axis]))
        for each in every
    ]


def asymmetric(every: list[PredictedTorque]) -> list[PredictedTorque]:
    def level(each: PredictedTorque) -> float:
        return 0.2 * float(np.abs(each.predicted).mean())

    return [replace(e, measured=e.predicted + level(e) * np.sign(e.qd)) for e in every]


def shaky(every: list[PredictedTorque]) -> list[PredictedTorque]:
    rng = np.random.default_rng(3)

    def noise(each: PredictedTorque) -> NDArray[np.float64]:
        size = 0.1 * float(np.abs(each.predicted).mean())
        return rng.normal(scale=size, size=len(each.time))

    return [replace(each, measured=each.predicted + noise(each)) for each in every]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (clipped, "largest torque; the drive was at its limit"),
        (asymmetric, "changes its sign with the direction|the model's friction is not"),
        (shaky, "does not hold for the speeds|intervals are too narrow"),
    ],
)
def test_what_is_wrong_with_a_recording_is_named(
    model: Model,
    other: Run,
    change: Callable[[list[PredictedTorque]], list[PredictedTorque]],
    reason: str,
) -> None:
    found = scored(model, change(list(predicted_torques(model, pooled([other])))))
    assert found.word == "doubtful"
    assert any(words in found.reason for words in reason.split("|"))


def test_axes_that_do_not_move_are_named(model: Model, other: Run) -> None:
    some = [each for each in predicted_torques(model, pooled([other])) if each.axis != 4]
    found = scored(model, some)
    assert (found.word, found.reason) == ("doubtful", "axes 5 do not move in this recording")


def test_a_recording_without_samples_judges_nothing(model: Model) -> None:
    assert scored(model, []).word == "failed"


def test_the_worst_word_stands() -> None:
    score = AxisScore(
        axis=1, unit="N m", samples=99, torque=1.0, residual=0.5, relative=0.5, naive=0.4,
        inside=0.1, gain=0.5, gain_error=0.0, asymmetry=0.9, limited=0.5, identified=0.01,
    )  # fmt: skip
    assert judged([score], 1).word == "failed"
    assert judged([score.model_copy(update={"naive": 1.0})], 1).word == "doubtful"
    good = {"relative": 0.01, "gain": 1.0, "limited": 0.0, "inside": 0.95}
    assert judged([score.model_copy(update=good)], 1).word == "good"


def test_the_recording_of_the_model_s_own_plan_is_remarked_upon(
    manutec: Robot, tmp_path: Path
) -> None:
    from hil.commands.validate import remarks

    run = write_run(tmp_path / "run", manutec)
    assert "with this plan" in remarks(identified_model(), run)[0]


def test_errors_of_parameters_that_compensate_are_no_doubt_about_the_torque() -> None:
    score = AxisScore(
        axis=1, unit="N m", samples=999, torque=1.0, residual=0.14, relative=0.14, naive=0.7,
        uncertain=0.66, inside=1.0, gain=1.0, gain_error=0.0, asymmetry=0.1, limited=0.0,
        identified=0.12,
    )  # fmt: skip
    assert judged([score], 1).word == "good"
    found = judged([score.model_copy(update={"identified": 0.05})], 1)
    assert found.word == "doubtful"
    assert "are 66% of this motion's torque (13% seen" in found.reason


def test_a_validation_of_an_earlier_version_is_read() -> None:
    stamp = dict.fromkeys(("folder", "measured", "robot_digest", "plan_digest", "recordings"), "")
    validation = {"verdict": "WARN", "reason": "axes 5 do not move", "axes": []}
    others = dict.fromkeys(("model", "method", "identified", "validated"), "")
    kept = ValidationRecord.model_validate({"run": stamp, "validation": validation, **others})
    assert str(kept.validation) == "doubtful: axes 5 do not move"
    assert [each.word for each in kept.validation.reasons] == ["doubtful"]
