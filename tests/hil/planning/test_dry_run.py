"""Dry run: limits, time, bus load, identifiability."""

import math

import numpy as np
import pytest

from hil.cli.plan_view import render
from hil.measuring.sequencer import measure
from hil.model.robot import Robot
from hil.planning.dry_run import BusCycle, dry_run
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.planning.plan import Plan, dump_plan
from hil.planning.prediction.identifiability import group_observations
from hil.planning.strokes import Partner
from hil.tasks.measuring import describe_problems


def repeat_plan(plan: Plan, number: int, **changes: object) -> Plan:
    items = list(plan.measurements)
    items[number] = items[number].model_copy(update=changes)
    return plan.model_copy(update={"measurements": tuple(items)})


def foresee(plan: Plan, *measurements: object) -> Plan:
    return plan.model_copy(update={"measurements": measurements})


def problems(plan: Plan, robot: Robot) -> list[str]:
    text = dump_plan(plan)
    return describe_problems(dry_run(plan, robot), text, "plan.yaml").splitlines()


def gravity_plan(plan: Plan, axis: int, *configurations: tuple[float, ...]) -> Plan:
    return foresee(
        plan,
        *(
            Gravity(id=f"g{k}", axis=axis, q=q, stroke=0.4, velocity=0.4, acceleration=8.0)
            for k, q in enumerate(configurations)
        ),
    )


def test_a_sound_plan_has_no_problems(small_plan: Plan, manutec: Robot) -> None:
    result = dry_run(small_plan, manutec)
    assert result.problems == ()
    assert result.counts == {"gravity": 1, "inertia": 1, "coupling": 1}


def test_the_duration_foreseen_is_what_the_sequencer_takes(
    small_plan: Plan, manutec: Robot, ideal_bus
) -> None:
    with ideal_bus:
        for _ in measure(small_plan, manutec, ideal_bus):
            pass
    assert dry_run(small_plan, manutec).duration == pytest.approx(ideal_bus.time, rel=0.15)


@pytest.mark.parametrize(("duration", "refused"), [(0.00279, False), (0.00346, True)])
def test_a_bus_loaded_above_70_percent_is_refused(
    small_plan: Plan, manutec: Robot, duration: float, refused: bool
) -> None:
    result = dry_run(small_plan, manutec, BusCycle(duration, 250_000, "SYNC and six TPDOs", 0.7))
    assert bool(result.problems) is refused
    if refused:
        assert "loads the bus with 86% at 250000 bit/s" in result.problems[0].message
        assert "sample every 0.005 s" in result.problems[0].message


@pytest.mark.parametrize(
    ("number", "changes", "message"),
    [
        (
            0,
            {"q": (0.0, -1.8, 0.2, 0.0, 0.5, 0.0)},
            "plan.yaml:12: measurements.0.q.1: g1: joint 2, with half its stroke, at -2 rad is"
            " outside -1.92 ... 1.92 rad; choose another configuration or stroke",
        ),
        (
            0,
            {"q": (0.0, -0.3, 0.2, 0.0, 90.0, 0.0)},
            "plan.yaml:12: measurements.0.q.4: g1: joint 5 at 90 rad is outside -2.007 ... 2.007"
            " rad; is it in degrees? then write 1.5708",
        ),
        (
            0,
            {"velocity": 1.6},
            "plan.yaml:14: measurements.0.velocity: g1: 1.6 rad/s is above the limit of joint 2,"
            " 1.5 rad/s; plan a lower one",
        ),
        (
            1,
            {"acceleration": 16.0},
            "plan.yaml:23: measurements.1.acceleration: i1: 16 rad/s^2 is above the limit of"
            " joint 3, 15 rad/s^2; plan a lower one",
        ),
        (
            2,
            {"partner": Partner(axis=2, stroke=0.1, velocity=0.5, acceleration=15.5)},
            "plan.yaml:36: measurements.2.partner.acceleration: c1: 15.5 rad/s^2 is above",
        ),
        (
            0,
            {"stroke": 0.05},
            "plan.yaml:13: measurements.0.stroke: g1: 0.05 rad leaves 0.075 s of constant velocity,"
            " must be at least 0.25 s; lengthen the stroke to 0.12 rad or lower the velocity",
        ),
        (2, {"stroke": 0.04}, "of creep, needed for two strokes of the partner"),
    ],
)
def test_a_problem_is_stated_with_line_value_bound_and_remedy(
    small_plan: Plan, manutec: Robot, number: int, changes: dict[str, object], message: str
) -> None:
    found = problems(repeat_plan(small_plan, number, **changes), manutec)
    assert any(message in line for line in found), found


def test_many_problems_are_counted_rather_than_listed(small_plan: Plan, manutec: Robot) -> None:
    q = (0.0, -1.8, 0.2, 0.0, 0.5, 0.0)
    found = problems(gravity_plan(small_plan, 2, *[q] * 15), manutec)
    assert len(found) == 11
    assert found[-1] == "... and 5 more problems of the plan"


def test_the_stretch_proposed_is_long_enough(small_plan: Plan, manutec: Robot) -> None:
    for number, stroke in ((0, 0.05), (2, 0.04)):
        short = repeat_plan(small_plan, number, stroke=stroke)
        advice = problems(short, manutec)[0]
        length = float(advice.split("lengthen the stroke to ")[1].split(" rad")[0])
        mended = repeat_plan(small_plan, number, stroke=length * 1.01)
        assert problems(mended, manutec) == []


