"""Plans as data."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from checked_files.yaml_file import FileError, parse_yaml
from hil.model.robot import Robot
from hil.planning.measurement import KINDS, Coupling, Gravity, Inertia
from hil.planning.plan import Plan, PlannedRobot, WarmUp, dump_plan, load_plan
from hil.planning.strokes import Partner

PLANS = Path(__file__).parent / "plans"
"""Folder of plans: for each kind of measurement one, in the oldest readable format."""

angles = st.floats(-10, 10)
sizes = st.floats(1e-3, 100)
common = {
    "q": st.tuples(*[angles] * 6),
    "stroke": sizes,
    "velocity": sizes,
    "acceleration": sizes,
    "cycles": st.integers(1, 9),
}
partners = st.builds(
    Partner, axis=st.integers(4, 6), stroke=sizes, velocity=sizes, acceleration=sizes
)
measurements = st.one_of(
    st.builds(Gravity, id=st.just("m"), axis=st.integers(1, 6), **common),
    st.builds(Inertia, id=st.just("m"), axis=st.integers(1, 6), **common),
    st.builds(Coupling, id=st.just("m"), axis=st.integers(1, 3), partner=partners, **common),
)
plans = st.builds(
    Plan,
    robot=st.just(PlannedRobot(name="any", digest="0123")),
    sample_period=st.floats(0.001, 0.1),
    travel=st.floats(0.01, 1),
    attempts=st.integers(1, 9),
    warm_up=st.none() | st.builds(WarmUp, duration=sizes, fraction=st.floats(0.01, 1)),
    measurements=st.tuples(measurements),
)


@settings(deadline=None, max_examples=40)
@given(plans)
def test_a_plan_read_back_equals_the_plan_written(plan: Plan) -> None:
    assert parse_yaml(dump_plan(plan), Plan, "plan.yaml") == plan


@pytest.mark.parametrize("kind", KINDS)
def test_a_plan_on_disk_is_written_again_byte_for_byte(kind: str) -> None:
    text = (PLANS / f"{kind}.yaml").read_text(encoding="utf-8")
    plan = parse_yaml(text, Plan, "plan.yaml")
    assert {measurement.kind for measurement in plan.measurements} == {kind}
    assert dump_plan(plan) == text


def test_a_measurement_is_one_short_block(small_plan: Plan) -> None:
    text = dump_plan(small_plan)
    block = text[text.index("- id: g1") : text.index("- id: i1")]
    assert block.splitlines() == [
        "- id: g1",
        "  kind: gravity",
        "  axis: 2",
        "  q: [0.0, -0.3, 0.2, 0.0, 0.5, 0.0]",
        "  stroke: 0.4",
        "  velocity: 0.4",
        "  acceleration: 8.0",
        "  cycles: 2",
    ]


def test_strokes_go_from_half_a_stroke_before_q_to_half_a_stroke_behind_it(
    small_plan: Plan,
) -> None:
    gravity, _, coupling = small_plan.measurements
    assert gravity.start[1] == pytest.approx(-0.5)
    assert gravity.end[1] == pytest.approx(-0.1)
    assert gravity.n_strokes == 4
    assert gravity.profile(0).end == gravity.profile(1).start == gravity.end[1]
    assert coupling.start[:2] == pytest.approx((0.025, -0.25))
    assert coupling.end[:2] == pytest.approx((0.175, -0.15))


@given(st.builds(Inertia, id=st.just("m"), axis=st.just(1), spread=st.floats(1e-4, 0.1), **common))
def test_cycles_are_spread_by_less_acceleration_and_both_strokes_of_each_alike(m: Inertia) -> None:
    accelerations = [m.profile(number).acceleration for number in range(m.n_strokes)]
    assert accelerations[::2] == accelerations[1::2]
    assert len(set(accelerations[::2])) == m.cycles
    assert accelerations[0] == pytest.approx(m.acceleration) == max(accelerations)
    later = m.velocity / np.array(accelerations) - m.velocity / m.acceleration
    assert later.max() <= m.spread
    alike = m.model_copy(update={"spread": None})
    assert {alike.profile(number).acceleration for number in range(m.n_strokes)} == {m.acceleration}


def test_layout_and_comments_do_not_change_the_digest(small_plan: Plan) -> None:
    text = "# mine\n" + dump_plan(small_plan).replace("stroke: 0.4", "stroke:   0.40")
    assert parse_yaml(text, Plan, "plan.yaml").digest == small_plan.digest


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("stroke: 0.4", "stroke: -1", "plan.yaml:13: measurements.0.stroke: -1: "),
        ("stroke: 0.4", "strike: 0.4", "plan.yaml:13: measurements.0.strike: unknown key"),
        ("  stroke: 0.4\n", "", "plan.yaml:9: measurements.0.stroke: missing"),
        ("axis: 2", "axis: 9", "axis 9 must be one of the 6 joints that q names"),
        ("kind: gravity", "kind: levity", "'gravity', 'inertia', 'coupling'"),
        ("id: i1", "id: g1", "measurements 0 and 1 have the same id g1"),
        ("id: g1", "id: ../g1", "plan.yaml:9: measurements.0.id: '../g1'"),
        ("    axis: 2", "    axis: 1", "partner.axis 1 must differ from axis 1"),
        ("travel: 0.3", "travel: 60", "plan.yaml:6: travel: 60: must be less than"),
        ("attempts: 3", "attempts: .nan", "plan.yaml:7: attempts"),
        ("cycles: 2", "cycles: 0", "cycles: 0: must be greater than or equal to 1"),
        (
            "cycles: 2",
            "cycles: 100000000",
            "cycles: 100000000: must be less than or equal to 10000",
        ),
        ("velocity: 0.4", "velocity: .inf", "velocity"),
        ("format: 1", "format: 2", "plan.yaml:1: format: 2"),
    ],
)
def test_a_wrong_plan_is_refused_with_place_and_value(
    small_plan: Plan, old: str, new: str, message: str
) -> None:
    text = dump_plan(small_plan)
    assert old in text
    with pytest.raises(FileError) as refused:
        parse_yaml(text.replace(old, new, 1), Plan, "plan.yaml")
    assert message in str(refused.value)


def test_a_plan_for_another_robot_is_refused_with_a_remedy(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan))
    assert load_plan(path, manutec) == small_plan
    path.write_text(dump_plan(small_plan).replace("name: manutec-r15", "name: puma"))
    with pytest.raises(FileError, match=r"is for puma, not for manutec-r15; make a new plan"):
        load_plan(path, manutec)


def test_a_plan_for_a_robot_file_changed_since_is_refused(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan).replace(manutec.digest, "f" * 64))
    with pytest.raises(FileError, match=r"was changed since the plan was made"):
        load_plan(path, manutec)


def test_a_plan_with_too_few_joints_is_refused(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan).replace("[0.0, -0.3, 0.2, 0.0, 0.5, 0.0]", "[0.0, 1.0]"))
    with pytest.raises(FileError, match=r"measurements.0.q: 2 values must be 6"):
        load_plan(path, manutec)


def test_a_list_of_recorded_motions_is_no_plan(tmp_path):
    listed = tmp_path / "motions.yaml"
    listed.write_text("format: 1\nmap_digest: abc\nmeasurements: [{kind: free}]\n")
    with pytest.raises(FileError, match=r"nothing to measure; identify .* hil identify") as no:
        load_plan(listed)
    assert len(str(no.value).splitlines()) == 1
