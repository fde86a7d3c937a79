"""Plans that make causes of error visible and distinguishable."""

from __future__ import annotations

import numpy as np
import pytest

from hil.errors import UnknownName
from hil.estimation.consistent.conditions import sized_bodies
from hil.estimation.excluded.distinguishing import causes_named, distinguish
from hil.estimation.excluded.foreseen import foreseen
from hil.planning.design.by_counts import design
from hil.planning.dry_run import measurement_problems
from hil.planning.prediction.noise import stated_noise
from hil.results.tables.excluded import distinguishing


@pytest.fixture(scope="module")
def plan(manutec):
    return design(manutec, {"gravity": 8, "inertia": 12, "coupling": 2})


@pytest.fixture(scope="module")
def reached(plan, manutec):
    """Visibility of the joint offset of axis 5, which resembles a load in the original plan."""
    return reached_of(plan, manutec, "load, joint offset of axis 5")


def reached_of(plan, robot, causes):
    named = causes_named(robot, causes)
    return distinguish(plan, robot, stated_noise(robot), sized_bodies(robot), named)


def test_a_usual_size_is_found_and_told_from_the_other_causes(reached):
    zero = next(each for each in reached.before if each.name == "joint offset of axis 5")
    assert zero.shown > zero.usual
    assert zero.distinct == np.inf
    assert zero.like == "load"
    zero = next(each for each in reached.after if each.name == "joint offset of axis 5")
    assert max(zero.shown, zero.distinct) <= zero.usual == 0.5


def test_a_cause_without_a_usual_size_is_told_as_soon_as_it_is_found(reached):
    loads = [each for each in reached.after if each.name.startswith("load")]
    assert len(loads) == 6
    assert all(each.distinct <= each.shown < np.inf for each in loads)


def test_measurements_are_added_behind_those_of_the_plan_for_as_long_at_most(plan, reached):
    n, (before, after) = len(plan.measurements), reached.durations
    assert reached.plan.measurements[:n] == plan.measurements
    assert tuple(each.id for each in reached.plan.measurements[n:]) == reached.added
    assert before < after <= 2 * before


def test_what_is_added_keeps_inside_the_limits(reached, manutec):
    assert measurement_problems(reached.plan, manutec) == []


def test_sizes_are_those_that_a_dry_run_states_of_the_plan(reached, manutec):
    noise, p = stated_noise(manutec), sized_bodies(manutec)
    limits = foreseen(reached.plan, manutec, noise, p).limits
    stated = next(each.size for each in limits if (each.cause, each.axis) == ("joint offset", 5))
    shown = next(each.shown for each in reached.after if each.name == "joint offset of axis 5")
    assert shown == pytest.approx(stated)


def test_what_no_motion_shows_is_stated_with_what_would_show_it(plan, manutec):
    reached = reached_of(plan, manutec, "torque constant of axis 6, rotor inertia of axis 1")
    assert reached.added == ()
    assert reached.plan == plan
    remedies = {each.name: each.remedy for each in reached.after}
    assert "known mass" in remedies["torque constant of axis 6"]
    assert "known inertia" in remedies["rotor inertia of axis 1"]


def test_a_plan_that_shows_what_is_usual_stays_as_it_is(plan, manutec):
    assert reached_of(plan, manutec, "joint offset of axis 2").plan == plan


def test_an_axis_that_hardly_moves_is_stated_in_place_of_an_impossible_size(manutec):
    few = design(manutec, {"gravity": 4, "inertia": 14, "coupling": 3})
    reached = reached_of(few, manutec, "spring of axis 6, spring of axis 5")
    sizes = {each.name: each for each in reached.before}
    assert (sizes["spring of axis 5"].resting, sizes["spring of axis 6"].resting) == (0, 6)
    assert sizes["spring of axis 6"].shown == sizes["spring of axis 6"].distinct == np.inf
    still = next(each for each in reached.after if each.name == "spring of axis 6")
    words = "spring of axis 6: not testable with this plan: axis 6 has too little torque"
    assert any(each.startswith(words) for each in distinguishing(reached)) == (still.resting == 6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lode", "must be one of: load, joint offset"),
        ("joint offset of axis 7", "axis must be 1 to 6"),
        ("joint offset of axis two", "axis must be 1 to 6"),
        ("zero:4", "for one axis write 'joint offset of axis 4'"),
        ("load,", "must be one of"),
        ("slip", "depends on the time of a measurement"),
        ("drift of torque constant of axis 2", "depends on the time of a measurement"),
        ("wrong sign of a position", "must be one of"),
    ],
)
def test_causes_that_measurements_cannot_be_chosen_for_are_refused(manutec, text, words):
    with pytest.raises(UnknownName, match=words):
        causes_named(manutec, text)
