"""Friction laws and dead zones are chosen by prediction of held-out blocks."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import COULOMB, OFFSET, TRUTH, VISCOUS, arm, recorded
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hil.estimation.free_motion.choice import covariance_of_choices
from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.solution import solve
from hil.estimation.free_motion.survey import configurations
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.identify import estimate
from hil.friction.terms import LAWS, TERMS
from hil.least_squares.choice import folds, simplest
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.runs.recording import Recording

    Array = NDArray[np.float64]


def motion_of(recording: Recording) -> tuple[Array, Array, Array]:
    """Return smooth positions of a noiseless recording, and their derivatives."""
    qd = np.gradient(recording.q, recording.time, axis=0)
    return recording.q, qd, np.gradient(qd, recording.time, axis=0)


@given(
    arrays.arrays(np.float64, st.tuples(st.integers(2, 6), st.integers(1, 20)),
                  elements=st.floats(0.0, 10.0))
)  # fmt: skip
def test_no_simpler_alternative_predicts_better_than_the_one_chosen(squares: np.ndarray) -> None:
    errors = {str(k): row for k, row in enumerate(squares)}
    chosen = int(simplest(errors))
    assert all(squares[k].sum() > squares[chosen].sum() for k in range(chosen))


def test_a_richer_alternative_is_chosen_if_it_is_better_by_more_than_chance() -> None:
    rng = np.random.default_rng(0)
    plain = rng.uniform(0.9, 1.1, 30)
    assert simplest({"plain": plain, "rich": plain - 0.3}) == "rich"
    assert simplest({"plain": plain, "rich": plain - rng.normal(0.001, 0.1, 30)}) == "plain"


@pytest.mark.parametrize("n_blocks", [8, 30])
def test_the_best_of_many_that_are_worth_nothing_is_seldom_chosen(n_blocks: int) -> None:
    rng, times = np.random.default_rng(1), 0
    for _ in range(100):
        plain = rng.uniform(0.9, 1.1, n_blocks)
        rich = {str(k): plain + rng.normal(0.0, 0.5, n_blocks) for k in range(12)}
        times += simplest({"plain": plain, **rich}) != "plain"
    assert times <= 6  # 2.5 of 100 expected: 7 or more with a probability of 2 %


def test_a_few_blocks_call_for_nothing_richer_than_the_usual() -> None:
    usual, rich = np.array([1.0, 1.2, 0.8, 3.0]), np.array([0.9, 1.1, 0.8, 1.0])
    assert simplest({"usual": usual, "rich": rich}) == "usual"


def test_an_alternative_that_is_not_certainly_better_itself_is_not_chosen() -> None:
    usual = np.full(8, 1.0)
    # random gains without a significant best one, and a gain in every block
    poor = usual - np.array([0.9, -0.5, 0.6, -0.7, 0.9, -0.8, 0.8, -0.6])
    rich = usual - np.array([0.30, 0.35, 0.25, 0.30, 0.40, 0.30, 0.20, 0.35])
    assert simplest({"usual": usual, "poor": poor, "rich": rich}) == "rich"


@pytest.mark.parametrize("n_blocks", range(1, 12))
def test_fewer_than_six_blocks_show_nothing(n_blocks: int) -> None:
    usual = np.random.default_rng(n_blocks).uniform(0.9, 1.1, n_blocks)
    chosen = simplest({"usual": usual, "rich": 0.5 * usual})
    assert chosen == ("usual" if n_blocks < 6 else "rich")


def test_no_friction_at_all_is_no_alternative_to_the_classical_law() -> None:
    # a bad block would make any difference insignificant
    found = estimate(arm(), recorded(arm(), TRUTH, np.zeros_like, n=1), "free motion").details
    assert found is not None
    assert {axis.law for axis in found.axes} == {"Coulomb and viscous"}
    assert all(abs(axis.terms["Coulomb"].value) < 0.1 for axis in found.axes)


def test_a_difference_that_is_certain_but_negligible_keeps_the_simpler_alternative() -> None:
    plain = np.random.default_rng(0).uniform(0.9, 1.1, 200)
    assert simplest({"plain": plain, "rich": 0.99 * plain}) == "plain"
    assert simplest({"plain": plain, "rich": 0.95 * plain}) == "rich"


def test_an_axis_is_judged_by_its_own_residual_however_many_there_are() -> None:
    others, usual, rich = np.full(50, 6.0), np.full(50, 1.1), np.full(50, 1.0)
    assert simplest({"usual": others + usual, "rich": others + rich}, n_channels=7) == "rich"
    assert simplest({"usual": others + usual, "rich": others + rich}, n_channels=1) == "usual"


@pytest.mark.parametrize("seed", range(60, 66))
def test_textbook_friction_gets_the_textbook_law(seed: int) -> None:
    data = recorded(arm(), TRUTH, n=1, duration=60.0, noise=0.5, seed=seed)
    found = estimate(arm(), data, "free motion").details
    assert found is not None
    assert [axis.law for axis in found.axes] == ["Coulomb and viscous"] * 2


def test_friction_of_the_load_takes_a_share_of_it_or_is_none() -> None:
    # torque that decreases with load is no gear friction
    def tau(share: float) -> list[str]:
        data = recorded(arm(), TRUTH, n=2)
        for _, recording in data:
            load = inverse_dynamics(arm(), TRUTH, *motion_of(recording))
            recording.tau[:] += share * np.abs(load) * np.sign(motion_of(recording)[1])
        found = estimate(arm(), data, "free motion").details
        assert found is not None
        return [axis.law for axis in found.axes]

    assert any("load" in law for law in tau(0.1))
    assert not any("load" in law for law in tau(-0.1))


def test_a_law_that_would_drive_an_unloaded_axis_is_not_chosen() -> None:
    """Friction below that of the load's share describes the recording, but adds power at rest."""

    def laws(below: float) -> list[str]:
        data = recorded(arm(), TRUTH, np.zeros_like, n=2)
        for _, recording in data:
            load = np.abs(inverse_dynamics(arm(), TRUTH, *motion_of(recording)))
            share = 0.2 * load - below * load.mean(axis=0)
            recording.tau[:] += share * np.sign(motion_of(recording)[1])
        found = estimate(arm(), data, "free motion").details
        assert found is not None
        assert found.driving == ()
        return [axis.law for axis in found.axes]

    assert any("load" in law for law in laws(0.0))
    assert not any("load" in law for law in laws(0.1))


