"""Errors in a map or a file give one message with place and remedy; nothing is written."""

import os

import h5py
import numpy as np
import pytest
import yaml
from small_recording import a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

COLUMNS = table(4.0)


def refusal(folder, content):
    """Import a wrong map; return its message after checking that nothing was written."""
    if not (folder / "data.csv").exists():
        write_csv(folder / "data.csv", COLUMNS)
    the_map = write_map(folder, content)
    before = sorted(folder.rglob("*"))
    with pytest.raises(FileError) as refused:
        import_recordings([the_map], folder / "run")
    assert sorted(folder.rglob("*")) == before
    return str(refused.value).replace(f"{folder}{os.sep}", "")


def modify(number, key, **changes):
    """Return a map with one part of a joint changed."""
    content = a_map()
    content["joints"][number][key] = content["joints"][number][key] | changes
    return content


A, B = ("position", "torque")
MAPS = {
    "an unknown key": (a_map(colour="red"), "map.yaml:20: colour: unknown key; remove it"),
    "no robot": (a_map(robot=None), "map.yaml:1: robot: missing; add this key"),
    "an unknown robot": (a_map(robot="kuka"), "map.yaml:1: robot: kuka: unknown robot; available"),
    "a robot file that is not there": (
        a_map(robot="none.yaml"), "map.yaml:1: robot: none.yaml: cannot be read: No such file"),
    "a URDF that is not there": (
        a_map(robot={"urdf": "a.urdf", "from": "b"}), "robot: a.urdf: cannot be read"),
    "a file that is not there": (
        a_map("gone.csv"), "map.yaml:3: files.0: gone.csv: cannot be read: No such file"),
    "no file": (a_map(files=[]), "map.yaml:2: files: "),
    "too few joints": (
        a_map(joints=a_map()["joints"][:1]), "joints: 1 joints must be 2, one for each joint of"),
    "a column that is not there": (
        modify(1, A, column="q3"),
        "joints.1.position.column: data.csv has no column 'q3'; similar names: q"),
    "a column beyond the last": (
        modify(0, B, column=9), "joints.0.torque.column: data.csv has 7 columns, but no"),
    "column 0": (modify(0, A, column=0), "columns are numbered from 1"),
    "a column that is true": (modify(0, A, column=True), "True must be a column's number"),
    "an unknown unit": (
        modify(0, A, unit="grad"), "joints.0.position.unit: 'grad': must be 'rad', 'deg'"),
    "a unit of another kind": (
        modify(1, A, unit="mm"),
        "joints.1.position.unit: mm does not suit joint 2 of pair, which is revolute"),
    "a force for a joint that turns": (modify(0, B, unit="N"), "N does not suit joint 1"),
    "amperes without a gain": (
        modify(0, B, unit="A"), "joints.0.torque: A need a gain: N m (or N) for one unit"),
    "a negative gain": (
        modify(0, B, unit="A", gain=-2), "-2 must be positive; for a reversed direction"),
    "an uncertainty of an unknown gain": (
        modify(0, B, unit="A", gain="unknown", gain_uncertainty=0.1),
        "gain_uncertainty 0.1 needs a stated gain; remove"),
    "a gain that is hardly known": (
        modify(0, B, unit="A", gain=1, gain_uncertainty=0.6), "must be below half the gain"),
    "counts without their worth": (modify(0, A, unit="counts"), "counts need per_unit"),
    "counts for one rad": (
        modify(0, A, unit="counts", per_unit=65536), "write its inverse"),
    "counts that exceed a turn": (
        modify(0, A, unit="counts", per_unit=7), "per_unit 7 must be in (0, 2 pi] rad (or m)"),
    "per_unit of radians": (modify(0, A, per_unit=0.1), "per_unit is for counts, not for rad"),
    "a sign of 2": (modify(0, A, sign=2), "joints.0.position.sign: 2: "),
    "rows beyond the end": (
        a_map(rows=[1, 5000]), "rows: row 5000 must be at most 801, the last row"),
    "rows from 0": (a_map(rows=[0, 50]), "rows are numbered from 1"),
    "rows that fall": (a_map(rows=[500, 20]), "[500, 20] must rise: first, then last"),
    "rows that overlap": (
        a_map(rows=[[1, 400], [300, 700]]), "300 follows 400: segments must rise"),
    "too few rows": (
        a_map(rows=[10, 50]), "the chosen rows last 0.2 s, 41 rows at 200 Hz; at least"),
    "times beyond the end": (
        a_map(time_range=[10, 20]), "has no samples; the recording has times from 0 to 4 s"),
    "rows and times": (
        a_map(rows=[1, 500], time_range=[0, 2]), "rows and time_range exclude each other"),
    "no time": (a_map(time=None), "time: missing, and data.csv has no stamps of its own"),
    "time and a rate": (
        a_map(time={"column": "t", "rate": 200}), "needs either a column, or a rate in Hz"),
    "a rate that is none": (a_map(time={"rate": 0}), "time.rate: 0: "),
    "milliseconds for seconds": (
        a_map(time={"column": "t", "unit": "ms"}), "map.yaml:4: time: the recording lasts 0.004 s"),
    "positions for time": (a_map(time={"column": "v1"}), "time: time runs backwards"),
    "an axis that is not there": (
        a_map(kind={"back_and_forth": 3}), "must be one of the 2 joints"),
    "an unknown kind": (a_map(kind="fast"), "'fast' must be free, or {back_and_forth: JOINT}"),
    "what is no motion back and forth": (
        a_map(kind={"back_and_forth": 2}), "joint 2 should move alone, but joint 1 moves"),
    "a motor's side without gears": (
        a_map(robot="gearless.yaml", torque_side="motor"), "motor needs the gear ratio of joint 1"),
    "a list for a map": ("- 1\n- 2\n", "map.yaml:1: must hold keys and values, not list"),
    "no YAML": ("robot: [", "map.yaml:2: is not valid YAML"),
    "a per cent sign without quotes": (
        "robot: %", "cannot start any token: quote a value that begins with %"
    ),
    "a value yet to be stated": (
        "robot: !state a robot\nfiles: [a]\n", "map.yaml:1: robot: must be stated: a robot"),
}  # fmt: skip


