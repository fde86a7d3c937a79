"""Friction models (1) to (3) and Stribeck's, fitted to points; model selection."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.friction.curves import LAWS, choose, fit_model, sliding, torque

LIMIT = 3.0
SPEED = np.geomspace(0.003, 1.0, 16) * LIMIT
TRUTH = {
    "linear": [5.0, 40.0],
    "cube-root": [5.0, 30.0, 12.0],
    "arctan": [5.0, 35.0, 15.0, 4.0],
    "stribeck": [8.0, 30.0, 12.0, 0.1],
}


def both(v):
    return np.concatenate([v, -v])


def measured(kind, sigma, seed=0):
    rng = np.random.default_rng(seed)
    level = torque(kind, TRUTH[kind], SPEED) + sigma * rng.standard_normal(len(SPEED))
    return SPEED, level


@pytest.mark.parametrize("kind", LAWS)
def test_every_model_finds_its_own_parameters(kind):
    v = both(SPEED)
    found = fit_model(kind, v, torque(kind, TRUTH[kind], v), LIMIT)
    assert found.a == pytest.approx(TRUTH[kind], rel=1e-3)
    assert not found.unidentifiable
    assert found.torque(v) == pytest.approx(torque(kind, TRUTH[kind], v), rel=1e-4)


@pytest.mark.parametrize("kind", LAWS)
def test_standard_errors_agree_with_the_scatter_of_repeated_fits(kind):
    rng, v = np.random.default_rng(1), both(SPEED)
    clean = torque(kind, TRUTH[kind], v)
    fits = [fit_model(kind, v, clean + 0.1 * rng.standard_normal(len(v)), LIMIT) for _ in range(60)]
    scatter = np.std([found.a for found in fits], axis=0)
    stated = np.median([found.standard_error for found in fits], axis=0)
    assert stated == pytest.approx(scatter, rel=0.4)


@given(kind=st.sampled_from(LAWS), seed=st.integers(0, 2**16))
def test_models_are_odd_functions_of_velocity(kind, seed):
    a = np.random.default_rng(seed).uniform(0.1, 10, len(TRUTH[kind]))
    assert torque(kind, a, -SPEED) == pytest.approx(-torque(kind, a, SPEED))
    assert torque(kind, a, np.zeros(1)) == 0.0


def test_scaling_speeds_and_torques_scales_the_parameters():
    v = both(SPEED)
    tau = torque("arctan", TRUTH["arctan"], v)
    slow = fit_model("arctan", v / 10, 3 * tau, LIMIT / 10)
    assert slow.a == pytest.approx(np.array(TRUTH["arctan"]) * [30, 3, 3, 10], rel=1e-3)


def test_a_knee_outside_the_measured_speeds_is_stated():
    v = both(SPEED)
    found = fit_model(
        "arctan", v, torque("linear", TRUTH["linear"], v) + 1e-3 * np.sin(9e3 * v), LIMIT
    )
    assert found.unidentifiable


def test_parameters_known_only_together_are_stated():
    rng = np.random.default_rng(4)
    v = both(np.linspace(2.0, 3.0, 8))
    tau = torque("cube-root", TRUTH["cube-root"], v) + 0.3 * rng.standard_normal(len(v))
    words = fit_model("cube-root", v, tau, LIMIT).unidentifiable
    assert any("only their combination is known" in word for word in words)


def test_two_speeds_do_not_determine_three_parameters():
    v = np.repeat([0.5, 2.0], 3)
    noise = np.array([0.1, -0.2, 0.1, 0.2, 0.0, -0.2])
    tau = torque("cube-root", TRUTH["cube-root"], v) + noise
    found = fit_model("cube-root", v, tau, LIMIT)
    assert set(found.standard_error) == {None}
    assert [word.split(":")[0] for word in found.unidentifiable] == ["a1", "a2", "a3"]


@pytest.mark.parametrize("kind", ["linear", "cube-root", "arctan", "stribeck"])
def test_the_model_that_made_the_data_is_chosen(kind):
    chosen = [choose(0, *measured(kind, 0.3, seed), LIMIT).chosen for seed in range(3)]
    assert chosen.count(kind) == 3


@pytest.mark.long
def test_richer_models_are_not_chosen_for_their_freedom():
    found = [choose(0, *measured("linear", 2.0, seed), LIMIT) for seed in range(8)]
    for each in found:
        assert each.models["arctan"].error <= each.models["linear"].error * 1.001
    assert sum(each.chosen == "linear" for each in found) >= 7


def test_too_few_speeds_make_no_model():
    velocity, torques = measured("linear", 0.1)
    assert choose(0, velocity[:2], torques[:2], LIMIT) is None
    found = choose(0, velocity[:4], torques[:4], LIMIT)
    assert list(found.models) == ["linear", "cube-root"]


def test_units_of_an_axis_that_slides_are_of_metres_and_newtons():
    tau = torque("arctan", TRUTH["arctan"], SPEED)
    assert fit_model("arctan", SPEED, tau, LIMIT).units == ("N m s/rad", "N m", "N m", "s/rad")
    assert fit_model("arctan", SPEED, tau, LIMIT, turns=False).units == ("N s/m", "N", "N", "s/m")
    assert sliding("N m (s/rad)^1/3") == "N (s/m)^1/3"
