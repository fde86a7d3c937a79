"""Verdict, reason, parameters and friction law of a report equal those of `hil identify`."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from html import unescape
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from free_run import TRUTH, arm, write_free_run
from free_run import recorded as free_motions
from small_run import empty_plots, write_run
from stroke_run import strokes
from trajectory_run import write_trajectory_run

from hil import cli
from hil.report import page
from hil.results.model import Model
from hil.results.tables.friction import campaign_friction
from hil.runs.recording_file import write_measured
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot


def hil(*arguments: Any) -> int:
    with pytest.raises(SystemExit) as ended:
        cli.main([str(each) for each in arguments])
    return int(ended.value.code or 0)


def campaign(path: Path, robot: Robot) -> None:
    write_run(path, robot)


def falsified(path: Path, robot: Robot) -> None:
    """Write a campaign with the wrong sign of axis 2's torques."""
    write_run(path, robot)
    for each in Run.open(path):
        tau = each.recording.tau * np.where(np.arange(robot.n_joints) == 1, -1.0, 1.0)
        turned = replace(each, recording=replace(each.recording, tau=tau))
        write_measured(path / "recordings" / f"{each.measurement.id}.h5", turned, robot)


def trajectories(path: Path, robot: Robot) -> None:
    write_trajectory_run(path, robot)


def imported(path: Path, robot: Robot) -> None:
    del robot
    two_axes = arm()
    write_free_run(path, two_axes, free_motions(two_axes, TRUTH, n=2))


def imported_strokes(path: Path, robot: Robot) -> None:
    del robot
    two_axes = arm()
    data = [
        strokes(two_axes, TRUTH, axis, (0.4 * k, 0.7 - 0.5 * k), name=f"s{axis}{k}", seed=k)
        for axis in range(2)
        for k in range(4)
    ]
    write_free_run(path, two_axes, data)


RUNS = {
    "good": (campaign, None),
    "falsified sign": (falsified, None),
    "trajectories": (trajectories, None),
    "imported": (imported, None),
    "imported, another method": (imported, "weighted least squares"),
    "imported strokes": (imported_strokes, None),
}
WORDS = {"good": "good", "falsified sign": "failed"}
"""Verdicts of two unambiguous runs."""


@pytest.mark.parametrize("kind", RUNS)
def test_a_report_shows_what_identify_found(
    kind: str, manutec: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, method = RUNS[kind]
    make(tmp_path / "run", manutec)
    chosen = () if method is None else ("--method", method)
    # status 3: identified, but judged failed
    assert hil("identify", tmp_path / "run", *chosen) in {0, 3}
    model = Model.load(tmp_path / "run")
    assert model.verdict is not None
    assert model.verdict.word == WORDS.get(kind, model.verdict.word)

    # tests/hil/results/test_findings.py compares reports from kept findings
    (tmp_path / "run" / "findings.json").unlink(missing_ok=True)
    empty_plots(monkeypatch)
    text = page.report(Run.open(tmp_path / "run")).read_text()

    shown = re.findall(r'(?s)<p class="outcome \w+"><strong>(.*?)</p>', text)
    assert unescape(shown[0].replace("</strong>", ":")) == str(model.verdict)
    left = model.band_residual.describe(model.robot.torque_limit)
    assert unescape(shown[1]) == f"note</strong> on these recordings: {left}"
    (packed,) = re.findall(r'parameters\.json" href="data:[^,]+;base64,([^"]+)"', text)
    found = json.loads(base64.b64decode(packed))
    assert found["method"] == model.method
    assert [each["value"] for each in found["parameters"]] == pytest.approx(model.values.tolist())
    for row in (row for part in campaign_friction(model).parts for row in part.rows):
        assert all(f">{unescape(str(cell))}<" in text for cell in row)
