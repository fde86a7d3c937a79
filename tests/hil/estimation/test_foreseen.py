"""Excludable causes of a plan are predicted before any motion."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from hil.estimation.consistent.conditions import sized_bodies
from hil.estimation.excluded.foreseen import foreseen, recorded
from hil.estimation.excluded.result import Limit
from hil.model.dynamics import inverse_dynamics
from hil.planning.design.by_counts import design
from hil.planning.measurement import Friction
from hil.planning.prediction.information import whole_range
from hil.planning.prediction.noise import stated_noise
from hil.planning.trajectory import Trajectory
from hil.results.tables import excluded


@pytest.fixture(scope="module")
def plan(manutec):
    return design(manutec, {"gravity": 16, "inertia": 20, "coupling": 4})


@pytest.fixture(scope="module")
def sizes(plan, manutec):
    return sizes_of(plan, manutec, stated_noise(manutec))


def sizes_of(plan, robot, noise, seed=0):
    proof = foreseen(plan, robot, noise, sized_bodies(robot), seed)
    return {(each.cause, each.axis, each.part): each.size for each in proof.limits}


def test_sizes_do_not_depend_on_the_noise_that_was_drawn(plan, manutec, sizes):
    again = sizes_of(plan, manutec, stated_noise(manutec), seed=7)
    both = [again[each] / size for each, size in sizes.items() if size and again[each]]
    assert np.median(np.exp(np.abs(np.log(both)))) < 1.2


def test_twice_the_noise_hides_twice_as_large_a_cause(plan, manutec, sizes):
    stated = stated_noise(manutec)
    loud = replace(stated, torque=2 * stated.torque, wander=2 * stated.wander)
    twice = sizes_of(plan, manutec, loud)
    both = [twice[each] / size for each, size in sizes.items() if size and twice[each]]
    # slightly less, since the encoder resolution is unchanged
    assert np.median(both) == pytest.approx(2.0, rel=0.07)


def test_what_no_motion_shows_is_never_found(sizes):
    assert sizes["rotor inertia", 1, ""] is None  # inseparable from Izz1
    assert sizes["joint offset", 1, ""] is None  # gravity is parallel to the axis


def test_a_plan_without_parameters_excludes_nothing(plan, manutec):
    sweep = Friction(
        id="f", axis=1, q=(0.0,) * 6, stroke=1.0, velocity=1.0, acceleration=8.0, cycles=2
    )
    only = plan.model_copy(update={"measurements": (sweep,)})
    assert foreseen(only, manutec, stated_noise(manutec), sized_bodies(manutec)) is None


@pytest.mark.parametrize("samples", [500.0, 500.575])
def test_a_trajectory_passes_from_period_to_period_without_a_jump(manutec, samples):
    period = 0.004
    waves = {"sine": ((0.2,),) * 6, "cosine": ((0.0,),) * 6}
    trajectory = Trajectory(id="t", q=(0.0,) * 6, period=samples * period, cycles=3, **waves)
    made = recorded(
        manutec, trajectory, period, replace(stated_noise(manutec), rounding=None),
        sized_bodies(manutec), np.random.default_rng(0), 0.0,
    )  # fmt: skip
    accelerations = np.diff(made.q, n=2, axis=0) / period**2
    most = np.abs(trajectory.motion(made.time)[2]).max()
    assert np.abs(accelerations).max() == pytest.approx(most, rel=0.01)
    assert np.unique(made.group).tolist() == [0, 1, 2]


def test_bodies_are_expected_as_heavy_as_the_drives_can_move(manutec):
    torque = np.abs(inverse_dynamics(manutec, sized_bodies(manutec), *whole_range(manutec)))
    assert (torque / manutec.torque_limit).max() == pytest.approx(1.0)


def test_no_size_makes_more_torque_than_expected_recordings_have(manutec):
    few = design(manutec, {"gravity": 4, "inertia": 14, "coupling": 3})
    noise, p = stated_noise(manutec), sized_bodies(manutec)
    proof = foreseen(few, manutec, noise, p)
    untestable = [each for each in proof.limits if not each.testable]
    assert [(each.cause, each.axis, each.size) for each in untestable] == [("spring", 6, None)]
    assert all((each.size or 0.0) * each.torque <= 1.0 for each in proof.limits)
    shown = excluded.foreseen(proof, manutec.n_joints, "of rods")
    cells = {row[0]: row[2:] for row in shown.parts[0].rows}
    assert cells["spring"][6] == excluded.UNTESTED  # after the column of the arm
    assert any(
        "not testable with this plan: axis 6 has too little torque" in note for note in shown.notes
    )


@pytest.mark.parametrize("content", [{}, {"torque": "a", "size": 1.0}, [1.0], None])
def test_a_limit_of_a_damaged_file_is_refused_by_its_fields(content: object) -> None:
    with pytest.raises(ValidationError):
        Limit.model_validate(content)
