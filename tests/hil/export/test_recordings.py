"""Recordings exported for other tools, read by the tools' own readers."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map
from small_run import SIMULATED, write_run
from synthetic import TABLE_3_A, Friction, record
from trajectory_run import write_trajectory_run

from checked_files.yaml_file import UNSTATED, FileError
from hil.errors import NotEnoughData
from hil.export.formats import RECORDINGS, export_recordings
from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings
from hil.imports.map_file import Format, MappedRobot
from hil.imports.readers import open_table
from hil.runs.recording import Finding
from hil.runs.recording_file import Measured
from hil.runs.run_folder import RunFolder
from hil.runs.set_points import set_points

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.runs.run import Run

pytest.importorskip("pyarrow")
pytest.importorskip("rosbags")
JOINTS = ("shoulder", "elbow")


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run of two joints with velocities, recorded elsewhere."""
    folder = tmp_path_factory.mktemp("imported")
    write_csv(folder / "data.csv", table())
    return import_recordings([write_map(folder, a_map(velocity=True))], folder / "run")


@pytest.fixture
def measured(small_plan: Plan, manutec: Robot, tmp_path: Path) -> RunFolder:
    """Run in two sessions: g1 was repeated in the second, with a gap and a finding."""
    folder = RunFolder.create(tmp_path / "run", small_plan, manutec)
    g1, *others = small_plan.measurements
    with folder.session(SIMULATED) as session:
        begin = 0.0
        for each in others:
            recording = record(manutec, each, TABLE_3_A, Friction(), begin=begin)
            folder.write(Measured(each, recording, session=session))
            begin = float(recording.time[-1]) + 1.0
    with folder.session(SIMULATED) as session:
        folder.keep_repeated("g1", 1, ["axis 2 stuck"])
        folder.keep(notes=("axis 3: its fan stands still",))
        recording = record(manutec, g1, TABLE_3_A, Friction())
        recording.q[5, 1] = recording.tau[5, 1] = np.nan
        recording.flags[5, 1] = 1
        found = (Finding("gaps", "a sample is missing, none may be", 1, 0),)
        folder.write(Measured(g1, recording, 2, found, session))
    return folder


def mapped(columns: str, **changes: object) -> dict[str, object]:
    """Return the map of exported columns; `columns` has placeholders for letter, joint and unit."""
    joints = [
        {
            key: {"column": columns.format(letter, j, in_name), "unit": unit}
            for key, letter, in_name, unit in (
                ("position", "q", "rad", "rad"),
                ("velocity", "qd", "rad_per_s", "rad/s"),
                ("torque", "tau", "Nm", "N m"),
            )
        }
        for j in (1, 2)
    ]
    return a_map(joints=joints, **changes)


@pytest.mark.parametrize("name", RECORDINGS)
def test_what_is_exported_and_imported_again_is_the_same(
    imported: Run, tmp_path: Path, name: str
) -> None:
    (motion,) = imported.ids
    export_recordings(imported, name, tmp_path / "out", JOINTS)
    if name == "mcap":
        content = mapped("{}", file="out/run.mcap", time=None)
        parts = {"position": "position", "velocity": "velocity", "torque": "effort"}
        for joint, columns in zip(JOINTS, content["joints"], strict=True):
            for key, part in parts.items():
                columns[key]["column"] = f"{part}/{joint}"
    else:
        time = {"column": "time_s", "unit": "s"}
        content = mapped("{}{}_{}", file=f"out/recordings/{motion}.{name}", time=time)
    again = import_recordings([write_map(tmp_path, content)], tmp_path / "again")
    first, second = imported[motion].recording, again["map-01"].recording
    np.testing.assert_array_equal(second.q, first.q)
    np.testing.assert_array_equal(second.tau, first.tau)
    np.testing.assert_array_equal(second.qd, first.qd)
    np.testing.assert_allclose(np.diff(second.time), np.diff(first.time), atol=2e-9)


