"""Run folders from maps and recordings: units, sides, pieces, rows, strokes; all or nothing."""

import hashlib

import numpy as np
import pytest
import yaml
from small_recording import a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports import one_map, samples
from hil.imports.importing import import_recordings
from hil.results.identification import identify
from hil.runs.run import Run


def made(folder, columns, content=None, name="run", **changes):
    """Import a CSV of these columns; return the run and the printed statement."""
    write_csv(folder / "data.csv", columns)
    stated = []
    the_map = write_map(folder, content or a_map(**changes))
    run = import_recordings([the_map], folder / name, lambda s: stated.extend(s.lines()))
    return run, "\n".join(stated)


def test_a_run_folder_has_all_that_a_run_has(tmp_path):
    run, _ = made(tmp_path, table())
    assert sorted(p.name for p in run.path.iterdir()) == [
        "maps", "motions.yaml", "recordings", "robot.yaml", "run.json",
    ]  # fmt: skip
    text = (tmp_path / "map.yaml").read_text()
    assert (run.path / "maps" / "map.yaml").read_text() == text
    assert run.imported
    assert run.plan.map_digest == hashlib.sha256(text.encode()).hexdigest()
    assert run.robot.text == (tmp_path / "pair.yaml").read_text()
    assert run.missing == ()
    (measured,) = Run.open(run.path)
    assert measured.measurement.source == "data.csv, rows 1 to 2001"
    assert measured.measurement.duration == pytest.approx(10)
    assert measured.measurement.cycles == 8
    assert set(measured.recording.group) == set(range(8))
    assert set(measured.recording.stroke) == {-1}
    assert not measured.recording.flags.any()


UNITS = [
    ("position", "q", "deg", {}, 180 / np.pi),
    ("position", "q", "counts", {"per_unit": 1e-4}, 1e4),
    ("position", "q", "counts", {"per_unit": 2 * np.pi / 3}, 1.5 / np.pi),
    ("position", "q", "counts", {"per_unit": 6.2832}, 1 / 6.2832),
    ("position", "q", "turns", {}, 0.5 / np.pi),
    ("position", "q", "rev", {}, 0.5 / np.pi),
    ("velocity", "v", "turns/s", {}, 0.5 / np.pi),
    ("velocity", "v", "rev/s", {}, 0.5 / np.pi),
    ("velocity", "v", "counts/s", {"per_unit": 2 * np.pi}, 0.5 / np.pi),
    ("velocity", "v", "deg/s", {}, 180 / np.pi),
    ("velocity", "v", "rpm", {}, 30 / np.pi),
    ("torque", "m", "A", {"gain": 2.5}, 0.4),
    ("torque", "m", "V", {"gain": 10}, 0.1),
    ("torque", "m", "per mille", {"gain": 0.3}, 1 / 0.3),
    ("torque", "m", "N m", {"sign": -1}, -1.0),
    ("position", "q", "rad", {"offset": 0.25, "sign": -1}, None),
]


@pytest.mark.parametrize(("key", "letter", "unit", "more", "factor"), UNITS)
def test_units_signs_and_offsets_become_si(tmp_path, key, letter, unit, more, factor):
    columns = table(3.0)
    q, qd, tau = motion(columns["t"])
    name = f"{letter}2"
    columns[name] = -(columns[name] - 0.25) if factor is None else columns[name] * factor
    content = a_map(velocity=key == "velocity")
    content["joints"][1][key] |= {"unit": unit, **more}
    run, _ = made(tmp_path, columns, content)
    recording = run["map-01"].recording
    np.testing.assert_allclose(recording.q, q, atol=1e-12)
    np.testing.assert_allclose(recording.tau, tau, atol=1e-12)
    if key == "velocity":
        np.testing.assert_allclose(recording.qd, qd, atol=1e-3)


