"""Refinement by simulation: known truth, stated errors, held-out errors, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from carriage_run import carriage, noisy_run, noisy_runs
from possible_models import model_of, possible

import hil
from hil.errors import NotEnoughData
from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.results.model import Model
from hil.runs.pooling import Pooled
from hil.simulation.refine import Layout, Simulations, refine
from hil.simulation.replay import Lanes

PERIOD, ERRORS = 0.004, {"offset": 0.3, "Coulomb": 0.3, "viscous": 0.6}
TRUTH = {"offset": 0.5, "Coulomb": 4.0, "viscous": 3.0}


def model(mass=5.0, mass_error=0.2, terms=TRUTH, plain=None, law="Coulomb and viscous") -> Model:
    def values(stated):
        return {k: TermValue(value=x, standard_error=ERRORS.get(k, 0.3)) for k, x in stated.items()}

    own = AxisLaw(
        law=law, speed=1.0, terms=values(terms), plain=values(plain or terms), held_out={}
    )
    robot = hil.Robot.load("emps")
    made = model_of(robot, np.array([mass]), np.array([mass_error]), friction=False)
    return replace(made, friction_law=FrictionLaw(axes=(own,)))


def recorded(seed: int = 0, seconds: float = 12.0) -> Pooled:
    return Pooled([noisy_run(model(), seed, seconds, PERIOD)])


def drawn(seed: int) -> Model:
    """Return the model of a regression with errors as stated."""
    rng = np.random.default_rng(seed + 100)
    off = {name: x + ERRORS[name] * rng.standard_normal() for name, x in TRUTH.items()}
    return model(5.0 + 0.2 * rng.standard_normal(), terms=off)


def deviations(found: Model) -> np.ndarray:
    """Return the errors of mass and friction over their standard errors."""
    law = found.friction_law.axes[0]
    assert law is not None
    own = [(law.terms[k].value - TRUTH[k]) / law.terms[k].standard_error for k in TRUTH]
    return np.array([(found.values[0] - 5.0) / found.standard_errors[0], *own])


def test_parameters_of_a_wrong_start_return_to_the_truth_within_their_stated_errors():
    found = refine(
        model(5.6, 0.4, {"offset": 1.0, "Coulomb": 3.4, "viscous": 4.0}), recorded(1), restart=0.5
    )
    assert found.refinement is not None
    assert found.refinement.kept
    assert found.refinement.ratio < 0.5
    assert (np.abs(deviations(found)) < 3.0).all()
    assert found.standard_errors[0] < 0.4 / 2


@pytest.mark.long
def test_stated_intervals_hold_the_truth_as_often_as_they_say():
    runs = enumerate(noisy_runs(model(), range(12), 12.0, PERIOD))
    found = [refine(drawn(seed), Pooled([run]), restart=0.5) for seed, run in runs]
    inside = np.abs([deviations(each) for each in found if each.refinement.kept]) < 1.96
    assert inside.shape[0] > 8
    # 95 % less two standard deviations of twelve draws, whose parameters are correlated
    assert 0.82 < inside.mean() <= 1.0


def test_a_start_that_cannot_be_improved_is_kept_and_named():
    start = model(5.0, 1e-6)
    law = start.friction_law.axes[0]
    sure = {k: each.model_copy(update={"standard_error": 1e-6}) for k, each in law.terms.items()}
    law = law.model_copy(update={"terms": sure})
    start = replace(start, friction_law=FrictionLaw(axes=(law,)))
    found = refine(start, recorded(2), restart=0.5)
    assert not found.refinement.kept
    assert found.digest == start.digest
    assert "the regression's parameters are kept" in str(found.refinement)


def test_a_gain_by_chance_is_refused():
    found = refine(model(), recorded(7), restart=0.5)  # the start is the truth
    assert not found.refinement.kept
    assert found.refinement.ratio < 1.0


def test_a_law_that_simulates_worse_than_plain_terms_is_replaced_and_named():
    poor = model(5.0, 0.2, {**TRUTH, "arc tangent": 2.5}, TRUTH, "arc tangent")
    found = refine(poor, recorded(3), restart=0.5)
    assert "plain terms; the chosen law simulates" in str(found.refinement)
    assert found.friction_law.axes[0].law == "Coulomb and viscous"
    assert np.abs(deviations(found)).max() < 4.0


def test_sensitivities_are_those_of_difference_quotients():
    layout = Layout(model(), plain=False)
    simulations = Simulations(layout, Lanes.create(recorded(4, 4.0), model(), None, 1.0))
    fit = simulations.run(layout.start)
    changes = simulations._sensitivities(fit.model, fit.positions[1][None], PERIOD, slice(None))[0]
    for k, unit in enumerate(0.02 * layout.roots.T):
        ends = [simulations.run(layout.start + x).positions[1][:, 0] for x in (unit, -unit)]
        expected = (ends[0] - ends[1]) / 0.04
        size = np.abs(expected).max()
        np.testing.assert_allclose(changes[:, 0, 2 + k], expected, atol=0.08 * size)


def test_sensitivities_of_an_arm_are_those_of_difference_quotients():
    robot = hil.Robot.load("tests/robots/ur10e.yaml")
    arm = model_of(robot, *possible(robot))
    time = np.arange(0.0, 1.5, 0.004)
    phases = 3.0 * time[:, None] + np.arange(6)
    q, qd, qdd = np.sin(phases), 3.0 * np.cos(phases), -9.0 * np.sin(phases)
    run = hil.Run.import_arrays(
        robot, time, q, arm.predict(q, qd, qdd), accept=["friction", "range"]
    )
    layout = Layout(arm, plain=False)
    simulations = Simulations(layout, Lanes.create(Pooled([run]), arm, None, 0.3))
    fit = simulations.run(layout.start)
    changes = simulations._sensitivities(fit.model, fit.positions[0][None], 0.004, slice(None))[0]
    for k in range(0, len(layout.start), 7):
        unit = 0.002 * layout.roots[:, k]
        ends = [simulations.run(layout.start + x).positions[0] for x in (unit, -unit)]
        expected = (ends[0] - ends[1]) / 0.004
        size = np.abs(expected).max()
        np.testing.assert_allclose(changes[:, :, 12 + k], expected, atol=0.08 * size)


def test_wrong_initial_states_of_stretches_move_no_parameters():
    layout = Layout(model(5.4), plain=False)
    lanes = Lanes.create(recorded(5, 4.0), model(), None, 0.5)
    rng, weights, found = np.random.default_rng(0), np.ones(1), []
    moved = [
        each._replace(q=each.q + 1e-3 * rng.normal(), qd=each.qd + 1e-2 * rng.normal())
        for each in lanes.starts
    ]
    for starts in (lanes.starts, tuple(moved)):
        simulations = Simulations(layout, replace(lanes, starts=starts))
        fit = simulations.run(layout.start)
        left, _ = simulations.response(fit, np.arange(len(starts)), weights)
        found.append((np.concatenate(fit.positions), np.concatenate(left)))
    positions, residuals = (np.std(b - a) for a, b in zip(*found, strict=True))
    assert residuals < 0.1 * positions


def test_a_model_that_no_bodies_have_is_refined_from_the_nearest_possible_ones():
    found = refine(model(-1.0, mass_error=5.0), recorded(0), restart=0.5)
    assert found.refinement.friction.endswith("beginning with the nearest possible bodies")
    assert found.values[0] > 0


def test_too_few_stretches_and_unknown_friction_are_refused():
    short, unknown = recorded(0, 2.0), carriage()
    with pytest.raises(NotEnoughData, match=r"refinement by simulation needs 4: record longer"):
        refine(model(), short, restart=1.0)
    with pytest.raises(NotEnoughData, match="no law of friction"):
        refine(replace(unknown, friction_law=FrictionLaw.absent(1)), short)


def test_a_refined_model_is_saved_and_loaded_with_its_errors(tmp_path):
    found = refine(model(5.6, 0.4), recorded(1, 8.0), restart=0.5)
    found.save(tmp_path / "model.yaml")
    again = Model.load(tmp_path / "model.yaml")
    assert again.refinement == found.refinement
    assert again.digest == found.digest
    assert "Simulated positions, held out" in str(again.summary())
