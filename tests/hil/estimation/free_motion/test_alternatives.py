"""The covariance includes the spread of results among alternative friction laws and dead zones."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import COULOMB, TRUTH, arm, recorded

from hil.estimation.free_motion.choice import covariance_of_choices
from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.friction.terms import COLUMNS

if TYPE_CHECKING:
    from collections.abc import Callable

N_BASE = len(TRUTH)


def covariance(friction: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the covariance of the arm's unknowns between choices."""
    robot, data = arm(), recorded(arm(), TRUTH, friction, noise=0.05)
    gathered = gather(robot, data, VARIANTS[DEFAULT])
    return covariance_of_choices(gathered.products, gathered.choice)


@pytest.fixture(scope="module")
def strange() -> np.ndarray:
    """Recordings with friction outside all laws."""
    return covariance(
        lambda qd: COULOMB * np.sign(qd) * (1 + 0.6 * np.exp(-((qd / 0.15) ** 2))) + np.sin(6 * qd)
    )


def test_laws_that_all_hold_agree_and_others_do_not(strange: np.ndarray) -> None:
    simple = covariance(lambda qd: COULOMB * np.sign(qd) + 2.0 * qd)
    assert (np.diag(simple)[:N_BASE] < 0.2 * np.diag(strange)[:N_BASE]).all()


def test_it_is_a_covariance_of_what_all_laws_have(strange: np.ndarray) -> None:
    assert np.linalg.eigvalsh(strange).min() > -1e-12
    of_friction = np.diag(strange)[N_BASE:].reshape(-1, len(COLUMNS))
    offset = COLUMNS.index("offset")
    assert (of_friction[:, offset] > 0).all()
    assert not np.delete(of_friction, offset, axis=1).any()


def test_a_dead_zone_smaller_than_the_chosen_one_is_no_alternative() -> None:
    gathered = gather(arm(), recorded(arm(), TRUTH, noise=0.05), VARIANTS[DEFAULT])
    whole, *faster = gathered.products.pieces
    spoilt = whole.products - faster[0].products
    spoilt[:, :, 0] *= 2.0
    spoilt[:, :, :, 0] *= 2.0
    whole = replace(whole, products=spoilt + faster[0].products)
    products = replace(gathered.products, pieces=(whole, *faster))
    none, some = (
        np.diag(covariance_of_choices(products, replace(gathered.choice, slowest=k)))[:N_BASE].max()
        for k in (0, 1)
    )
    assert some < 0.01 * none
