"""A stranger's run folder never causes writing outside of it."""

from __future__ import annotations

import os
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from small_run import write_run

from checked_files.yaml_file import FileError
from hil import cli
from hil.report.reported_run import ReportedRun, _neighbour
from hil.runs.atomic_file import own_folder, write_file
from hil.runs.recording_file import Measured
from hil.runs.run_folder import RunFolder
from hil.tasks.measuring import prepared_folder

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.planning.plan import Plan

MINE = "the user's own file"


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """File of the user outside the folder."""
    path = tmp_path / "victim.txt"
    path.write_text(MINE)
    return path


@pytest.fixture
def folder(tmp_path: Path, manutec: Robot) -> RunFolder:
    return write_run(tmp_path / "run", manutec)


def test_an_estimate_and_its_report_overwrite_no_file_that_a_link_leads_to(
    folder: RunFolder, victim: Path
) -> None:
    for name in ("model.yaml", "model.yaml.part", "report.html", "report.html.part"):
        (folder.path / name).symlink_to(victim)
    hil("identify", folder.path)
    hil("report", folder.path)
    assert victim.read_text() == MINE
    assert not (folder.path / "model.yaml").is_symlink()
    assert "parameters" in (folder.path / "model.yaml").read_text()
    assert (folder.path / "report.html").read_text().startswith("<!DOCTYPE")


def test_a_report_shows_no_run_outside_of_the_folder_around_its_own(
    tmp_path: Path, manutec: Robot
) -> None:
    """The recordings of another run of the user's would be in a report that is sent back."""
    run = write_run(tmp_path / "theirs" / "run", manutec)
    mine = write_run(tmp_path / "mine" / "run", manutec)
    (tmp_path / "theirs" / "link").symlink_to(mine.path)
    report = ReportedRun(run)
    vars(report)["own_torques"] = "its own"
    vars(report)["found"] = None
    for named in ("../../mine/run", str(mine.path), "../link"):
        vars(report).pop("shown_torques", None)
        vars(report)["kept_model"] = SimpleNamespace(validations=[SimpleNamespace(run=named)])
        assert report.shown_torques == "its own"
        with pytest.raises(FileError, match=r"names a run outside of .*; if you trust that run"):
            _neighbour(run, run.path / named)
    assert _neighbour(run, run.path / "../other") == run.path / "../other"


@pytest.mark.parametrize("name", ["run.json", "run.json.part"])
def test_the_journal_overwrites_no_file_that_a_link_leads_to(
    folder: RunFolder, tmp_path: Path, name: str
) -> None:
    elsewhere = tmp_path / "elsewhere.json"
    elsewhere.write_bytes((folder.path / "run.json").read_bytes())
    before = elsewhere.read_bytes()
    (folder.path / name).unlink(missing_ok=True)
    (folder.path / name).symlink_to(elsewhere)
    folder.note_rehearsed(0.2)
    assert elsewhere.read_bytes() == before
    assert RunFolder.open(folder.path).journal.rehearsed == 0.2


def test_recordings_behind_a_link_are_neither_written_nor_removed(
    folder: RunFolder, tmp_path: Path
) -> None:
    outside = tmp_path / "outside"
    (folder.path / "recordings").rename(outside)
    (folder.path / "recordings").symlink_to(outside)
    (outside / "thesis.part").write_text(MINE)
    measured = next(iter(folder))
    with pytest.raises(
        FileError, match=r"recordings: is a symbolic link .* move the whole parent folder"
    ):
        folder.set_aside_damaged()
    with pytest.raises(FileError, match="recordings: is a symbolic link"):
        folder.write(Measured(measured.measurement, measured.recording))
    assert (outside / "thesis.part").read_text() == MINE


def test_a_stub_whose_recordings_are_a_link_is_not_completed(
    tmp_path: Path, small_plan: Plan, manutec: Robot
) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "recordings").symlink_to(outside)
    with pytest.raises(FileError, match="already exists"):
        prepared_folder(tmp_path / "run", small_plan, manutec, "axes: []\n", resume=False)


def test_a_folder_that_a_kill_left_empty_is_begun_and_one_with_somebody_s_plan_is_kept(
    tmp_path: Path, small_plan: Plan, manutec: Robot
) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (own / "plan.yaml").write_text(MINE)
    with pytest.raises(FileError, match=r"run\.json: cannot be read"):
        prepared_folder(own, small_plan, manutec, "axes: []\n", resume=True)
    assert (own / "plan.yaml").read_text() == MINE
    (tmp_path / "run").mkdir()
    found, _ = prepared_folder(tmp_path / "run", small_plan, manutec, "axes: []\n", resume=True)
    assert found.journal.sessions == ()


def test_plots_of_a_diagnosis_are_not_drawn_behind_a_link(
    folder: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (folder.path / "diagnosis").symlink_to(outside)
    with pytest.raises(SystemExit):
        cli.main(["diagnose", str(folder.path)])
    assert "diagnosis: is a symbolic link" in capsys.readouterr().err
    assert not list(outside.iterdir())


def test_what_a_killed_process_left_blocks_nothing(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    (tmp_path / "model.yaml.part").mkdir()
    write_file(path, b"whole")
    assert path.read_bytes() == b"whole"


def test_two_writers_of_the_same_file_do_not_share_a_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, flush, parts = tmp_path / "model.yaml", os.fsync, []

    def interleaved(descriptor: int) -> None:
        flush(descriptor)
        parts.append(sorted(part.name for part in tmp_path.glob("*.part")))
        if len(parts) == 1:
            write_file(path, b"the other's")

    monkeypatch.setattr(os, "fsync", interleaved)
    write_file(path, b"ours")
    assert len(set(parts[1])) == 2
    assert path.read_bytes() == b"ours"
    assert not list(tmp_path.glob("*.part"))


def test_a_file_is_as_readable_as_any_that_the_user_makes(tmp_path: Path) -> None:
    write_file(tmp_path / "ours", b"")
    (tmp_path / "plain").touch()
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_the_users_own_link_to_a_folder_is_followed(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "runs").symlink_to(tmp_path / "disk")
    own_folder(tmp_path / "runs" / "first")
    write_file(tmp_path / "runs" / "first" / "plan.yaml", b"x")
    assert (tmp_path / "disk" / "first" / "plan.yaml").read_bytes() == b"x"


def hil(*arguments: object) -> None:
    with pytest.raises(SystemExit) as left:
        cli.main([str(argument) for argument in arguments])
    assert not left.value.code
