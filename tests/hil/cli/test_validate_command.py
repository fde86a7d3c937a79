"""`hil validate`: verdict, exit status, and records in the run's folder and in the model."""

from __future__ import annotations

import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from small_run import empty_plots, identified_run, write_run

from hil.errors import Mismatch
from hil.model.robot import parse_robot
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.provenance import recordings_in_common
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil

    from hil.model.robot import Robot


@pytest.fixture(scope="module")
def folders(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Identified run, and another run of the same robot."""
    where = tmp_path_factory.mktemp("runs")
    other = write_run(where / "other", manutec, seed=2)
    return identified_run(where / "first"), other.path


def test_a_good_model_passes_and_keeps_the_verdict(hil: Hil, folders: tuple[Path, Path]) -> None:
    first, other = folders
    status, out, _ = hil("validate", other, "--model", first)
    assert status == 0
    assert "good: torque predicted within" in out
    page = (other / "validation.html").read_text()
    assert "<strong>good</strong> torque predicted within" in page
    assert 'id="plot-torque"' in page
    assert "word: good" in (other / "validation.yaml").read_text()
    (kept,) = Model.load(first).validations
    assert (kept.run, kept.word) == ("../other", "good")


def test_a_second_validation_on_the_same_run_takes_the_place_of_the_first(
    hil: Hil, folders: tuple[Path, Path]
) -> None:
    first, other = folders
    for _ in range(2):
        assert hil("validate", other, "--model", first / NAME)[0] == 0
    assert len(Model.load(first).validations) == 1


def test_recordings_that_the_model_was_made_from_are_refused_in_a_copy_too(
    hil: Hil, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    first, _ = folders
    before = [each for each in Model.load(first).validations if each.word == "good"]
    copy = shutil.copytree(first, tmp_path / "copy")
    for folder in (first, copy):
        status, out, _ = hil("validate", folder, "--model", first)
        assert status == 3
        assert "failed: its recordings are those used for identification" in out
        assert "word: failed" in (folder / "validation.yaml").read_text()
    after = [each for each in Model.load(first).validations if each.word == "good"]
    assert after == before


def test_a_part_of_the_model_s_recordings_is_refused_and_what_was_left_out_is_not(
    hil: Hil, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    first, _ = folders
    run = Run.open(shutil.copytree(first, tmp_path / "copy"))
    model = identify(run.exclude(run.ids[:1]), "published")
    assert recordings_in_common(model.provenance, run) == len(run) - 1
    for name in run.ids[1:]:
        (run.path / "recordings" / f"{name}.h5").unlink()
    assert recordings_in_common(model.provenance, Run.open(run.path)) == 0


def test_a_model_without_digests_is_known_by_plan_and_time_of_its_run(
    folders: tuple[Path, Path],
) -> None:
    first, other = folders
    made = Model.load(first).provenance.model_copy(update={"recordings": ()})
    assert recordings_in_common(made, Run.open(first)) == len(Run.open(first))
    earlier = made.model_copy(update={"measured": "2020-01-02T03:04:05+00:00"})
    assert recordings_in_common(earlier, Run.open(other)) == 0


def test_a_refused_model_ends_with_status_3(hil: Hil, folders: tuple[Path, Path]) -> None:
    first, other = folders
    model = Model.load(first)
    wrong = other.parent / "wrong.yaml"
    replace(model, values=-model.values).save(wrong)
    status, out, _ = hil("validate", other, "--model", wrong)
    assert status == 3
    assert "failed: axis" in out


def test_a_report_shows_what_its_model_was_worth_elsewhere(
    hil: Hil, folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    empty_plots(monkeypatch)
    first, other = folders
    hil("validate", other, "--model", first)
    above = (other / "validation.html").read_text().split("<main>")[0]
    assert "<dt>Recordings</dt><dd>other</dd>" in above
    assert "<dt>Model</dt><dd>../first/model.yaml</dd>" in above
    assert hil("report", first)[0] == 0
    page = (first / "report.html").read_text()
    assert "Judged by other recordings" in page
    assert "on other recordings (../other): torque predicted within" in page.split("<main>")[0]
    assert "Held out: ../other," in page
    other.rename(other.parent / "elsewhere")
    assert hil("report", first)[0] == 0
    (other.parent / "elsewhere").rename(other)
    assert "Held out: ../other," not in (first / "report.html").read_text()


def test_a_model_of_another_robot_is_refused(
    hil: Hil, folders: tuple[Path, Path], manutec: Robot, tmp_path: Path
) -> None:
    first, other = folders
    text = manutec.text.replace("torque_limit: 945", "torque_limit: 946")
    stranger = replace(Model.load(first), robot=parse_robot(text, "other.yaml"))
    with pytest.raises(Mismatch, match="identified with another robot file"):
        stranger.refuse_other_robot(Run.open(other).robot, str(other))
    status, _, err = hil("validate", other, "--model", tmp_path)
    assert status == 1
    assert "make it with: hil identify" in err


@pytest.mark.long
def test_a_motion_is_measured_for_the_purpose(
    hil: Hil, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    first, _ = folders
    status, out, _ = hil("validate", tmp_path / "check", "--model", first, "--measure")
    # the model is from synthetic recordings, the motion from the virtual plant
    assert status in (0, 3)
    assert "Predicted torques of this recording" in out
    assert (tmp_path / "check" / "recordings" / "validation.h5").exists()
