"""`hil fleet`: the index grows, never reads a run twice, and answers questions."""

from __future__ import annotations

import json
import shutil
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from free_run import arm
from stated_model import stated_model

from hil.commands.fleet import index as index_models
from hil.results import fleet_index
from hil.results.fleet_index import read_fleets

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from command_line import Hil

pytest.importorskip("duckdb")
pytest.importorskip("pyarrow")


@pytest.fixture
def plants(tmp_path: Path) -> Path:
    """Two machines with three runs each; the last run of machine b has another p2."""
    model = stated_model(arm(), friction=("offset", "Coulomb", "viscous"))
    for machine in "ab":
        for month in (1, 2, 3):
            shift = (machine == "b" and month == 3) * 0.5 * np.eye(len(model.values))[1]
            shift = shift + 1e-4 * month
            about = {"measured": f"2026-{month:02}-01T08:00:00+00:00"}
            folder = tmp_path / "plants" / machine / f"run-{month}"
            folder.mkdir(parents=True)
            provenance = model.provenance.model_copy(update=about)
            moved = replace(model, values=model.values + shift, provenance=provenance)
            moved.save(folder / "model.yaml")
    return tmp_path / "plants"


def test_only_new_models_are_read_into_an_index(hil: Hil, plants: Path, tmp_path: Path) -> None:
    index = tmp_path / "fleet.parquet"
    assert "6 runs added" in hil("fleet", "index", plants, "-o", index)[1]
    assert "0 runs added" in hil("fleet", "index", plants, "-o", index)[1]
    (plants / "b" / "run-3" / "model.yaml").touch()
    status, out, _ = hil("fleet", "index", plants, "-o", index, "--json")
    assert (status, json.loads(out)["added"], json.loads(out)["known"]) == (0, 1, 5)


