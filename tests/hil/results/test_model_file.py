"""model.yaml contains the complete result of `identify`, usable without the run."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from small_run import SIMULATED, write_run
from synthetic import TABLE_3_A

from checked_files.yaml_file import FileError, load_yaml
from hil.errors import NotIdentifiable
from hil.model.base_parameters import base_parameters
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.model_file import NAME, ModelFile
from hil.runs.pooling import recorded
from hil.runs.run import Run


@pytest.fixture(scope="module")
def run(manutec, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("model") / "run", manutec).path


def identified(path, method="improved"):
    """Return the model of `hil identify`, and its file in the run's folder."""
    model = identify(Run.open(path), method)
    model.save(path / NAME)
    return model


@pytest.fixture(scope="module")
def found(run):
    return identified(run)


@pytest.fixture
def copy(run, tmp_path):
    """Copy of the run before its identification, to be changed."""
    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / NAME).unlink(missing_ok=True)
    return tmp_path / "run"


@pytest.fixture
def model(found, run):
    return load_yaml(run / NAME, ModelFile)


def test_what_is_read_back_is_the_model_that_was_identified(found, run):
    model = Model.load(run / NAME)
    assert np.array_equal(model.values, found.values)
    assert model.covariance == pytest.approx(found.covariance, rel=1e-12, abs=1e-15)
    assert model.interval(0.8) == pytest.approx(found.interval(0.8), rel=1e-12)
    assert np.array_equal(model.residual, found.residual)
    assert (model.robot, model.provenance) == (found.robot, found.provenance)
    assert model.condition == found.condition


def test_the_parameters_are_those_of_the_machine(found):
    assert np.linalg.norm(found.values - TABLE_3_A) < 1e-3 * np.linalg.norm(TABLE_3_A)


def test_every_parameter_says_what_it_is(manutec, model):
    base = base_parameters(manutec)
    assert tuple(p.name for p in model.parameters) == base.names
    assert tuple(p.expression for p in model.parameters) == base.expressions
    assert tuple(p.unit for p in model.parameters) == base.units
    assert {p.group for p in model.parameters} == set(base.groups)


def test_the_covariance_fits_the_standard_errors_and_intervals(model):
    errors = np.sqrt(np.diag(model.covariance))
    assert errors == pytest.approx([p.standard_error for p in model.parameters])
    for parameter in model.parameters:
        low, high = parameter.interval_95
        assert (low + high) / 2 == pytest.approx(parameter.value)
        assert high - low > 2 * 1.9 * parameter.standard_error


def test_it_says_where_it_comes_from(manutec, model):
    origin = model.provenance
    assert (origin.robot, origin.robot_digest) == (manutec.name, manutec.digest)
    assert (origin.bus, origin.method, origin.measurements) == (str(SIMULATED), "improved", 39)
    assert origin.left_out == ()


def test_identifying_again_gives_the_same_parameters_and_writes_nothing(copy, found):
    assert np.array_equal(identify(Run.open(copy)).values, found.values)
    assert not (copy / NAME).exists()


def test_the_printed_method_says_so(copy):
    assert identified(copy, "published").method == "published"
    assert Model.load(copy).method == "published"


def test_without_model_the_remedy_is_named(copy):
    with pytest.raises(FileError, match="does not exist yet; make it with: hil identify"):
        Model.load(copy)


def test_causes_of_former_versions_have_their_present_names(copy, found):
    found.save(copy / NAME)
    text = (copy / NAME).read_text()
    stated = [each.cause for each in found.excluded.limits]
    assert {"joint offset", "backlash"} <= set(stated)
    former = text.replace('"joint offset"', "zero").replace('"backlash"', "play")
    (copy / NAME).write_text(former)
    assert [each.cause for each in Model.load(copy).excluded.limits] == stated
    (copy / NAME).write_text(text.replace('"joint offset"', "joint"))
    with pytest.raises(FileError, match=r"unknown cause 'joint'; identify the run again"):
        Model.load(copy)


def test_a_damaged_model_is_refused_with_its_line(copy, found):
    found.save(copy / NAME)
    (copy / NAME).write_text((copy / NAME).read_text().replace("format: 1", "format: 7"))
    with pytest.raises(FileError, match=r"model\.yaml:1: format"):
        Model.load(copy)


def test_a_run_without_couplings_is_refused_by_the_parameter_s_name(copy):
    for path in (copy / "recordings").glob("c*.h5"):
        path.unlink()
    with pytest.raises(NotIdentifiable, match=r"run: 0 usable coupling measurements .* p3;"):
        identified(copy)
    assert not (copy / NAME).exists()


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(FileError, match=r"is not a run folder; make one with: hil run"):
        Run.open(tmp_path / "nothing")


def test_time_goes_on_from_one_session_to_the_next(run):
    first, second = list(Run.open(run))[:2]
    earlier = second.recording.time - second.recording.time[0]
    begun_anew = replace(second, recording=replace(second.recording, time=earlier), session=1)
    (_, one), (_, two) = recorded([first, begun_anew])
    assert one.time[0] == first.recording.time[0]
    assert two.time[0] == one.time[-1]
