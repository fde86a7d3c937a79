"""Rows as objects: lines and lists of JSON, messages and records of XML."""

import json

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from hil.imports.map_file import Format
from hil.imports.readers import open_table
from hil.imports.tables import column_of

N = 40
T, Q = 0.01 * np.arange(N), np.stack([np.sin(0.1 * np.arange(N)), np.cos(0.1 * np.arange(N))], 1)


def read(path, *names):
    found = open_table(path, Format())
    return np.concatenate(list(found.blocks([column_of(found, name) for name in names])))


def rows():
    return [{"t": t, "arm": {"q": list(q)}, "mode": "run"} for t, q in zip(T, Q, strict=True)]


@pytest.mark.parametrize("name", ["a.jsonl", "a.ndjson", "a.json"])
def test_objects_of_json_are_rows_and_lists_in_them_joints(tmp_path, name):
    pytest.importorskip("pyarrow")
    lines = [json.dumps(row) for row in rows()]
    (tmp_path / name).write_text(f"[{','.join(lines)}]" if name == "a.json" else "\n".join(lines))
    np.testing.assert_array_equal(read(tmp_path / name, "arm.q/2", "t"), np.stack([Q[:, 1], T], 1))
    assert "mode" in open_table(tmp_path / name, Format()).left_out


def test_an_object_of_columns_holds_samples(tmp_path):
    pytest.importorskip("pyarrow")
    columns = {"meta": {"rate": 100}, "time": T.tolist(), "q": Q.tolist(), "names": ["a", "b"]}
    (tmp_path / "a.json").write_text(json.dumps(columns))
    np.testing.assert_array_equal(
        read(tmp_path / "a.json", "q/2", "time"), np.stack([Q[:, 1], T], 1)
    )


def test_text_of_another_ending_is_to_be_renamed(tmp_path):
    (tmp_path / "a.t").write_text(" 0.01 1.5\n 0.02 1.6\n")
    with pytest.raises(FileError, match=r"rename it to end in \.txt"):
        open_table(tmp_path / "a.t", Format())


def test_numbers_that_come_later_or_are_missing_are_no_error(tmp_path):
    pytest.importorskip("pyarrow")
    lines = '{"t": 0, "q": [1]}\n{"t": 1}\n{"t": 2, "q": [0.5], "x": 7}\n'
    (tmp_path / "a.jsonl").write_text(lines)
    found = read(tmp_path / "a.jsonl", "t", "q", "x")
    n = np.nan
    np.testing.assert_array_equal(found, [[0, 1, n], [1, n, n], [2, 0.5, 7]])


def test_strings_of_numbers_are_numbers_and_other_strings_are_not(tmp_path):
    pytest.importorskip("pyarrow")
    lines = [
        json.dumps({"t": f"{t:.3f}", "arm": {"q": [repr(float(x)) for x in q]}, "mode": "5 s"})
        for t, q in zip(T, Q, strict=True)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(lines))
    np.testing.assert_allclose(
        read(tmp_path / "a.jsonl", "t", "arm.q/2"), np.stack([T, Q[:, 1]], 1)
    )
    assert "mode" in open_table(tmp_path / "a.jsonl", Format()).left_out


@pytest.mark.parametrize("text", ["[1, 2]", "[[1]]", "so it goes", '{"t": 1}\n{"t": '])
def test_what_is_no_rows_of_json_is_refused_with_the_file(tmp_path, text):
    pytest.importorskip("pyarrow")
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(FileError, match=r"a\.json: (is neither a JSON list|holds)"):
        open_table(tmp_path / "a.json", Format())


def messages(n=N):
    """Return successive messages of a robot, as received by a socket."""
    return "".join(
        f'<Rob Type="KUKA"><RIst X="445.0" A="180.0"/><AIPos A1="{q[0]!r}" A2="{q[1]!r}"/>\n'
        f"  <Delay D='0'/><IPOC>{4 * k}</IPOC></Rob>\n"
        for k, q in enumerate(np.degrees(Q[:n]).tolist())
    )


def test_messages_without_a_root_are_rows(tmp_path):
    (tmp_path / "a.xml").write_text(messages())
    found = read(tmp_path / "a.xml", "IPOC", "AIPos.A2")
    np.testing.assert_array_equal(found, np.stack([4.0 * np.arange(N), np.degrees(Q[:, 1])], 1))
    assert open_table(tmp_path / "a.xml", Format()).left_out == {"Type": "text"}


def test_declared_messages_and_utf_16_are_read(tmp_path):
    text = messages().replace("<Rob", "<?xml version='1.0' encoding='utf-16'?><Rob")
    (tmp_path / "a.xml").write_text(text, encoding="utf-16")
    assert read(tmp_path / "a.xml", "AIPos.A1").shape == (N, 1)


def test_records_below_a_root_are_rows_and_signals_above_them_are_not(tmp_path):
    signals = "".join(f'<dataSignal name="/Nck/s{k}" type="8"/>' for k in range(12))
    records = "".join(f'<rec time="{t!r}" f1="{q[0]!r}" f2="{q[1]!r}"/>'
                      for t, q in zip(T.tolist(), Q.tolist(), strict=True))  # fmt: skip
    (tmp_path / "a.xml").write_text(
        f'<?xml version="1.0"?><trace><setup version="2"/><traceData><dataFrame>{signals}{records}'
        "</dataFrame></traceData></trace>"
    )
    found = read(tmp_path / "a.xml", "time", "f2")
    np.testing.assert_array_equal(found, np.stack([T, Q[:, 1]], 1))


def test_elements_for_each_joint_within_a_row_are_numbered(tmp_path):
    joints = "".join(f'<s t="{k}"><j q="{k}"/><j q="{2 * k}"/></s>' for k in range(N))
    (tmp_path / "a.xml").write_text(f"<log>{joints}</log>")
    found = read(tmp_path / "a.xml", "t", "j.q", "j.q/2")
    np.testing.assert_array_equal(found, np.outer(np.arange(N), [1, 1, 2]))


def test_a_log_that_is_cut_is_read_as_far_as_it_goes(tmp_path):
    (tmp_path / "a.xml").write_text(messages() + '<Rob><AIPos A1="1')
    found = open_table(tmp_path / "a.xml", Format())
    assert len(next(found.blocks([0]))) == N
    assert found.notes == (f"invalid XML from line {2 * N + 1} on: only the part before is read",)


@pytest.mark.parametrize("text", ["so it goes", "<a/>", "<a><b c='x'/></a>"])
def test_xml_without_rows_of_numbers_is_refused(tmp_path, text):
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(FileError, match=r"a\.xml: has no repeated elements with numbers"):
        open_table(tmp_path / "a.xml", Format())


def test_entities_are_never_expanded(tmp_path):
    (tmp_path / "a.xml").write_text(
        '<!DOCTYPE r [<!ENTITY a "1">]><r>' + "<s q='&a;'/>" * 30 + "</r>"
    )
    with pytest.raises(FileError, match="no repeated elements"):
        open_table(tmp_path / "a.xml", Format())
