"""Report of an imported run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from free_run import TRUTH, arm, recorded, write_free_run

from hil.report.page import report

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    robot = arm()
    folder = tmp_path_factory.mktemp("report") / "run"
    run = write_free_run(folder, robot, recorded(robot, TRUTH, n=2))
    return report(run, folder / "figures").read_text()


def test_it_states_parameters_friction_and_what_is_left(text: str) -> None:
    for words in (
        "identified dynamics",
        "Friction",
        "Residual torque of the fit, all samples",
    ):
        assert words in text
    assert "cut-off" in text


def test_it_shows_measured_beside_predicted_torques(text: str) -> None:
    assert 'id="plot-torque"' in text
    assert 'data-r="r0"' in text


def test_figures_are_written_as_files_too(tmp_path: Path) -> None:
    robot = arm()
    run = write_free_run(tmp_path / "run", robot, recorded(robot, TRUTH, n=1))
    report(run, tmp_path / "figures")
    assert (tmp_path / "figures" / "torque.svg").stat().st_size > 1000


def test_an_axis_at_rest_has_a_report_and_a_verdict(tmp_path: Path) -> None:
    data = recorded(arm(), TRUTH, n=2)
    for _, recording in data:
        recording.q[:, 0] = 0.3
    run = write_free_run(tmp_path / "run", arm(), data)
    shown = report(run, tmp_path / "figures").read_text()
    assert "axis 1 does not move in the recordings: " in shown
    assert "(p1), " in shown
    assert "(p3) not identified" in shown
