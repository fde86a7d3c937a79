"""Study of drift (`benchmarks/drift_study`): measurements, verdicts, repetitions and failures."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from small_study import PLANT, SEEDS, begun, cell_of, errors_of, here, opened, put, small_plans

from benchmarks.drift_study import summary
from benchmarks.drift_study.__main__ import main
from benchmarks.drift_study.cell import OUR_DEFAULT, judge, measure
from benchmarks.drift_study.drift import judged, measure_cells
from benchmarks.drift_study.scenarios import SCENARIOS
from checked_files.yaml_file import FileError
from hil import execution
from hil.model.dependencies import GROUPS
from hil.model.robot import ROBOTS, Robot
from hil.runs.pooling import recorded
from hil.runs.run import Run
from hil.terminal.console import out

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from benchmarks.drift_study.cell import Cell
    from benchmarks.drift_study.drift import Done


@pytest.fixture(scope="module")
def finished(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Done]]:
    """Complete study with all its campaigns, and the report of the command."""
    folder = tmp_path_factory.mktemp("study") / "study"
    cells = begun(folder, manutec)
    with execution.local(1) as execute:
        done = list(measure_cells(cells, execute))
        ((_, group),) = execute(os.getpgid, [0])
    assert group != os.getpgrp(), "Ctrl-C at the terminal would reach the worker"
    return folder, done


@pytest.fixture
def study(finished: tuple[Path, list[Done]], tmp_path: Path) -> Path:
    """Copy of the study, to be damaged by a test."""
    return Path(shutil.copytree(finished[0], tmp_path / "study"))


def files(folder: Path) -> dict[Path, int]:
    """Return recordings and verdicts with the times of their last change."""
    found = (*folder.glob("*/*/*.json"), *folder.glob("*/*/*/recordings/*"))
    return {path.relative_to(folder): path.stat().st_mtime_ns for path in found}


@pytest.fixture
def program(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Call the command; return exit status, standard output and standard error."""

    def call(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        assert "Traceback" not in printed.out + printed.err
        return int(left.value.code or 0), printed.out, printed.err

    return call


class TestStudy:
    def test_every_campaign_is_measured_and_judged_without_an_error(
        self, finished: tuple[Path, list[Done]]
    ) -> None:
        steps = [(done.step, done.done, done.of, done.error) for done in finished[1]]
        expected = [(step, n, 8, "") for step in ("measured", "judged") for n in range(1, 9)]
        assert steps == expected

    def test_each_campaign_is_another_plant(self, finished: tuple[Path, list[Done]]) -> None:
        runs = [cell_of(finished[0], "trajectory", seed).run for seed in SEEDS]
        one, other = (next(recorded(Run.open(run)))[1].tau for run in runs)
        assert np.abs(one - other).max() > 1.0

    def test_all_methods_are_judged_and_ours_is_the_best(
        self, finished: tuple[Path, list[Done]]
    ) -> None:
        rows = {row.method: row for row in summary.summarise(judged(opened(finished[0])))}
        assert len(rows) == 29
        assert {row.n for row in rows.values()} == {2}
        for group in GROUPS:
            best = min(rows, key=lambda method, group=group: rows[method].group_error[group])
            assert best == OUR_DEFAULT
        assert rows[OUR_DEFAULT].torque_error < 0.01

    def test_friction_of_another_session_is_that_of_the_other_seed(
        self, finished: tuple[Path, list[Done]]
    ) -> None:
        cell = cell_of(finished[0], "compensated", 1)
        assert cell.earlier_run == cell_of(finished[0], "compensated", 2).run
        same, _, other, _ = judge(cell)
        assert same.error != other.error

    def test_called_again_it_measures_and_judges_nothing(self, study: Path) -> None:
        before = files(study)
        assert set(errors_of(measure_cells(opened(study), here)).values()) == {""}
        assert files(study) == before

    def test_a_deleted_verdict_is_judged_again(self, study: Path) -> None:
        cell = cell_of(study, "trajectory", 2)
        before, found = files(study), judge(cell)
        cell.verdict.unlink()
        list(measure_cells(opened(study), here))
        again = files(study)
        changed = {path for path in again if again[path] != before[path]}
        assert changed == {cell.verdict.resolve().relative_to(study.resolve())}
        assert [o.method for o in judge(cell)] == [o.method for o in found]

    def test_a_verdict_never_rests_on_a_part_of_a_sweep(self, study: Path) -> None:
        cell = cell_of(study, "compensated", 1)
        cell.verdict.unlink()
        next((cell.earlier_run / "recordings").glob("f*.h5")).unlink()
        with pytest.raises(FileError, match="1 of 19 measurements is missing"):
            judge(cell)
        assert not cell.verdict.exists()

    def test_judging_writes_into_no_run(self, study: Path) -> None:
        cell = cell_of(study, "compensated", 1)
        before = {path for path in study.rglob("*") if path.is_file()}
        cell.verdict.unlink()
        judge(cell)
        assert {path for path in study.rglob("*") if path.is_file()} == before

    def test_only_what_was_begun_is_resumed(
        self, study: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        commands: list[Sequence[str]] = []

        def run(command: Sequence[str], **_: object) -> subprocess.CompletedProcess[str]:
            commands.append(command)
            return subprocess.CompletedProcess(command, 0)

        monkeypatch.setattr(subprocess, "run", run)
        begun, stub = (cell_of(study, "trajectory", seed) for seed in SEEDS)
        (begun.run / "recordings" / "t1.h5").unlink()
        shutil.rmtree(stub.run)
        (stub.run / "recordings").mkdir(parents=True)
        measure(begun)
        measure(stub)
        assert ["--resume" in command for command in commands] == [True, False]

    @pytest.mark.parametrize(
        ("change", "reason"),
        [
            ({"share": 0.5}, r"share was 1\.0 and is 0\.5 now; give the study a folder of its own"),
            ({"minutes": 10.0}, r"minutes was not given and is 10\.0 now"),
            ({"plant": "PLANT"}, f"plant was {PLANT} and is .*plant.yaml now"),
        ],
    )
    def test_the_folder_of_another_study_is_refused(
        self, study: Path, change: dict[str, object], reason: str
    ) -> None:
        plant = study / "on" / "plant.yaml"
        others = {key: str(plant) if value == "PLANT" else value for key, value in change.items()}
        with pytest.raises(FileError, match=reason):
            opened(study, **others)

    def test_the_same_minutes_go_on_and_others_are_refused(
        self, tmp_path: Path, manutec: Robot
    ) -> None:
        folder = put(small_plans(manutec), tmp_path / "study")
        opened(folder, minutes=8.0)
        opened(folder, minutes=8.0)
        with pytest.raises(FileError, match=r"minutes was 8\.0 and is 9\.0 now"):
            opened(folder, minutes=9.0)
        with pytest.raises(FileError, match=r"minutes was 8\.0 and is not given now"):
            opened(folder)


class TestFailure:
    def test_share_and_minutes_exclude_each_other(
        self, tmp_path: Path, program: Callable[..., tuple[int, str, str]]
    ) -> None:
        status, _, err = program("-o", tmp_path / "study", "--share", 1, "--minutes", 10)
        assert (status, "give one of them" in err) == (2, True)
        assert not (tmp_path / "study").exists()

    def test_a_campaign_that_fails_is_reported_and_the_others_go_on(
        self,
        study: Path,
        program: Callable[..., tuple[int, str, str]],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(execution, "local", lambda _workers: nullcontext(here))
        bad, good = (cell_of(study, "trajectory", seed) for seed in SEEDS)
        shutil.rmtree(bad.run)
        bad.run.write_text("in the way")
        for cell in (bad, good):
            cell.verdict.unlink()
        options = ("--scenario", "on", "--seeds", 2, "--first-seed", 1, "--workers", 1)
        status, out, err = program("-o", study, *options)
        assert status == 1
        assert f"on, trajectory, seed 1: {bad.run}: {bad.run} is not a folder" in out
        assert "1 campaigns failed, see above; the same command retries" in err
        assert good.verdict.exists()
        assert not bad.verdict.exists()
        rows = list(csv.DictReader((study / summary.TABLE).read_text().splitlines()))
        seeds = {row["method"]: row["seeds"] for row in rows}
        assert (seeds["jointly: strongest"], seeds[OUR_DEFAULT]) == ("1", "2")

    def test_a_plant_that_cannot_be_read_fails_its_own_scenario(self, study: Path) -> None:
        cells = opened(study)
        cells[0].plant.write_text("axes: [")
        cells[0].verdict.unlink()
        errors = errors_of(measure_cells(cells, here))
        assert "plant.yaml" in errors["judged", str(cells[0])]
        assert [error for error in errors.values() if error] == [errors["judged", str(cells[0])]]

    def test_a_study_in_which_all_failed_has_no_table(
        self,
        tmp_path: Path,
        manutec: Robot,
        program: Callable[..., tuple[int, str, str]],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        folder = put(small_plans(manutec), tmp_path / "study")
        monkeypatch.setattr(
            "benchmarks.drift_study.drift.measure_cells",
            lambda cells, _: measure_cells(cells, failing),
        )
        status, out, err = program("-o", folder, "--scenario", "on", "--seeds", 2)
        assert (status, "8 campaigns failed" in err) == (1, True)
        assert "[/etc] is full" in out
        assert not (folder / summary.TABLE).exists()

    def test_an_unknown_scenario_is_refused_with_the_known_ones(
        self, tmp_path: Path, program: Callable[..., tuple[int, str, str]]
    ) -> None:
        status, _, err = program("-o", tmp_path / "study", "--scenario", "sideways")
        assert status == 2
        for name in SCENARIOS:
            assert name in err
        assert not (tmp_path / "study").exists()

    def test_a_robot_of_ones_own_needs_a_drives_file(self, tmp_path: Path) -> None:
        text = (ROBOTS / f"{PLANT}.yaml").read_text()
        own = tmp_path / "own.yaml"
        own.write_text(text.replace(f"name: {PLANT}", "name: own"))
        with pytest.raises(FileError, match=r"give one for .*own\.yaml with --drives"):
            opened(tmp_path / "study", robot=str(own))
        put(small_plans(Robot.load(own)), tmp_path / "study")
        drives = ROBOTS / f"{PLANT}.drives.yaml"
        opened(tmp_path / "study", robot=str(own), drives=drives)
        assert (tmp_path / "study" / "drives.yaml").read_text() == drives.read_text()

    def test_an_unknown_plant_is_refused_before_anything_is_made(
        self, tmp_path: Path, program: Callable[..., tuple[int, str, str]]
    ) -> None:
        status, _, err = program("-o", tmp_path / "study", "--plant", "puma")
        assert (status, "puma: neither a plant file" in err) == (1, True)
        assert not (tmp_path / "study").exists()

    def test_planning_is_announced_on_a_terminal(
        self,
        tmp_path: Path,
        program: Callable[..., tuple[int, str, str]],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        def stop(*_: object) -> None:
            raise FileError("so far")

        monkeypatch.setattr(out, "_force_terminal", True)
        monkeypatch.setattr(out, "is_interactive", True)
        monkeypatch.setattr("benchmarks.drift_study.drift.prepare", stop)
        status, printed, err = program("-o", tmp_path / "study")
        assert (status, "so far" in err) == (1, True)
        assert "planning the campaigns" in printed

    def test_a_study_does_not_follow_a_link_in_its_folder(self, tmp_path: Path) -> None:
        outside, study = tmp_path / "outside", tmp_path / "study"
        outside.mkdir()
        study.mkdir()
        (study / "off").symlink_to(outside)
        with pytest.raises(FileError, match="off: is a symbolic link"):
            opened(study, scenarios=["off"])
        assert not list(outside.iterdir())


def failing(_function: object, jobs: Iterable[Cell]) -> Iterator[tuple[Cell, Exception]]:
    for job in jobs:
        yield job, FileError("[/etc] is full")


class TestCluster:
    def test_two_workers_of_a_dask_cluster_find_the_same(
        self, finished: tuple[Path, list[Done]], study: Path
    ) -> None:
        import distributed

        cells, alone = (
            [cell for cell in opened(folder) if cell.seed == 1 and cell.kind != "two-step"]
            for folder in (study, finished[0])  # judging the strokes takes longest
        )
        for cell in cells:
            cell.verdict.unlink()
        shutil.rmtree(cell_of(study, "trajectory", 1).run)
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
            ) as cluster,
            execution.cluster(cluster.scheduler_address) as execute,
        ):
            assert set(errors_of(measure_cells(cells, execute)).values()) == {""}
        for found, expected in zip(judged(cells), judged(alone), strict=True):
            for one, other in zip(found.outcomes, expected.outcomes, strict=True):
                assert (one.method, one.inside) == (other.method, other.inside)
                assert one.error == pytest.approx(other.error, rel=1e-6)

    def test_without_dask_it_is_said_what_to_install(
        self,
        study: Path,
        program: Callable[..., tuple[int, str, str]],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setitem(sys.modules, "distributed", None)
        options = ("--scenario", "on", "--seeds", 2, "--first-seed", 1)
        status, _, err = program("-o", study, *options, "--scheduler", "tcp://localhost:1")
        assert status == 1
        assert "pip install distributed; or, in a checkout, pip install '.[dask]'" in err

    def test_a_scheduler_that_does_not_answer_is_reported(self) -> None:
        import dask

        with (
            dask.config.set({"distributed.comm.timeouts.connect": "0.2s"}),
            pytest.raises(FileError, match=r"tcp://127\.0\.0\.1:1: no Dask scheduler answers"),
            execution.cluster("tcp://127.0.0.1:1"),
        ):
            pass
