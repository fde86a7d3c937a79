"""Joint identification of a robot's runs, and their use for the next plan."""

import shutil
from functools import partial

import numpy as np
import pytest
from small_run import NOISE, identified_model, write_run

from hil import cli
from hil.errors import Mismatch
from hil.model.robot import parse_robot
from hil.planning.design import by_minutes
from hil.planning.design.candidates import pool
from hil.planning.plan import load_plan
from hil.results.identification import experience, identify
from hil.runs.pooling import open_runs, pooled
from hil.runs.run import Run
from hil.runs.run_folder import RunFolder


@pytest.fixture(scope="module")
def run(manutec, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("pool") / "first", manutec).path


@pytest.fixture(scope="module")
def again(run):
    """Return the same recordings under another name."""
    return shutil.copytree(run, run.parent / "second")


@pytest.fixture
def hil(capsys, monkeypatch, wide_console):
    monkeypatch.setattr(by_minutes, "pool", partial(pool, each=6))

    def call(*arguments):
        with pytest.raises(SystemExit) as left:
            cli.main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return int(left.value.code or 0), printed.out, printed.err

    return call


def test_two_runs_are_one_campaign_in_which_time_goes_on_and_ids_differ(run, again):
    found = list(pooled(open_runs([run, again])))
    ids = [measurement.id for measurement, _ in found]
    assert len(set(ids)) == len(ids) == 78
    assert ids[39:] == [f"{name}.2" for name in ids[:39]]
    begins = [float(recording.time[0]) for _, recording in found]
    assert begins == sorted(begins)


@pytest.fixture(scope="module")
def together(run, again):
    return identify(Run.open(run), others=[Run.open(again)])


@pytest.mark.long
def test_the_same_recordings_twice_give_the_same_model_surer(together):
    """Errors decrease at least by the root of two: with few measurements the jackknife is
    conservative.

    Only p14 shows the gear of axis 6, which counts as elastic here; its uncertainty by sampling
    does not average out.
    """
    alone = identified_model()
    assert together.values == pytest.approx(alone.values, rel=1e-3, abs=1e-3)
    ratio = np.sqrt(np.diag(alone.covariance) / np.diag(together.covariance))
    assert ratio[:-1].min() > 0.95 * np.sqrt(2)
    assert ratio[-1] > 1.1


def test_the_model_says_which_runs_it_was_made_from(again, together):
    origin = together.provenance
    assert origin.together_with == (str(again),)
    assert origin.measurements == len(together.local) == 78


def test_runs_of_another_robot_file_are_refused(run, manutec, tmp_path):
    changed = parse_robot(manutec.text.replace("torque_limit: 75", "torque_limit: 76"), "mine.yaml")
    plan = (run / "plan.yaml").read_text().replace(manutec.digest, changed.digest)
    (tmp_path / "plan.yaml").write_text(plan)
    RunFolder.create(tmp_path / "other", load_plan(tmp_path / "plan.yaml"), changed)
    with pytest.raises(Mismatch, match=r"another robot file than .* only runs of one robot"):
        open_runs([run, tmp_path / "other"])


def test_a_run_named_twice_is_refused(run):
    with pytest.raises(Mismatch, match="is named twice"):
        open_runs([run, run.parent / "." / run.name])


def test_a_run_shows_its_torque_noise(run, manutec):
    noise, *_ = experience(open_runs([run]))
    share = noise.torque / manutec.torque_limit
    assert share == pytest.approx(NOISE, rel=0.25)
    assert np.median(share) == pytest.approx(NOISE, rel=0.1)


def test_a_dry_run_predicts_from_an_earlier_run(hil, run):
    status, out, _ = hil("dry-run", run / "plan.yaml", "--noise-from", run)
    assert status == 0
    assert "noise as in an earlier run" in out
    status, out, _ = hil("dry-run", run / "plan.yaml")
    assert status == 0
    assert "expected noise: torque 0.25% of the torque limit" in out


def test_refining_states_the_deviations_now_and_then(hil, run, tmp_path):
    path = tmp_path / "next.yaml"
    status, out, err = hil("plan", "--refine", run, "--minutes", "2", "-o", path)
    assert (status, err) == (0, "")
    assert "then / now" in out
    planned = load_plan(path, RunFolder.open(run).robot)
    assert planned.measurements
    assert not {m.id for m in planned.measurements} & {
        m.id for m in RunFolder.open(run).plan.measurements
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give either a robot, or a run with --refine"),
        (("manutec-r15", "--minutes", "20", "--gravity", "9"), "omit them with"),
        (("manutec-r15", "--refine", "runs/x"), "give either a robot"),
        (("--refine", "runs/x", "--with-trajectories"), "--with-trajectories cannot be used with"),
        (("manutec-r15", "--with-trajectories"), "--with-trajectories needs --minutes"),
        (
            ("manutec-r15", "--minutes", 9, "--distinguish", "load,joint offset"),
            "--distinguish extends a plan by counts",
        ),
        (("--refine", "runs/x", "--warm-up", "60"), "--refine takes workspace and noise from the"),
        (("manutec-r15", "--noise-from", "runs/x"), "a plan by counts uses no noise"),
    ],
)
def test_options_that_contradict_each_other_are_refused(hil, tmp_path, arguments, message):
    status, _, err = hil("plan", *arguments, "-o", tmp_path / "plan.yaml")
    assert status == 2
    assert message in " ".join(err.replace("│", " ").split())


def test_too_few_minutes_are_refused_in_one_line(hil, tmp_path):
    status, _, err = hil("plan", "manutec-r15", "--minutes", "1", "-o", tmp_path / "plan.yaml")
    assert status == 1
    assert err.startswith("manutec-r15: 1 minutes for measurements must be at least")
