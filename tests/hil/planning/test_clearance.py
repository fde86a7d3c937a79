"""Capsules, their distance from boxes, and proof that a swept path is clear."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sampled_depth import sampled_depth

from checked_files.yaml_file import FileError
from hil.model.capsules import DEFAULT_RADIUS, capsules, segments
from hil.model.robot import Robot, parse_robot
from hil.planning.timetable import SKEW, JointBoxes, Travels
from hil.planning.workspace import RESOLUTION, Box, Workspace, are_clear, box_distance, find_hits

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
def test_the_distance_of_a_segment_from_a_box_is_that_of_its_nearest_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, last = rng.normal(size=(2, 20, 3)) * 2
    last[:5] = np.where(rng.random((5, 3)) < 0.5, first[:5], last[:5])  # along faces, or points
    low = rng.normal(size=3)
    high = low + rng.exponential(size=3)
    points = first + np.linspace(0, 1, 2001)[:, None, None] * (last - first)
    sampled = np.linalg.norm(points - np.clip(points, low, high), axis=-1).min(axis=0)
    exact = box_distance(first, last, low, high)
    assert np.all(exact <= sampled + 1e-12)
    assert np.all(sampled - exact < 1e-2)


@given(SEEDS)
def test_no_link_moves_farther_than_its_reach(chains, seed: int) -> None:
    robot, rng = chains.random(seed), np.random.default_rng(seed)
    here, there = rng.uniform(-1, 1, size=(2, 50, robot.n_joints))
    way = np.linalg.norm(segments(robot, there) - segments(robot, here), axis=-1).max(axis=-1)
    assert np.all(way <= np.abs(there - here) @ capsules(robot).reach.T + 1e-12)


def test_links_follow_the_frames(manutec: Robot) -> None:
    straight_up = segments(manutec, np.array([[0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0]]))[0]
    assert straight_up[1, 1] == pytest.approx([0.0, 0.0, 0.5], abs=1e-12)
    wrist = straight_up[3, 1]
    assert np.linalg.norm(wrist - straight_up[1, 1]) == pytest.approx(0.73)


def test_a_link_without_a_stated_capsule_leads_to_the_next_joint(chains) -> None:
    robot = chains.robot(chains.joint(), chains.joint(d="a"), chains.joint(alpha="pi/2", r="b"))
    shapes = capsules(robot)
    assert shapes.stated == (False, False, False)
    assert shapes.radii.tolist() == [DEFAULT_RADIUS] * 3
    assert shapes.ends[0].tolist() == [[0, 0, 0], [0.3, 0, 0]]
    assert shapes.ends[1] == pytest.approx(np.array([[0, 0, 0], [0, -0.45, 0]]))
    assert not shapes.ends[2].any()


def somewhere(rng: np.random.Generator) -> Workspace:
    low = rng.uniform(-1.2, 1.0, size=3)
    high = low + rng.uniform(0.05, 0.5, size=3)
    return Workspace(boxes=(Box(name="box", low=tuple(low), high=tuple(high)),))


@settings(max_examples=30)
@given(SEEDS)
@example(68345)  # passes 0.35 m beside the box; the mean of both ends is inside
def test_what_counts_as_clear_is_clear_wherever_one_looks(manutec: Robot, seed: int) -> None:
    rng = np.random.default_rng(seed)
    workspace = somewhere(rng)
    start, end = rng.uniform(manutec.q_min, manutec.q_max, size=(2, 1, 6))
    velocity = 0.3 * manutec.velocity_limit
    sweep = Travels(start, end, velocity, 0.3 * manutec.acceleration_limit)
    times = np.linspace(0, sweep.high[0, 0], 1000)[:, None]
    depth = sampled_depth(
        manutec, workspace, sweep.configurations(np.zeros(1000, dtype=int), times)
    )
    hits = find_hits(manutec, workspace, sweep)
    if hits:
        skewed = (capsules(manutec).reach @ velocity).max() * SKEW
        assert depth > -(skewed + RESOLUTION)  # no more than the tolerance in time
        assert hits[0].depth >= depth - RESOLUTION
    else:
        assert depth <= 0
    assert bool(are_clear(manutec, workspace, sweep)[0]) is not bool(hits)


@settings(max_examples=30)
@given(SEEDS)
def test_all_angles_of_two_axes_at_once_are_looked_at(manutec: Robot, seed: int) -> None:
    rng = np.random.default_rng(seed)
    workspace = somewhere(rng)
    start = rng.uniform(manutec.q_min, manutec.q_max, size=(1, 6))
    end = start.copy()
    axes = rng.choice(6, 2, replace=False)
    end[0, axes] += rng.uniform(-1, 1, size=2)
    between = start + (end - start) * rng.random((1000, 6))
    depth = sampled_depth(manutec, workspace, between)
    hits = find_hits(manutec, workspace, JointBoxes(start, end))
    assert hits or depth <= 0
    assert not hits or hits[0].depth > 0
    assert not hits or depth - 0.01 <= hits[0].depth


def test_a_travel_whose_highest_speed_is_0_in_floating_point_takes_no_time() -> None:
    rate = np.array([0.5])
    assert Travels(np.zeros((1, 1)), np.full((1, 1), 5e-324), rate, rate).high == 0.0


def test_a_link_that_stands_in_a_box_can_be_left_out(manutec: Robot) -> None:
    floor = {"name": "floor", "low": (-2, -2, -2), "high": (2, 2, -0.25)}
    up = np.array([[0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0]])
    hits = find_hits(manutec, Workspace(boxes=(Box(**floor),)), JointBoxes(up, up))
    assert hits[0].link == 0
    ignored = Workspace(boxes=(Box(**floor, ignore_links=(1,)),))
    assert not find_hits(manutec, ignored, JointBoxes(up, up))


@pytest.mark.parametrize(
    ("capsule", "message"),
    [
        ("{ends: [[0, 0, 0], [500, 0, 0]], radius: 0.1}", "500 m must be within +-20 m"),
        ("{ends: [[0, 0, 0], [0.5, 0, 0]], radius: 0}", "0 m must be positive"),
        ("{ends: [[0, 0, 0], [0.5, 0, 0]], radius: 80}", "80 m must be at most 5 m: it looks like"),
    ],
)
def test_a_wrong_capsule_is_refused_with_its_line(
    manutec: Robot, capsule: str, message: str
) -> None:
    stated = "{ends: [[0, 0, 0], [0.50, 0, 0]], radius: 0.15}"
    assert stated in manutec.text
    with pytest.raises(FileError) as refused:
        parse_robot(manutec.text.replace(stated, capsule), "robot.yaml")
    assert message in str(refused.value)
    assert "robot.yaml:29: joints.1.capsule." in str(refused.value)
