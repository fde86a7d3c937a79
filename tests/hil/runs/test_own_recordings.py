"""A recording belongs to its run; a run with a damaged recording remains usable."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from small_run import write_run

from checked_files.yaml_file import FileError
from hil.errors import UnknownName
from hil.runs.journal import write_journal
from hil.runs.recording_file import write_measured
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot


@pytest.fixture(scope="module")
def whole(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("own") / "run", manutec).path


@pytest.fixture
def run(whole: Path, tmp_path: Path) -> Run:
    return Run.open(shutil.copytree(whole, tmp_path / "run"))


def exchange_recording(run: Run, run_id: str | None) -> str:
    """Replace the first recording by the same measurement of another run; return its id."""
    name = run.ids[0]
    path = run.path / "recordings" / f"{name}.h5"
    write_measured(path, replace(run[name], run=run_id), run.robot)
    return name


@pytest.mark.parametrize("other", ["0" * 32, None])
def test_a_recording_of_another_run_of_the_same_plan_is_refused(
    run: Run, other: str | None
) -> None:
    name = exchange_recording(run, other)
    with pytest.raises(FileError, match=rf"{name}\.h5: was measured in another run .*--without"):
        list(run)


def test_a_run_of_an_earlier_version_has_no_id_and_is_read(run: Run) -> None:
    for name in run.ids:
        path = run.path / "recordings" / f"{name}.h5"
        write_measured(path, replace(run[name], run=None), run.robot)
    write_journal(run.path / "run.json", run.journal.model_copy(update={"run_id": None}))
    assert len(list(Run.open(run.path))) == len(run)


def test_a_damaged_recording_can_be_left_out_and_that_is_stated(run: Run) -> None:
    name, *others = run.ids
    (run.path / "recordings" / f"{name}.h5").write_bytes(b"damaged")
    with pytest.raises(FileError, match=f"hil identify {run.path} --without {name}"):
        list(run)
    rest = run.exclude([name])
    assert [each.measurement.id for each in rest] == others
    assert rest.shortfall == f"left out on request: {name}"
    assert run.shortfall == ""


def test_what_is_left_out_must_be_a_measurement_of_the_plan(run: Run) -> None:
    with pytest.raises(UnknownName, match=r"--without g011: .*; did you mean g\d+\?"):
        run.exclude(["g011"])


def test_a_pipe_in_place_of_a_recording_is_refused_and_not_waited_for(run: Run) -> None:
    path = run.path / "recordings" / f"{run.ids[0]}.h5"
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(FileError, match="is a pipe or a device"):
        list(run)
