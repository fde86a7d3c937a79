"""Half-widths and degrees of freedom with known values."""

import numpy as np
import pytest
from scipy import stats

from hil.estimation.intervals import (
    MANY,
    combined_degrees,
    degrees_behind,
    half_width,
    welch_degrees,
)

VARIANCES, DEGREES = np.array([4.0, 4.0, 0.0]), np.array([6.0, 6.0, 2.0])


def test_what_is_stated_is_normal_and_what_shows_in_few_data_is_student_s():
    none, one = np.zeros(()), np.ones(())
    assert half_width(none, one, np.array(3.0), 0.95) == pytest.approx(1.960, abs=1e-3)
    assert half_width(one, none, np.array(3.0), 0.95) == pytest.approx(3.182, abs=1e-3)
    both = half_width(one, one, np.array(3.0), 0.95)
    assert both == pytest.approx(np.hypot(1.960, 3.182), abs=1e-3)


def test_degrees_of_freedom_of_a_sum_are_welch_s():
    rows = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 5.0]])
    assert welch_degrees(rows, VARIANCES, DEGREES) == pytest.approx([6.0, 12.0, 6.0])


def test_parameters_of_the_same_groups_have_no_more_degrees_of_freedom_together():
    rows = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 5.0]])
    assert combined_degrees(rows, VARIANCES, DEGREES) == pytest.approx([6.0, 6.0, 6.0])


def test_a_sum_that_nothing_scatters_is_as_sure_as_the_normal_distribution():
    rows = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert combined_degrees(rows, VARIANCES, DEGREES) == pytest.approx([MANY, MANY])


@pytest.mark.parametrize("degrees", [1.5, 4.0, 30.0])
def test_degrees_of_freedom_are_found_from_the_width_that_they_give(degrees):
    ratio = float(stats.t.ppf(0.975, degrees))
    assert degrees_behind(ratio) == pytest.approx(degrees, rel=1e-4)


@pytest.mark.parametrize("ratio", [1.0, 1e3])
def test_a_width_that_no_degrees_of_freedom_give_counts_as_normal(ratio):
    assert degrees_behind(ratio) == MANY
