"""Traces of KUKA's controllers: a DIAdem header for each drive, and its values in another file."""

import numpy as np
import pytest
from small_recording import table, write_map

from checked_files.yaml_file import FileError
from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings
from hil.imports.map_file import Format
from hil.imports.readers import open_table

COLUMNS = table(4.0)
PARTS = {"q": ("Istposition", "deg", 180 / np.pi), "m": ("Drehmoment", "Nm", 1.0)}
GENERAL = "DIAEXTENDED  {@:GERMAN\r\n\r\n#BEGINGLOBALHEADER\r\n111,9.9E+34\r\n#ENDGLOBALHEADER\r\n"


def channel(**properties):
    lines = (f"{key[1:]},{value}\r\n" for key, value in properties.items())
    return f"#BEGINCHANNELHEADER\r\n{''.join(lines)}#ENDCHANNELHEADER\r\n"


def time(n, step=0.005):
    return channel(_200="Zeit", _202="s", _210="IMPLIZIT", _220=n, _240=0, _241=step)


def stored(name, unit, file, n, first, *, how="BLOCK", kind="REAL64", factor=1.0):
    return channel(_200=name, _202=unit, _210="EXPLIZIT", _211=file, _213=how, _214=kind,
                   _220=n, _221=first, _240=0, _241=factor)  # fmt: skip


def drive(folder, joint, *, ending="r64", **changes):
    """Write the trace of one drive: values of all channels, sample
    by sample; degrees by a factor.
    """
    n, stem = len(COLUMNS["t"]), f"run_NextGenDrive#{joint}"
    text = GENERAL + time(n)
    for first, (name, unit, factor) in enumerate(PARTS.values(), start=1):
        text += stored(name, unit, f"{stem}.{ending}", n, first, factor=factor, **changes)
    (folder / f"{stem}.dat").write_bytes(text.encode("latin-1"))
    values = np.stack([COLUMNS[f"{part}{joint}"] for part in PARTS], axis=1)
    values.astype("<f8").tofile(folder / f"{stem}.r64")
    return folder / f"{stem}.dat"


def test_files_of_two_drives_are_one_recording(tmp_path):
    first, second = drive(tmp_path, 1), drive(tmp_path, 2, ending="R64")
    parts = {"position": "Istposition [deg]", "torque": "Drehmoment [Nm]"}
    joints = [
        {part: {"column": {"file": file.name, "column": name}, "unit": unit}
         for (part, name), unit in zip(parts.items(), ("deg", "N m"), strict=True)}
        for file in (first, second)
    ]  # fmt: skip
    content = {"robot": "pair.yaml", "files": [first.name], "time": {"column": "Zeit [s]"},
               "joints": joints}  # fmt: skip
    recording = import_recordings([write_map(tmp_path, content)], tmp_path / "run")[
        "map-01"
    ].recording
    for k in (1, 2):
        np.testing.assert_allclose(recording.q[:, k - 1], COLUMNS[f"q{k}"], atol=1e-12)
        np.testing.assert_allclose(recording.tau[:, k - 1], COLUMNS[f"m{k}"], atol=1e-12)


def test_a_drive_is_drafted(tmp_path):
    text = draft_map(drive(tmp_path, 1), "run.dat")
    for line in ('column: "Zeit [s]"', 'column: "Istposition [deg]"', 'column: "Drehmoment [Nm]"'):
        assert line in text


@pytest.mark.parametrize(("kind", "type_"), [("REAL32", "<f4"), ("INT16", "<i2"), ("WORD8", "u1")])
def test_channels_stored_one_after_the_other(tmp_path, kind, type_):
    x = np.array([[1, 2, 3], [7, 99, 9]], type_)
    x.tofile(tmp_path / "x.bin")
    parts = (stored(n, "", "x.bin", 3, first, how="CHANNEL", kind=kind, factor=0.5)
             for n, first in (("a", 1), ("b", 4)))  # fmt: skip
    none = GENERAL.replace("9.9E+34", "99").encode()
    (tmp_path / "x.dat").write_bytes(none + "".join(parts).encode())
    found = open_table(tmp_path / "x.dat", Format())
    assert found.names == ("a", "b")
    (block,) = found.blocks([0, 1])
    np.testing.assert_array_equal(block, [[0.5, 3.5], [1, np.nan], [1.5, 4.5]])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"ending": "r65"}, "values in run_NextGenDrive#1.r65; copy that file beside"),
        ({"ending": "/r64"}, "values in run_NextGenDrive#1./r64; copy that file beside"),
        ({"kind": "TWOC12"}, "values as TWOC12, stored by BLOCK.*export them as REAL64, or as CSV"),
        ({"how": "CHANNEL"}, "801 values, number 2 to 802"),
    ],
)
def test_what_cannot_be_read_is_said_with_the_remedy(tmp_path, changes, said):
    path = drive(tmp_path, 1, **changes)
    if "how" in changes:
        values = tmp_path / "run_NextGenDrive#1.r64"
        values.write_bytes(values.read_bytes()[: 8 * 801])
        assert any(said in words for words in open_table(path, Format()).left_out.values())
        return
    with pytest.raises(FileError, match=f"has no channel with values; .*{said}"):
        open_table(path, Format())


def test_values_alone_are_refused_by_name(tmp_path):
    drive(tmp_path, 1)
    with pytest.raises(
        FileError, match=r"without their names; import its header, run_Nex.*#1\.dat"
    ):
        open_table(tmp_path / "run_NextGenDrive#1.r64", Format())
