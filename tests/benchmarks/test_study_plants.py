"""Plant files of a study's scenarios, and campaigns of equal duration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import yaml
from small_study import PLANT, planned, put, small_plans, some_trajectory

from benchmarks.drift_study import campaigns as study_campaigns
from benchmarks.drift_study.campaigns import (
    KINDS,
    PERIOD,
    SLOWEST,
    SPEEDS,
    WARM_UP,
    campaigns,
    duration,
)
from benchmarks.drift_study.scenarios import SCENARIOS, write_plant
from checked_files.yaml_file import FileError
from hil.planning.design.by_counts import design
from hil.planning.design.friction import sweep
from hil.planning.plan import PlannedRobot, load_plan
from hil.planning.prediction.noise import stated_noise
from sim_plant.plant_file import load_plant_file

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.planning.prediction.noise import Noise
    from hil.planning.trajectory import Trajectory


class TestScenarios:
    @pytest.mark.parametrize(
        ("name", "drift", "symmetric", "strength", "load"),
        [
            ("off", False, True, 1.0, 0.0),
            ("on", True, True, 1.0, 0.0),
            ("strong", True, True, 3.0, 0.0),
            ("asymmetric", True, False, 1.0, 0.0),
            ("load", True, False, 1.0, 0.05),
        ],
    )
    def test_the_plant_reads_what_a_scenario_says(
        self, tmp_path: Path, name: str, drift: bool, symmetric: bool, strength: float, load: float
    ) -> None:
        write_plant(SCENARIOS[name], PLANT, tmp_path / "plant.yaml")
        found = load_plant_file(str(tmp_path / "plant.yaml"))
        assert (found.drift, found.symmetric, found.drift_strength) == (drift, symmetric, strength)
        assert {axis.friction.load for axis in found.axes} == {load}

    @pytest.mark.parametrize("name", SCENARIOS)
    def test_all_else_is_as_the_plant_has_it(self, tmp_path: Path, name: str) -> None:
        write_plant(SCENARIOS[name], PLANT, tmp_path / "plant.yaml")
        found, plant = (load_plant_file(str(p)) for p in (tmp_path / "plant.yaml", PLANT))
        changed = {"drift", "symmetric", "drift_strength", "axes"}
        assert found.model_dump(exclude=changed) == plant.model_dump(exclude=changed)
        for axis, other in zip(found.axes, plant.axes, strict=True):
            friction = other.friction.model_copy(update={"load": axis.friction.load})
            assert axis == other.model_copy(update={"friction": friction})

    def test_a_plant_file_that_has_changed_since_is_refused(self, tmp_path: Path) -> None:
        write_plant(SCENARIOS["on"], PLANT, tmp_path / "plant.yaml")
        other = yaml.safe_load((tmp_path / "plant.yaml").read_text())
        other["axes"][0]["link"]["Izz"] *= 1.1
        (tmp_path / "other.yaml").write_text(yaml.safe_dump(other))
        with pytest.raises(FileError, match=r"is another plant than .*folder of its own"):
            write_plant(SCENARIOS["on"], str(tmp_path / "other.yaml"), tmp_path / "plant.yaml")

    def test_what_is_no_plant_file_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "plan.yaml").write_text("measurements: []\n")
        with pytest.raises(FileError, match="is no plant file"):
            write_plant(SCENARIOS["on"], str(tmp_path / "plan.yaml"), tmp_path / "plant.yaml")


class TestCampaigns:
    @pytest.fixture(autouse=True)
    def _quickly_designed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def cheap(robot: Robot, *, name: str) -> Trajectory:
            return some_trajectory(robot, 0, PERIOD).model_copy(update={"id": name})

        def mixed(robot: Robot, minutes: float, _: Noise, **how: bool) -> Plan:
            assert how == {"with_trajectories": True}
            wave = some_trajectory(robot, 0, PERIOD)
            return planned(robot, wave.model_copy(update={"cycles": round(6 * minutes)}))

        monkeypatch.setattr(study_campaigns, "design_trajectory", cheap)
        monkeypatch.setattr(study_campaigns, "design_within", mixed)

    def test_all_take_the_same_time_but_for_a_period(self, manutec: Robot, tmp_path: Path) -> None:
        found = campaigns(manutec, 1.0, tmp_path)
        times = {kind: duration(manutec, plan) for kind, plan in found.items()}
        for kind in KINDS:
            assert times[kind] == pytest.approx(times["two-step"], abs=1.5 * PERIOD)

    @pytest.mark.parametrize(
        ("minutes", "of_sweep"),
        [pytest.param(10.0, True, id="short"), pytest.param(40.0, False, id="long")],
    )
    def test_minutes_are_those_of_every_campaign_and_too_few_leave_the_sweep_out_of_account(
        self,
        manutec: Robot,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        minutes: float,
        of_sweep: bool,
    ) -> None:
        asked: list[tuple[float, bool, str]] = []

        def design_small(
            robot: Robot, wanted: float, noise: Noise, *, with_trajectories: bool = False
        ) -> Plan:
            asked.append((wanted, with_trajectories, noise.source))
            return small_plans(robot)["mixed" if with_trajectories else "two-step"]

        monkeypatch.setattr(study_campaigns, "design_within", design_small)
        found = campaigns(manutec, 1.0, tmp_path, minutes)
        source = stated_noise(manutec).source
        assert asked == [(minutes, False, source), (minutes, True, source)]
        assert found["two-step"] == small_plans(manutec)["two-step"]
        times = {kind: duration(manutec, plan) for kind, plan in found.items()}
        beforehand = duration(manutec, sweep(manutec, speeds=SPEEDS, slowest=SLOWEST))
        beside = beforehand if of_sweep else 0.0
        assert times["trajectory"] == pytest.approx(60 * minutes, abs=1.5 * PERIOD)
        for kind in ("compensated", "warmed"):
            assert times[kind] == pytest.approx(60 * minutes + beside, abs=1.5 * PERIOD)

    def test_only_the_warmed_one_has_a_warm_up(self, manutec: Robot, tmp_path: Path) -> None:
        found = campaigns(manutec, 1.0, tmp_path)
        warm_up = {kind: plan.warm_up and plan.warm_up.duration for kind, plan in found.items()}
        assert warm_up == {**dict.fromkeys(KINDS[:-1]), "warmed": WARM_UP}
        assert found["warmed"].measurements == found["compensated"].measurements

    def test_they_are_kept_and_those_there_are_taken_as_they_are(
        self, manutec: Robot, tmp_path: Path
    ) -> None:
        own = design(manutec, {"gravity": 40, "inertia": 60, "coupling": 6})
        put({"two-step": own}, tmp_path)
        found = campaigns(manutec, 1.0, tmp_path)
        assert load_plan(tmp_path / "two-step.yaml") == found["two-step"] == own
        assert duration(manutec, found["trajectory"]) == pytest.approx(
            duration(manutec, own), abs=1.5 * PERIOD
        )
        assert campaigns(manutec, 1.0, tmp_path) == found

    def test_too_small_a_share_is_refused(self, manutec: Robot, tmp_path: Path) -> None:
        with pytest.raises(
            ValueError, match=r"left for the trajectory .* raise --share or --minutes"
        ):
            campaigns(manutec, 0.1, tmp_path)

    def test_plans_of_another_robot_are_refused(self, manutec: Robot, tmp_path: Path) -> None:
        plans = small_plans(manutec)
        other = plans["trajectory"].model_copy(
            update={"robot": PlannedRobot(name="puma", digest="0" * 64)}
        )
        put(plans | {"trajectory": other}, tmp_path)
        with pytest.raises(FileError, match=r"trajectory\.yaml"):
            campaigns(manutec, 1.0, tmp_path)
