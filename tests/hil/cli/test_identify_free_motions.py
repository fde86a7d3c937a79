"""`hil identify` on imported recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import free_run
import pytest
from free_run import TRUTH, arm, recorded, some_motion, write_free_run
from stroke_run import campaign
from urdf_robots import ROBOTS, urdf

from hil.estimation.prior import Prior
from hil.export.urdf_file import bodies_of, given_urdf
from hil.model.robot import Robot
from hil.results.model import Model

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil
    from free_run import Array


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    robot = arm()
    return write_free_run(tmp_path / "run", robot, recorded(robot, TRUTH, n=2)).path


def test_the_method_is_chosen_by_what_was_recorded_and_stated(hil: Hil, folder: Path) -> None:
    status, shown, _ = hil("identify", folder)
    assert status == 0
    assert "free motion method: all recordings are imported" in shown
    assert "rms, N m " in shown
    assert "N m or N" not in shown
    assert "Friction" in shown
    assert "Residual torque of the fit, all samples" in shown
    assert (folder / "model.yaml").exists()


def test_another_method_is_taken_where_it_is_named(hil: Hil, folder: Path) -> None:
    status, shown, _ = hil("identify", folder, "--method", "least squares")
    assert status == 0
    assert "least squares method" in shown
    assert "free motion method" not in shown


def test_strokes_of_one_axis_at_a_time_have_a_method_of_their_own(hil: Hil, tmp_path: Path) -> None:
    robot = arm()
    run = write_free_run(tmp_path / "strokes", robot, campaign(robot, TRUTH, pairs=2))
    status, shown, _ = hil("identify", run.path)
    assert status == 0
    assert "back and forth method: all recordings are strokes of a single axis" in shown
    assert "Friction over the speed" in shown
    assert "friction: any odd function of the velocity" in shown


@pytest.fixture
def half_still(tmp_path: Path) -> tuple[Path, Path]:
    """Recordings with axis 1 of a pan-tilt head at rest, and the head's URDF with inertials."""
    stated = tmp_path / "head.urdf"
    stated.write_text(urdf("pan-tilt", ROBOTS["pan-tilt"]))
    robot = Robot.load(stated)
    bodies = bodies_of(given_urdf(stated, robot), robot)
    assert bodies is not None
    truth = Prior(bodies, 0.3).predict(robot)[0]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(free_run, "some_motion", lambda *given: _held(some_motion(*given)))
        data = recorded(robot, truth, n=2, noise=0.02)
    return write_free_run(tmp_path / "run", robot, data).path, stated


def _held(motion: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    for x in motion:
        x[:, 0] = 0.0
    return motion


def test_a_urdfs_inertials_complete_what_the_motion_does_not_excite(
    hil: Hil, half_still: tuple[Path, Path]
) -> None:
    folder, stated = half_still
    status, alone, _ = hil("identify", folder)
    assert status == 0
    assert "not identified" in alone
    assert Model.load(folder / "model.yaml").details.not_identified
    _, shown, _ = hil("identify", folder, "--prior", "cad=0.3", "--urdf", stated)
    words = " ".join(shown.split())
    assert "(prior): not identified by the recordings, taken from the inertials of" in words
    assert "head.urdf" in words
    model = Model.load(folder / "model.yaml")
    assert model.prior is not None
    assert model.prior.relative == 0.3
    assert set(model.prior.replaced) < set(model.names)


def test_a_prior_of_inertials_that_no_body_has_is_refused_by_line_and_link(
    hil: Hil, half_still: tuple[Path, Path]
) -> None:
    folder, stated = half_still
    stated.write_text(stated.read_text().replace('ixx="0.2"', 'ixx="-0.2"'))
    status, _, refused = hil("identify", folder, "--prior", "cad=0.3", "--urdf", stated)
    assert status != 0
    assert "head.urdf:3: link 'link1': principal moments of inertia" in refused
    assert "head.urdf:5: link 'link2': principal moments of inertia" in refused


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("--prior", "cad=0.3"), "give both --prior and --urdf, or neither"),
        (("--prior", "cad=30", "--urdf", "head.urdf"), "must be cad=SHARE"),
        (("--prior", "fea=0.3", "--urdf", "head.urdf"), "must be cad=SHARE"),
    ],
)
def test_a_prior_that_says_nothing_is_refused(
    hil: Hil, folder: Path, given: tuple[str, ...], words: str
) -> None:
    status, _, refused = hil("identify", folder, *given)
    assert status != 0
    assert words in " ".join(refused.replace("│", " ").split())
