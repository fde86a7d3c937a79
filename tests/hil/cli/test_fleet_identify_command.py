"""`hil fleet identify`: many runs on the cores of this machine or on a Dask cluster."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

import pytest
from free_run import TRUTH, arm, recorded, write_free_run

from checked_files.yaml_file import FileError
from hil import execution
from hil.commands.fleet import identify_runs
from hil.results.model import Model
from hil.results.model_file import NAME

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path
    from typing import Any

    from command_line import Hil


@pytest.fixture
def plants(tmp_path: Path) -> Path:
    """Three runs of two machines."""
    robot = arm()
    for k, run in enumerate(("a/june", "a/july", "b/june")):
        data = recorded(robot, TRUTH, n=2, duration=8.0, seed=10 * k)
        write_free_run(tmp_path / "plants" / run, robot, data)
    return tmp_path / "plants"


def execute_in_turn(
    function: Callable[[Any], Any], jobs: Iterable[Any]
) -> Iterator[tuple[Any, Any]]:
    """Execute the jobs in this process."""
    for job in jobs:
        yield job, function(job)


def models(plants: Path) -> dict[Path, str]:
    """Return all models below a folder, without their times of identification."""
    return {
        path.relative_to(plants): "\n".join(
            line for line in path.read_text().splitlines() if "  identified: " not in line
        )
        for path in plants.rglob(NAME)
    }


@pytest.mark.long  # two processes begin
def test_runs_without_a_model_are_identified_and_others_stay(hil: Hil, plants: Path) -> None:
    (plants / "b" / "june" / "robot.yaml").write_text("name: none\n")
    status, out, _ = hil("fleet", "identify", plants, "--workers", 2)
    assert (status, "2 runs identified, 0 up to date" in out) == (3, True)
    damaged, robot = plants / "b" / "june", arm()
    assert f"left out: {damaged}: {damaged / 'robot.yaml'}:1: " in out
    write_free_run(plants / "b" / "july", robot, recorded(robot, TRUTH, n=2, duration=8.0))
    (damaged / "run.json").unlink()
    (plants / "a" / "june" / NAME).unlink()
    status, out, _ = hil("fleet", "identify", plants, "--workers", 1)
    assert (status, "2 runs identified, 1 up to date: 3 good" in out) == (0, True)
    assert Model.load(plants / "a" / "june").values == pytest.approx(TRUTH, abs=0.3)
    status, _, err = hil("fleet", "identify", damaged)
    assert (status, "no runs below; name folders that contain run folders" in err) == (1, True)


@pytest.mark.long  # processes begin and end
def test_a_cluster_finds_the_same_and_a_killed_worker_loses_nothing(plants: Path) -> None:
    distributed = pytest.importorskip("distributed")
    identify_runs([plants], execute_in_turn, str)
    expected = models(plants)
    assert len(expected) == 3
    for path in (*plants.rglob(NAME), *plants.rglob("findings.json")):
        path.unlink()
    stated: list[str] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as cluster:
        address = cluster.scheduler_address
        with distributed.Client(address) as client:
            pids = client.run(os.getpid)

        def kill_the_other(sentence: str) -> None:
            stated.append(sentence)
            if len(stated) == 1:
                os.kill(next(iter(pids.values())), signal.SIGKILL)

        with execution.cluster(address) as execute:
            found = identify_runs([plants], execute, kill_the_other)
    assert (found.new + found.known, found.left_out) == (3, ())
    assert models(plants) == expected
    assert stated[-1] == "identified 3 of 3 runs"


@pytest.mark.long  # processes begin and end
def test_a_scheduler_that_ends_meanwhile_is_named(plants: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as cluster:

        def end_it(sentence: str) -> None:
            if sentence == "identified 1 of 3 runs":
                cluster.close()

        with (
            pytest.raises(FileError, match="the Dask scheduler ended meanwhile; start it"),
            execution.cluster(cluster.scheduler_address) as execute,
        ):
            identify_runs([plants], execute, end_it)
