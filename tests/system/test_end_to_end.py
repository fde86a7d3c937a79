"""Main workflow on the command line: plan, dry run, run, identify, report, compare.

One small campaign over CANopen frames on the virtual plant, drift and asymmetry on. The whole one,
64 + 92 + 9 configurations, is `make demo`.
"""

import re

import h5py
import numpy as np
import pytest
import yaml

import hil
from checked_files.yaml_file import FileError
from hil.cli import main
from hil.estimation.consistent.conditions import sized_bodies
from hil.estimation.excluded.foreseen import foreseen
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison
from hil.ground_truth.true_parameters import find_plant, true_parameters
from hil.planning.prediction.noise import stated_noise
from hil.runs.pooling import recorded

COUNTS = ["--gravity", "8", "--inertia", "20", "--coupling", "2"]

FIRST = 6
"""Measurements repeated with the same seed."""

pytestmark = pytest.mark.long


def cli(*arguments):
    """Run `hil` with these arguments, and check that it exits with status 0."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    assert not ended.value.code


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("campaign")
    cli("plan", "manutec-r15", "-o", place / "plan.yaml", *COUNTS)
    cli("dry-run", place / "plan.yaml")
    cli("run", place / "plan.yaml", "-o", place / "run")
    return place / "run"


@pytest.fixture(scope="module")
def robot():
    return hil.Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def truth(robot):
    return true_parameters(robot, "manutec-r15")


def judged(folder, robot, truth, method):
    return Comparison(estimate(robot, recorded(hil.Run.open(folder)), method), truth)


def test_every_measurement_is_kept_with_its_units_and_no_finding(folder):
    plan = yaml.safe_load((folder / "plan.yaml").read_text())
    files = sorted(path.stem for path in (folder / "recordings").iterdir())
    assert files == sorted(m["id"] for m in plan["measurements"])
    with h5py.File(folder / "recordings" / "g01.h5") as file:
        assert file["q"].shape == file["tau"].shape
        assert file["q"].shape[1] == 6
        assert not np.any(file["flags"])


def test_the_improved_method_finds_the_plant_s_parameters(folder, robot, truth):
    found = judged(folder, robot, truth, "improved")
    assert found.group_error["gravity"] < 0.1e-2
    assert found.group_error["diagonal"] < 0.3e-2
    assert found.group_error["off_diagonal"] < 2e-2
    assert found.mean_torque_error < 0.6e-2
    assert found.inside.sum() >= 11


def test_the_printed_method_finds_them_to_a_few_percent(folder, robot, truth):
    found = judged(folder, robot, truth, "published")
    assert found.group_error["gravity"] < 1e-2
    assert found.group_error["diagonal"] < 5e-2
    assert found.mean_torque_error < 5e-2


def sizes(excluded):
    return {(each.cause, each.axis, each.part): each.size for each in excluded.limits}


def test_what_the_dry_run_says_will_be_excluded_is_what_identify_finds_excluded(folder, robot):
    run = hil.Run.open(folder)
    before = sizes(foreseen(run.planned, robot, stated_noise(robot), sized_bodies(robot)))
    after = sizes(hil.identify(run).excluded)
    both = [cause for cause in after if before[cause] and after[cause]]
    assert len(both) > 40
    times = [np.exp(abs(np.log(before[cause] / after[cause]))) for cause in both]
    assert np.median(times) < 1.5
    torque = {("torque constant", axis, "") for axis in (2, 3)}, ("rotor inertia", 1, "")
    assert all(before[each] < 1.0 for each in torque[0])
    assert before[torque[1]] is after[torque[1]] is None


def test_model_report_and_comparison_can_be_made_again_and_again(folder, capsys):
    for command in ("identify", "report", "identify"):
        cli(command, folder)
    cli("validate", folder, "--truth", "manutec-r15")
    assert "p14" in capsys.readouterr().out
    model = yaml.safe_load((folder / "model.yaml").read_text())
    assert [p["name"] for p in model["parameters"]] == [f"p{k}" for k in range(1, 15)]
    page = (folder / "report.html").read_text()
    assert not re.search(r'(src|href)="(http|//)', page)


def test_the_same_seed_gives_the_same_samples(folder, tmp_path):
    plan = yaml.safe_load((folder / "plan.yaml").read_text())
    begin = plan | {"measurements": plan["measurements"][:FIRST]}
    (tmp_path / "begin.yaml").write_text(yaml.safe_dump(begin, sort_keys=False))
    cli("run", tmp_path / "begin.yaml", "-o", tmp_path / "again", "--bus-option", "seed=1")
    again = sorted((tmp_path / "again" / "recordings").iterdir())
    assert len(again) == FIRST
    for path in again:
        with h5py.File(folder / "recordings" / path.name) as one, h5py.File(path) as two:
            assert np.array_equal(one["tau"][:], two["tau"][:])
            assert np.array_equal(one["q"][:], two["q"][:])


def stop(*_):
    raise FileError("stopped between the slow and the fast stage")


def recordings(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("recordings/*.h5")}


def test_a_load_is_measured_in_minutes_beside_the_run_and_resumed(
    folder, tmp_path, capsys, monkeypatch
):
    plant = tmp_path / "loaded.yaml"
    text = find_plant("manutec-r15").read_text()
    plant.write_text(f"{text}\npayload: {{mass: 10.86, centre: [0, 0, 0.14], Izz: 0.047}}\n")
    measure = ("payload", "measure", "--model", folder, "-o", tmp_path / "load",
               "--channel", plant, "--bus-option", "seed=9", "--minutes", "2")  # fmt: skip
    with monkeypatch.context() as stopped:
        stopped.setattr("hil.planning.design.load.fast_plan", stop)
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in measure])
    assert ended.value.code == 1
    slow = recordings(tmp_path / "load" / "slow")
    assert slow
    assert not (tmp_path / "load" / "fast").exists()
    cli(*measure, "--resume")
    assert recordings(tmp_path / "load" / "slow") == slow
    kept = yaml.safe_load((tmp_path / "load" / "load.yaml").read_text())
    mass = next(each for each in kept["load"] if each["name"] == "mass")
    assert mass["value"] == pytest.approx(10.86, abs=1.5 * mass["half_width"])
    assert mass["half_width"] < 0.1
    assert kept["verdict"][0] in capsys.readouterr().out
