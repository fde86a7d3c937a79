"""`hil history`: tables, page, JSON and exit status."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run
from stated_model import stated_model

from hil.cli.outputs import Status

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


@pytest.fixture
def runs(tmp_path: Path) -> list[Path]:
    """Three runs of one machine; the last one has a larger p2."""
    model = stated_model(arm(), friction=("offset", "Coulomb", "viscous"))
    folders = []
    for day in (1, 2, 3):
        shift = 1e-3 * day + (day == 3) * 0.5 * np.eye(len(model.values))[1]
        provenance = model.provenance.model_copy(
            update={"measured": f"2026-03-{day:02}T08:00:00+00:00"}
        )
        folder = tmp_path / f"march-{day}"
        folder.mkdir()
        replace(model, values=model.values + shift, provenance=provenance).save(
            folder / "model.yaml"
        )
        folders.append(folder)
    return folders


def test_a_change_is_stated_with_size_p_value_and_what_it_may_come_from(
    hil: Hil, runs: list[Path]
) -> None:
    status, out, _ = hil("history", *runs)
    assert status == 0
    assert "(p2) changed by 0.502 ± 0.029 kg m" in out
    assert "possible cause: a load, counterweight" in out


def test_a_change_ends_with_status_4_where_that_is_asked_for(hil: Hil, runs: list[Path]) -> None:
    assert hil("history", *runs, "--fail-on-change")[0] == Status.CHANGED
    status, out, _ = hil("history", *runs[:2], "--fail-on-change")
    assert status == 0
    assert "nothing changed significantly" in out


def test_json_states_runs_values_and_changes(hil: Hil, runs: list[Path]) -> None:
    status, out, _ = hil("history", *runs, "--json")
    assert status == 0
    found = json.loads(out)["history"]
    assert found["newest_changed"] is True
    assert [run["changed"] for run in found["runs"]] == [False, False, True]
    assert {each["quantity"] for each in found["changes"]} == {"p2"}
    assert found["runs"][0]["values"]["p2"]["half_width_95"] == pytest.approx(0.0209, rel=0.01)
    low, high = found["changes"][0]["interval_95"]
    assert low < 0.5 < high


def test_the_page_holds_everything_itself(hil: Hil, runs: list[Path]) -> None:
    path = runs[0] / "history.html"
    assert hil("history", *runs, "--page", path)[0] == 0
    page = path.read_text()
    assert "(p2) changed by" in page
    assert page.count("<figure") == 4
    assert "http:" not in page
    assert "https:" not in page


def test_another_reference_may_be_chosen(hil: Hil, runs: list[Path]) -> None:
    status, out, _ = hil("history", *runs[:2], "--reference", runs[2], "--json")
    assert status == 0
    found = json.loads(out)["history"]
    assert found["reference"] == str(runs[2])
    assert {each["against"] for each in found["changes"]} >= {str(runs[2])}


def test_a_damaged_model_is_refused_before_anything_is_written(hil: Hil, runs: list[Path]) -> None:
    file, path = runs[1] / "model.yaml", runs[0] / "history.html"
    file.write_text(file.read_text()[:500])
    status, _, error = hil("history", *runs, "--page", path)
    assert status == 1
    assert f"{file}" in error
    assert "hil identify" in error
    assert not path.exists()


def test_runs_without_a_model_are_identified_where_that_is_asked_for(
    hil: Hil, tmp_path: Path
) -> None:
    robot = arm()
    for seed in (1, 2):
        data = recorded(robot, TRUTH, n=2, duration=10.0, seed=seed)
        write_free_run(tmp_path / f"run-{seed}", robot, data)
    folders = tmp_path / "run-1", tmp_path / "run-2"
    status, _, error = hil("history", *folders)
    assert (status, "hil identify" in error) == (1, True)
    status, out, _ = hil("history", *folders, "--identify")
    assert status == 0
    assert "some runs have no time of measurement" in out
    assert (folders[1] / "model.yaml").exists()


@pytest.mark.long
def test_what_changed_is_named_by_its_cause_where_recordings_of_both_runs_are_there(
    hil: Hil, tmp_path: Path
) -> None:
    robot, folders = arm(), [tmp_path / "before", tmp_path / "after"]
    for day, folder in enumerate(folders, start=1):
        data = recorded(robot, TRUTH, n=3, duration=12.0, seed=day)
        for _, recording in data:
            recording.tau[:, 1] /= 1.0 + 0.2 * (day - 1)
        write_free_run(folder, robot, data)
    status, out, _ = hil("history", *folders, "--identify")
    assert status == 0
    said = " ".join(out.split())
    assert f"cause of the difference from {folders[0]}: axis 2: torque constant greater" in said
