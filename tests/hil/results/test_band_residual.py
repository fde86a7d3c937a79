"""The stated residual equals an independent computation over the same band, for every method."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded
from scipy import signal

from drivers.drive_bus import SampleFlag
from hil.errors import InvalidValue
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.options import Options
from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.results.band_residual import band_residual
from hil.results.residual import BandResidual, unexplained
from hil.results.verdict import verdict

if TYPE_CHECKING:
    from free_run import FreeRecorded

    from hil.results.model import Model

from stated_model import stated_model


@pytest.fixture(scope="module")
def model() -> Model:
    """Model whose friction is a tenth less than that of `free_run.classical`."""
    own = []
    for offset, coulomb, viscous in ((0.5, 3.6, 1.8), (-0.2, 1.35, 0.72)):
        values = {"offset": offset, "Coulomb": coulomb, "viscous": viscous}
        terms = {
            name: TermValue(value=value, standard_error=0.01) for name, value in values.items()
        }
        own.append(
            AxisLaw(law="Coulomb and viscous", speed=1.0, terms=terms, plain=terms, held_out={})
        )
    made = stated_model(arm())
    return replace(made, values=TRUTH, friction_law=FrictionLaw(axes=tuple(own)))


@pytest.fixture(scope="module")
def data() -> FreeRecorded:
    return recorded(arm(), TRUTH, n=2, noise=0.5)


def independent(model: Model, data: FreeRecorded) -> tuple[np.ndarray, float]:
    """Return the relative residual of each axis and of all, by SciPy's filter and differences."""
    left, torque = [], []
    for _, recording in data:
        step = recording.period
        low = signal.butter(4, 2 * 8.0 * step)
        q, tau = (signal.filtfilt(*low, x, axis=0) for x in (recording.q, recording.tau))
        qd = np.gradient(q, step, axis=0)
        inner = slice(round(0.4 / step), -round(0.4 / step))
        found = tau - model.predict(q, qd, np.gradient(qd, step, axis=0))
        left.append(found[inner])
        torque.append(tau[inner])
    e, y = (np.sqrt(np.mean(np.vstack(x) ** 2, axis=0)) for x in (left, torque))
    return e / y, float(np.linalg.norm(e) / np.linalg.norm(y))


def test_an_axis_whose_torque_the_estimate_leaves_out_is_not_judged(
    model: Model, data: FreeRecorded
) -> None:
    fit = FreeMotionFit.model_construct(relative_residual=(None, 0.1))
    found = band_residual(replace(model, details=fit), data)
    assert found is not None
    assert found.left[0] is None
    assert found.left[1] == pytest.approx(band_residual(model, data).left[1])


def test_it_equals_what_a_user_computes_over_the_same_band(
    model: Model, data: FreeRecorded
) -> None:
    found = band_residual(model, data)
    assert found is not None
    by_axis, overall = independent(model, data)
    assert found.band == 8.0
    assert found.relative == pytest.approx(by_axis, rel=0.02)
    assert found.overall == pytest.approx(overall, rel=0.02)
    assert found.overall_unfiltered > found.overall


