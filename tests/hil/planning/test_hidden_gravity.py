"""Parameters without gravity torque are identified by acceleration.

The weight on a vertical prismatic axis is constant, like an offset of its torque.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import Friction, record

from hil.cli.plan_view import render
from hil.errors import NotIdentifiable
from hil.estimation.identify import estimate
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot
from hil.planning.design import by_minutes, candidates
from hil.planning.design.by_counts import LEAST_SHARE, design
from hil.planning.dry_run import dry_run
from hil.planning.prediction.information import predict
from hil.planning.prediction.noise import stated_noise
from hil.results.advice import CampaignResult, advice, error_budget
from hil.results.model import Model
from hil.results.prediction import effect_of_errors
from hil.results.provenance import Provenance

if TYPE_CHECKING:
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan
    from hil.runs.recording import Recording

Recorded = list[tuple["Measurement", "Recording"]]
TRUTH = np.array([40.0, 25.0, 9.0])
UPRIGHT, TILTED = (0.0, 0.0, -9.81), (0.0, 5.0, -8.0)


def gantry(gravity: tuple[float, float, float]) -> Robot:
    """Return a robot with prismatic axes along y, x and -z of the base."""
    turns = [("-pi/2", "pi/2"), ("pi/2", "pi/2"), ("pi/2", "0")]
    return Robot.create(
        "gantry",
        [
            {
                "type": "prismatic",
                "frame": {"alpha": alpha, "theta": theta},
                "q_min": 0.0,
                "q_max": 0.8,
                "velocity_limit": 1.0,
                "acceleration_limit": 20.0,
                "torque_limit": 500.0,
                "drive": {"gear_ratio": 300.0, "rotor_inertia": 1e-4, "torque_constant": 0.5},
            }
            for alpha, theta in turns
        ],
        gravity=gravity,
    )


@pytest.fixture(scope="module")
def robot() -> Robot:
    return gantry(UPRIGHT)


@pytest.fixture(scope="module")
def plan(robot: Robot) -> Plan:
    return design(robot)


def axes(plan: Plan, kind: str) -> list[int]:
    return [m.axis for m in plan.measurements if m.kind == kind]


def only(plan: Plan, keep: object) -> Plan:
    kept = tuple(m for m in plan.measurements if keep(m))
    return plan.model_copy(update={"measurements": kept})


def deviation(robot: Robot, plan: Plan) -> float:
    """Return the predicted standard deviation of the vertical axis's mass after a minute [kg]."""
    found = predict(robot, plan.measurements, 0.004, stated_noise(robot))
    (mass,) = base_parameters(robot).groups["gravity"]
    return float(found.deviation[mass]) * np.sqrt(dry_run(plan, robot).duration / 60)


def test_the_mass_on_a_vertical_axis_is_hidden_from_gravity(robot: Robot) -> None:
    base = base_parameters(robot)
    assert np.flatnonzero(base.dependencies.hidden).tolist() == list(base.groups["gravity"])


def test_gravity_that_varies_hides_nothing(manutec: Robot) -> None:
    base = base_parameters(manutec)
    assert not base.dependencies.hidden.any()
    assert base.dependencies.sought() == base.groups


def test_on_a_slope_the_masses_on_all_axes_that_it_tilts_are_hidden() -> None:
    tilted = base_parameters(gantry(TILTED))
    assert tilted.groups["gravity"] == (0, 1, 2)
    assert tilted.dependencies.hidden.all()


def test_the_vertical_axis_is_accelerated_and_its_gravity_is_hardly_measured(plan: Plan) -> None:
    assert axes(plan, "gravity") == [3] * LEAST_SHARE
    assert axes(plan, "inertia").count(3) > 10


def test_as_many_gravity_measurements_as_asked_for(robot: Robot) -> None:
    assert len(axes(design(robot, {"gravity": 20}), "gravity")) == 20


def test_a_minute_says_ten_times_as_much_as_gravity_did(robot: Robot, plan: Plan) -> None:
    blind = only(design(robot, {"gravity": 56}), lambda m: m.kind == "gravity" or m.axis < 3)
    assert deviation(robot, plan) < deviation(robot, blind) / 10


def test_a_plan_by_minutes_accelerates_it_too(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(by_minutes, "pool", lambda *given: candidates.pool(*given, each=12))
    plan = by_minutes.design_within(robot, 4.0, stated_noise(robot))
    assert axes(plan, "inertia").count(3) > axes(plan, "gravity").count(3)


def test_the_dry_run_says_so(robot: Robot, plan: Plan, capsys: pytest.CaptureFixture[str]) -> None:
    render(dry_run(plan, robot), robot)
    said = "(p3): distinguished from an offset or from one another only"
    assert said in capsys.readouterr().out


def test_without_its_acceleration_its_mass_is_not_identifiable(robot: Robot, plan: Plan) -> None:
    groups = dry_run(only(plan, lambda m: m.kind == "gravity"), robot).groups
    gravity = next(group for group in groups if group.group == "gravity")
    assert not gravity.complete
    assert gravity.poorly_identifiable == ("p3",)


@pytest.fixture(scope="module")
def recorded(robot: Robot) -> Recorded:
    """Return a small campaign; every torque has an offset."""
    friction = Friction(12.0, 4.0, 3.0, offset=np.array([5.0, -8.0, 20.0]))
    rng = np.random.default_rng(3)
    return [
        (m, record(robot, m, TRUTH, friction, noise=0.001, rng=rng))
        for m in design(robot, {"inertia": 24}).measurements
    ]


def test_an_offset_of_the_torque_does_not_count_as_mass(robot: Robot, recorded: Recorded) -> None:
    found = estimate(robot, recorded)
    assert found.values == pytest.approx(TRUTH, rel=0.005)


def test_without_its_acceleration_an_estimate_is_refused(robot: Robot, recorded: Recorded) -> None:
    blind = [(m, r) for m, r in recorded if m.kind == "gravity" or m.axis < 3]
    with pytest.raises(
        NotIdentifiable, match=r"gravity measurements do not identify p3: the condition .* 1e\+04"
    ):
        estimate(robot, blind)


def test_advice_for_a_hidden_mass_is_more_acceleration(
    robot: Robot, plan: Plan, recorded: Recorded
) -> None:
    found = estimate(robot, recorded)
    uncertain = replace(found, scatter_covariance=np.diag([0.0, 0.0, 2.0**2]))
    where = Provenance(
        robot=robot.name, robot_digest="", plan_digest="", measured="", bus="", measurements=1,
        left_out=(), identified="", method=found.method, version="",
    )  # fmt: skip
    model = Model(**vars(uncertain), provenance=where, error_budget=error_budget(uncertain))
    judged = CampaignResult(model, effect_of_errors(uncertain), plan, [])
    advised = {item.subject: item.remedy for item in advice(judged)}
    (hidden,) = (remedy for subject, remedy in advised.items() if "(p3)" in subject)
    assert "add inertia measurements of axis 3" in hidden
    assert not any("gravity measurements" in remedy for remedy in advised.values())
