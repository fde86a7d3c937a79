"""Identification and report begin with a verdict, and the most likely cause to check."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run
from small_run import empty_plots

from hil.cli.outputs import say_verdicts
from hil.results.model import Model
from hil.show.outcome import Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


def test_a_good_estimate_begins_with_that_word(hil: Hil, tmp_path: Path) -> None:
    run = write_free_run(tmp_path / "run", arm(), recorded(arm(), TRUTH, n=3, duration=12.0))
    status, out, _ = hil("identify", run.path)
    method, first, *_ = out.splitlines()
    assert (status, method.split(":")[0], first.split(":")[0]) == (0, "free motion method", "good")
    kept = Model.load(run.path).verdict
    assert kept is not None
    assert str(kept) == first


def test_a_wrong_sign_is_the_first_thing_that_identify_and_report_state(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty_plots(monkeypatch)
    data = recorded(arm(), TRUTH, n=3, duration=12.0)
    wrong = [(m, replace(r, tau=r.tau * np.array([-1.0, 1.0]))) for m, r in data]
    run = write_free_run(tmp_path / "run", arm(), wrong)
    status, out, _ = hil("identify", run.path)
    assert status == 3
    assert "failed: axis 1: wrong sign of the torque" in out
    assert hil("report", run.path)[0] == 0
    page = (run.path / "report.html").read_text(encoding="utf-8")
    assert page.index('class="outcome failed"') < page.index("<dl")


def test_a_report_states_that_a_model_which_was_edited_is_not_used(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty_plots(monkeypatch)
    run = write_free_run(tmp_path / "run", arm(), recorded(arm(), TRUTH, n=3, duration=12.0))
    (run.path / "model.yaml").write_text("provenance:\n")
    status, out, _ = hil("report", run.path)
    assert status == 0
    assert f"not used, the report shows a new estimate: {run.path / 'model.yaml'}:" in out


@pytest.mark.usefixtures("wide_console")
def test_further_objections_follow_in_one_line_before_the_notes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    say_verdicts((
        Verdict("doubtful", "doubtful", "axis 1: lag at the limit; check the low-pass"),
        Verdict("note", "note", "residual 5 %"),
        Verdict("doubtful", "doubtful", "axis 2: not excited; record more"),
        Verdict("doubtful", "doubtful", "axis 2: not excited; record more"),
        Verdict("doubtful", "doubtful", "axis 3: not excited; record more"),
    ))  # fmt: skip
    assert capsys.readouterr().out.splitlines() == [
        "doubtful: axis 1: lag at the limit; check the low-pass",
        "also: axis 2: not excited; axis 3: not excited",
        "note: residual 5 %",
    ]
