"""Encoders are read at the present instant, even between two steps of the physics."""

from __future__ import annotations

import numpy as np
import pytest

from sim_plant.physics import state as st
from sim_plant.plant import load_plant

POSITION = 0
"""Index of the position in a reading."""


@pytest.mark.parametrize("ahead", [0.0, 0.0004, 0.0009])
def test_a_moving_axis_is_read_where_it_is_between_two_steps(ahead: float) -> None:
    plant = load_plant("manutec-r15", 3)
    plant.advance(0.004)
    there = plant.read().reshape(6, -1)[:, POSITION].copy()
    plant.state[:, st.QD] = 1.5
    before = plant.state[:, st.Q].copy()
    plant.advance(ahead)
    way = plant.read().reshape(6, -1)[:, POSITION] - there
    assert way == pytest.approx(ahead * 1.5 * plant.const[:, st.COUNTS_PER_RAD], abs=1.0)
    assert np.array_equal(plant.state[:, st.Q], before)  # the machine itself advances in steps
