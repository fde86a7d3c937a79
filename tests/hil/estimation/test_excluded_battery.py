"""Level and power of the tests of causes agree with the stated ones for known noise."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy import stats

from hil.estimation.excluded.battery import LEVEL, Battery
from hil.estimation.excluded.columns import Column, Columns
from hil.estimation.excluded.dispersion import moderated
from hil.estimation.excluded.evidence import Evidence
from hil.estimation.excluded.finding import Step, likeliest, possible
from hil.estimation.excluded.limits import POWER, noncentrality, smallest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]

N_AXES, EACH = 2, 12
CAUSES = ("joint offset", "spring", "torque constant", "backlash")
TIMES = 80


def evidence(
    rng: np.random.Generator, n_groups: int, slow: tuple[float, ...], size: float = 0.0
) -> tuple[Evidence, Columns]:
    """Return rows of two axes: white noise, and in each group a torque of `slow` times the noise.

    The first column of the first axis is present with this `size`.
    """
    axis = np.repeat(np.arange(N_AXES), n_groups * EACH)
    group = np.repeat(np.arange(N_AXES * n_groups), EACH)
    n = len(axis)
    parts = tuple((slice(k * EACH, (k + 1) * EACH), np.zeros((EACH, 0)))
                  for k in range(N_AXES * n_groups))  # fmt: skip
    names = [Column(cause, k) for k in range(N_AXES) for cause in CAUSES]
    # columns that hardly change within a group, like those of gravity
    level = rng.standard_normal((N_AXES * n_groups, len(names)))[group]
    values = level + 0.5 * rng.standard_normal((n, len(names)))
    values[axis[:, None] != np.array([name.axis for name in names])] = 0.0
    walk = rng.standard_normal(N_AXES * n_groups)[group] * np.array(slow)[axis]
    X = rng.standard_normal((n, 2))
    torque = X @ [3.0, 4.0] + rng.standard_normal(n) + walk + size * values[:, 0]
    rate = np.zeros(n)
    made = Evidence(
        axis=axis, group=group, torque=torque, recorded=torque, rate=rate, X=X,
        own=np.zeros((n, 0)),
        motion=np.zeros((3, 3, n, N_AXES)), period=np.ones(n), time=np.arange(float(n)),
        parts=parts, finest=np.full(N_AXES, 1e-9),
        signals=(), source=np.zeros(n, dtype=int), sample=np.arange(n),
    )  # fmt: skip
    return made, Columns(tuple(names), values)


def share_found(n_groups: int, slow: tuple[float, ...], times: float) -> float:
    """Return how often the first cause is found at a multiple of the size stated by the run."""
    found = 0
    for seed in range(TIMES):
        clean = Battery(*evidence(np.random.default_rng(seed), n_groups, slow))
        tests = clean.columns.tests
        size = times * smallest(clean, [0], len(tests))[0]
        battery = Battery(*evidence(np.random.default_rng(seed), n_groups, slow, size))
        step = likeliest(battery, tests, LEVEL / len(tests))
        found += step is not None and (step[0] == ("joint offset", 0) or not times)
    return found / TIMES


@pytest.mark.parametrize(
    ("n_groups", "slow"), [(6, (0.5, 0.5)), (20, (0.0, 0.0)), (20, (0.5, 0.5))]
)
def test_level_and_power_are_those_stated(n_groups: int, slow: tuple[float, ...]) -> None:
    # standard errors of these shares are 0.024 and 0.045
    assert share_found(n_groups, slow, 0.0) < LEVEL + 0.07
    assert share_found(n_groups, slow, 1.0) == pytest.approx(POWER, abs=0.13)


def test_a_large_cause_does_not_hide_itself_in_the_noise_that_it_makes() -> None:
    # the cause is many times the noise, which determines the weights of the rows
    assert share_found(6, (0.5, 0.5), 4.0) > 0.98


def test_a_cause_is_found_though_another_axis_is_much_noisier() -> None:
    assert share_found(12, (0.2, 3.0), 2.0) > 0.95


@pytest.mark.parametrize("degrees", [2, 20])
def test_the_size_of_one_column_is_students_t_about_it(degrees: int) -> None:
    level = LEVEL / 100
    wanted = stats.t.isf(level / 2, degrees) + stats.t.isf(1 - POWER, degrees)
    assert np.sqrt(noncentrality(1, degrees, level)) == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("rank", [1, 2, 10])
def test_a_variance_with_one_degree_of_freedom_hides_all_but_huge_sizes(rank):
    assert 1e11 < noncentrality(rank, 1.0, 1e-6) < 1e13


@pytest.mark.parametrize("response", [0.1, 1.0])
def test_a_delay_is_sized_by_what_it_does_to_the_recorded_torque(response: float) -> None:
    # the model explains a part of the torque's derivative, and the rest is as large
    rng = np.random.default_rng(5)
    rows, columns = evidence(rng, 20, (0.0, 0.0))
    columns = replace(columns, names=(Column("torque delay", 0), *columns.names[1:]))
    moved = response * (columns.values[:, 0] + rng.standard_normal(len(rows.axis)))
    moved[rows.axis != 0] = 0.0
    late = 7.0 / response
    rows = replace(rows, torque=rows.torque + late * moved, rate=-1e3 * moved)
    test = Battery(rows, columns).test([0], itself=True)
    assert test is not None
    assert test.size[0] == pytest.approx(late, rel=0.25)


@pytest.mark.parametrize(("elsewhere", "shown"), [(0.0, True), (1.0, True), (30.0, False)])
def test_a_delay_that_moves_torques_elsewhere_hides_itself(
    elsewhere: float, *, shown: bool
) -> None:
    rng = np.random.default_rng(5)
    rows, columns = evidence(rng, 20, (0.0, 0.0))
    columns = replace(columns, names=(Column("torque delay", 0), *columns.names[1:]))
    moved = columns.values[:, 0] + elsewhere * rng.standard_normal(len(rows.axis))
    moved[rows.axis != 0] = 0.0
    size = smallest(Battery(replace(rows, rate=-1e3 * moved), columns), [0], 8)[0]
    without = smallest(Battery(replace(rows, rate=-1e3 * columns.values[:, 0]), columns), [0], 8)[0]
    assert np.isfinite(size) == shown
    assert size >= without


def test_a_slip_is_named_where_the_zero_that_explains_as_much_is_too_large(manutec: Robot) -> None:
    rng = np.random.default_rng(5)
    rows, columns = evidence(rng, 20, (0.0, 0.0))
    values = columns.values.copy()
    values[:, 1] = 1.5 * values[:, 0]
    slips = (Column("slip", 0, "60"), Column("slip", 0, "120"))
    names = (Column("joint offset", 0), *slips, *columns.names[3:])
    columns = replace(columns, names=names, values=values)
    degrees = 35.0  # second-order effect, of which a slip of the coupling explains two thirds
    battery = Battery(replace(rows, torque=rows.torque + degrees * values[:, 0]), columns)
    tests = columns.tests
    found = likeliest(battery, tests, LEVEL / len(tests), partial(possible, manutec, rows))
    assert found is not None
    assert found[0] == ("slip", 0)
    step = Step(manutec, *found, battery, battery.extend([1, 2]), tests)
    assert (step.found.cause, step.found.others) == ("slip", ())


def test_dispersions_that_scatter_alike_tell_no_more_than_one() -> None:
    rng = np.random.default_rng(3)
    degrees = np.full(40, 6.0)
    alone = moderated(np.full(40, 1.3), degrees, np.ones((40, 40)))
    assert alone.degrees == pytest.approx(6.0)
    apart = moderated(rng.chisquare(6.0, 40) / 6.0, degrees, np.eye(40))
    assert apart.degrees > 15.0
    assert apart.dispersion == pytest.approx(1.0, abs=0.3)
