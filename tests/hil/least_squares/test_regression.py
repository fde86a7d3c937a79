"""Single regression: blocks of named columns add up; estimates have names and errors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.least_squares.blocks import Blocks
from hil.least_squares.regression import Regression

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.least_squares.normal_equations import Normal
    from hil.least_squares.regression import Covariance

    Array = NDArray[np.float64]

SHARED, OWN = ("p1", "p2"), ("offset", "Coulomb")
TRUTH = np.array([3.0, -2.0, 0.5, 1.0, -0.5, 2.0])


@pytest.fixture
def rng() -> np.random.Generator:
    """Generator with a fixed seed."""
    return np.random.default_rng(7)


def samples(rng: np.random.Generator, n_groups: int, noise: float = 0.1) -> tuple[Array, Array]:
    """Return columns, shape (n_groups, n_channels, n, 4), and torques of two channels."""
    W = rng.normal(size=(n_groups, 2, 30, 4))
    x = np.array([TRUTH[[0, 1, 2, 3]], TRUTH[[0, 1, 4, 5]]])
    y = np.einsum("gcnk,ck->gcn", W, x) + noise * rng.normal(size=W.shape[:3]) * [[[1.0], [5.0]]]
    return W, y


def blocks(W: Array, y: Array, own: tuple[str, ...] = OWN) -> Blocks:
    """Return blocks of these samples."""
    rows = np.concatenate([y[..., np.newaxis], W], axis=-1)
    products = np.einsum("gcni,gcnj->gcij", rows, rows)
    counts = np.full(W.shape[:2], float(W.shape[2]))
    return Blocks(SHARED, own, products, counts, labels={"run": np.zeros(len(W), np.intp)})


def stacked(W: Array, y: Array, weights: Array) -> Array:
    """Return the weighted least-squares solution over all stacked samples."""
    rows, sides = [], []
    for channel, weight in enumerate(weights):
        X = np.zeros((*W.shape[:1], *W.shape[2:3], 6))
        X[..., [0, 1, 2 + 2 * channel, 3 + 2 * channel]] = W[:, channel]
        rows.append(np.sqrt(weight) * X.reshape(-1, 6))
        sides.append(np.sqrt(weight) * y[:, channel].ravel())
    return np.linalg.lstsq(np.vstack(rows), np.concatenate(sides), rcond=None)[0]


def test_blocks_say_what_all_samples_say(rng: np.random.Generator) -> None:
    W, y = samples(rng, 8)
    found = Regression.weighed(blocks(W, y))
    np.testing.assert_allclose(found.solution, stacked(W, y, found.weights), rtol=1e-9)


def test_weights_are_reciprocal_residual_variances(rng: np.random.Generator) -> None:
    W, y = samples(rng, 40)
    found = Regression.weighed(blocks(W, y))
    np.testing.assert_allclose(found.weights, [1 / 0.1**2, 1 / 0.5**2], rtol=0.1)


@given(st.integers(0, 2**32 - 1))
def test_mixtures_are_one_estimate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    W, y = samples(rng, 6)
    whole, parts = blocks(W, y), (blocks(W[:2], y[:2]), blocks(W[2:], y[2:]))
    joined = parts[0].joined(parts[1])
    np.testing.assert_allclose(joined.products, whole.products)
    assert len(joined) == 6


def test_columns_that_one_part_lacks_are_zero_there(rng: np.random.Generator) -> None:
    W, y = samples(rng, 4)
    other = blocks(W[..., [0, 1, 2, 3]], y, own=("offset", "viscous"))
    joined = blocks(W, y).joined(other)
    assert joined.own == ("offset", "Coulomb", "viscous")
    assert not joined.products[:4, :, joined.place("viscous")].any()
    assert not joined.products[4:, :, joined.place("Coulomb")].any()


def test_an_axis_recorded_in_two_ways_is_two_channels(rng: np.random.Generator) -> None:
    """Noise and friction differ; common parameters are estimated from both."""
    W, y = samples(rng, 40)
    loud = y + 3.0 * rng.normal(size=y.shape) + 2.0 * W[..., 3]
    other = replace(blocks(W, loud), channels=("axis 1 imported", "axis 2 imported"))
    joined = blocks(W, y).joined(other)
    assert joined.layout.size == 2 + 4 * 2
    found, alone = Regression.weighed(joined), Regression.weighed(blocks(W, y))
    np.testing.assert_allclose(found.weights[:2], alone.weights, rtol=0.1)
    np.testing.assert_allclose(found.weights[2:], 1.0 / np.array([9.01, 9.25]), rtol=0.1)
    params = found.fit().params
    coulomb = [params[f"axis {k} {way}Coulomb"] for k in (1, 2) for way in ("", "imported ")]
    np.testing.assert_allclose(coulomb, [1.0, 3.0, 2.0, 4.0], atol=0.3)


def test_two_channels_of_one_axis_share_its_own_unknowns(rng: np.random.Generator) -> None:
    W, y = samples(rng, 40)
    again = y + 3.0 * rng.normal(size=y.shape)
    names = {"axis 1 again": "axis 1", "axis 2 again": "axis 2"}
    other = replace(blocks(W, again), channels=tuple(names), owners=names)
    joined = blocks(W, y).joined(other)
    assert joined.layout == blocks(W, y).layout
    found = Regression.weighed(joined)
    both = np.concatenate([W, W], axis=2), np.concatenate([y, again], axis=2)
    weights = np.repeat(found.weights.reshape(2, 2).T, 30, axis=1)[np.newaxis]
    rows = np.sqrt(weights)[..., np.newaxis] * both[0]
    expected = stacked(rows, np.sqrt(weights) * both[1], np.ones(2))
    np.testing.assert_allclose(found.solution, expected, rtol=1e-9)


def test_other_columns_cost_no_pass_over_samples(rng: np.random.Generator) -> None:
    W, y = samples(rng, 5)
    T = np.eye(5)
    T[1, 2] = 4.0
    changed = W.copy()
    changed[..., 1] += 4.0 * W[..., 0]
    combined = blocks(W, y).combined(T, SHARED, OWN)
    np.testing.assert_allclose(combined.products, blocks(changed, y).products)


def test_another_torque_and_other_shared_columns_cost_none_either(rng: np.random.Generator) -> None:
    W, y = samples(rng, 5)
    torque, added = np.zeros((2, 5)), rng.normal(size=(5, 2, 5))
    torque[:, 0], torque[:, 2] = 2.0, -1.0
    rows = np.concatenate([y[..., np.newaxis], W], axis=-1)
    made = np.einsum("gcnk,gck->gcn", rows, added)
    found = blocks(W, y).recast(torque, {"new": added}, dropped=("p2",))
    assert (found.shared, found.own) == (("p1", "new"), OWN)
    new = np.stack([W[..., 0], made, W[..., 2], W[..., 3]], axis=-1)
    expected = blocks(new, 2.0 * y - W[..., 1])
    np.testing.assert_allclose(found.products, expected.products, atol=1e-9)


def test_groups_of_one_label_are_added_up_wherever_they_stand(rng: np.random.Generator) -> None:
    whole, label = blocks(*samples(rng, 6)), np.array([1, 0, 1, 2, 0, 1])
    merged = whole.merged(label)
    of_one = whole.products[label == 1].sum(axis=0)
    np.testing.assert_allclose(merged.products[1], of_one)
    np.testing.assert_allclose(merged.counts[:, 0], [60.0, 90.0, 30.0])


def test_a_solver_weights_groups_as_it_sees_fit(rng: np.random.Generator) -> None:
    W, y = samples(rng, 12)
    y[3] += 50.0
    plain = Regression.weighed(blocks(W, y), rounds=1)

    def drop_worst(equations: Normal) -> tuple[Normal, Array]:
        error = equations.error(equations.solution())
        kept = equations.weighted((error < error.max()).astype(float))
        return kept, kept.solution()

    robust = replace(plain, solver=drop_worst)
    error, of_plain = (np.abs(each.fit().x - TRUTH).max() for each in (robust, plain))
    assert error < 0.1 * of_plain


@pytest.mark.parametrize("rule", ["jackknife", "clusters", "CR2", "white"])
def test_intervals_hold_the_truth_of_white_noise(rule: Covariance) -> None:
    inside = []
    for seed in range(60):
        fit = Regression.weighed(blocks(*samples(np.random.default_rng(seed), 20))).fit(rule)
        intervals = np.array(list(fit.conf_int().values()))
        inside.append((intervals[:, 0] <= TRUTH) & (intervals[:, 1] >= TRUTH))
    # 360 intervals of 95 %, dependent within a seed
    assert 0.91 <= np.mean(inside) <= 0.99


def test_what_is_found_has_names(rng: np.random.Generator) -> None:
    all_blocks = blocks(*samples(rng, 10))
    kept = all_blocks.layout.kept([["Coulomb"], ["offset", "Coulomb"]])
    fit = Regression.weighed(all_blocks, kept).fit()
    assert fit.names == ("p1", "p2", "axis 1 Coulomb", "axis 2 offset", "axis 2 Coulomb")
    assert set(fit.params) == set(fit.conf_int()) == set(fit.bse)
    assert fit.x[all_blocks.layout.index("offset", 0)] == 0.0
    assert not fit.covariance[all_blocks.layout.index("offset", 0)].any()


@pytest.mark.parametrize("of_time", [0.0, 0.5])
@pytest.mark.parametrize("of_state", [0.0, 0.5])
def test_errors_are_as_stated_for_noise_errors_of_time_and_errors_of_states(
    rng: np.random.Generator, of_time: float, of_state: float
) -> None:
    """Both groups of time and cells of states contain the noise, which counts once."""
    n_time, n_state = 30, 60
    phase = 2 * np.pi * np.arange(n_state) / n_state
    W = np.empty((n_time, 2, n_state, 4))
    W[..., 0] = np.sin(phase) * (1 + 0.3 * rng.normal(size=(n_time, 2, 1)))
    W[..., 1] = np.cos(2 * phase) + 0.3 * rng.normal(size=W.shape[:3])
    W[..., 2], W[..., 3] = 1.0, np.sign(np.cos(phase))
    x, z = np.array([TRUTH[[0, 1, 2, 3]], TRUTH[[0, 1, 4, 5]]]), []
    for _ in range(30):
        y = np.einsum("tcsk,ck->tcs", W, x) + rng.normal(size=W.shape[:3])
        y += of_time * rng.normal(size=(n_time, 2, 1)) * W[..., 3]
        y += of_state * rng.normal(size=(2, n_state))
        cells = blocks(W.transpose(2, 1, 0, 3), y.transpose(2, 1, 0))
        fit = Regression.weighed(blocks(W, y)).fit("CR2", cells)
        z.append((fit.x - TRUTH) / np.sqrt(np.diag(fit.covariance)))
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.2


def test_errors_of_places_count_although_states_there_are_several(
    rng: np.random.Generator,
) -> None:
    """Ripple of a gear is the same forward and back: cells of one position hold both."""
    n_time, n_state = 30, 60
    phase = 2 * np.pi * (np.arange(n_state) + 0.5) / n_state
    place = np.minimum(np.arange(n_state), n_state - 1 - np.arange(n_state))
    W = np.empty((n_time, 2, n_state, 4))
    W[..., 0], W[..., 1] = np.cos(phase), np.cos(2 * phase)
    W[..., 2], W[..., 3] = 1.0, np.sign(np.sin(phase))
    x, found = np.array([TRUTH[[0, 1, 2, 3]], TRUTH[[0, 1, 4, 5]]]), []
    for _ in range(60):
        y = np.einsum("tcsk,ck->tcs", W, x) + 0.1 * rng.normal(size=W.shape[:3])
        y += rng.normal(size=(2, n_state // 2))[:, place]
        states = blocks(W.transpose(2, 1, 0, 3), y.transpose(2, 1, 0))
        cells = states.joined(states.merged(place))
        of = np.repeat([0, 1], [n_state, n_state // 2])
        cells = replace(cells, labels={"partition": of})
        whole = Regression.weighed(blocks(W, y))
        fits = whole.fit("CR2", states), whole.fit("CR2", cells)
        found.append([(fit.x - TRUTH)[:2] / np.sqrt(np.diag(fit.covariance))[:2] for fit in fits])
    of_states, of_both = np.sqrt(np.mean(np.square(found), axis=(0, 2)))
    assert of_states > 1.25
    assert 0.7 < of_both < 1.2


def test_cells_with_samples_that_groups_lack_show_no_errors_of_their_own(
    rng: np.random.Generator,
) -> None:
    """A single cell determines a direction that hardly any group of time shows."""
    W, y = samples(rng, 20)
    W[..., 1] *= 1e-3
    W[0, :, :, 1] *= 1e3
    y = np.einsum("gcnk,ck->gcn", W, np.array([TRUTH[[0, 1, 2, 3]], TRUTH[[0, 1, 4, 5]]]))
    y += 0.1 * rng.normal(size=y.shape)
    whole = blocks(W, y)
    # the ends of the groups are in the cells alone
    groups = blocks(W[:, :, :20], y[:, :, :20])
    alone = Regression.weighed(groups).fit("CR2")
    beside = Regression.weighed(groups).fit("CR2", whole)
    assert beside.bse["p2"] < 3.0 * alone.bse["p2"]
