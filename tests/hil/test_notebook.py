"""`import hil`: public names, and correctness of the documented examples."""

import dataclasses
import doctest
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from small_run import identified_model, write_run

import hil
from hil.planning.design.friction import sweep

ROOT = Path(__file__).parents[2]
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.fixture(scope="module")
def place(manutec, tmp_path_factory):
    """Folder with runs of the manutec-r15 and of the pan-tilt head, and the repository's examples.

    `runs/first` is a small run with its model, `runs/friction` also has friction measurements.
    `runs/head` is imported, with its model; `runs/other` is held out, and `runs/loaded` is the
    same motion with 1 kg at a distance of 0.1 m from the tilt axis.
    """
    folder = tmp_path_factory.mktemp("notebook")
    (folder / "examples").symlink_to(ROOT / "examples")
    (runs := folder / "runs").mkdir()
    write_run(runs / "first", manutec)
    identified_model().save(runs / "first" / "model.yaml")
    write_run(runs / "friction", manutec, more=sweep(manutec, [5]).measurements)
    head, _ = (
        hil.import_recordings([ROOT / "examples" / "pan_tilt" / f"{recorded}.yaml"], runs / name)
        for name, recorded in (("head", "excitation"), ("other", "other"))
    )
    hil.identify(head).save(runs / "head" / "model.yaml")
    head.mapped(carrying_a_load).save(runs / "loaded")
    return folder


def carrying_a_load(measured):
    """Return the recording of the pan-tilt head with the torque of a load added."""
    recording = measured.recording
    qd = np.gradient(recording.q, recording.time, axis=0)
    qdd = np.gradient(qd, recording.time, axis=0)
    robot = hil.Robot.load(ROOT / "examples" / "pan_tilt" / "head.urdf")
    load = [0, 0.01, 0, 0, 0, 0.01, 0, 0.1]
    torque = hil.regressor(robot, recording.q, qd, qdd) @ load
    return dataclasses.replace(recording, tau=recording.tau + torque)


def documented_names():
    """Return the functions and classes on the page of public names, with their modules."""
    page = (ROOT / "docs" / "reference" / "python.md").read_text()
    names = re.findall(r"^\.\. auto(?:function|class):: (\S+)", page, re.MULTILINE)
    return [name if name.startswith("hil.") else f"hil.{name}" for name in names]


def refuse_differences(test):
    differences = []
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    assert not runner.run(test, out=differences.append).failed, "".join(differences)


@pytest.mark.parametrize("name", ["README.md", "docs/how-to/notebook.md"])
def test_the_examples_of_documents_do_what_they_say(name, place, monkeypatch):
    monkeypatch.chdir(ROOT if name == "README.md" else place)
    blocks = re.findall(r"```pycon\n(.*?)```", (ROOT / name).read_text(), re.DOTALL)
    assert blocks
    refuse_differences(doctest.DocTestParser().get_doctest("\n".join(blocks), {}, name, name, 0))


@pytest.mark.parametrize("name", ["hil.errors", *documented_names()])
def test_the_examples_of_docstrings_do_what_they_say(name, place, monkeypatch):
    monkeypatch.chdir(place)
    found = [
        test for test in doctest.DocTestFinder().find(pydoc.locate(name), name) if test.examples
    ]
    assert name in [test.name for test in found]
    for test in found:
        test.globs = {"hil": hil, "np": np}
        refuse_differences(test)


def test_dir_lists_the_api_and_every_name_of_it_has_a_docstring():
    assert set(dir(hil)) >= {"Robot", "Run", "Model", "identify", "errors"}
    for name in dir(hil):
        assert getattr(hil, name).__doc__, name


def test_a_name_that_is_not_offered_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'load_robot'"):
        _ = hil.load_robot


def test_importing_hil_loads_no_numerics():
    code = "import hil, sys; dir(hil); sys.exit('numpy' in sys.modules or 'scipy' in sys.modules)"
    ended = subprocess.run([sys.executable, "-c", code], check=False)  # noqa: S603 - our own code
    assert ended.returncode == 0


class TestRobotOfValues:
    def test_it_is_the_robot_of_the_same_file(self, manutec):
        content = manutec.file.model_dump(exclude_none=True)
        same = hil.Robot.create(**content)
        assert same == manutec
        assert hil.Robot.create(**same.file.model_dump(exclude_none=True)).text == same.text

    def test_a_tie_to_an_absent_parameter_is_refused(self, manutec):
        content = manutec.file.model_dump(exclude_none=True) | {"ties": ("Iyy6 = Ixx9",)}
        with pytest.raises(hil.errors.InvalidValue, match=r"ties\.0: Ixx9 is not present"):
            hil.Robot.create(**content)


class TestRecording:
    def test_an_unknown_measurement_lists_those_recorded(self, place):
        run = hil.Run.open(place / "runs" / "first")
        with pytest.raises(hil.errors.UnknownName, match="no recording of 'x1'; recorded are g01"):
            run["x1"]

    def test_its_table_has_a_column_a_joint_with_its_unit(self, place):
        pytest.importorskip("pandas")
        recording = hil.Run.open(place / "runs" / "first")["g01"].recording
        table = recording.dataframe()
        assert np.array_equal(table["tau6"], recording.tau[:, 5])
        assert table.attrs["units"]["tau6"] == "N m"
        assert len(table.columns) == 3 + 3 * 6

    def test_the_table_of_a_run_is_indexed_by_measurement(self, place):
        pytest.importorskip("pandas")
        run = hil.Run.open(place / "runs" / "first")
        table = run.dataframe()
        assert tuple(table.index.unique("measurement")) == run.ids
        assert np.array_equal(table.loc["i03"]["q2"], run["i03"].recording.q[:, 1])


@pytest.mark.parametrize("files", [("__init__.py",), ("notes.txt",)])
def test_a_folder_that_hides_a_package_of_ours_is_named(tmp_path, files):
    (tmp_path / "drivers").mkdir()
    for name in files:
        (tmp_path / "drivers" / name).touch()
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import hil; hil.Run"
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    hidden = f"ImportError: {tmp_path / 'drivers'} shadows the package drivers"
    assert hidden in done.stderr or (files != ("__init__.py",) and not done.stderr)