def test_a_machine_that_changed_is_named_with_what_it_may_come_from(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    index, page = tmp_path / "fleet.parquet", tmp_path / "fleet.html"
    hil("fleet", "index", plants, "-o", index)
    status, out, _ = hil("fleet", "query", index)
    assert status == 0
    assert "1 of 2 machines with significant deviations: b" in out
    assert "counterweight" in out
    assert "fewer than 20 machines, each compared with its own past only" in " ".join(out.split())
    assert hil("fleet", "page", index, "-o", page)[0] == 0
    text = page.read_text(encoding="utf-8")
    assert "fleet, median" in text
    assert ">run-1<" in text  # within the machine's folder


def test_a_run_identified_anew_takes_the_place_of_its_earlier_model(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    index, run = tmp_path / "fleet.parquet", plants / "b" / "run-3" / "model.yaml"
    hil("fleet", "index", plants, "-o", index)
    run.write_text(
        (plants / "b" / "run-2" / "model.yaml").read_text("utf-8").replace("2026-02", "2026-03"),
        "utf-8",
    )
    hil("fleet", "index", plants, "-o", index)
    assert "none of 2 machines deviates" in hil("fleet", "query", index)[1]


@pytest.mark.parametrize("name", ["m*", "a::b", "simplecache::b"])
def test_the_name_of_a_machine_s_folder_leads_to_no_other_file(
    hil: Hil, plants: Path, tmp_path: Path, name: str
) -> None:
    (plants / "a").rename(plants / name)
    status, out, err = hil("fleet", "index", plants, "-o", tmp_path / "fleet.parquet")
    assert (status, "6 runs added" in out) == (0, True), err


@pytest.mark.parametrize("name", ["fleet*", "fleet?", "[f]leet"])
def test_the_name_of_an_index_leads_to_no_other_index(
    hil: Hil, plants: Path, tmp_path: Path, name: str
) -> None:
    for other in ("fleet", "fleets"):
        hil("fleet", "index", plants / "a", "-o", tmp_path / other)
    index = tmp_path / name
    assert "3 runs added" in hil("fleet", "index", plants / "b", "-o", index)[1]
    (fleet,) = read_fleets(index).values()
    assert (fleet.machines, len(fleet.machine)) == (("b",), 3)


def test_a_loop_of_folders_and_repeated_folders_add_a_run_once(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    (plants / "a" / "loop").symlink_to(plants)
    index = tmp_path / "fleet.parquet"
    assert "6 runs added" in hil("fleet", "index", plants, plants, "-o", index)[1]


def test_repeated_rows_count_once(hil: Hil, plants: Path, tmp_path: Path) -> None:
    index = tmp_path / "fleet.parquet"
    hil("fleet", "index", plants, "-o", index)
    once = hil("fleet", "query", index)[1]
    (part,) = index.glob("robot=*/*.parquet")
    (part.parent / "copy.parquet").write_bytes(part.read_bytes())
    assert hil("fleet", "query", index)[1] == once


def test_models_that_cannot_be_read_are_left_out(hil: Hil, plants: Path, tmp_path: Path) -> None:
    (plants / "a" / "run-1" / "model.yaml").write_bytes(b"\xff")
    (plants / "a" / "run-2" / "model.yaml").unlink()
    (plants / "a" / "run-2" / "model.yaml").symlink_to(plants / "nothing")
    status, out, _ = hil("fleet", "index", plants, "-o", tmp_path / "fleet.parquet")
    assert status != 0
    assert "4 runs added" in out


def test_a_damaged_model_is_left_out_with_its_reason(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    (plants / "a" / "run-1" / "model.yaml").write_text("format: 1\n")
    status, out, err = hil("fleet", "index", plants, "-o", tmp_path / "fleet.parquet")
    assert status != 0
    assert "5 runs added" in out + err
    assert "left out: " in out + err


@pytest.mark.parametrize("date", ["yesterday", "1901-01-01T00:00:00Z", "2999-01-01T00:00:00Z"])
def test_a_model_of_an_impossible_date_is_left_out_with_its_date(
    hil: Hil, plants: Path, tmp_path: Path, date: str
) -> None:
    model = plants / "a" / "run-1" / "model.yaml"
    model.write_text(model.read_text("utf-8").replace("2026-01-01T08:00:00+00:00", date), "utf-8")
    status, out, _ = hil("fleet", "index", plants, "-o", tmp_path / "fleet.parquet")
    assert (status, "5 runs added" in out) == (3, True)
    said = " ".join(out.split())
    assert f"{model.parent}: measured '{date}' must be a date from 1970 to now" in said
    assert hil("fleet", "query", tmp_path / "fleet.parquet")[0] == 0


def test_a_folder_s_copy_under_another_path_counts_once(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    index = tmp_path / "fleet.parquet"
    hil("fleet", "index", plants, "-o", index)
    shutil.copytree(plants, tmp_path / "moved" / "plants")
    hil("fleet", "index", tmp_path / "moved" / "plants", "-o", index)
    again = tmp_path / "moved" / "plants" / "b" / "run-3" / "model.yaml"
    again.write_text(f"{again.read_text('utf-8')}\n", "utf-8")
    hil("fleet", "index", tmp_path / "moved" / "plants", "-o", index)
    (fleet,) = read_fleets(index).values()
    assert (fleet.machines, len(fleet.machine)) == (("a", "b"), 6)
    assert "1 of 2 machines with significant deviations: b" in hil("fleet", "query", index)[1]


def test_machines_of_one_name_in_two_folders_are_stated(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    index, other = tmp_path / "fleet.parquet", tmp_path / "plant-2"
    shutil.copytree(plants / "b" / "run-3", other / "b" / "run-9")
    model = other / "b" / "run-9" / "model.yaml"
    model.write_text(model.read_text("utf-8").replace("2026-03", "2026-04"), "utf-8")
    hil("fleet", "index", plants, other, "-o", index)
    said = " ".join(hil("fleet", "query", index)[1].split())
    assert f"machine b: runs below {other} and {plants} count as one machine; rename" in said
    assert "machine a:" not in said


def test_machines_with_a_single_run_are_not_called_unchanged(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    index = tmp_path / "fleet.parquet"
    shutil.rmtree(plants / "a" / "run-1")
    shutil.rmtree(plants / "a" / "run-2")
    hil("fleet", "index", plants / "a", "-o", index)
    status, out, _ = hil("fleet", "query", index, "--json")
    found = json.loads(out)["judgement"]
    assert (status, found["word"]) == (0, "doubtful")
    assert "none of 1 machines can be compared" in found["text"]
    hil("fleet", "index", plants / "b", "-o", index)
    out = hil("fleet", "query", index)[1]
    assert "1 of 1 comparable machines (1 more with too few runs) with significant" in out


def execute_in_turn(
    results: Callable[[Any], Any],
) -> Callable[[Callable[..., Any], Iterable[Any]], Iterator[Any]]:
    """Return an executor in this process; `results` changes the result of each job."""
    return lambda function, jobs: ((job, results(function(job))) for job in jobs)


def test_an_interrupted_index_keeps_what_it_has_read(
    plants: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, models in (("BATCH", 2), ("PART", 4)):
        monkeypatch.setattr(f"hil.commands.fleet.{name}", models)

    def interrupt(sentence: str) -> None:
        if sentence == "read 4 of 6 models":
            raise SystemExit  # a killed process keeps what is on the disk

    with pytest.raises(SystemExit):
        index_models(
            [str(plants)], tmp_path / "fleet.parquet", execute_in_turn(lambda x: x), interrupt
        )
    found = index_models(
        [str(plants)], tmp_path / "fleet.parquet", execute_in_turn(lambda x: x), str
    )
    assert (found.new, found.known) == (2, 4)


def test_models_whose_process_ended_are_left_out_of_an_index(plants: Path, tmp_path: Path) -> None:
    ended = execute_in_turn(lambda _: BrokenExecutor("killed"))
    found = index_models([str(plants)], tmp_path / "fleet.parquet", ended, str)
    assert (found.new, len(found.left_out)) == (0, 6)
    assert "its process ended early; give the same command again" in found.left_out[0]


@pytest.mark.parametrize(
    ("folder", "why"),
    [
        ("unknown://bucket/plant", "cannot be read: Protocol not known: unknown"),
        ("{}/a/run-1/model.yaml", "is a file; name a folder"),
    ],
)
def test_what_is_no_folder_is_refused_with_its_address(
    hil: Hil, plants: Path, tmp_path: Path, folder: str, why: str
) -> None:
    status, _, err = hil("fleet", "index", folder.format(plants), "-o", tmp_path / "fleet.parquet")
    assert status == 1
    assert f"{folder.format(plants)}: {why}" in " ".join(err.split())


def test_a_folder_without_models_and_an_index_that_is_none_are_refused(
    hil: Hil, tmp_path: Path
) -> None:
    status, _, err = hil("fleet", "index", tmp_path, "-o", tmp_path / "fleet.parquet")
    assert status != 0
    assert "hil identify RUN" in err
    status, _, err = hil("fleet", "query", tmp_path / "none.parquet")
    assert status != 0
    assert "hil fleet index FOLDER" in err


@pytest.mark.parametrize(
    ("damage", "why"),
    [
        (lambda rows: rows.drop_columns("value"), "column value must hold double"),
        (lambda rows: changed(rows, "value", "text"), "column value must hold double, not string"),
        (lambda rows: changed(rows, "time", 1e300), "time from 1970 to 9999"),
        (lambda rows: changed(rows, "time", float("nan")), "time from 1970 to 9999"),
        (lambda rows: changed(rows, "machine", None, "string"), "must have values of machine"),
        (lambda rows: changed(rows, "kind", "stranger"), "a known kind"),
        (lambda _: b"PAR1, or so", "is not an index of hil fleet"),
    ],
    ids=["column missing", "text", "late", "no time", "no machine", "kind", "damaged"],
)
def test_an_index_of_a_stranger_is_refused_with_its_name(
    hil: Hil, plants: Path, tmp_path: Path, damage: Callable[[Any], Any], why: str
) -> None:
    from pyarrow import parquet

    index = tmp_path / "fleet.parquet"
    hil("fleet", "index", plants, "-o", index)
    (part,) = index.glob("*/*.parquet")
    damaged = damage(parquet.ParquetFile(part).read())
    if isinstance(damaged, bytes):
        part.write_bytes(damaged)
    else:
        parquet.write_table(damaged, part)
    status, _, err = hil("fleet", "query", index)
    assert status != 0
    assert part.parent.name in err
    assert why in " ".join(err.split())


def changed(rows: Any, name: str, value: object, kind: str | None = None) -> Any:
    """Return a table with one value in a whole column."""
    import pyarrow as pa

    column = pa.array([value] * len(rows), kind)
    return rows.set_column(rows.column_names.index(name), name, column)


def test_an_index_that_would_not_fit_into_memory_is_refused(
    hil: Hil, plants: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hil("fleet", "index", plants, "-o", tmp_path / "fleet.parquet")
    monkeypatch.setattr(fleet_index, "MOST", -100_000)
    status, _, err = hil("fleet", "query", tmp_path / "fleet.parquet")
    assert status != 0
    assert "rows would take" in " ".join(err.split())


def test_an_index_of_as_many_rows_as_a_fleet_of_a_thousand_machines_has_is_read(
    hil: Hil, plants: Path, tmp_path: Path
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    index = tmp_path / "fleet.parquet"
    hil("fleet", "index", plants, "-o", index)
    (part,) = index.glob("*/*.parquet")
    rows = parquet.read_table(part)
    many = rows.take([k % len(rows) for k in range(1_400_000)])
    parquet.write_table(many, part, compression="zstd")  # repeated rows in a small file
    assert hil("fleet", "query", index)[0] == 0
