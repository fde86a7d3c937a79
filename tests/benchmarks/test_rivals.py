"""Results and command of `benchmarks/rivals`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run
from synthetic import TABLE_3_A
from trajectory_run import write_trajectory_run

from benchmarks.rivals import RIVALS
from benchmarks.rivals.__main__ import main
from benchmarks.rivals.free_motions import SOLVERS
from hil import cli
from hil.estimation.identify import METHODS, estimate
from hil.estimation.options import DEFAULTS
from hil.results.model import Model

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot


def distance(found: Estimate) -> float:
    return float(np.linalg.norm(found.values - TRUTH) / np.linalg.norm(TRUTH))


@pytest.mark.parametrize("name", SOLVERS)
def test_solvers_for_free_motions_find_the_parameters_and_state_their_errors(name: str) -> None:
    found = RIVALS[name](arm(), recorded(arm(), TRUTH), DEFAULTS)
    assert found.method == name
    assert distance(found) < 1e-3
    assert (np.abs(found.values - TRUTH) < 4 * found.standard_errors).all()
    assert (found.standard_errors > 0).all()


def test_the_robust_method_bears_a_stretch_in_which_somebody_touched_the_arm() -> None:
    robot = arm()
    data = recorded(robot, TRUTH)
    data[1][1].tau[2000:3000] += 30.0
    plain = estimate(robot, data, "weighted least squares")
    assert distance(RIVALS["robust"](robot, data, DEFAULTS)) < 0.5 * distance(plain)


def test_documents_name_rivals_that_there_are() -> None:
    root = Path(__file__).parents[2]
    text = (root / "docs" / "how-to" / "trajectories.md").read_text(encoding="utf-8")
    rows = re.findall(r"(?m)^\| ([^|]+?) \|", text[text.index("python -m benchmarks.rivals") :])
    named = [each for each in rows if each != "name" and not re.search(r" and |each of", each)]
    assert len(named) > 5
    assert set(named) <= set(RIVALS)


def status(program: Callable[[Sequence[str]], None], *arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        program([str(each) for each in arguments])
    return int(left.value.code or 0)


class TestCommand:
    """``python -m benchmarks.rivals`` writes a model file of the usual format."""

    @pytest.fixture(autouse=True)
    def _methods_as_before(self, monkeypatch: pytest.MonkeyPatch, wide_console: None) -> None:
        for name in RIVALS:
            monkeypatch.setitem(METHODS, name, RIVALS[name])
            monkeypatch.delitem(METHODS, name)

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        return write_free_run(tmp_path / "run", arm(), recorded(arm(), TRUTH, n=2)).path

    @pytest.fixture
    def driven(self, tmp_path: Path, manutec: Robot) -> Path:
        return write_trajectory_run(tmp_path / "driven", manutec).path

    def test_it_shows_and_keeps_what_a_rival_finds(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert status(main, folder, "--method", "robust") == 0
        assert "robust method" in capsys.readouterr().out
        assert Model.load(folder).method == "robust"

    def test_a_model_of_trajectories_is_a_model_like_any_other(
        self, driven: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert status(main, driven, "--method", "strongest") == 0
        model = Model.load(driven)
        assert (model.method, model.provenance.measurements, model.local) == ("strongest", 1, ())
        assert np.linalg.norm(model.values - TABLE_3_A) < 0.02 * np.linalg.norm(TABLE_3_A)
        assert np.isfinite(model.interval(0.8)).all()
        shown = capsys.readouterr().out
        assert "1 measurement, strongest method" in shown
        assert "condition number" in shown

    def test_hil_states_where_rivals_are(
        self, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert status(cli.main, "identify", folder, "--method", "robust") == 2
        said = " ".join(capsys.readouterr().err.replace("│", " ").split())
        assert "python -m benchmarks.rivals RUN --method NAME" in said

    @pytest.mark.parametrize(
        ("made", "rival", "default"),
        [("folder", "robust", "free motion"), ("driven", "strongest", "improved")],
    )
    def test_a_report_beside_the_model_of_a_rival_is_of_a_new_estimate(
        self,
        made: str,
        rival: str,
        default: str,
        request: pytest.FixtureRequest,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        run = request.getfixturevalue(made)
        assert status(main, run, "--method", rival) == 0
        for name in RIVALS:
            monkeypatch.delitem(METHODS, name)
        capsys.readouterr()
        assert status(cli.main, "report", run) == 0
        assert "not used, the report shows a new estimate" in capsys.readouterr().out
        assert f"{default} method" in (run / "report.html").read_text()
