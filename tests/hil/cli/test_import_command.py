"""`hil import`: output, and refusals without any written file."""

from pathlib import Path

import pytest
from command_line import Hil
from small_recording import a_map, table, write_csv, write_map

import hil as library
from hil.imports.importing import import_recordings
from hil.runs.run import Run


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Working folder with a recording and its map."""
    monkeypatch.chdir(tmp_path)
    write_csv(tmp_path / "data.csv", table(4.0))
    write_map(tmp_path, a_map())
    return tmp_path


def test_a_run_is_made_and_what_was_found_is_stated(hil: Hil, folder: Path) -> None:
    status, printed, errors = hil("import", "map.yaml", "-o", "runs/x")
    assert (status, errors) == (0, "")
    assert printed.splitlines() == [
        "map.yaml: data.csv: 801 rows at 200 Hz, jitter 0 ms; time stamps equidistant as recorded",
        "map.yaml: 1 motion, map-01: 4 s in 4 blocks",
        "runs/x: a run of pair; continue with: hil identify runs/x",
    ]
    assert Run.open(folder / "runs" / "x").ids == ("map-01",)


def test_what_is_wrong_is_one_message(hil: Hil, folder: Path) -> None:
    write_map(folder, a_map("none.csv"))
    status, printed, errors = hil("import", "map.yaml", "-o", "runs/x")
    assert (status, printed) == (1, "")
    assert errors == ("map.yaml:3: files.0: none.csv: cannot be read: No such file or directory\n")
    assert not (folder / "runs").exists()


def test_a_draft_names_the_recording_as_seen_from_the_map(hil: Hil, folder: Path) -> None:
    (folder / "maps").mkdir()
    status, printed, _ = hil("import", "--draft", "data.csv", "-o", "maps/first.yaml")
    assert status == 0
    assert printed.splitlines() == [
        "maps/first.yaml: 8 lines marked !state must be filled in by you",
        "maps/first.yaml: names files outside of its folder; import with: hil"
        f" import maps/first.yaml --files {folder} -o RUN",
    ]
    assert 'files: ["../data.csv"]' in (folder / "maps" / "first.yaml").read_text()


def test_a_draft_states_the_format_that_it_was_read_by(hil: Hil, folder: Path) -> None:
    """A layout that cannot be recognised is given to the draft, and a map needs it too."""
    text = (folder / "data.csv").read_text().replace(",", "|")
    (folder / "data.csv").write_text("1|2 settings\n3|4\n" + text)
    options = ("--format", "delimiter=|", "--format", "skip=2", "--format", "header=true")
    status, _, _ = hil("import", "--draft", "data.csv", *options, "-o", "first.yaml")
    assert status == 0
    drafted = (folder / "first.yaml").read_text()
    assert 'format:\n  header: true\n  delimiter: "|"\n  skip: 2\n' in drafted
    assert drafted.count("position:") == 2


def test_a_draft_names_the_robot_as_a_map_does(hil: Hil, folder: Path) -> None:
    links = '<link name="base"/><link name="arm"/><link name="tool"/>'
    joint = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>{}</joint>'
    limit = '<limit lower="-1" upper="1" effort="9" velocity="3"/>'
    joints = joint.format("j", "revolute", "base", "arm", limit)
    follows = joint.format("f", "revolute", "arm", "tool", f'{limit}<mimic joint="j"/>')
    (folder / "a.urdf").write_text(f'<robot name="a">{links}{joints}{follows}</robot>')
    draft = "import", "--draft", "data.csv", "-o", "sub/first.yaml", "--robot"
    (folder / "sub").mkdir()
    status, _, errors = hil(*draft, "a.urdf")
    assert status == 1
    assert "robot: {urdf: a.urdf, to: arm}, for a draft by that --robot" in " ".join(errors.split())
    status, said, _ = hil(*draft, "{urdf: a.urdf, to: arm}")
    assert status == 0
    assert said.count("--files") == 1
    drafted = (folder / "sub" / "first.yaml").read_text()
    assert 'robot: {urdf: "../a.urdf", to: "arm"}' in drafted


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [(("--draft", "data.csv", "--format", "skip=-1"), "must be greater than or equal to 0"),
     (("--draft", "data.csv", "--format", "topics=/a"), "topics: unknown key"),
     (("--draft", "data.csv", "--format", "topic"), "must read key=value"),
     (("map.yaml", "--format", "skip=1"), "maps name their robot and format")],
)  # fmt: skip
def test_a_format_that_nothing_can_be_read_by_is_refused(
    hil: Hil, folder: Path, arguments: tuple[str, ...], reason: str
) -> None:
    status, _, errors = hil("import", *arguments, "-o", "first.yaml")
    assert status == 2
    assert reason in " ".join(errors.split())


def test_a_map_reads_files_outside_of_its_folder_where_they_are_allowed_alone(
    hil: Hil, folder: Path
) -> None:
    """A map may come from a stranger, and the user may send back the run made from it."""
    (folder / "maps").mkdir()
    write_map(folder / "maps", a_map("../data.csv"))
    status, _, errors = hil("import", "maps/map.yaml", "-o", "runs/x")
    assert status == 1
    assert errors == (
        "maps/map.yaml:3: files.0: maps/../data.csv is outside of the map's folder, and its content"
        " would become part of the run; if you trust the map, allow it with --files"
        f" {folder}, in Python with files=\n"
    )
    assert not (folder / "runs").exists()
    for number, allowed in enumerate([folder, "data.csv"]):
        status, *_ = hil("import", "maps/map.yaml", "-o", f"runs/{number}", "--files", str(allowed))
        assert status == 0


@pytest.mark.parametrize(
    "named",
    [a_map("link.csv"), a_map(robot={"urdf": "../arm.urdf"}), a_map(robot="../arm.yaml"),
     a_map(robot="../arm"), a_map(time={"column": {"file": "../data.csv", "column": "t"}})],
)  # fmt: skip
def test_whatever_a_map_names_outside_of_its_folder_is_refused(
    hil: Hil, folder: Path, named: str
) -> None:
    (folder / "maps").mkdir()
    (folder / "maps" / "data.csv").write_bytes((folder / "data.csv").read_bytes())
    (folder / "maps" / "link.csv").symlink_to(folder / "data.csv")
    write_map(folder / "maps", named)
    status, _, errors = hil("import", "maps/map.yaml", "-o", "runs/x")
    assert (status, errors.count("outside of the map's folder")) == (1, 1)


def test_a_recording_in_place_of_a_map_is_refused_with_the_way_to_one(
    hil: Hil, folder: Path
) -> None:
    status, _, errors = hil("import", "data.csv", "-o", "runs/x")
    assert status == 1
    assert errors.endswith("draft one with: hil import --draft data.csv -o map.yaml\n")
    assert not (folder / "runs").exists()


def test_a_draft_is_never_written_over_a_file(hil: Hil, folder: Path) -> None:
    status, _, errors = hil("import", "--draft", "data.csv", "-o", "map.yaml")
    assert status == 1
    assert "map.yaml: already exists" in errors


@pytest.mark.parametrize("arguments", [(), ("map.yaml", "--draft", "data.csv")])
def test_maps_or_a_draft(hil: Hil, folder: Path, arguments: tuple[str, ...]) -> None:
    status, _, errors = hil("import", *arguments, "-o", "x")
    assert status == 2
    assert "give either maps" in errors
    assert not (folder / "x").exists()


@pytest.mark.long
def test_maps_are_imported_at_once_by_processes(hil: Hil, folder: Path) -> None:
    write_csv(folder / "more.csv", table(5.0))
    write_map(folder, a_map("more.csv"), "second.yaml")
    hil("import", "map.yaml", "second.yaml", "-o", "in-turn")
    status, printed, errors = hil("import", "map.yaml", "second.yaml", "-o", "x", "--workers", 2)
    assert (status, errors) == (0, "")
    assert "second.yaml: 1 motion, second-01: 5 s in 5 blocks" in printed
    for path in (folder / "in-turn").rglob("*"):
        # run.json contains the times of its creation
        if path.is_file() and path.name != "run.json":
            assert (folder / "x" / path.relative_to(folder / "in-turn")).read_bytes() == (
                path.read_bytes()
            )


def test_workers_of_this_machine_and_a_cluster_exclude_each_other(hil: Hil, folder: Path) -> None:
    options = ("--workers", 2, "--scheduler", "tcp://127.0.0.1:1")
    status, _, errors = hil("import", "map.yaml", "-o", "x", *options)
    assert status == 2
    assert "--workers applies to this machine" in errors


def test_python_has_the_same() -> None:
    assert library.import_recordings is import_recordings


def test_escape_sequences_in_names_do_not_reach_the_terminal(hil: Hil, folder: Path) -> None:
    write_map(folder, a_map("\x1b[31mgone.csv"))
    _, _, errors = hil("import", "map.yaml", "-o", "x")
    assert r"\x1b[31mgone.csv: cannot be read" in errors
    (folder / "\x1b[31mgone.csv").write_bytes((folder / "data.csv").read_bytes())
    status, printed, _ = hil("import", "--draft", "\x1b[31mgone.csv", "-o", "x.yaml")
    assert (status, printed.count("x.yaml")) == (0, 1)
    assert "\x1b" not in printed + errors + (folder / "x.yaml").read_text()
