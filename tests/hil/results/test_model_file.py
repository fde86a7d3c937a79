"""model.yaml: what `identify` writes is what it found, and can be used and judged without it."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from small_run import SIMULATED, write_run
from synthetic import TABLE_3_A

from checked_files.yaml_file import FileError
from hil.model.base_parameters import base_parameters
from hil.results.model_file import NAME, identify, load_model, recorded
from hil.runs.run_folder import RunFolder


@pytest.fixture(scope="module")
def run(manutec, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("model") / "run", manutec).path


@pytest.fixture(scope="module")
def found(run):
    return identify(run)


@pytest.fixture
def copy(run, tmp_path):
    """The run as it was before it was identified, to be changed."""
    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / NAME).unlink(missing_ok=True)
    return tmp_path / "run"


@pytest.fixture
def model(found, run):
    return load_model(run)


def test_the_file_holds_what_identify_returned(found, model):
    assert np.array_equal(model.p, found.p)
    assert [p.standard_error for p in model.parameters] == found.standard_error.tolist()
    assert model.condition == found.condition


def test_the_parameters_are_those_of_the_machine(model):
    assert np.linalg.norm(model.p - TABLE_3_A) < 1e-3 * np.linalg.norm(TABLE_3_A)


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
    assert (origin.bus, origin.method, origin.measurements) == (SIMULATED, "improved", 39)
    assert origin.left_out == ()


def test_identifying_again_gives_the_same_parameters(run, found):
    assert np.array_equal(identify(run).p, found.p)


def test_the_printed_method_says_so(copy):
    assert identify(copy, "printed").method == "printed"
    assert load_model(copy).provenance.method == "printed"


def test_without_model_the_remedy_is_named(copy):
    with pytest.raises(FileError, match="not there yet; make it with: hil identify"):
        load_model(copy)


def test_a_damaged_model_is_refused_with_its_line(copy):
    identify(copy)
    (copy / NAME).write_text((copy / NAME).read_text().replace("format: 1", "format: 7"))
    with pytest.raises(FileError, match=r"model\.yaml:1: format"):
        load_model(copy)


def test_a_run_without_couplings_is_refused_by_the_parameter_s_name(copy):
    for path in (copy / "recordings").glob("c*.h5"):
        path.unlink()
    with pytest.raises(FileError, match=r"run: 0 usable coupling measurements .* p3 "):
        identify(copy)
    assert not (copy / NAME).exists()


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(FileError, match=r"is no run folder; make one with: hil run"):
        identify(tmp_path / "nothing")


def test_time_goes_on_from_one_session_to_the_next(run):
    first, second = list(RunFolder.open(run))[:2]
    earlier = second.recording.time - second.recording.time[0]
    begun_anew = replace(second, recording=replace(second.recording, time=earlier), session=1)
    (_, one), (_, two) = recorded([first, begun_anew])
    assert one.time[0] == first.recording.time[0]
    assert two.time[0] == one.time[-1]
