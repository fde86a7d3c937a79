"""Guarded workspace in plan, dry run, planner, sequencer and on the drives."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from checked_files.yaml_file import FileError, parse_yaml
from drivers.drive_bus import LimitExceeded
from drivers.drives_file import load_drives
from hil import cli
from hil.measuring.sequencer import measure
from hil.model.capsules import capsules, link_reaches, segments
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.by_counts import design
from hil.planning.dry_run import dry_run
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, WarmUp, dump_plan, load_plan, load_workspace, remarks
from hil.planning.workspace import Box, Workspace
from hil.tasks.measuring import describe_problems, narrowed_drives

FLOOR = Box(name="floor", low=(-3, -3, -1.5), high=(3, 3, -0.8), ignore_links=(1,))
POST = Box(name="post", low=(0.7, 0.3, -0.8), high=(0.9, 0.5, 1.0))
CELL = Workspace(boxes=(FLOOR, POST))


def guarded(plan: Plan, *boxes: Box, **changes: object) -> Plan:
    return plan.model_copy(update={"workspace": Workspace(boxes=boxes, **changes)})


def reported(plan: Plan, robot: Robot) -> str:
    return describe_problems(dry_run(plan, robot), dump_plan(plan), "plan.yaml")


def reaching(plan: Plan, *configurations: tuple[float, ...], axis: int = 6) -> Plan:
    motion = {"stroke": 0.2, "velocity": 0.4, "acceleration": 4.0}
    measurements = tuple(
        Gravity(id=f"g{k}", axis=axis, q=q, **motion) for k, q in enumerate(configurations)
    )
    return plan.model_copy(update={"measurements": measurements})


UP = (0.0, -1.5, 0.0, 0.0, 0.3, 0.0)
LEFT, RIGHT = (1.2, 0.0, 1.5, 0.0, 0.0, 0.0), (-0.2, 0.0, 1.5, 0.0, 0.0, 0.0)
AT_POST = (0.5, 0.0, 1.5, 0.0, 0.0, 0.0)


def test_a_plan_clear_of_all_boxes_has_no_problems(small_plan: Plan, manutec: Robot) -> None:
    assert not dry_run(guarded(small_plan, FLOOR), manutec).problems


def test_a_measurement_in_a_box_is_reported_with_link_box_and_place(
    small_plan: Plan, manutec: Robot
) -> None:
    text = reported(guarded(reaching(small_plan, UP, AT_POST), POST), manutec)
    assert "measurements.1.q: g1: link" in text
    assert "into post at q = (0.5, 0, 1.5" in text
    assert "plan again with --workspace, choose another configuration" in text


def test_a_stroke_that_sweeps_into_a_box_is_reported(small_plan: Plan, manutec: Robot) -> None:
    still = guarded(reaching(small_plan, RIGHT), POST)
    assert not dry_run(still, manutec).problems
    swung = still.measurements[0].model_copy(update={"axis": 1, "stroke": 1.2})
    text = reported(still.model_copy(update={"measurements": (swung,)}), manutec)
    assert "g0: link" in text
    assert "post" in text


def test_a_travel_through_a_box_between_clear_ends_is_reported(
    small_plan: Plan, manutec: Robot
) -> None:
    text = reported(guarded(reaching(small_plan, LEFT, RIGHT), POST), manutec)
    assert text.startswith("plan.yaml:")
    assert "measurements.1.q: travel to g1: link" in text
    assert "runs right into post" in text


def test_a_way_round_is_clear(small_plan: Plan, manutec: Robot) -> None:
    over = guarded(reaching(small_plan, LEFT, (1.2, *UP[1:]), (-0.2, *UP[1:]), RIGHT), POST)
    assert not dry_run(over, manutec).problems


def test_the_warm_up_is_guarded_too(small_plan: Plan, manutec: Robot) -> None:
    plan = guarded(reaching(small_plan, RIGHT, (-0.2, *UP[1:]), (1.2, *UP[1:]), LEFT), POST)
    assert not dry_run(plan, manutec).problems
    warm = plan.model_copy(update={"warm_up": WarmUp(duration=60.0)})
    assert "warm-up after g3: link" in reported(warm, manutec)


def test_the_margin_counts(small_plan: Plan, manutec: Robot) -> None:
    plan = reaching(small_plan, RIGHT)
    assert not dry_run(guarded(plan, POST, margin=0.0), manutec).problems
    assert "comes within" in reported(guarded(plan, POST, margin=0.5), manutec)


def test_narrowed_ranges_are_kept_by_the_dry_run(small_plan: Plan, manutec: Robot) -> None:
    text = reported(guarded(small_plan, ranges={2: (-0.1, 0.1)}), manutec)
    assert "joint 2, with half its stroke, at -0.5 rad is outside -0.1 ... 0.1 rad" in text


# Planning


def test_the_planner_chooses_clear_configurations_and_travels(manutec: Robot) -> None:
    counts = {"gravity": 9, "inertia": 22, "coupling": 1}
    unguarded = design(manutec, counts)
    assert dry_run(unguarded.model_copy(update={"workspace": CELL}), manutec).problems
    plan = design(manutec, counts, workspace=CELL)
    assert not dry_run(plan, manutec).problems
    assert len(plan.measurements) == sum(counts.values())
    assert plan.workspace == CELL


def test_a_cell_without_room_is_refused_by_the_planner(manutec: Robot) -> None:
    full = Workspace(boxes=(Box(name="wall", low=(-2, -2, -2), high=(2, 2, 2)),))
    with pytest.raises(ValueError, match="no configuration with axis 2 in motion keeps clear"):
        design(manutec, {"gravity": 9, "inertia": 22, "coupling": 1}, workspace=full)


def test_a_plan_with_a_workspace_reads_back_as_written(small_plan: Plan) -> None:
    plan = guarded(small_plan, FLOOR, POST, ranges={1: (-1.0, 1.0)})
    assert parse_yaml(dump_plan(plan), Plan, "plan.yaml") == plan


# Driving an arm


def test_no_axis_is_sent_into_a_box_from_where_the_robot_stands(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    plan = guarded(reaching(small_plan, LEFT), POST)
    assert not dry_run(plan, manutec).problems
    ideal_bus.__enter__()
    for _ in measure(reaching(small_plan, (-0.2, *UP[1:]), RIGHT), manutec, ideal_bus):
        pass
    moves = len(ideal_bus.moves)
    with pytest.raises(LimitExceeded, match=r"travel from \(-0.2.*link .* post"):
        list(measure(plan, manutec, ideal_bus))
    assert len(ideal_bus.moves) == moves


def test_left_alone_the_same_arm_does_run_into_the_box(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    from sampled_depth import sampled_depth

    seen: list[tuple[float, ...]] = []

    def note(sample):
        seen.append(sample.q)
        return sample

    ideal_bus.tamper = note
    with ideal_bus:
        for _ in measure(reaching(small_plan, (-0.2, *UP[1:]), RIGHT, LEFT), manutec, ideal_bus):
            pass
    bare = Workspace(boxes=(POST,), margin=0.0)
    assert sampled_depth(manutec, bare, np.array(seen)) > 0.08


def test_the_drives_get_the_narrowed_ranges_as_their_limits() -> None:
    drives = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    narrow = narrowed_drives(drives, Workspace(ranges={2: (-0.5, 0.25)}))
    assert (narrow.axes[1].limits.q_min, narrow.axes[1].limits.q_max) == (-0.5, 0.25)
    assert narrow.axes[0] == drives.axes[0]


# Files


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ranges: {7: [-1, 1]}", "ranges.7: manutec-r15 has joints 1 to 6"),
        ("ranges: {1: [-1, 5]}", "ranges.1: -1 ... 5 must lie within the range of the robot"),
        ("ranges: {1: [1, -1]}", "joint 1: 1 must be below -1"),
        ("boxes: [{name: a, low: [0, 0, 0], high: [1, 0, 1]}]", "low y = 0 m must be below high y"),
        (
            "boxes: [{name: a, low: [0, 0, 0], high: [1, 1, 1], ignore_links: [9]}]",
            "boxes.0.ignore_links: manutec-r15 has links 1 to 6",
        ),
        ("ranges: {2: [-60, 45]}", "in degrees? then write [-1.0472, 0.7854]"),
        (
            "boxes: [{name: a, low: [600, 600, -800], high: [1200, 1200, 200]}]",
            "cell.yaml:1: boxes.0.low: -800 m of a must be within +-",
        ),
        (
            "boxes: [{name: a, low: [600, 600, -800], high: [1200, 1200, 200]}]",
            "it looks like millimetres; then write 1.2",
        ),
        (
            "margin: 0.05\nboxes:\n- {name: b, low: [1, 1, 1], high: [2, 2, 2]}\n"
            "- {name: a, low: [60, 60, -80],\n   high: [61, 61, -79]}",
            "cell.yaml:5: boxes.1.high: -79 m of a must be within",
        ),
        (
            "boxes: [{name: a, low: [0.0006, 0, 0], high: [0.0012, 0.0006, 0.001]}]",
            "a has a largest edge of 0.001 m, must be at least 0.0",
        ),
        (
            "boxes: [{name: floor, low: [-3, -3, -1.5], high: [3, 3, -0.4]}]",
            "floor contains link 1 of manutec-r15 at every configuration, so nothing could be"
            " measured; correct its corners, or, if the arm is fixed to it, state"
            " ignore_links: [1]",
        ),
        (
            "boxes: [{name: cube, low: [-10, -10, -10], high: [10, 10, 10]}]",
            "cube contains links 1, 2, 3, 4, 5, 6 of manutec-r15 at every configuration",
        ),
        ("margin: -0.1", "margin"),
        ("boxen: []", "boxen: unknown key"),
    ],
)
def test_a_wrong_workspace_is_refused(
    manutec: Robot, tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "cell.yaml"
    path.write_text(text)
    with pytest.raises(FileError) as refused:
        load_workspace(path, manutec)
    assert message in str(refused.value)
    assert str(path) in str(refused.value)


def test_a_floor_far_larger_than_the_arm_is_accepted_without_a_remark(
    manutec: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "cell.yaml"
    path.write_text("boxes: [{name: floor, low: [-9, -9, -1.5], high: [9, 9, -0.8]}]")
    assert not remarks(load_workspace(path, manutec), manutec)


@pytest.mark.parametrize(
    ("box", "guards"),
    [
        (Box(name="pit", low=(-9, -9, -6), high=(9, 9, -4)), False),
        (Box(name="far", low=(10, 20, -15), high=(30, 25, 5)), False),
        (Box(name="column", low=(-0.3, -0.3, -2), high=(0.3, 0.3, -0.9), ignore_links=(1,)), True),
        (
            Box(name="shelf", low=(0.6, 0.6, -1), high=(1, 1, 1), ignore_links=(2, 3, 4, 5, 6)),
            False,
        ),
    ],
)
def test_a_box_that_no_link_can_reach_is_stated_with_both_distances(
    manutec: Robot, box: Box, guards: bool
) -> None:
    found = remarks(Workspace(boxes=(box,)), manutec)
    assert len(found) == (0 if guards else 1)
    if not guards:
        assert f"box {box.name} has no effect:" in found[0]


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_no_link_is_ever_farther_from_the_base_than_its_reach(chains, seed: int) -> None:
    robot, rng = chains.random(seed), np.random.default_rng(seed)
    q = rng.uniform(robot.q_min, robot.q_max, size=(100, robot.n_joints))
    farthest = np.linalg.norm(segments(robot, q), axis=-1).max(axis=(0, 2)) + capsules(robot).radii
    assert np.all(farthest <= link_reaches(robot) + 1e-9)


@pytest.mark.long
def test_commands_state_a_box_that_guards_nothing(
    small_plan: Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cell.yaml").write_text("boxes: [{name: pit, low: [-9, -9, -6], high: [9, 9, -4]}]")
    (tmp_path / "plan.yaml").write_text(dump_plan(small_plan))
    cell = ["--workspace", str(tmp_path / "cell.yaml")]
    for command in (
        ["dry-run", str(tmp_path / "plan.yaml")],
        ["run", str(tmp_path / "plan.yaml"), "-o", str(tmp_path / "run")],
        ["plan", "manutec-r15", "-o", str(tmp_path / "new.yaml"), "--gravity", "9"],
    ):
        with pytest.raises(SystemExit):
            cli.main([*command, *cell])
        assert "box pit has no effect" in " ".join(capsys.readouterr().out.split())


def test_an_arm_that_stands_in_a_box_is_not_moved(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    with ideal_bus:
        list(measure(reaching(small_plan, AT_POST), manutec, ideal_bus))
        moves = len(ideal_bus.moves)
        with pytest.raises(LimitExceeded, match=r"the arm is inside post or .* hil drives jog"):
            list(measure(guarded(reaching(small_plan, UP), POST), manutec, ideal_bus))
        assert len(ideal_bus.moves) == moves


def test_a_plan_with_the_workspace_of_another_robot_is_refused(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(guarded(small_plan, ranges={9: (-1.0, 1.0)})))
    with pytest.raises(FileError, match=r"workspace\.ranges\.9: manutec-r15 has joints 1 to 6"):
        load_plan(path, manutec)
