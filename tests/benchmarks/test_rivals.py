"""`benchmarks/rivals`: what they find, and the command that takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run

from benchmarks.rivals import RIVALS
from benchmarks.rivals.__main__ import main
from benchmarks.rivals.free_motions import SOLVERS
from hil import cli
from hil.estimation.identify import METHODS, estimate
from hil.results.model import Model

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from hil.estimation.estimate import Estimate


def distance(found: Estimate) -> float:
    return float(np.linalg.norm(found.p - TRUTH) / np.linalg.norm(TRUTH))


@pytest.mark.parametrize("name", SOLVERS)
def test_solvers_for_free_motions_find_the_parameters_and_state_their_errors(name: str) -> None:
    found = RIVALS[name](arm(), recorded(arm(), TRUTH))
    assert found.method == name
    assert distance(found) < 1e-3
    assert (np.abs(found.p - TRUTH) < 4 * found.standard_error).all()
    assert (found.standard_error > 0).all()


def test_the_robust_method_bears_a_stretch_in_which_somebody_touched_the_arm() -> None:
    robot = arm()
    data = recorded(robot, TRUTH)
    data[1][1].tau[2000:3000] += 30.0
    plain = estimate(robot, data, "weighted least squares")
    assert distance(RIVALS["robust"](robot, data)) < 0.5 * distance(plain)


def status(program: Callable[[Sequence[str]], None], *arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        program([str(each) for each in arguments])
    return int(left.value.code or 0)


class TestCommand:
    """``python -m benchmarks.rivals`` writes a model like any other."""

    @pytest.fixture(autouse=True)
    def _methods_as_before(self, monkeypatch: pytest.MonkeyPatch, wide_console: None) -> None:
        for name in RIVALS:
            monkeypatch.setitem(METHODS, name, RIVALS[name])
            monkeypatch.delitem(METHODS, name)

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        return write_free_run(tmp_path / "run", arm(), recorded(arm(), TRUTH, n=2)).path

    def test_it_shows_and_keeps_what_a_rival_finds(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert status(main, folder, "--method", "robust") == 0
        assert "robust method" in capsys.readouterr().out
        assert Model.load(folder).method == "robust"

    def test_hil_states_where_rivals_are(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert status(cli.main, "identify", folder, "--method", "robust") == 2
        said = " ".join(capsys.readouterr().err.replace("│", " ").split())
        assert "python -m benchmarks.rivals RUN --method NAME" in said

    def test_a_report_of_a_run_that_a_rival_was_made_of_is_of_a_new_estimate(
        self, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert status(main, folder, "--method", "robust") == 0
        for name in RIVALS:
            monkeypatch.delitem(METHODS, name)
        assert status(cli.main, "report", folder) == 0
        assert "not used, the report is of a new estimate" in capsys.readouterr().out
        assert "free motion method" in (folder / "report.html").read_text()