@pytest.mark.parametrize(
    ("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("min", 1 / 60)]
)
def test_stamps_in_any_unit(tmp_path, unit, factor):
    columns = table(3.0)
    columns["t"] = columns["t"] * factor
    run, _ = made(tmp_path, columns, time={"column": "t", "unit": unit})
    assert run["map-01"].recording.period == pytest.approx(0.005)


def test_stamps_of_a_date_count_from_the_first(tmp_path):
    columns = table(5.0)
    columns["t"] = columns["t"] + 1.7e9
    run, _ = made(tmp_path, columns, time_range=[1, 3])
    recording = run["map-01"].recording
    assert recording.n_samples == 401
    np.testing.assert_allclose(recording.q[0], motion(np.array([1.0]))[0][0], atol=1e-5)


def test_without_stamps_a_rate_does(tmp_path):
    run, stated = made(tmp_path, table(3.0), time={"rate": 200})
    assert run["map-01"].recording.period == pytest.approx(0.005)
    assert "601 rows at 200 Hz" in stated


def test_the_motor_s_side_comes_to_the_joint_s(tmp_path):
    columns = table(4.0)
    q, _, tau = motion(columns["t"])
    gears = np.array([[50.0, 0.0], [20.0, 20.0]])  # motor 2 turns with joint 1 as well
    at_motors, efforts = q @ gears.T, tau @ np.linalg.inv(gears)
    for j in range(2):
        columns |= {f"q{j + 1}": at_motors[:, j], f"m{j + 1}": efforts[:, j]}
    write_map(tmp_path, a_map(position_side="motor", torque_side="motor", robot="coupled.yaml"))
    robot = (tmp_path / "pair.yaml").read_text()
    (tmp_path / "coupled.yaml").write_text(f"{robot}couplings: [{{motor: 2, joint: 1}}]\n")
    write_csv(tmp_path / "data.csv", columns)
    recording = import_recordings([tmp_path / "map.yaml"], tmp_path / "run")["map-01"].recording
    np.testing.assert_allclose(recording.q, q, atol=1e-9)
    np.testing.assert_allclose(recording.tau, tau, atol=1e-9)


def test_an_uncertain_gain_becomes_the_torque_constant_s_uncertainty(tmp_path):
    content = a_map()
    content["joints"][0]["torque"] |= {"unit": "A", "gain": 2.0, "gain_uncertainty": 0.1}
    columns = table(3.0)
    columns["m1"] = columns["m1"] / 2
    run, _ = made(tmp_path, columns, content)
    assert run.robot.torque_constant_uncertainty.tolist() == [0.05, 0.0]


def test_rows_make_segments(tmp_path):
    run, _ = made(tmp_path, table(), rows=[[1, 401], [1001, 2001]])
    assert [m.measurement.source for m in run] == [
        "data.csv, rows 1 to 401", "data.csv, rows 1001 to 2001",
    ]  # fmt: skip
    assert [m.recording.n_samples for m in run] == [401, 1001]
    np.testing.assert_array_equal(run["map-02"].recording.q[:, 0], table()["q1"][1000:])


def test_times_make_segments(tmp_path):
    run, _ = made(tmp_path, table(), time_range=[[1.0, 3.0], [5.0, 9.5]])
    assert [m.measurement.duration for m in run] == [2.0, 4.5]


def test_files_are_pieces_of_one_recording(tmp_path):
    whole = table()
    for name, part in (("a.csv", slice(0, 1000)), ("b.csv", slice(1000, None))):
        write_csv(tmp_path / name, {key: values[part] for key, values in whole.items()})
    run, _ = made(tmp_path, whole, files=["a.csv", "b.csv"])
    assert len(run) == 1  # stamps continue, so there is no gap
    np.testing.assert_array_equal(run["map-01"].recording.q[:, 1], whole["q2"])


def test_files_whose_time_begins_anew_are_apart(tmp_path):
    write_csv(tmp_path / "a.csv", table(4.0))
    run, _ = made(tmp_path, table(), files=["a.csv", "data.csv", "a.csv"])
    assert [m.measurement.source for m in run] == [
        "a.csv, rows 1 to 801", "data.csv, rows 1 to 2001", "a.csv, rows 1 to 801",
    ]  # fmt: skip


def test_columns_may_stand_in_files_side_by_side(tmp_path):
    whole = table(5.0)
    write_csv(tmp_path / "torques.csv", {key: whole[key] for key in ("m1", "m2")})
    content = a_map()
    for j, joint in enumerate(content["joints"], start=1):
        joint["torque"]["column"] = {"file": "torques.csv", "column": j}
    run, _ = made(tmp_path, {k: v for k, v in whole.items() if k[0] != "m"}, content)
    np.testing.assert_array_equal(run["map-01"].recording.tau[:, 1], whole["m2"])


def test_several_maps_make_one_run(tmp_path):
    write_csv(tmp_path / "data.csv", table(3.0))
    first = write_map(tmp_path, a_map(), "first.yaml")
    second = write_map(tmp_path, a_map(cut_off=8), "second.yaml")
    run = import_recordings([first, second], tmp_path / "run")
    assert run.ids == ("first-01", "second-01")
    assert [m.cut_off for m in run.motions] == [None, 8.0]
    assert sorted(p.name for p in (run.path / "maps").iterdir()) == ["first.yaml", "second.yaml"]


def test_maps_of_different_robots_are_refused(tmp_path):
    write_csv(tmp_path / "data.csv", table(3.0))
    first = write_map(tmp_path, a_map(), "first.yaml")
    second = write_map(tmp_path, a_map(robot="other.yaml"), "second.yaml")
    other = (tmp_path / "pair.yaml").read_text().replace("l: 0.5", "l: 0.6")
    (tmp_path / "other.yaml").write_text(other)
    with pytest.raises(FileError, match=r"second.yaml:1: robot: pair differs from the robot of"):
        import_recordings([first, second], tmp_path / "run")


def test_a_long_recording_is_cut_into_minutes(tmp_path):
    run, stated = made(tmp_path, table(150.0, rate=50.0))
    assert run.ids == ("map-01", "map-02", "map-03")
    assert sum(m.recording.n_samples for m in run) == 7501
    assert [m.measurement.cycles for m in run] == [3, 3, 3]
    times = np.concatenate([m.recording.time for m in run])
    np.testing.assert_allclose(np.diff(times), 0.02, atol=1e-9)
    assert "3 motions, map-01 to map-03" in stated


def test_what_is_left_out_is_stated_and_kept(tmp_path):
    columns = table()
    columns["q1"][100] = np.nan
    columns = {key: np.delete(values, np.s_[600:700]) for key, values in columns.items()}
    run, stated = made(tmp_path, columns)
    assert "1 row lacks a number" in stated
    assert "1 missing sample is interpolated" in stated
    assert "1 gap, 0.5 s in all, is left out" in stated
    assert "\n".join(run.journal.sessions[0].notes) == stated
    recording = run["map-01"].recording
    np.testing.assert_allclose(recording.q[100], motion(recording.time[[100]])[0][0], atol=1e-5)


@pytest.mark.parametrize("rows", [1, samples.IN_CACHE])
def test_angles_that_were_kept_within_a_turn_go_on(tmp_path, monkeypatch, rows):
    """One turn begins with the first row of a block of rows."""
    monkeypatch.setattr(samples, "IN_CACHE", rows)
    columns = table()
    columns["t"] = columns["t"] + 0.002 * np.sin(np.arange(len(columns["t"])))
    turned = columns["q1"] + 2.5
    columns["q1"] = (turned + np.pi) % (2 * np.pi) - np.pi
    content = a_map(accept=["range"])
    content["joints"][0]["position"]["offset"] = -2.5
    run, stated = made(tmp_path, columns, content)
    q = run["map-01"].recording.q[:, 0]
    assert np.abs(np.diff(q)).max() < 0.05
    turns = (q[:1900] - table()["q1"][:1900]) / (2 * np.pi)
    np.testing.assert_allclose(turns, round(turns[0]), atol=0.01)
    assert "jumps of whole turns are removed" in stated


# --- velocities -----------------------------------------------------------------------------------


def test_every_recorded_velocity_is_kept_however_noisy_or_late(tmp_path):
    columns, rng = table(), np.random.default_rng(0)
    columns["v1"] = columns["v1"] + rng.normal(0, 0.1, len(columns["t"]))
    columns["v2"] = motion(columns["t"] - 0.012)[1][:, 1]
    run, stated = made(tmp_path, columns, velocity=True)
    recording = run["map-01"].recording
    np.testing.assert_array_equal(recording.qd, np.stack([columns["v1"], columns["v2"]], axis=1))
    assert "velocity of all joints was recorded; identification states whether" in stated


def test_a_joint_without_a_recorded_velocity_has_none_in_the_run(tmp_path):
    columns, content = table(), a_map(velocity=True)
    del content["joints"][0]["velocity"]
    run, stated = made(tmp_path, columns, content)
    recording = run["map-01"].recording
    assert np.isnan(recording.qd[:, 0]).all()
    np.testing.assert_array_equal(recording.qd[:, 1], columns["v2"])
    assert "velocity of joint 2 was recorded" in stated


def test_without_recorded_velocities_a_run_has_no_array_of_them(tmp_path):
    run, stated = made(tmp_path, table(3.0))
    assert run["map-01"].recording.qd is None
    assert "velocity" not in stated


# --- strokes --------------------------------------------------------------------------------------


def resting_elbow():
    """Return columns of a recording whose second joint trembles at rest."""
    columns = table(20.0)
    columns["q2"] = 0.3 + 1e-4 * np.random.default_rng(0).standard_normal(len(columns["t"]))
    return columns


def test_what_import_doubts_is_kept_and_lowers_the_first_word(tmp_path):
    run, stated = made(tmp_path, resting_elbow())
    (warning,) = run.journal.warnings
    assert "map.yaml:14: joints.1.position: moves by" in warning
    assert "accept: [still]" in warning
    assert "joints.1.position" in stated
    outcome = identify(run).verdict
    assert outcome.word == "doubtful"
    assert outcome.reason.startswith("axis 2 does not move in the recordings: ")
    (doubt,) = [each for each in outcome.reasons if each.reason.startswith("import warned: ")]
    assert "accept: [still]" in doubt.remedy


def test_the_gravest_doubt_comes_first(tmp_path):
    columns = resting_elbow()
    columns["q1"] += 1.5  # beyond the range of the robot file
    run, _ = made(tmp_path, columns)
    beyond, resting = run.journal.warnings
    assert "joints.0.position: reaches" in beyond
    assert "joints.1.position: moves by" in resting


def test_a_doubt_that_the_map_accepts_is_resolved(tmp_path):
    run, stated = made(tmp_path, resting_elbow(), accept=["still"])
    assert run.journal.warnings == ()
    assert "joints.1.position" in stated


def back_and_forth(duration=40.0, way=0.4, rate=100.0):
    """Return columns with joint 1 forward and backward in 4 s, with rests; the first motion is
    backward.
    """
    t = np.arange(round(duration * rate)) / rate
    phase = (t - 1.0) % 4.0
    q = way * np.interp(phase, [0, 1.5, 2, 3.5, 4], [0, 1, 1, 0, 0])
    qd = np.gradient(q, t)
    zeros = np.zeros_like(t)
    columns = {"t": t, "q1": q, "q2": zeros + 0.3, "m1": 30 * np.cos(q) + 2 * np.tanh(qd / 0.01),
               "m2": 8 + 1e-3 * np.sin(40 * t)}  # fmt: skip
    return columns, qd


def test_strokes_are_found_and_numbered(tmp_path):
    columns, qd = back_and_forth()
    run, stated = made(tmp_path, columns, kind={"back_and_forth": 1})
    (measured,) = run
    stroke, speed = measured.recording.stroke, qd[: measured.recording.n_samples]
    assert measured.measurement.alone == 1
    assert measured.measurement.cycles == 10
    assert set(stroke) == set(range(-1, 20))
    assert set(measured.recording.group) == set(range(-1, 10))
    assert np.array_equal(measured.recording.group, measured.recording.pair)
    assert np.all(speed[(stroke >= 0) & (stroke % 2 == 0)] >= 0)
    assert np.all(speed[(stroke >= 0) & (stroke % 2 == 1)] <= 0)
    assert np.all(np.abs(speed[stroke == -1]).reshape(-1)[150:] < 0.3)
    assert "in 10 pairs of strokes of joint 1" in stated


def test_long_ones_are_cut_between_pairs(tmp_path):
    columns, _ = back_and_forth(200.0)
    run, _ = made(tmp_path, columns, kind={"back_and_forth": 1})
    assert len(run) == 4
    assert sum(m.measurement.cycles for m in run) == 50
    assert all(m.measurement.duration <= 60 for m in run)
    for measured in run:
        assert set(measured.recording.stroke) >= set(range(2 * measured.measurement.cycles))


def test_another_joint_that_moves_is_refused(tmp_path):
    columns, _ = back_and_forth()
    columns["q2"] = columns["q1"] + 0.1
    with pytest.raises(FileError, match=r"joint 1 should move alone, but joint 2 moves by 0.4"):
        made(tmp_path, columns, kind={"back_and_forth": 1})


# --- all or nothing -------------------------------------------------------------------------------


def test_nothing_is_left_behind_when_the_disk_is_full(tmp_path, monkeypatch):
    def full(*_):
        raise FileError("run/recordings/map-01.h5: cannot be written: No space left on device")

    monkeypatch.setattr(one_map, "write_measured", full)
    write_csv(tmp_path / "data.csv", table(3.0))
    the_map = write_map(tmp_path, a_map())
    before = sorted(p.name for p in tmp_path.iterdir())
    with pytest.raises(FileError, match="No space left"):
        import_recordings([the_map], tmp_path / "run")
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_nothing_is_left_behind_after_an_interrupt(tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(one_map, "suspicions", interrupted)
    write_csv(tmp_path / "data.csv", table(3.0))
    the_map = write_map(tmp_path, a_map())
    with pytest.raises(KeyboardInterrupt):
        import_recordings([the_map], tmp_path / "run")
    assert {p.name for p in tmp_path.iterdir()} == {"data.csv", "map.yaml", "pair.yaml"}


def test_a_folder_that_is_there_is_never_touched(tmp_path):
    run, _ = made(tmp_path, table(3.0))
    before = (run.path / "run.json").read_bytes()
    with pytest.raises(FileError, match=r"run: already exists; choose another folder with -o"):
        made(tmp_path, table(3.0))
    assert (run.path / "run.json").read_bytes() == before


def test_the_map_is_yaml_that_stands_for_itself(tmp_path):
    run, _ = made(tmp_path, table(3.0))
    assert yaml.safe_load((run.path / "maps" / "map.yaml").read_text()) == a_map()


def headers_again(folder, later=0.0):
    """Write a recording of 10 s, and after another header one of 8 s."""
    write_csv(folder / "data.csv", table(10.0))
    again = table(time=later + np.arange(1601) / 200)
    write_csv(folder / "again.csv", again)
    text = (folder / "data.csv").read_text() + (folder / "again.csv").read_text()
    (folder / "data.csv").write_text(text)


@pytest.mark.parametrize("rows", [None, [[1, 2001], [2003, 3603]]])
@pytest.mark.parametrize("time", [{"column": "t", "unit": "s"}, {"rate": 200}])
def test_a_header_that_is_repeated_begins_another_recording(tmp_path, rows, time):
    headers_again(tmp_path)
    said = []
    the_map = write_map(tmp_path, a_map(rows=rows, time=time))
    run = import_recordings([the_map], tmp_path / "run", said.append)
    assert [len(each.recording.time) for each in run] == [2001, 1601]
    assert any(
        "data.csv: the header is repeated in row 2002: the recorder started anew" in line
        for line in said[0].lines()
    )


def test_a_header_that_is_repeated_while_time_goes_on_begins_nothing(tmp_path):
    headers_again(tmp_path, later=10.005)
    run = import_recordings([write_map(tmp_path, a_map())], tmp_path / "run")
    assert [len(each.recording.time) for each in run] == [3602]