def test_csv_has_a_plain_header_and_the_very_numbers(measured: RunFolder, tmp_path: Path) -> None:
    export_recordings(measured, "csv", tmp_path / "out")
    for each in measured:
        with (tmp_path / "out" / "recordings" / f"{each.measurement.id}.csv").open() as file:
            header, *rows = csv.reader(file)
        assert len(header) == len(set(header))
        assert all(name.replace("_", "").isalnum() for name in header)
        assert {len(row) for row in rows} == {len(header)}
        cells = dict(zip(header, zip(*rows, strict=True), strict=True))
        recording = each.recording
        assert [float(cell) for cell in cells["time_s"]] == recording.time.tolist()
        for letter, unit, values in (("q", "rad", recording.q), ("tau", "Nm", recording.tau)):
            for joint, column in enumerate(values.T, start=1):
                found = [float(cell or "nan") for cell in cells[f"{letter}{joint}_{unit}"]]
                np.testing.assert_array_equal(found, column)
        assert [int(cell) for cell in cells["stroke"]] == recording.stroke.tolist()
        assert not any("qd" in name for name in header)


def test_a_missing_sample_is_an_empty_cell(measured: RunFolder, tmp_path: Path) -> None:
    export_recordings(measured, "csv", tmp_path / "out")
    with (tmp_path / "out" / "recordings" / "g1.csv").open() as file:
        row = list(csv.DictReader(file))[5]
    assert (row["q2_rad"], row["tau2_Nm"], row["flags2"]) == ("", "", "1")


