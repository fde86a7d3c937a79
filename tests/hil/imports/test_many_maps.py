"""Several maps in parallel give the run of sequential import, or none."""

import pickle
from concurrent.futures import BrokenExecutor

import pytest
from small_recording import a_map, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil import execution
from hil.imports.importing import import_recordings
from hil.runs.journal import read_journal

NAMES = ("first", "second", "third")


@pytest.fixture
def maps(tmp_path):
    """Maps of recordings of different lengths."""
    for number, name in enumerate(NAMES):
        write_csv(tmp_path / f"{name}.csv", table(3.0 + number))
    return [write_map(tmp_path, a_map(f"{name}.csv"), f"{name}.yaml") for name in NAMES]


def sent(what):
    """Return the job as received by another process."""
    return pickle.loads(pickle.dumps(what))  # noqa: S301 - our own


def backwards(function, jobs):
    """Yield results of the last job first, as another process may."""
    for job in reversed(list(jobs)):
        try:
            result = function(sent(job))
        except FileError as error:
            result = error
        yield job, sent(result)


def content(folder):
    """Return all files of a run except the times of its journal."""
    files = {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    (session,) = read_journal(folder / "run.json").sessions
    files[next(p for p in files if p.name == "run.json")] = session.notes
    return files


def test_the_run_is_the_same_at_once_and_in_turn(tmp_path, maps):
    import_recordings(maps, tmp_path / "in turn")
    stated = []
    import_recordings(maps, tmp_path / "at once", stated.append, execute=backwards)
    assert content(tmp_path / "at once") == content(tmp_path / "in turn")
    assert [statement.the_map.path for statement in stated] == maps[::-1]


def test_a_dask_cluster_makes_the_same_run(tmp_path, maps):
    distributed = pytest.importorskip("distributed")
    import_recordings(maps, tmp_path / "in turn")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0"
        ) as cluster,
        execution.cluster(cluster.scheduler_address) as execute,
    ):
        import_recordings(maps, tmp_path / "x", execute=execute)
    assert content(tmp_path / "x") == content(tmp_path / "in turn")


def test_errors_name_their_maps_and_nothing_is_written(tmp_path, maps):
    (tmp_path / "first.csv").write_text("t,q1,q2,m1,m2\n0,0,oops,0,0\n0,0,0,0,0\n")
    write_map(tmp_path, a_map("gone.csv"), "third.yaml")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(FileError) as refused:
        import_recordings(maps, tmp_path / "x", execute=backwards)
    first, third = str(refused.value).splitlines()
    assert first.startswith(f"{tmp_path}/first.yaml: {tmp_path}/first.csv:2: 'oops' in column 3")
    assert third.startswith(f"{tmp_path}/third.yaml:3: files.0: {tmp_path}/gone.csv: cannot be")
    assert sorted(tmp_path.rglob("*")) == before


def test_in_turn_too_an_error_names_its_map(tmp_path, maps):
    (tmp_path / "second.csv").write_text("t,q1,q2,m1,m2\n0,0,oops,0,0\n0,0,0,0,0\n")
    with pytest.raises(FileError, match=r"second.yaml: .*second.csv:2: 'oops' in column 3"):
        import_recordings(maps, tmp_path / "x")


def test_a_process_that_dies_is_one_message(tmp_path, maps):
    def dying(_, jobs):
        for job in jobs:
            yield job, BrokenExecutor("terminated abruptly")

    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(FileError, match=r"first.yaml: a process ended .* fewer --workers"):
        import_recordings(maps, tmp_path / "x", execute=dying)
    assert sorted(tmp_path.rglob("*")) == before


def test_maps_of_the_same_name_have_ids_of_their_own(tmp_path, maps):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        write_csv(tmp_path / folder / "data.csv", table(2.0))
    same = [write_map(tmp_path / folder, a_map(), "move.yaml") for folder in ("a", "b")]
    write_csv(tmp_path / "data.csv", table(2.0))
    third = write_map(tmp_path, a_map(), "move-2.yaml")
    run = import_recordings([*same, third], tmp_path / "x")
    assert len(set(run.ids)) == 3
