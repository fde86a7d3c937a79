"""Cut-off frequency and velocity source are chosen from the recordings."""

from __future__ import annotations

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded

from hil.errors import NotEnoughData
from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.settings import processing_of
from hil.estimation.free_motion.survey import STRETCHES, survey
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS


def test_noise_of_the_positions_lowers_the_cut_off() -> None:
    found = [
        processing_of(survey(recorded(arm(), TRUTH, of_position=noise)))[0].cut_off
        for noise in (1e-6, 1e-4, 1e-2)
    ]
    assert found[0] > found[1] > found[2]


def test_axes_at_rest_in_most_recordings_do_not_lower_the_cut_off() -> None:
    data = recorded(arm(), TRUTH, n=3, of_position=1e-5)
    moving = processing_of(survey(data))[0].cut_off
    for number, axis in ((0, 1), (1, 0), (2, 0), (2, 1)):
        q = data[number][1].q
        q[:, axis] = 0.1 * number + 1e-5 * np.random.default_rng(number).standard_normal(len(q))
    assert processing_of(survey(data))[0].cut_off == pytest.approx(moving, rel=0.3)


def test_a_stated_cut_off_is_taken_and_its_reason_said() -> None:
    data = [
        (motion.model_copy(update={"cut_off": 8.0}), each)
        for motion, each in recorded(arm(), TRUTH)
    ]
    processing, reason = processing_of(survey(data))
    assert processing.cut_off == 8.0
    assert "stated" in reason.cut_off


def test_a_cut_off_beyond_what_samples_show_is_lowered() -> None:
    data = [
        (motion.model_copy(update={"cut_off": 500.0}), each)
        for motion, each in recorded(arm(), TRUTH)
    ]
    processing, reason = processing_of(survey(data))
    assert processing.cut_off == pytest.approx(0.25 / 0.004)
    assert "at most" in reason.cut_off


def test_stretches_of_a_long_run_stay_few_and_come_from_all_of_it() -> None:
    data = recorded(arm(), TRUTH, n=2) * 60
    found = survey(data)
    assert sum(s.n_samples * s.period for s in found.stretches) <= STRETCHES
    assert len(found.stretches) > 10
    assert found.n_recordings == 120
    assert found.duration == pytest.approx(120 * 20.0)
    assert np.isfinite(found.speed).all()


@pytest.mark.parametrize("sigma", [0.0, 2e-4, 5e-4])
def test_an_axis_that_shows_noise_alone_stands_still(sigma: float) -> None:
    rng = np.random.default_rng(5)
    for _, recording in (data := recorded(arm(), TRUTH)):
        recording.q[:, 1] = 0.4 + sigma * rng.standard_normal(recording.n_samples)
    assert survey(data).still == (1,)


def test_stretches_are_as_long_as_a_low_cut_off_needs() -> None:
    data = [
        (motion.model_copy(update={"cut_off": 1.0}), each)
        for motion, each in recorded(arm(), TRUTH, n=1, duration=30.0) * 20
    ]
    # twenty recordings share 150 s; the low-pass would spoil all 5 s of each
    assert {round(each.n_samples * each.period) for each in survey(data).stretches} == {5}
    gathered = gather(arm(), data, VARIANTS[DEFAULT])
    assert all(motion.used.any() for motion in gathered.stretches)


def test_recordings_that_the_low_pass_spoils_say_how_long_the_longest_is() -> None:
    data = [
        (motion.model_copy(update={"cut_off": 1.0}), each)
        for motion, each in recorded(arm(), TRUTH, n=2, duration=10.0)
    ]
    with pytest.raises(NotEnoughData, match=r"the longest recording has 10 s, .* at 1 Hz makes"):
        gather(arm(), data, VARIANTS[DEFAULT])