def test_gravity_rows_are_the_weighted_torque_of_the_axis(small_plan: Plan, manutec: Robot) -> None:
    """Table 2: g2 depends on p5, p8 and p13, with g cos q2 as factor of p5."""
    q2 = 0.7
    plan = gravity_plan(small_plan, 2, (0.0, q2, 0.0, 0.0, 0.0, 0.0))
    row = group_observations(plan, manutec, "gravity")[0]
    assert abs(row[0]) == pytest.approx(9.81 * math.cos(q2) / 1890)


def test_inertia_rows_are_those_of_the_mass_matrix_without_gravity(
    small_plan: Plan, manutec: Robot
) -> None:
    """M44 = p10 + p11 sin^2 q5 + p14 cos^2 q5."""
    item = Inertia(
        id="i",
        axis=4,
        q=(0.0, 0.3, 0.2, 0.1, 0.6, 0.0),
        stroke=0.4,
        velocity=1.0,
        acceleration=8.0,
    )
    row = group_observations(foresee(small_plan, item), manutec, "diagonal")[0] * 210
    assert sorted(np.abs(row[np.abs(row) > 1e-12])) == pytest.approx(
        sorted([1.0, math.sin(0.6) ** 2, math.cos(0.6) ** 2])
    )


def test_coupling_rows_relate_the_creeping_axis_to_its_partner(
    small_plan: Plan, manutec: Robot
) -> None:
    coupling = small_plan.measurements[2]
    assert isinstance(coupling, Coupling)
    row = group_observations(foresee(small_plan, coupling), manutec, "off_diagonal")
    assert row.shape == (1, 1)
    assert abs(row[0, 0]) > 1e-6


def test_one_configuration_cannot_identify_three_parameters(
    small_plan: Plan, manutec: Robot
) -> None:
    plan = gravity_plan(small_plan, 2, (0.0, 0.2, 0.3, 0.4, 0.5, 0.0))
    groups = {group.group: group for group in dry_run(plan, manutec).groups}
    assert groups["gravity"].rank == 1
    assert not groups["gravity"].complete
    assert groups["gravity"].poorly_identifiable == ("p5", "p8", "p13")
    assert groups["diagonal"].rows == 0
    assert len(groups["diagonal"].poorly_identifiable) == 10


def test_configurations_that_hardly_differ_do_not_identify_either(
    small_plan: Plan, manutec: Robot
) -> None:
    """A condition number beyond 1e4 makes an estimate useless."""
    rng = np.random.default_rng(3)
    near = [tuple(0.4 + rng.uniform(-2e-5, 2e-5, 6)) for _ in range(8)]
    far = [tuple(0.4 + rng.uniform(-0.2, 0.2, 6)) for _ in range(8)]
    refused, accepted = (
        dry_run(gravity_plan(small_plan, 2, *each), manutec).groups[0] for each in (near, far)
    )
    assert not refused.complete
    assert math.isinf(refused.condition)
    assert accepted.complete
    assert 10 < accepted.condition < 1e4


def test_several_configurations_identify_gravity(small_plan: Plan, manutec: Robot) -> None:
    rng = np.random.default_rng(3)
    configurations = [tuple(rng.uniform(-1.5, 1.5, 6)) for _ in range(8)]
    gravity = dry_run(gravity_plan(small_plan, 2, *configurations), manutec).groups[0]
    assert gravity.complete
    assert 1 < gravity.condition < 20
    assert gravity.poorly_identifiable == ()


def test_a_parameter_that_nothing_excites_is_named(small_plan: Plan, manutec: Robot) -> None:
    """With q5 = 0 and q4 = 0 throughout, p13 has the same column in g2 as p8."""
    angles = [(0.0, a, b, 0.0, 0.0, 0.0) for a in (-0.8, 0.1, 0.9) for b in (-1.0, 0.2, 1.2)]
    gravity = dry_run(gravity_plan(small_plan, 2, *angles), manutec).groups[0]
    assert gravity.rank == 2
    assert "p13" in gravity.poorly_identifiable
    assert "p5" not in gravity.poorly_identifiable


def test_the_answer_is_rendered_with_costs_and_gains(
    small_plan: Plan, manutec: Robot, capsys: pytest.CaptureFixture[str]
) -> None:
    cycle = BusCycle(0.000864, 1_000_000, "SYNC and six TPDOs", 0.7)
    render(dry_run(small_plan, manutec, cycle), manutec)
    text = capsys.readouterr().out
    for words in (
        "bus load 21.6%",
        "total",
        "off-diagonal",
        "poorly identifiable in gravity: gravity of axis 2 (p5), gravity of axis 3 (p8),",
    ):
        assert words in text


def test_axes_that_move_too_seldom_for_a_law_of_friction_are_named(
    small_plan: Plan, manutec: Robot, capsys: pytest.CaptureFixture[str]
) -> None:
    once = next(m for m in small_plan.measurements if m.kind == "inertia")
    plan = small_plan.model_copy(update={"measurements": (once,)})
    found = dry_run(plan, manutec)
    assert found.without_law == {axis: int(axis == once.index) for axis in range(6)}
    render(found, manutec)
    said = f"axis {once.axis}: 1 measurement planned, a friction law needs 3"
    assert said in capsys.readouterr().out
