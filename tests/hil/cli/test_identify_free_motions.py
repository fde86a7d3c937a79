"""hil identify on recordings that were imported."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from free_run import TRUTH, arm, recorded, write_free_run
from stroke_run import campaign

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    robot = arm()
    return write_free_run(tmp_path / "run", robot, recorded(robot, TRUTH, n=2)).path


def test_the_method_is_chosen_by_what_was_recorded_and_stated(hil: Hil, folder: Path) -> None:
    status, shown, _ = hil("identify", folder)
    assert status == 0
    assert "free motion method: all recordings are of motions that somebody else chose" in shown
    assert "Friction" in shown
    assert "Torque left by the fit, all samples" in shown
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
    assert "back and forth method: in all recordings one axis moves back and forth by" in shown
    assert "Friction over the speed" in shown
    assert "friction is any odd function of the velocity" in shown
