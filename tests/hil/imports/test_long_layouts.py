"""Tables with a row for each joint are named, with a remedy that makes a row of each stamp."""

import json
import re

import numpy as np
import pytest
from small_recording import ROBOT, a_map, table, write_map

from checked_files.yaml_file import FileError
from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings
from hil.model.robot import parse_robot

PAIR = parse_robot(ROBOT, "pair.yaml")
COLUMNS = table(5.0, rate=100.0)
INFLUX = "#datatype,string,long,dateTime:RFC3339,double,string,string,string\n"


def long_text(joints, delimiter=",", decimal=".", header="t,joint,position,torque"):
    rows = [header] * bool(header)
    for k, t in enumerate(COLUMNS["t"]):
        for number, joint in enumerate(joints, start=1):
            cells = [f"{t:.4f}", joint, *(repr(float(COLUMNS[f"{c}{number}"][k])) for c in "qm")]
            rows.append(",".join(cells))
    text = "\n".join(rows) + "\n"
    return text.replace(",", delimiter).replace(".", decimal)


def influx_text():
    rows = [",result,table,_time,_value,_field,_measurement,joint"]
    for name, field in (("q", "position"), ("m", "torque")):
        for joint in (1, 2):
            for t, x in zip(COLUMNS["t"], COLUMNS[f"{name}{joint}"], strict=True):
                # whole seconds have no fraction
                at = np.datetime64("2026-01-31T12:00:00") + np.timedelta64(round(1e3 * t), "ms")
                stamp = str(at).removesuffix(".000")
                rows.append(f",,0,{stamp}Z,{float(x)!r},{field},arm,joint_{joint}")
    return INFLUX + "\n".join(rows) + "\n"


NAMES = (("POSITION", "q"), ("TORQUE", "m"))
LONG = {
    "names": long_text(["elbow_1", "elbow_2"]),
    "numbers": long_text(["1", "2"]),
    "semicolons": long_text(["1", "2"], ";", ","),
    "blanks": long_text(["a1", "a2"], " "),
    "no header": long_text(["1st", "2nd"], header=""),
    "influx": influx_text(),
}


@pytest.mark.parametrize("case", LONG)
def test_a_long_layout_is_named_and_its_remedy_makes_a_recording(tmp_path, case, monkeypatch):
    pandas = pytest.importorskip("pandas")
    (tmp_path / "data.csv").write_text(LONG[case])
    with pytest.raises(FileError, match=r"long layout: each .* make a row of each") as refused:
        draft_map(tmp_path / "data.csv", "data.csv", PAIR)
    with pytest.raises(FileError, match="long layout"):
        import_recordings([write_map(tmp_path, a_map())], tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    remedy = str(refused.value).partition("pandas: ")[2]
    exec(remedy, {"pandas": pandas})  # noqa: S102
    wide = pandas.read_csv("wide.csv")
    assert len(wide) == len(COLUMNS["t"])
    for number in (1, 2):
        like = [c for c in wide.columns[1:] if re.search(rf"{number}(st|nd)?$", c)]
        for values, name in zip(wide[like].to_numpy().T, "qm", strict=True):
            np.testing.assert_allclose(values, COLUMNS[f"{name}{number}"])
    assert len(draft_map(tmp_path / "wide.csv", "wide.csv", PAIR).split("rows: [[")) == 1


@pytest.mark.parametrize("late", [0.0, 2e-4])
def test_json_lines_of_one_servo_each_are_named_and_the_remedy_makes_a_recording(
    tmp_path, monkeypatch, late
):
    """Objects of moteus: nested, and each servo answers at its own instant."""
    pandas, _ = pytest.importorskip("pandas"), pytest.importorskip("pyarrow")
    lines = [
        json.dumps(
            {
                "time": round(t + late * number, 4),
                "id": number,
                "values": {name: float(COLUMNS[f"{c}{number}"][k]) for name, c in NAMES},
            }
        )
        for k, t in enumerate(COLUMNS["t"].tolist())
        for number in (1, 2)
    ]
    (tmp_path / "data.jsonl").write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError, match=r"long layout: each .* make a row of each") as refused:
        draft_map(tmp_path / "data.jsonl", "data.jsonl", PAIR)
    monkeypatch.chdir(tmp_path)
    exec(str(refused.value).partition("pandas: ")[2], {"pandas": pandas})  # noqa: S102
    wide = pandas.read_csv("wide.csv")
    for number in (1, 2):
        for name, c in NAMES:
            np.testing.assert_allclose(wide[f"values.{name}_{number}"], COLUMNS[f"{c}{number}"])


def test_stamps_with_an_offset_from_utc_are_read(tmp_path):
    stamps = [f"2026-01-31 14:00:0{k}.000+02:00" for k in range(10)]
    rows = [f"{stamp},{k},{k}" for k, stamp in enumerate(stamps)]
    (tmp_path / "data.csv").write_text("\n".join(["time,q1,m1", *rows]) + "\n")
    assert "1 time: 1.76986e+18 to 1.76986e+18, rising" in draft_map(
        tmp_path / "data.csv", "data.csv", PAIR
    )


def test_names_of_states_are_no_names_of_joints(tmp_path):
    columns = [*COLUMNS.values()]
    rows = [
        ",".join([*map(repr, map(float, row)), "run" if k % 2 else "hold"])
        for k, row in enumerate(zip(*columns, strict=True))
    ]
    (tmp_path / "data.csv").write_text("\n".join([",".join([*COLUMNS, "state"]), *rows]) + "\n")
    import_recordings([write_map(tmp_path, a_map())], tmp_path / "run")
