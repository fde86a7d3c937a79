"""A report states friction of the last `hil friction`: by the same model, with its bound."""

import shutil

import numpy as np
import pytest
from small_run import SIMULATED, identified_run
from synthetic import TABLE_3_A, Friction, record

from hil.commands.friction import fit_friction, write_friction
from hil.planning.design.friction import sweep
from hil.report.reported_run import MODEL_LEFT_OUT, friction_of_run
from hil.runs.pooling import recorded
from hil.runs.recording_file import Measured
from hil.runs.run_folder import RunFolder

LOADED = 1
"""Index of an axis with gravity: without a model its symmetry cannot be tested."""
BOUND = 0.31


@pytest.fixture(scope="module")
def runs_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def model_folder(runs_folder):
    return identified_run(runs_folder / "identified")


@pytest.fixture
def run(manutec, runs_folder, tmp_path):
    """Sweep of one axis with different friction in either direction."""
    plan = sweep(manutec, [LOADED], speeds=6, slowest=0.02)
    folder = RunFolder.create(runs_folder / tmp_path.name, plan, manutec)
    uneven, begin = Friction(offset=np.array([1.0, -2.0, 0.5, 0.3, -0.2, 0.1])), 0.0
    with folder.session(SIMULATED) as session:
        for m in plan.measurements:
            recording = record(manutec, m, TABLE_3_A, uneven, begin=begin)
            folder.write(Measured(m, recording, session=session))
            begin = float(recording.time[-1]) + 1.0
    return folder


def test_gravity_is_compensated_by_the_model_of_the_fit_and_its_bound_is_kept(run, model_folder):
    write_friction(run, fit_friction(run, model_folder, BOUND))
    found = friction_of_run(run, list(recorded(run)))
    assert found.model_folder == str(model_folder)
    assert {axis: test.bound for axis, test in found.symmetry.items()} == {LOADED: BOUND}


def test_without_a_fit_half_differences_compensate_gravity(run):
    found = friction_of_run(run, list(recorded(run)))
    assert found.model_folder is None
    assert not found.symmetry
    assert not found.left_out


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_model_that_is_gone_or_of_a_folder_elsewhere_is_not_followed(
    run, model_folder, tmp_path, elsewhere
):
    """A stranger's friction.yaml brought a model of the user's own folders into a report."""
    named = tmp_path / "own"
    if elsewhere:
        shutil.copytree(model_folder, named)
    write_friction(run, fit_friction(run, model_folder, BOUND))
    kept = (run.path / "friction.yaml").read_text()
    (run.path / "friction.yaml").write_text(kept.replace(str(model_folder), str(named)))
    found = friction_of_run(run, list(recorded(run)))
    assert found.model_folder is None
    assert not found.symmetry
    assert found.left_out[-1] == MODEL_LEFT_OUT
    assert fit_friction(run, named if elsewhere else None).axes  # named by the user