def test_it_is_the_same_however_the_model_was_found_and_a_gap_or_a_missing_sample_is_no_jump(
    model: Model, data: FreeRecorded
) -> None:
    whole = band_residual(model, data)
    assert whole is not None
    parted = []
    for motion, recording in data:
        time, q = recording.time.copy(), recording.q.copy()
        time[len(time) // 2 :] += 5.0
        q[1000] = np.nan
        parted.append((motion, replace(recording, time=time, q=q)))
    found = band_residual(replace(model, residual=np.full(2, np.nan)), parted)
    assert found is not None
    assert found.overall == pytest.approx(whole.overall, rel=0.05)


@pytest.mark.parametrize("flag", [SampleFlag.UNTIMED, SampleFlag.OLD])
def test_samples_that_the_estimation_leaves_out_do_not_count(
    model: Model, data: FreeRecorded, flag: SampleFlag
) -> None:
    whole = band_residual(model, data)
    disturbed = []
    for motion, recording in data:
        time, flags = recording.time.copy(), recording.flags.copy()
        time[50::100] += 0.9 * recording.period
        flags[50::100] = flag.value
        disturbed.append((motion, replace(recording, time=time, flags=flags)))
    found = band_residual(model, disturbed)
    assert whole is not None
    assert found is not None
    assert found.relative == pytest.approx(whole.relative, rel=0.01)


@pytest.mark.parametrize("size", [3, 9])
def test_the_interpolation_of_left_out_samples_does_not_count(
    model: Model, data: FreeRecorded, size: int
) -> None:
    whole = band_residual(model, data)
    parted = []
    for motion, recording in data:
        place = np.arange(recording.n_samples)
        kept = (place % 250 >= size) | (place < size)
        arrays = {name: each[kept] for name, each in recording.arrays.items()}
        parted.append((motion, replace(recording, **arrays)))
    found = band_residual(model, parted)
    assert whole is not None
    assert found is not None
    assert found.relative == pytest.approx(whole.relative, rel=0.1)


def test_friction_that_jumps_at_a_reversal_is_no_residual_of_a_model_that_is_right(
    model: Model,
) -> None:
    data = recorded(arm(), TRUTH, friction=lambda qd: model.predict(
        0 * qd, qd, 0 * qd, parts=("friction",)
    ), n=1, noise=0.0)  # fmt: skip
    found = band_residual(model, data)
    assert found is not None
    assert (found.relative > 0.006).all()
    assert (found.relative_smoothed < 0.3 * found.relative).all()


def test_a_model_without_friction_states_none(model: Model, data: FreeRecorded) -> None:
    assert band_residual(replace(model, friction_law=FrictionLaw.absent(2)), data) is None


def residual(*shares: float, torque: float = 20.0) -> BandResidual:
    left = tuple(torque * share for share in shares)
    rms = (torque,) * len(shares)
    return BandResidual(
        band=8.0, torque=rms, left=left, moving=rms, smoothed=left, recorded=rms, unfiltered=left
    )


def test_good_needs_accuracy_on_every_axis_that_carries_load(model: Model) -> None:
    fine = verdict(replace(model, band_residual=residual(0.05, 0.09)))
    poor = verdict(replace(model, band_residual=residual(0.05, 0.30)))
    assert not [each for each in fine.reasons if "(--accuracy)" in each.reason]
    (doubt,) = (each for each in poor.reasons if "(--accuracy)" in each.reason)
    assert doubt.word == "doubtful"
    assert doubt.reason.startswith("axis 2: residual 30 % of the torque")
    wide = verdict(replace(model, band_residual=residual(0.05, 0.30)), accuracy=0.35)
    assert not [each for each in wide.reasons if "(--accuracy)" in each.reason]


def test_a_model_that_is_worse_than_none_has_failed(model: Model, data: FreeRecorded) -> None:
    wrong = replace(model, values=-20.0 * TRUTH)
    left, limit = band_residual(wrong, data), model.robot.torque_limit
    worse, *_ = unexplained(left, limit, 0.1, own_friction=True)
    assert worse.word == "failed"
    assert "noise of positions explains only" in worse.reason
    # friction of other recordings may be another
    assert {each.word for each in unexplained(left, limit, 0.1)} == {"doubtful"}


def noisy(data: FreeRecorded, sigma: float) -> FreeRecorded:
    rng = np.random.default_rng(1)
    return [(m, replace(r, q=r.q + sigma * rng.standard_normal(r.q.shape))) for m, r in data]


def test_noise_of_positions_makes_no_model_worse_than_none(
    model: Model, data: FreeRecorded
) -> None:
    found = band_residual(model, noisy(data, 0.05))
    assert found is not None
    assert (found.relative_smoothed > 1.0).any()
    assert not found.worse_than_none.any()
    said = list(unexplained(found, model.robot.torque_limit, 0.1, own_friction=True))
    assert said
    for each in said:
        assert re.match(r"axis \d: noise of its position is \d+ % of the torque", each.reason)
    assert verdict(replace(model, band_residual=residual(0.05, 20.03))).word == "doubtful"


def test_noise_of_positions_counts_for_nothing_where_the_rest_is_accurate(
    model: Model, data: FreeRecorded
) -> None:
    found = band_residual(model, noisy(data, 0.004))
    assert found is not None
    assert (found.relative_smoothed > 0.1).any()
    assert list(unexplained(found, model.robot.torque_limit, 0.1)) == []
    assert "due to the noise of its position" in found.describe(model.robot.torque_limit)


def test_an_axis_that_hardly_carries_load_counts_no_accuracy() -> None:
    limits = np.array([90.0, np.nan])
    small = residual(0.5, 0.5).model_copy(update={"torque": (0.5, 20.0)})
    assert [each.reason[:35] for each in unexplained(small, limits, 0.1)] == [
        "axis 2: residual 50 % of the torque"
    ]
    worse = small.model_copy(update={"smoothed": (19.0, 10.0)})
    assert worse.describe(limits).endswith("worst loaded axis 2 with 50 % in motion")
    assert not list(unexplained(None, limits, 0.1))


def test_a_residual_stated_above_its_limit_reads_as_above_it() -> None:
    found = [each.reason for each in unexplained(residual(0.102, 0.104), np.full(2, np.nan), 0.1)]
    assert [each[8:23] for each in found] == ["residual 10.4 %", "residual 10.2 %"]


def test_every_word_states_the_residual(model: Model) -> None:
    found = verdict(replace(model, band_residual=residual(0.05, 0.30)))
    assert any(each.reason.startswith("residual up to 8 Hz 22 % of the torque")
               for each in found.reasons)  # fmt: skip


@pytest.mark.parametrize("accuracy", [0.0, -0.1, 1.5])
def test_an_accuracy_is_a_share(accuracy: float) -> None:
    with pytest.raises(InvalidValue, match="must be a share above 0, at most 1"):
        Options(accuracy=accuracy)
