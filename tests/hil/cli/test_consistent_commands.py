"""`hil identify --consistent` and `hil export --to urdf`: bodies, their cost, and refusals."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run

from hil.model.dynamics import inverse_dynamics
from hil.results.identification import identify
from hil.results.model import Model
from hil.runs.run import Run

if TYPE_CHECKING:
    from command_line import Hil

TOO_LIGHT = "2:0.5:2"
"""Mass in kg; link 2 of `arm` has s^2 / Izz = 3.4 kg at least."""


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    robot = arm()
    folder = tmp_path_factory.mktemp("bodies") / "run"
    return write_free_run(folder, robot, recorded(robot, TRUTH, n=2)).path


@pytest.fixture
def folder(measured: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(measured, tmp_path / "run"))


@pytest.fixture(scope="module")
def identified(measured: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = Path(shutil.copytree(measured, tmp_path_factory.mktemp("identified") / "run"))
    identify(Run.open(folder)).save(folder / "model.yaml")
    return folder


def test_identify_keeps_bodies_beside_the_estimate(hil: Hil, folder: Path) -> None:
    status, shown, _ = hil("identify", folder, "--consistent")
    assert status == 0
    assert "Nearest physically consistent robot" in shown
    assert "are physically consistent" in shown
    model = Model.load(folder)
    assert model.consistent is not None
    np.testing.assert_allclose(model.consistent.p, model.values, rtol=1e-6)
    assert len(model.consistent.torque) == 2


def test_without_the_option_no_bodies_are_found(hil: Hil, folder: Path) -> None:
    _, shown, _ = hil("identify", folder)
    assert "physically consistent" not in shown
    assert Model.load(folder).consistent is None


def test_what_binds_what_it_costs_and_what_the_data_say_against_it_is_shown_and_reported(
    hil: Hil, folder: Path
) -> None:
    _, shown, _ = hil("identify", folder, "--consistent", "--mass", TOO_LIGHT)
    model = Model.load(folder)
    found = model.consistent
    assert found is not None
    assert found.masses == {2: (0.5, 2.0)}
    assert {each.name for each in found.binding} == {"link 2", "greatest mass of link 2"}
    assert found.contradicted
    assert np.abs(found.change).max() > 1.0
    assert max(each.change / each.standard_error for each in found.torque) > 1.0
    for words in (
        "active conditions",
        "greatest mass of link 2",
        "the data contradict physical consistency",
    ):
        assert words in " ".join(shown.split())
    assert np.abs(model.values - found.p).max() > 0.1
    assert hil("report", folder)[0] == 0
    report = (folder / "report.html").read_text()
    assert "Nearest physically consistent robot" in report
    assert "Change of torque by physical consistency" in report


def test_what_bodies_cost_is_the_change_of_the_torques_over_the_recorded_motion(
    hil: Hil, folder: Path
) -> None:
    hil("identify", folder, "--mass", TOO_LIGHT)
    model, changes = Model.load(folder), []
    assert model.consistent is not None
    for each in Run.open(folder):
        q, period = each.recording.q, float(np.diff(each.recording.time)[0])
        qd = np.gradient(q, period, axis=0)
        motion = q, qd, np.gradient(qd, period, axis=0)
        torques = (
            inverse_dynamics(model.robot, p, *motion) for p in (model.consistent.p, model.values)
        )
        changes.append(np.subtract(*torques))
    size = np.sqrt(np.mean(np.vstack(changes) ** 2, axis=0))
    stated = [each.change for each in model.consistent.torque]
    np.testing.assert_allclose(stated, size, rtol=0.1)


def test_export_finds_bodies_and_states_what_they_cost(
    hil: Hil, identified: Path, tmp_path: Path
) -> None:
    status, shown, _ = hil(
        "export", identified, "--to", "urdf", "-o", tmp_path, "--mass", TOO_LIGHT
    )
    assert status == 0
    text = (tmp_path / "arm.urdf").read_text()
    assert "active conditions" in text
    assert "torques change, rms over the run's motions: axis 1" in text
    assert "no validation passed" in text
    assert "no validation passed" in shown
    assert Model.load(identified).consistent is None


def test_export_takes_the_bodies_that_identify_kept(hil: Hil, folder: Path, tmp_path: Path) -> None:
    hil("identify", folder, "--consistent", "--mass", "2:3.5:5")
    hil("export", folder / "model.yaml", "--to", "mjcf", "-o", tmp_path)
    kept = Model.load(folder).consistent
    assert kept is not None
    assert f'mass="{kept.links[1].parameters[9]!r}"' in (tmp_path / "arm.xml").read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--to", "urdf", "--mass", "2:5:3"),
            "mass of link 2: 5 to 3 kg must be positive and ascending",
        ),
        (("--to", "urdf", "--mass", "light"), "light must be LINK:MIN:MAX"),
        (("--to", "urdf", "--mass", "9:1:2"), "bounds of link 9: arm has links 1 to 2"),
        (
            ("--to", "urdf", "--urdf", "examples/pan_tilt/head.urdf"),
            "no chain of 2 joints has the frames of arm",
        ),
        (("--to", "json", "--mass", "1:2:3"), "use them with urdf and mjcf"),
        (("--to", "sdf"), "unknown format; available: .*ros2, urdf, mjcf, ranges"),
    ],
)
def test_wrong_values_are_refused_before_anything_is_written(
    hil: Hil, identified: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    status, shown, errors = hil("export", identified, *options, "-o", tmp_path / "out")
    assert status != 0
    assert re.search(message, " ".join((shown + errors).replace("│", " ").split()))
    assert not (tmp_path / "out").exists()
