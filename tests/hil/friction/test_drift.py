"""Symmetry of friction, and its time constants, from levels with known ones."""

from dataclasses import replace

import numpy as np
import pytest

from hil.estimation.friction.points import FrictionPoint, judge_points
from hil.friction.drift import REFERENCE, Level, drift
from hil.friction.warmth import History

WARM_UP, SETTLING, STIRRING = 1200.0, 150.0, 25.0
SPEED = 0.4


def simulate_stops(sigma, seed=0, motion=2400.0, stops=(300.0, 60.0, 120.0), interval=12.0):
    """Return levels every `interval` of motion with stops, and the motion's history."""
    rng = np.random.default_rng(seed)
    ends, speeds, levels = [], [], []
    now, warmth, settled = 0.0, 0.0, 1.0
    for stop in (*stops, 0.0):
        for _ in range(int(motion / (len(stops) + 1) / interval)):
            now += interval
            warmth = SPEED + (warmth - SPEED) * np.exp(-interval / WARM_UP)
            settled *= np.exp(-interval * SPEED / REFERENCE / STIRRING)
            ends.append(now)
            speeds.append(SPEED)
            log = -0.5 * warmth + 0.15 * settled + sigma * rng.standard_normal()
            levels.append(Level(now, 100.0 * np.exp(log), "50 %"))
        if stop:
            now += stop
            warmth *= np.exp(-stop / WARM_UP)
            settled = 1 + (settled - 1) * np.exp(-stop / SETTLING)
            ends.append(now)
            speeds.append(0.0)
    return levels, History(np.array(ends), np.array(speeds)[:, np.newaxis], 0.0)


def constants(found):
    return {constant.name: constant for constant in found.constants}


def test_exact_levels_give_exact_time_constants():
    found = drift(0, *simulate_stops(0.0))
    values = [constant.value for constant in found.constants]
    assert values == pytest.approx([WARM_UP, SETTLING, STIRRING], rel=0.01)
    assert found.rest_effect == pytest.approx(np.exp(0.15) - 1, rel=0.01)
    assert not any(constant.word for constant in found.constants)


def test_standard_errors_cover_what_noise_does():
    misses = []
    for seed in range(12):
        found = constants(drift(0, *simulate_stops(0.003, seed)))
        for name, truth in (("settling", SETTLING), ("stirring", STIRRING)):
            misses.append((found[name].value - truth) / found[name].standard_error)
    assert 0.4 < np.sqrt(np.mean(np.square(misses))) < 2.0


def test_without_stops_the_settling_time_is_not_identifiable():
    levels, past = simulate_stops(0.003, stops=())
    assert constants(drift(0, levels, past))["settling"].word


def test_friction_that_does_not_drift_has_no_time_constants():
    levels, past = simulate_stops(0.0)
    rng = np.random.default_rng(2)
    still = [Level(k.time, 100.0 + rng.standard_normal(), k.group) for k in levels]
    assert all(constant.word for constant in drift(0, still, past).constants)


def test_a_few_levels_identify_nothing():
    levels, past = simulate_stops(0.001)
    assert drift(0, levels[:15], past) is None
    assert drift(0, levels[:16], past) is not None


def asymmetric(share, sigma, seed=0, gravity_error=0.0):
    rng = np.random.default_rng(seed)
    return [
        FrictionPoint(f"p{k}", 0, float(k), 0.1 * k + 0.1, 50.0, 0.05,
                      50.0 * share + sigma * rng.standard_normal(), sigma, gravity_error,
                      absolute=True)
        for k in range(16)
    ]  # fmt: skip


def test_symmetric_friction_passes_and_its_p_values_are_uniform():
    p = [judge_points(asymmetric(0.0, 0.2, seed))[0].p_zero for seed in range(200)]
    assert np.mean(np.array(p) < 0.1) == pytest.approx(0.1, abs=0.06)
    assert np.mean(p) == pytest.approx(0.5, abs=0.08)


def test_a_small_asymmetry_is_found_and_let_pass():
    test = judge_points(asymmetric(0.005, 0.1))[0]
    assert test.asymmetry == pytest.approx(0.005, abs=0.002)
    assert test.p_zero < 1e-4
    assert test.passed
    assert test.verdict == "asymmetric, within 2 %"


def test_an_asymmetry_beyond_the_bound_fails():
    test = judge_points(asymmetric(0.03, 0.1))[0]
    assert not test.passed
    assert test.verdict == "asymmetric by more than 2 %"
    assert judge_points(asymmetric(0.03, 0.1), bound=0.05)[0].passed


@pytest.mark.parametrize(("share", "passed"), [(0.01, True), (0.03, False)])
def test_where_nothing_scatters_the_outcome_is_certain(share, passed):
    alike = [replace(point, common=50.0 * share) for point in asymmetric(0.0, 0.1)]
    test = judge_points(alike)[0]
    assert test.standard_error == pytest.approx(0.0, abs=1e-12)
    assert (test.p_zero, test.p_bound) == pytest.approx((0.0, float(passed)))


def test_two_measurements_are_too_few_for_a_test_of_symmetry_and_three_are_not():
    points = asymmetric(0.0, 0.1)
    assert judge_points(points[:2]) == {}
    assert judge_points(points[:3])[0].measurements == 3


def test_an_asymmetry_that_gravity_s_uncertainty_explains_is_none():
    test = judge_points(asymmetric(0.03, 0.1, gravity_error=2.0))[0]
    assert test.passed
    assert test.p_zero > 0.05
