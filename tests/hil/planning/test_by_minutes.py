"""Plans within minutes: they take that long, and identify all, better than a plan by counts."""

from functools import partial

import numpy as np
import pytest

from hil.model.base_parameters import base_parameters
from hil.planning.design import by_minutes
from hil.planning.design.by_counts import TRAVEL, design
from hil.planning.design.by_minutes import CORE, design_within, refine
from hil.planning.design.candidates import pool
from hil.planning.design.selection import Selection
from hil.planning.dry_run import dry_run
from hil.planning.plan import dump_plan
from hil.planning.prediction.noise import stated_noise
from hil.planning.prediction.precision import covariance, information, precision, torque_scale
from hil.planning.timetable import travel_time, travel_times
from hil.planning.workspace import Box, Workspace

PERIOD = 0.004
MINUTES = 12.0


@pytest.fixture(scope="module", autouse=True)
def few_options():
    """Twelve configurations of every element are enough to see what is chosen."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(by_minutes, "pool", partial(pool, each=12))
        yield


@pytest.fixture(scope="module")
def noise(manutec):
    return stated_noise(manutec)


@pytest.fixture(scope="module")
def plan(manutec, noise):
    return design_within(manutec, MINUTES, noise)


@pytest.fixture(scope="module")
def options(manutec, noise):
    return pool(manutec, None, PERIOD, noise, each=3)


def count(plan, kind):
    return sum(m.kind == kind for m in plan.measurements)


def test_it_takes_its_minutes_and_hardly_less(manutec, plan):
    assert 0.95 * MINUTES < dry_run(plan, manutec).duration / 60 <= MINUTES


def test_it_may_be_run_and_identifies_every_group(manutec, plan):
    result = dry_run(plan, manutec)
    assert not result.problems
    assert all(group.complete and group.condition < 100 for group in result.groups)
    kinds = ("gravity", "inertia", "coupling")
    for kind, columns in zip(kinds, base_parameters(manutec).groups.values(), strict=True):
        assert count(plan, kind) >= CORE * len(columns)


def test_it_is_more_informative_than_a_plan_by_counts_that_takes_as_long(manutec, plan, noise):
    n_base = len(base_parameters(manutec))
    by_counts = design(manutec, {"gravity": 22, "inertia": 32, "coupling": 3})
    assert dry_run(by_counts, manutec).duration >= 0.99 * dry_run(plan, manutec).duration
    found, other = (
        covariance(information(manutec, p.measurements, PERIOD, noise), n_base)
        for p in (plan, by_counts)
    )
    gain = (np.linalg.slogdet(other)[1] - np.linalg.slogdet(found)[1]) / (2 * n_base)
    assert gain > 0.04  # of the standard deviations, in the geometric mean


def test_the_same_robot_and_minutes_give_the_same_plan(manutec, plan, noise):
    assert dump_plan(design_within(manutec, MINUTES, noise)) == dump_plan(plan)


def test_a_warm_up_counts(manutec, noise):
    plan = design_within(manutec, MINUTES, noise, warm_up=120.0)
    assert dry_run(plan, manutec).duration / 60 <= MINUTES
    assert plan.warm_up is not None


def test_too_few_minutes_are_refused_with_what_is_needed(manutec, noise):
    with pytest.raises(ValueError, match=r"2 minutes for measurements must be at least \d") as e:
        design_within(manutec, 2.0, noise)
    needed = float(str(e.value).split("at least ")[1].split(",")[0])
    plan = design_within(manutec, needed + 0.05, noise)
    assert dry_run(plan, manutec).duration / 60 <= needed + 0.05


def test_in_a_guarded_workspace_every_way_is_clear(manutec, noise):
    floor = Box(name="floor", low=(-3, -3, -1.5), high=(3, 3, -0.8), ignore_links=(1,))
    plan = design_within(manutec, 10.0, noise, workspace=Workspace(boxes=(floor,)))
    result = dry_run(plan, manutec)
    assert not result.problems
    assert result.duration / 60 <= 10.0


@pytest.mark.parametrize("criterion", ["det", "torque"])
def test_gains_are_what_adding_the_measurement_changes(manutec, options, criterion):
    n_base = len(base_parameters(manutec))
    selection = Selection(manutec, options, TRAVEL, criterion)
    for number in range(0, len(options), 2):
        selection.take(number)
    before = selection._information.copy()
    gains = selection.gains()
    for number in range(1, len(options), 8):
        after = before.copy()
        for at, worth in options[number].worth:
            after[np.ix_(at, at)] += worth
        if criterion == "det":
            change = _log_det(after, n_base) - _log_det(before, n_base)
        else:
            change = 1 - _variance(manutec, after) / _variance(manutec, before)
        assert gains[number] == pytest.approx(change, rel=1e-4, abs=1e-7)


def _log_det(information, n_base):
    """Of the information of the base parameters, common terms eliminated."""
    inverse = np.linalg.inv(information)[:n_base, :n_base]
    return -np.linalg.slogdet(inverse)[1]


def _variance(robot, information):
    scale = torque_scale(robot)
    return scale**2 @ np.diag(np.linalg.inv(information))[: len(scale)]


def test_ways_of_many_take_as_long_as_one_by_one(manutec):
    ends = np.random.default_rng(2).uniform(-1.5, 1.5, (20, 6))
    ends[3] = ends[0]
    together = travel_times(manutec, ends[0], ends, TRAVEL)
    single = [travel_time(manutec, ends[0], end, TRAVEL) for end in ends]
    assert together == pytest.approx(single)


@pytest.fixture(scope="module")
def run(manutec):
    return design(manutec, {"gravity": 12, "inertia": 24, "coupling": 3})


@pytest.fixture(scope="module")
def known(manutec, run, noise):
    return information(manutec, run.measurements, PERIOD, noise)


@pytest.fixture(scope="module")
def refinement(manutec, run, known, noise):
    return refine(manutec, 5.0, noise, known, run)


def test_a_refinement_mends_what_a_run_left_weakest(manutec, known, refinement, noise):
    result = dry_run(refinement, manutec)
    assert not result.problems
    assert result.duration / 60 <= 5.0
    before = precision(manutec, known, "")
    more = information(manutec, refinement.measurements, PERIOD, noise)
    after = precision(manutec, known + more, "")
    assert (after.deviation <= before.deviation * 1.001).all()
    worst = np.argsort(before.effect)[-4:]
    assert (after.deviation[worst] < 0.7 * before.deviation[worst]).all()


def test_a_refinement_has_ids_of_its_own(run, refinement):
    assert not {m.id for m in refinement.measurements} & {m.id for m in run.measurements}