@given(n=st.integers(1, 200))
def test_every_block_is_held_out_once(n: int) -> None:
    held_out = np.concatenate([np.arange(n)[fold] for fold in folds(n)])
    assert held_out.tolist() == list(range(n))


def test_laws_come_from_the_simplest_and_their_terms_exist() -> None:
    sizes = [len(law) for law in LAWS.values()]
    assert sizes[0] == 1
    assert sizes[-1] == len(TERMS)
    assert all(set(law) <= set(TERMS) for law in LAWS.values())


def test_friction_as_simple_as_it_is_keeps_the_simple_law() -> None:
    found = estimate(arm(), recorded(arm(), TRUTH), "free motion").details
    assert found is not None
    assert {axis.law for axis in found.axes} == {"Coulomb and viscous"}
    for k, axis in enumerate(found.axes):
        assert axis.terms["Coulomb"].value == pytest.approx(COULOMB[k], rel=0.02)
        assert axis.terms["offset"].value == pytest.approx(OFFSET[k], abs=0.05)
        assert axis.terms["viscous"].value / axis.speed == pytest.approx(VISCOUS[k], rel=0.03)


def test_a_law_whose_terms_an_axis_does_not_show_is_not_tried() -> None:
    """An unknown gear ratio excludes ripple, so laws with ripple equal those without."""
    robot = arm(geared=False)
    p = np.ones(len(base_parameters(robot)))
    found = estimate(robot, recorded(robot, p), "free motion").details
    assert found is not None
    for axis in found.axes:
        assert not {"Coulomb, viscous and ripple", "all"} & set(axis.held_out)


def test_a_degressive_friction_gets_a_law_that_is() -> None:
    def friction(qd: np.ndarray) -> np.ndarray:
        return COULOMB * np.sign(qd) + 4.0 * np.cbrt(qd)

    found = estimate(arm(), recorded(arm(), TRUTH, friction), "free motion").details
    assert found is not None
    for axis in found.axes:
        assert axis.law in ("cube root", "asymmetric cube root", "cube root and load")
        assert axis.held_out["Coulomb and viscous"] > 1.01
        assert axis.held_out[axis.law] == 1.0


def presliding(qd: np.ndarray) -> np.ndarray:
    """Return friction that rises steeply from zero velocity."""
    return 12.0 * np.sign(qd) * np.tanh((qd / 0.03) ** 4)


def test_friction_follows_slow_samples_that_base_parameters_do_not_see() -> None:
    gathered = gather(arm(), recorded(arm(), TRUTH, presliding), VARIANTS[DEFAULT])
    choice, products = gathered.choice, gathered.products
    assert choice.slowest > 0
    found = solve(arm(), products, choice, "positive", configurations(gathered.found)).fit
    n = len(found.layout.shared)
    np.testing.assert_array_equal(found.x[:n], choice.fitted(products).solution[:n])
    every, own = products.pieces[0].total.normal(np.ones(2)), found.kept[found.kept >= n]
    left = every.scores(found.x)[0][own]
    assert (np.abs(left) < 1e-6 * np.abs(every.vector[own]).max()).all()
    assert (np.linalg.eigvalsh(found.covariance) > -1e-12).all()


def test_a_presliding_that_no_law_holds_gets_a_dead_zone_and_counts_as_residual() -> None:
    with_zone = estimate(arm(), recorded(arm(), TRUTH, presliding), "free motion")
    without = estimate(arm(), recorded(arm(), TRUTH, presliding), "weighted least squares")
    assert with_zone.details.dead_zone > 0
    # the score also covers speeds omitted from the fit
    assert (with_zone.residual > 0.9 * without.residual).all()
    error, of_all = (np.linalg.norm(found.values - TRUTH) for found in (with_zone, without))
    assert error < of_all


def test_an_alternative_with_too_few_samples_adds_no_more_than_the_choice_leaves() -> None:
    gathered = gather(arm(), recorded(arm(), TRUTH), VARIANTS[DEFAULT])
    products, choice = gathered.products, gathered.choice
    assert choice.slowest == 0
    few = np.zeros((products.n_pieces, 1, 1, 1))
    few[0] = 1.0
    pieces = [replace(each, products=each.products * few) for each in products.pieces[1:]]
    scarce = replace(products, pieces=(products.pieces[0], *pieces))
    n = len(TRUTH)
    N = choice.fitted(products).normal.information[:n, :n]
    added = np.trace(N @ covariance_of_choices(scarce, choice)[:n, :n])
    # residuals weighted by their variances: 1 for each sample
    assert added < products.pieces[0].counts.sum()