def test_pandas_reads_each_table_and_the_index(measured: RunFolder, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    export_recordings(measured, "csv", tmp_path / "csv")
    export_recordings(measured, "parquet", tmp_path / "parquet")
    index = pandas.read_csv(tmp_path / "csv" / "index.csv")
    assert index["id"].tolist() == ["g1", "i1", "c1"]
    assert index["kind"].tolist() == ["gravity", "inertia", "coupling"]
    assert index["axes"].astype(str).tolist() == ["2", "3", "1 2"]
    assert index["read"].tolist() == [2, 3, 1]
    assert index["session"].tolist() == [1, 0, 0]
    assert index["findings"].tolist()[0] == "a sample is missing, none may be"
    for name in index["file"]:
        text = pandas.read_csv(tmp_path / "csv" / name)
        columns = pandas.read_parquet(tmp_path / "parquet" / name.replace("csv", "parquet"))
        pandas.testing.assert_frame_equal(text, columns, check_dtype=False, rtol=1e-14)


def test_parquet_states_units_and_what_is_derived(measured: RunFolder, tmp_path: Path) -> None:
    from pyarrow.parquet import read_schema

    export_recordings(measured, "parquet", tmp_path / "out")
    schema = read_schema(tmp_path / "out" / "recordings" / "g1.parquet")
    assert schema.metadata[b"run id"].decode() == measured.journal.run_id
    stated = {field.name: field.metadata for field in schema}
    assert stated["tau2_Nm"][b"unit"] == b"N m"
    assert stated["tau2_Nm"][b"origin"] == b"recorded"
    assert stated["set2_rad"][b"origin"] == b"derived"


def test_set_points_are_where_the_robot_was_sent(manutec: Robot, tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", manutec)
    export_recordings(folder, "csv", tmp_path / "out")
    path = tmp_path / "out" / "recordings" / "g01.csv"
    rows = np.genfromtxt(path, delimiter=",", names=True)
    axis = folder["g01"].measurement.axis
    assert np.ptp(rows[f"set{axis}_rad"]) > 0.1
    assert np.abs(rows[f"set{axis}_rad"] - rows[f"q{axis}_rad"]).max() < 0.01


def test_set_points_of_a_trajectory_are_what_was_streamed(manutec: Robot, tmp_path: Path) -> None:
    folder = write_trajectory_run(tmp_path / "run", manutec)
    export_recordings(folder, "csv", tmp_path / "out")
    (each,) = folder
    rows = np.genfromtxt(
        tmp_path / "out" / "recordings" / f"{each.measurement.id}.csv", delimiter=",", names=True
    )
    path = each.measurement.path(each.recording.period)
    found = np.column_stack([rows[f"set{axis}_rad"] for axis in range(1, 7)])
    np.testing.assert_allclose(found[:-1], path[1:], atol=1e-9)  # one SYNC before its sample


def test_the_text_beside_them_explains_every_column(measured: RunFolder, tmp_path: Path) -> None:
    export_recordings(measured, "csv", tmp_path / "out")
    text = (tmp_path / "out" / "README.txt").read_text()
    header = (tmp_path / "out" / "recordings" / "g1.csv").read_text().partition("\n")[0]
    for name in header.split(","):
        assert f"\n{name}: " in text
    assert "set2_rad: set-point of joint 2 [rad], derived" in text
    assert "q2_rad: position of joint 2 [rad], recorded" in text
    assert measured.journal.run_id in text


def test_torques_of_unknown_gain_have_no_unit_in_their_name(imported: Run, tmp_path: Path) -> None:
    (each,) = imported
    motion = each.measurement.model_copy(update={"unknown_gains": (2,)})
    from hil.export.recordings.tables import columns

    names = [c.name for c in columns(imported.robot, replace(each, measurement=motion))]
    assert "tau1_Nm" in names
    assert "tau2_unknown_unit" in names


# --- MCAP -----------------------------------------------------------------------------------------


def messages(path: Path, topic: str) -> list[tuple[int, object]]:
    """Return messages of a topic by the readers of rosbags."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        here = [each for each in reader.connections if each.topic == topic]
        return [
            (stamp, reader.deserialize(data, connection.msgtype))
            for connection, stamp, data in reader.messages(here)
        ]


def test_joint_states_are_the_samples(measured: RunFolder, tmp_path: Path) -> None:
    export_recordings(measured, "mcap", tmp_path / "out")
    found = messages(tmp_path / "out" / "run.mcap", "/joint_states")
    recordings = [measured[name].recording for name in ("i1", "c1", "g1")]  # in order of time
    assert len(found) == sum(recording.n_samples for recording in recordings)
    positions = np.array([message.position for _, message in found])
    np.testing.assert_array_equal(positions, np.concatenate([r.q for r in recordings]))
    efforts = np.array([message.effort for _, message in found])
    np.testing.assert_array_equal(efforts, np.concatenate([r.tau for r in recordings]))
    assert found[0][1].name == [f"joint{k}" for k in range(1, 7)]
    assert found[0][1].velocity.size == 0
    stamps = [stamp for stamp, _ in found]
    assert [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for _, m in found] == stamps
    assert (np.diff(stamps) > 0).all()
    within = np.diff(stamps[: recordings[0].n_samples]) / 1e9
    np.testing.assert_allclose(within, np.diff(recordings[0].time), atol=2e-9)


def test_the_official_reader_finds_all_and_where_it_comes_from(
    measured: RunFolder, tmp_path: Path
) -> None:
    from mcap.reader import make_reader

    export_recordings(measured, "mcap", tmp_path / "out")
    with (tmp_path / "out" / "run.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        schemas = {each.name: each for each in summary.schemas.values()}
        (stated,) = reader.iter_metadata()
        samples = [message for _, _, message in reader.iter_messages(["/joint_states"])]
    n_samples = sum(each.recording.n_samples for each in measured)
    assert len(samples) == n_samples
    assert set(schemas) == {"sensor_msgs/msg/JointState", "rcl_interfaces/msg/Log"}
    assert {each.encoding for each in schemas.values()} == {"ros2msg"}
    assert b"float64[] effort" in schemas["sensor_msgs/msg/JointState"].data
    assert stated.metadata["run id"] == measured.journal.run_id


def test_events_state_measurements_findings_repetitions_and_notes(
    measured: RunFolder, tmp_path: Path
) -> None:
    export_recordings(measured, "mcap", tmp_path / "out")
    found = messages(tmp_path / "out" / "run.mcap", "/events")
    assert [(m.name, m.level, m.msg) for _, m in found] == [
        ("i1", 20, "inertia, axis 3"),
        ("c1", 20, "coupling, axis 1 with partner 2"),
        ("g1", 20, "axis 3: its fan stands still"),
        ("g1", 30, "attempt 1 was repeated: axis 2 stuck"),
        ("g1", 20, "gravity, axis 2"),
        ("g1", 30, "a sample is missing, none may be"),
    ]


def test_set_points_lie_at_the_stamps_of_the_samples(measured: RunFolder, tmp_path: Path) -> None:
    export_recordings(measured, "mcap", tmp_path / "out")
    path = tmp_path / "out" / "run.mcap"
    planned, states = messages(path, "/set_points"), messages(path, "/joint_states")
    assert [stamp for stamp, _ in planned] == [stamp for stamp, _ in states]
    assert all(message.effort.size == 0 for _, message in planned)
    wanted = [set_points(measured[name].measurement, measured[name].recording)
              for name in ("i1", "c1", "g1")]  # fmt: skip
    positions = np.array([message.position for _, message in planned])
    np.testing.assert_array_equal(positions, np.concatenate(wanted))


def test_set_points_are_not_taken_for_a_recording(measured: RunFolder, tmp_path: Path) -> None:
    export_recordings(measured, "mcap", tmp_path / "out")
    found = open_table(tmp_path / "out" / "run.mcap", Format())
    assert "effort/joint1" in found.names


def test_a_map_drafted_from_it_leaves_the_robot_alone_to_state(
    measured: RunFolder, tmp_path: Path
) -> None:
    export_recordings(measured, "mcap", tmp_path / "out")
    text = draft_map(tmp_path / "out" / "run.mcap", "run.mcap")
    (unstated,) = (line for line in text.splitlines() if f": {UNSTATED}" in line)
    assert unstated.startswith("robot: ")
    whole = draft_map(
        tmp_path / "out" / "run.mcap", "run.mcap", measured.robot, MappedRobot(name="manutec-r15")
    )
    assert UNSTATED not in whole.partition("\nrobot: ")[2]


def test_what_is_imported_has_velocities_but_no_set_points(imported: Run, tmp_path: Path) -> None:
    export_recordings(imported, "mcap", tmp_path / "out")
    path = tmp_path / "out" / "run.mcap"
    assert messages(path, "/set_points") == []
    (each,) = imported
    velocities = np.array([message.velocity for _, message in messages(path, "/joint_states")])
    np.testing.assert_array_equal(velocities, each.recording.qd)


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_damaged_recording_leaves_nothing_behind(
    measured: RunFolder, tmp_path: Path, name: str
) -> None:
    path = tmp_path / "run" / "recordings" / "c1.h5"
    path.write_bytes(path.read_bytes()[:-100])
    before = sorted(tmp_path.iterdir())
    with pytest.raises(FileError, match=r"c1.h5: is damaged"):
        export_recordings(measured, name, tmp_path / "out")
    assert sorted(tmp_path.iterdir()) == before
    export_recordings(measured.exclude(["c1"]), name, tmp_path / "out")


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_folder_with_other_things_in_it_stays_as_it_is(
    measured: RunFolder, tmp_path: Path, name: str
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(FileError, match="out: already exists; choose another folder with -o"):
        export_recordings(measured, name, tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine.txt"]
    (tmp_path / "out" / "mine.txt").unlink()
    export_recordings(measured, name, tmp_path / "out")


def test_the_folder_in_which_the_user_stands_is_not_exchanged(
    measured: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with pytest.raises(FileError, match="already exists"):
        export_recordings(measured, "csv", Path())


def test_a_run_without_recordings_is_refused(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    folder = RunFolder.create(tmp_path / "run", small_plan, manutec)
    with pytest.raises(NotEnoughData, match="no recordings to export; measure them with --resume"):
        export_recordings(folder, "csv", tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "package"), [("mcap", "mcap"), ("mcap", "rosbags"), ("parquet", "pyarrow")]
)
def test_a_package_that_is_missing_is_named_with_its_remedy(
    measured: RunFolder,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    package: str,
) -> None:
    for module in (package, f"{package}.writer", f"{package}.typesys", f"{package}.parquet"):
        monkeypatch.setitem(__import__("sys").modules, module, None)
    with pytest.raises(FileError) as refused:
        export_recordings(measured, name, tmp_path / "out")
    assert f"--to {name}: needs the package {package}" in str(refused.value)
    assert "in a checkout, pip install '.[recordings]'" in str(refused.value)
    assert not (tmp_path / "out").exists()
