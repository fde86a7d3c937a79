"""Foreign HDF5 files: bounds of the unpacked size and of data referenced by cells.

Harmless input: the budget is lowered, so that some hundred kilobytes exceed it.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest

from checked_files import budget
from checked_files.yaml_file import FileError
from hil.imports.map_file import Format
from hil.imports.readers import open_table

if TYPE_CHECKING:
    from pathlib import Path


def _chunk(path: Path, content: bytes, **how: object) -> None:
    """Write a dataset of one chunk of 8 kB whose stored bytes are `content`."""
    with h5py.File(path, "w") as file:
        q = file.create_dataset("q", (1000,), "f8", chunks=(1000,), **how)
        q.id.write_direct_chunk((0,), content)


def test_a_chunk_unpacks_to_no_more_than_it_declares(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """HDF5's own filter doubles its memory until all is unpacked, independently of the declared
    size.
    """
    monkeypatch.setattr(budget, "BASE", 100_000)
    _chunk(tmp_path / "a.h5", zlib.compress(bytes(8000)), compression="gzip")
    assert len(next(iter(open_table(tmp_path / "a.h5", Format()).blocks([0])))) == 1000
    _chunk(tmp_path / "a.h5", zlib.compress(bytes(1_000_000)), compression="gzip")
    with pytest.raises(FileError, match=r"a chunk of q would take .*HIL_READ_LIMIT"):
        open_table(tmp_path / "a.h5", Format())


@pytest.mark.parametrize("how", [{"scaleoffset": 3}, {"compression": "szip"}])
def test_filters_that_state_their_own_size_are_refused(
    tmp_path: Path, how: dict[str, object]
) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        try:
            file.create_dataset("q", data=np.arange(1000.0), chunks=(1000,), **how)
        except ValueError:
            pytest.skip("this HDF5 has no such filter")
    with pytest.raises(FileError, match=r"q is compressed by filter \d+.*h5repack -f GZIP=4"):
        open_table(tmp_path / "a.h5", Format())


def _mat(path: Path) -> h5py.File:
    file = h5py.File(path, "w", userblock_size=512)
    file.attrs["version"] = "7.3"
    return file


def test_the_cells_of_a_mat_file_hold_no_values_of_other_files(tmp_path: Path) -> None:
    (tmp_path / "notes.bin").write_bytes(bytes(800))
    with _mat(tmp_path / "a.mat") as file:
        kept = file.create_group("#refs#")
        cells = [
            kept.create_dataset(f"c{k}", (1,), "f8", external=[(tmp_path / "notes.bin", 8 * k, 8)])
            for k in range(50)
        ]
        q = file.create_dataset("q", (50,), h5py.ref_dtype)
        q[:] = [each.ref for each in cells]
        q.attrs["MATLAB_class"] = np.bytes_("cell")
    with pytest.raises(FileError, match=r"has its values in other files.*h5repack"):
        open_table(tmp_path / "a.mat", Format())


def test_the_cells_of_a_mat_file_are_no_more_than_the_budget(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(budget, "BASE", 100_000)
    with _mat(tmp_path / "a.mat") as file:
        q = file.create_dataset("q", (10**9,), h5py.ref_dtype, chunks=(1000,))
        q.attrs["MATLAB_class"] = np.bytes_("cell")
    with pytest.raises(FileError, match=r"q would take 5\.2e\+06 MB"):
        open_table(tmp_path / "a.mat", Format())
