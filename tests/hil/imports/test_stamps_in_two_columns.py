"""Stamps as seconds and nanoseconds: exact across dates, refused for other pairs."""

import numpy as np
import pytest
import yaml
from small_recording import a_map, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings
from hil.imports.map_file import load_map
from hil.imports.to_si import TimeColumns

BEGIN = 1_700_000_000
PAIR = {"column": "sec", "unit": "s", "plus": {"column": "nanosec", "unit": "ns"}}


def stamp_pair(duration=4.0, jitter=0):
    """Return columns of a recording with stamps in two columns, with jitter up to this number of
    ns.
    """
    columns = table(duration)
    shaken = np.random.default_rng(0).integers(0, jitter + 1, len(columns["t"]))
    stamp = BEGIN * 10**9 + 123_456_789 + np.round(columns.pop("t") * 1e9).astype(int) + shaken
    return stamp, {"sec": stamp // 10**9, "nanosec": stamp % 10**9} | columns


def write(folder, columns):
    """Write columns as a CSV, stamps as whole numbers."""
    write_csv(folder / "rest.csv", {k: v for k, v in columns.items() if "sec" not in k})
    lines = (folder / "rest.csv").read_text().splitlines()
    stamps = [f"{s},{n}" for s, n in zip(columns["sec"], columns["nanosec"], strict=True)]
    text = [f"{a},{b}" for a, b in zip(["sec,nanosec", *stamps], lines, strict=True)]
    (folder / "data.csv").write_text("\n".join(text) + "\n")
    (folder / "rest.csv").unlink()


def test_a_date_is_exact_to_a_nanosecond(tmp_path):
    stamp, columns = stamp_pair(jitter=999)
    the_map = load_map(write_map(tmp_path, a_map(time=PAIR)))
    times = TimeColumns(the_map)
    found = times.convert(np.stack([columns["sec"], columns["nanosec"]], axis=1).astype(float), 0)
    np.testing.assert_allclose(found * 1e9, stamp - stamp[0], atol=1e-3)  # a ps
    assert times.origin == pytest.approx(stamp[0] / 1e9)


def test_a_recording_is_stamped_by_the_sum(tmp_path):
    stamp, columns = stamp_pair()
    write(tmp_path, columns)
    run = import_recordings([write_map(tmp_path, a_map(time=PAIR))], tmp_path / "run")
    recording = run["map-01"].recording
    assert recording.n_samples == len(stamp)
    np.testing.assert_allclose(np.diff(recording.time), 0.005, atol=1e-9)


@pytest.mark.parametrize(("time", "message"), [
    (PAIR | {"column": "nanosec", "unit": "ns", "plus": {"column": "sec", "unit": "s"}},
     "unit of plus, s, must be smaller than the column's unit, ns: .* exchange the two columns"),
    ({"rate": 200, "plus": {"column": "nanosec", "unit": "ns"}},
      "plus belongs to a column of time"),
    (PAIR | {"plus": {"column": "nanosec", "unit": "us"}},
     r"time.plus: has values from .* at least 0 and below 1000000 \(one unit"),
    (PAIR | {"column": "nanosec", "plus": {"column": "sec", "unit": "ns"}},
     r"time.plus: has values from 17\d* to .* below 1000000000 \(one unit of column"),
    (PAIR | {"plus": {"column": "nsec", "unit": "ns"}}, "has no column 'nsec'; similar names: sec"),
])  # fmt: skip
def test_what_is_no_such_pair_is_refused(tmp_path, time, message):
    write(tmp_path, stamp_pair()[1])
    with pytest.raises(FileError, match=message):
        import_recordings([write_map(tmp_path, a_map(time=time))], tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("sec", "nanosec"), [
    ("sec", "nanosec"), ("header.stamp.sec", "header.stamp.nanosec"),
    ("field.header.stamp.secs", "field.header.stamp.nsecs"), ("stamp_sec", "stamp_nsec"),
])  # fmt: skip
def test_a_draft_recognises_the_pair(tmp_path, sec, nanosec):
    write(tmp_path, stamp_pair()[1])
    text = (tmp_path / "data.csv").read_text().replace("sec,nanosec", f"{sec},{nanosec}", 1)
    (tmp_path / "data.csv").write_text(text)
    drafted = draft_map(tmp_path / "data.csv", "data.csv")
    filled = yaml.safe_load("\n".join(line.split(" !state")[0] for line in drafted.splitlines()))
    assert filled["time"]["column"] == sec
    assert filled["time"]["plus"]["column"] == nanosec
    assert [filled["time"]["unit"], filled["time"]["plus"]["unit"]] == ["s", "ns"]


def test_seconds_without_nanoseconds_are_one_column(tmp_path):
    columns = table(2.0)
    write_csv(tmp_path / "data.csv", {"secs": columns.pop("t")} | columns)
    assert "plus" not in draft_map(tmp_path / "data.csv", "data.csv")
