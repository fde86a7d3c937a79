"""Plans by minutes: correct duration, complete identification, better than plans by counts."""

from functools import partial

import numpy as np
import pytest

from hil.model.base_parameters import base_parameters
from hil.planning.design import by_minutes, candidates
from hil.planning.design.by_counts import TRAVEL, design
from hil.planning.design.by_minutes import CORE, Selection, design_within, refine
from hil.planning.design.candidates import pool
from hil.planning.design.trajectories import Search
from hil.planning.dry_run import dry_run
from hil.planning.measurement import axes_lacking_law
from hil.planning.plan import dump_plan, make_plan
from hil.planning.prediction.information import covariance, information, precision, torque_scale
from hil.planning.prediction.noise import stated_noise
from hil.planning.timetable import travel_time, travel_times
from hil.planning.workspace import Box, Workspace

PERIOD = 0.004
MINUTES = 12.0


@pytest.fixture(scope="module", autouse=True)
def few_options():
    """Limit candidates to twelve configurations of every element."""
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


@pytest.fixture(scope="module")
def mixed(manutec, noise):
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(candidates, "SEARCH", Search(random=20, refined=1, steps=5))
        return design_within(manutec, MINUTES, noise, with_trajectories=True)


def count(plan, kind):
    return sum(m.kind == kind for m in plan.measurements)


def test_it_takes_its_minutes_and_hardly_less(manutec, plan):
    assert 0.95 * MINUTES < dry_run(plan, manutec).duration / 60 <= MINUTES


class TestWithTrajectories:
    def test_it_takes_its_minutes_too(self, manutec, mixed):
        assert 0.9 * MINUTES < dry_run(mixed, manutec).duration / 60 <= MINUTES

    def test_each_trajectory_is_one_measurement_without_a_stop(self, mixed):
        waves = [m for m in mixed.measurements if m.kind == "trajectory"]
        assert waves
        assert len({wave.sine for wave in waves}) == len(waves)
        assert [wave.id for wave in waves] == [f"t{k:02d}" for k in range(1, len(waves) + 1)]

    def test_every_group_has_measurements_of_its_own_kind(self, manutec, mixed):
        result = dry_run(mixed, manutec)
        assert not result.problems
        assert all(group.complete for group in result.groups)

    def test_it_promises_more_than_strokes_alone(self, manutec, plan, mixed, noise):
        strokes, both = (
            precision(manutec, information(manutec, p.measurements, PERIOD, noise), "").effect.max()
            for p in (plan, mixed)
        )
        assert both < 0.7 * strokes

    def test_where_no_trajectory_keeps_clear_of_a_box_that_is_said(
        self, manutec, noise, monkeypatch
    ):
        monkeypatch.setattr(candidates, "SEARCH", Search(random=2, refined=1, steps=1))
        box = Box(name="cell", low=(0.5, -2.0, -2.0), high=(1.5, 2.0, 2.0))
        with pytest.raises(ValueError, match=r"no trajectory keeps clear .* without trajectories"):
            candidates.trajectories(manutec, Workspace(boxes=(box,)), PERIOD, noise, 1.0)


def test_corners_of_an_axiss_strokes_fall_anywhere_between_samples(manutec, plan):
    strokes = [m for m in plan.measurements if m.kind == "inertia" and m.axis == 6]
    for instants in (
        [m.velocity / m.acceleration for m in strokes],
        [m.stroke / m.velocity for m in strokes],
    ):
        phase = np.sort(np.array(instants) % PERIOD) / PERIOD
        assert np.diff(phase, append=phase[0] + 1).max() < 3 / len(strokes)


def test_it_may_be_run_and_identifies_every_group(manutec, plan):
    result = dry_run(plan, manutec)
    assert not result.problems
    assert all(group.complete and group.condition < 100 for group in result.groups)
    kinds = ("gravity", "inertia", "coupling")
    for kind, columns in zip(kinds, base_parameters(manutec).groups.values(), strict=True):
        assert count(plan, kind) >= CORE * len(columns)


@pytest.mark.parametrize("minutes", [8.0, MINUTES])
def test_each_axis_moves_as_often_as_a_law_of_its_friction_needs(manutec, noise, minutes):
    """At 8 minutes the most informative measurements move the last axis twice."""
    plan = design_within(manutec, minutes, noise)
    assert axes_lacking_law(plan.measurements, 6) == {}
    assert all(group.complete for group in dry_run(plan, manutec).groups)


@pytest.mark.parametrize("each", [1, CORE])
def test_the_core_alone_identifies_every_group(manutec, options, each):
    """Inertia of axes 5 and 6 depends on no position, so both are measured at the same place."""
    chosen = tuple(options[k].measurement for k in by_minutes._core(manutec, options, each))
    plan = make_plan(manutec, by_minutes.assign_ids(chosen, set()), 0.0, None)
    groups = dry_run(plan, manutec).groups
    assert [group.group for group in groups if not group.complete] == []


def test_a_refinement_reserves_what_the_run_before_lacks(manutec, plan, noise, known):
    of_others = tuple(m for m in plan.measurements if 5 not in m.moved)
    before = plan.model_copy(update={"measurements": of_others})
    found = refine(manutec, 6.0, noise, known, before)
    assert axes_lacking_law((*of_others, *found.measurements), 6) == {}


def test_it_is_more_informative_than_a_plan_by_counts_that_takes_as_long(manutec, plan, noise):
    n_base = len(base_parameters(manutec))
    by_counts = design(manutec, {"gravity": 22, "inertia": 32, "coupling": 3})
    assert dry_run(by_counts, manutec).duration >= 0.99 * dry_run(plan, manutec).duration
    found, other = (
        covariance(information(manutec, p.measurements, PERIOD, noise), n_base)
        for p in (plan, by_counts)
    )
    gain = (np.linalg.slogdet(other)[1] - np.linalg.slogdet(found)[1]) / (2 * n_base)
    assert gain > 0.04  # geometric mean of the standard deviations


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
    selection = Selection(manutec, options, criterion)
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
    """Return log det of the base parameters' information, common terms eliminated."""
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
