"""`hil friction` over CANopen frames on the virtual plant: plan, run, laws, gate, report."""

import re

import h5py
import pytest
import yaml

import hil
from hil.cli import main
from hil.planning.design.friction import sweep
from hil.planning.measurement import Friction
from hil.planning.plan import dump_plan

EXERCISE, REST = 3.0, 6.0


def cli(*arguments):
    """Run `hil` with these arguments; return its exit status."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return ended.value.code or 0


@pytest.fixture(scope="module")
def robot():
    return hil.Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def planned(robot):
    """Plan of six short measurements of the last axis; one follows a rest and an exercise."""
    plan = sweep(robot, [5], speeds=6, slowest=0.03)
    first, second, *others = plan.measurements
    history = {"rest": REST, "exercise": EXERCISE}
    quick = [first.model_copy(update={"exercise": None}), second.model_copy(update=history)]
    return plan.model_copy(update={"measurements": (*quick, *others)})


@pytest.fixture(scope="module")
def folder(planned, tmp_path_factory):
    place = tmp_path_factory.mktemp("friction")
    (place / "plan.yaml").write_text(dump_plan(planned))
    assert cli("run", place / "plan.yaml", "-o", place / "run") == 0
    assert cli("friction", place / "run") == 0
    return place / "run"


def test_a_sweep_is_planned_for_the_axes_asked_for(tmp_path, robot):
    assert (
        cli("plan", "manutec-r15", "--kind", "friction", "-o", tmp_path / "p.yaml", "--axis", 2)
        == 0
    )
    plan = yaml.safe_load((tmp_path / "p.yaml").read_text())
    assert {m["axis"] for m in plan["measurements"]} == {2}
    assert {m["kind"] for m in plan["measurements"]} == {"friction"}
    assert cli("dry-run", tmp_path / "p.yaml") == 0


@pytest.mark.parametrize("experiment", ["stops", "operation"])
def test_variance_in_time_is_planned_for_one_axis(tmp_path, capsys, experiment):
    plan = ["plan", "manutec-r15", "--kind", "friction", "-o", tmp_path / "p.yaml"]
    assert cli(*plan, "--experiment", experiment) == 2
    assert "takes one axis" in capsys.readouterr().err
    assert cli(*plan, "--experiment", experiment, "--axis", 2) == 0
    assert cli("dry-run", tmp_path / "p.yaml") == 0


def test_an_axis_that_is_none_is_told(tmp_path, capsys):
    assert (
        cli("plan", "manutec-r15", "--kind", "friction", "-o", tmp_path / "p.yaml", "--axis", 7)
        == 2
    )
    assert "7 must be in 1 ... 6" in capsys.readouterr().err


def test_rest_and_exercise_come_right_before_the_recording(folder, planned):
    def span(measurement):
        with h5py.File(folder / "recordings" / f"{measurement.id}.h5") as file:
            return file["time"][0], file["time"][-1]

    first, second = planned.measurements[:2]
    assert isinstance(second, Friction)
    waited = span(second)[0] - span(first)[1]
    pair = 2 * second.profile(0).duration + 1.0
    assert REST + EXERCISE < waited < REST + EXERCISE + pair + 3.0


def test_models_and_symmetry_of_the_axis_are_in_friction_yaml(folder, robot):
    found = yaml.safe_load((folder / "friction.yaml").read_text())
    (axis,) = found["axes"]
    assert axis["axis"] == 6
    assert axis["models"][0]["kind"] == "linear"
    errors = {model["kind"]: model["held_out_error"] for model in axis["models"]}
    assert errors["cube-root"] < errors["linear"]
    assert axis["symmetry"]["passed"]
    assert axis["symmetry"]["asymmetry"] == pytest.approx(-0.005, abs=0.005)


def test_the_recommended_model_can_be_evaluated(folder, robot):
    from hil.commands.friction import load_friction

    kept = load_friction(hil.Run.open(folder))
    model = kept.model(5)
    assert 20 < model.torque(float(robot.velocity_limit[5])) < 45
    assert kept.model(0) is None


def test_a_report_of_friction_alone_has_its_figures_and_no_links(folder, tmp_path):
    assert cli("report", folder, "--figures", tmp_path / "figures") == 0
    page = (folder / "report.html").read_text()
    assert " rms at held-out speeds" in page.split("<main>")[0]
    assert "held out" in page
    assert re.findall(r'<figure id="plot-([^"]+)"', page) == ["models"]
    assert not re.search(r'(src|href)="(http|//)', page)
    assert {p.name for p in (tmp_path / "figures").iterdir()} == {"models.svg"}


def test_friction_alone_identifies_no_base_parameters(folder, capsys):
    assert cli("identify", folder) == 1
    assert "0 usable measurements of gravity, inertia or coupling" in capsys.readouterr().err


def test_what_is_missing_is_measured_on_resume(folder, planned, capsys):
    (folder / "recordings" / f"{planned.measurements[3].id}.h5").unlink()
    assert cli("run", folder / "plan.yaml", "-o", folder, "--resume") == 0
    assert "1 measurement in" in capsys.readouterr().out


def test_the_gate_lets_symmetric_friction_pass_and_tells_what_it_cannot_judge(
    folder, tmp_path, capsys
):
    assert cli("run", folder / "plan.yaml", "-o", folder, "--resume", "--symmetric", folder) == 0
    assert "symmetry of axis 1, 2, 3, 4, 5 was not tested" in capsys.readouterr().out


def test_the_gate_refuses_an_asymmetry_beyond_the_bound_before_anything_moves(
    folder, tmp_path, capsys
):
    assert cli("friction", folder, "--asymmetry", 0.0001) == 0
    capsys.readouterr()
    gated = ["run", folder / "plan.yaml", "-o", tmp_path / "gated", "--symmetric", folder]
    assert cli(*gated) == 1
    assert "friction differs by direction by more than 0.01 %: axis 6" in capsys.readouterr().err
    assert not (tmp_path / "gated").exists()


def test_a_gate_without_a_fit_names_the_command(folder, tmp_path, capsys):
    (folder / "friction.yaml").unlink()
    gated = ["run", folder / "plan.yaml", "-o", tmp_path / "gated", "--symmetric", folder]
    assert cli(*gated) == 1
    assert "make it with: hil friction" in capsys.readouterr().err