@pytest.mark.parametrize("case", MAPS)
def test_a_wrong_map_is_one_message_with_its_place(tmp_path, case):
    content, message = MAPS[case]
    write_map(tmp_path, a_map())
    robot = yaml.safe_load((tmp_path / "pair.yaml").read_text())
    del robot["joints"][0]["drive"]
    (tmp_path / "gearless.yaml").write_text(yaml.safe_dump(robot))
    found = refusal(tmp_path, content)
    assert message in found
    assert len(found.splitlines()) == 1, found


def candump(path):
    path.write_text("".join(f"({k}.{k:06}) can0 181#{k:08X}\n" for k in range(50)))


def binary(path):
    path.write_bytes(bytes(range(256)) * 40)


def sparse(path):
    with path.open("wb") as file:
        file.truncate(10 * 2**30)


def sparse_after_a_table(path):
    write_csv(path, COLUMNS)
    with path.open("r+b") as file:
        file.truncate(10 * 2**30)


def text_in_numbers(path):
    write_csv(path, COLUMNS)
    lines = path.read_text().splitlines()
    lines[100] = lines[100].replace(",", ",oops,", 1)
    path.write_text("\n".join(lines))


def all_missing(path):
    write_csv(path, COLUMNS | {"q1": np.full(len(COLUMNS["t"]), np.nan)})


def alternate(path):
    rows = np.arange(len(COLUMNS["t"]))
    q, m = (np.where(rows % 2 == k, np.nan, COLUMNS[name]) for k, name in enumerate(("q1", "m1")))
    write_csv(path, COLUMNS | {"q1": q, "m1": m})


def other_lengths(path):
    np.savez(path, **COLUMNS | {"m2": COLUMNS["m2"][:-5]})


def damaged_hdf5(path):
    with h5py.File(path, "w") as file:
        file["t"] = COLUMNS["t"]
    path.write_bytes(path.read_bytes()[:900])


