"""Text exports of Windows programs: UTF-16, and measurement files of LabVIEW."""

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from hil.imports.map_file import Format
from hil.imports.readers import open_table
from hil.imports.tables import NoColumn, column_of

LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\tOne
Time_Pref\tRelative
Date\t2026/01/31
Time\t12:00:00.5
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t4\t4\t
Date\t2026/01/31\t2026/01/31\t
Time\t12:00:00.5\t12:00:00.5\t
X_Dimension\tTime\tTime\t
X0\t0.0\t0.0\t
Delta_X\t0.004\t0.004\t
***End_of_Header***\t\t\t
X_Value\tangle\ttorque\tComment
0.000\t0.1\t5.0\t
0.004\t0.2\t6.0\t
0.008\t0.3\t7.0\t
0.012\t0.4\t8.0\t
"""


def values(path, columns):
    table = open_table(path, Format())
    return table.names, np.concatenate(list(table.blocks(columns)))


@pytest.mark.parametrize("coding", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_utf_16_is_read_where_its_mark_tells(tmp_path, coding, end):
    mark = "" if coding == "utf-16" else "\ufeff"
    rows = [f"{0.004 * k:.3f};{k}" for k in range(3000)]
    text = mark + end.join(["t;winkel [\u00b0]", *rows, ""])
    (tmp_path / "a.csv").write_bytes(text.encode(coding))
    names, found = values(tmp_path / "a.csv", [0, 1])
    assert names == ("t", "winkel [\u00b0]")
    np.testing.assert_allclose(found, [[0.004 * k, k] for k in range(3000)])


def test_a_measurement_file_of_labview_is_read(tmp_path):
    (tmp_path / "a.lvm").write_text(LVM)
    names, found = values(tmp_path / "a.lvm", [0, 1, 2])
    assert names[:3] == ("X_Value", "angle", "torque")
    assert found.tolist() == [[0, 0.1, 5], [0.004, 0.2, 6], [0.008, 0.3, 7], [0.012, 0.4, 8]]


def test_control_characters_of_names_and_cells_are_escaped_once(tmp_path):
    (tmp_path / "a.csv").write_text("t,man\x1b\n0,1\n1,2\n2,wo\x1b\n")
    table = open_table(tmp_path / "a.csv", Format())
    with pytest.raises(NoColumn, match=r"no column 'men\\x1b'; similar names: man\\x1b"):
        column_of(table, r"men\x1b")
    with pytest.raises(FileError, match=r"a.csv:4: 'wo\\x1b' in column 2 \(man\\x1b\), row 3"):
        list(table.blocks([1]))