def half_gz(path):
    import gzip

    write_csv(path, COLUMNS)
    path.write_bytes(gzip.compress(path.read_bytes())[:-2000])


FILES = {
    "an empty file": ("a.csv", lambda p: p.write_text(""), "a.csv: is empty"),
    "a header alone": (
        "a.csv", lambda p: p.write_text("t,q1,q2,m1,m2\n"), "a.csv: has no row of numbers"),
    "words": (
        "a.csv", lambda p: p.write_text("to be\nor not\n"),
        "a.csv: has no row of numbers in its first lines, the first is 'to be'"),
    "a list of a controller": (
        "a.csv", lambda p: p.write_text("A.B[0]:=26.0F16#A4H-3\nA.B[1]:=27.0F16#A4H-3\n"),
        "the first is 'A.B[0]:=26.0F16#A4H-3'; state header"),
    "text among numbers": (
        "a.csv", text_in_numbers, "a.csv:101: 'oops' in column 2 (q1), row 100, is not a number"),
    "nothing but NaN": (
        "a.csv", all_missing, "joints.0.position.column: column q1 holds no number in any of 801"
        " rows; name another"),
    "numbers of two columns in turn": (
        "a.csv", alternate, "columns have numbers in different rows: of 801 rows of a.csv, q1, "
        "q2, m2 in 400; m1 in 401; like topics"),
    "bytes": ("a.csv", binary, "a.csv: holds NUL bytes: not UTF-8 text"),
    "10 GiB of nothing": ("a.csv", sparse, "a.csv: holds NUL bytes"),
    "10 GiB of nothing after a table": ("a.csv", sparse_after_a_table, "a.csv: holds NUL bytes"),
    "10 GiB of nothing as arrays": ("a.npy", sparse, "a.npy: is not a NumPy file"),
    "10 GiB of nothing as HDF5": ("a.h5", sparse, "a.h5: is not an HDF5 file, or is damaged"),
    "10 GiB of nothing as Parquet": ("a.parquet", sparse, "a.parquet: is not a Parquet file"),
    "10 GiB of nothing as MATLAB": ("a.mat", sparse, "a.mat: is not a MATLAB file, or is damaged"),
    "10 GiB of nothing as a bag": ("a.mcap", sparse, "a.mcap: cannot be read as a bag"),
    "10 GiB of nothing, compressed": ("a.csv.gz", sparse, "a.csv.gz: cannot be unpacked"),
    "half of a compressed file": ("a.csv.gz", half_gz, "a.csv.gz: cannot be unpacked"),
    "half of an HDF5 file": ("a.h5", damaged_hdf5, "a.h5: is not an HDF5 file, or is damaged"),
    "arrays of other lengths": ("a.npz", other_lengths, "columns must have equal numbers of rows"),
    "an unknown format": ("a.docx", binary, "a.docx: .docx is an unknown format; known: .csv"),
    "a sheet": ("a.xlsx", binary, "unknown format; save the sheet as CSV; known: .csv"),
    "a log of frames": ("a.log", candump, "is a log of CAN frames without decoded values"),
    "a folder": ("a.csv", lambda p: p.mkdir(), "a.csv: is a folder without the metadata.yaml"),
    "pickles": (
        "a.npy", lambda p: np.save(p, np.array([{}]), allow_pickle=True), "is not a NumPy file"),
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_cannot_be_used_is_one_message(tmp_path, case):
    name, write, message = FILES[case]
    write(tmp_path / name)
    found = refusal(tmp_path, a_map(name))
    assert message in found
    assert len(found.splitlines()) == 1, found


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read(tmp_path):
    write_csv(tmp_path / "a.csv", COLUMNS)
    (tmp_path / "a.csv").chmod(0)
    assert "a.csv: cannot be read: Permission denied" in refusal(tmp_path, a_map("a.csv"))


# --- contradictions -------------------------------------------------------------------------------

LONG = table(20.0, rate=100.0)
Q, QD, TAU = motion(LONG["t"])


def contradiction(folder, columns=LONG, **changes):
    write_csv(folder / "data.csv", columns)
    return refusal(folder, a_map(velocity="v1" in columns, **changes))


DATA = {
    "degrees for radians": (
        {"q1": np.degrees(Q[:, 0])},
        " rad, but joint 1 of pair has -2 to 2 rad; they look like positions in deg or on"),
    "the motor's side": (
        {"q2": 20 * Q[:, 1]},
        "they look like positions in deg or on the motor's side at a gear ratio of 20"),
    "a velocity of the wrong sign": (
        {"v1": -QD[:, 0]}, "one of the two has the wrong sign: correct sign"),
    "a velocity in degrees": (
        {"v2": np.degrees(QD[:, 1])},
        "times the derivative of the position of joint 2; velocity is in deg: "),
    "a velocity of the motor": (
        {"v1": 50 * QD[:, 0]}, "velocity is on the motor's side at a gear ratio of 50"),
    "velocities in another order": (
        {"v1": QD[:, 1], "v2": QD[:, 0]}, "follows the position of joint 2, not of joint 1"),
    "a velocity that is something else": ({"v1": TAU[:, 0]}, "does not follow the position of"),
    "a torque of the wrong sign": (
        {"m1": -TAU[:, 0]},
        "joints.0.torque.sign: axis 1: wrong sign of the torque: this correction leaves"),
    "torques in another order": (
        {"m1": TAU[:, 1], "m2": TAU[:, 0]},
        "axes 1 and 2: torques exchanged"),
    "torques in mN m": ({"m1": 1e3 * TAU[:, 0]}, "N m, but joint 1 of pair is limited to 90 N m"),
    "a torque that never changes": ({"m2": 0 * Q[:, 0]}, "is 0 throughout; name the column"),
}  # fmt: skip


@pytest.mark.parametrize("case", DATA)
def test_a_contradiction_is_found_before_anything_is_estimated(tmp_path, case):
    changes, message = DATA[case]
    found = contradiction(tmp_path, LONG | changes)
    assert message in found.splitlines()[0]
    assert "; if this is correct, write accept: [" in found


def test_what_the_map_accepts_is_stated_all_the_same(tmp_path):
    write_csv(tmp_path / "data.csv", LONG | {"m1": -TAU[:, 0]})
    lines = []
    the_map = write_map(tmp_path, a_map(accept=["shape"]))
    import_recordings([the_map], tmp_path / "run", lambda s: lines.extend(s.lines()))
    assert "joints.0.torque.sign: axis 1: wrong sign of the torque" in "\n".join(lines)


def test_a_locked_joint_of_a_noisy_encoder_stands_still(tmp_path):
    rng = np.random.default_rng(1)
    noisy = {name: size * rng.standard_normal(len(Q)) for name, size in (("q2", 4e-4), ("v2", 0.1))}
    write_csv(tmp_path / "data.csv", LONG | noisy | {"m2": 8 + 0.1 * rng.standard_normal(len(Q))})
    stated = []
    the_map = write_map(tmp_path, a_map(velocity=True))
    import_recordings([the_map], tmp_path / "run", stated.append)
    (suspicion,) = stated[0].suspicions
    assert suspicion.message.endswith("check column and unit")
    assert "friction of joint 2 cannot be identified, and its torque is used" in suspicion.message
    assert suspicion.message.startswith("moves by only 0.00")
    assert not suspicion.certain


@pytest.mark.parametrize("at", [0.0, 0.31, -1e-7])
def test_a_joint_at_rest_does_not_move_by_any_rounding(tmp_path, at):
    write_csv(tmp_path / "data.csv", LONG | {"q2": at + 0 * Q[:, 1], "m2": 8 + 0 * Q[:, 1]})
    stated = []
    import_recordings([write_map(tmp_path, a_map())], tmp_path / "run", stated.append)
    (suspicion,) = stated[0].suspicions
    assert suspicion.message.startswith("does not move: friction of joint 2 cannot be identified")


def test_a_right_recording_raises_no_suspicion(tmp_path):
    write_csv(tmp_path / "data.csv", LONG)
    found = []
    the_map = write_map(tmp_path, a_map(velocity=True))
    import_recordings([the_map], tmp_path / "run", found.append)
    assert found[0].suspicions == ()
