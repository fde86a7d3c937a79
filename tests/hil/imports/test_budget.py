"""Memory budget of recordings: small files that would exceed the budget are refused beforehand.

Harmless input: the budget is lowered, so that files of some kilobytes exceed it.
"""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from checked_files import budget
from checked_files.yaml_file import FileError
from hil.imports.map_file import Format
from hil.imports.readers import open_table, unpacked

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ZEROS = np.zeros(50_000)
"""400 kB that compress to less than one."""


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "BASE", 100_000)


def _h5(path: Path, **how: Any) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("q", **how)


WRITERS: dict[str, Callable[[Path], object]] = {
    "a.npz": lambda path: np.savez_compressed(path, q=ZEROS),
    "a.mat": lambda path: savemat(path, {"q": ZEROS}, do_compression=True),
    "declared.h5": lambda path: _h5(path, shape=(10**12,), chunks=(1000,), dtype="f8"),
    "chunk.h5": lambda path: _h5(path, data=ZEROS, chunks=(50_000,), compression="gzip"),
    "a.csv.gz": lambda path: path.write_bytes(gzip.compress(b"q\n" + b"0\n" * 50_000)),
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_becomes_larger_than_the_budget_is_refused_with_the_remedy(
    tmp_path: Path, name: str
) -> None:
    WRITERS[name](tmp_path / name)
    with pytest.raises(FileError, match=r"MB, at most .* MB allowed .* set HIL_READ_LIMIT=\d+"):
        for _ in open_table(tmp_path / name, Format()).blocks([0]):
            pass


@pytest.mark.parametrize("name", sorted(WRITERS.keys() - {"declared.h5"}))
def test_the_budget_is_raised_by_an_environment_variable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    WRITERS[name](tmp_path / name)
    monkeypatch.setenv(budget.LIMIT, "0.01")
    assert sum(map(len, open_table(tmp_path / name, Format()).blocks([0]))) == len(ZEROS)


@pytest.mark.parametrize("value", ["", "x", "-1", "nan", "inf"])
def test_a_limit_that_is_no_number_raises_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    (tmp_path / "a").write_bytes(b"12345")
    monkeypatch.setenv(budget.LIMIT, value)
    assert budget.allowed(tmp_path / "a") == 100_020


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_chunk_of_mcap_is_counted_before_it_is_unpacked(tmp_path: Path, compression: str) -> None:
    mcap = pytest.importorskip("mcap.writer")
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = mcap.Writer(
            file, chunk_size=1 << 30, compression=mcap.CompressionType[compression.upper()]
        )
        writer.start()
        schema = writer.register_schema("a", "ros2msg", b"")
        channel = writer.register_channel("/a", "cdr", schema)
        for stamp in range(10):
            writer.add_message(channel, stamp, bytes(50_000), stamp)
        writer.finish()
    with pytest.raises(FileError, match="a chunk would take"):
        open_table(path, Format())
    # rows beyond the declared number are counted
    content = bytearray(path.read_bytes())
    at = content.index(compression.encode(), 8) - 4 - 4 - 8
    content[at : at + 8] = (1).to_bytes(8, "little")
    path.write_bytes(content)
    with pytest.raises(FileError, match="a chunk would take"):
        unpacked.mcap_chunks(path)


@pytest.mark.parametrize("virtual", [True, False])
def test_values_in_other_files_are_not_read(tmp_path: Path, virtual: bool) -> None:
    """Otherwise a file of the user would become a column of a run that is sent back."""
    (tmp_path / "notes.bin").write_bytes(bytes(800))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = np.arange(100.0)
        if virtual:
            with h5py.File(tmp_path / "other.h5", "w") as other:
                other["q"] = np.ones(100)
            layout = h5py.VirtualLayout((100,), "f8")
            layout[:] = h5py.VirtualSource("other.h5", "q", (100,))
            file.create_virtual_dataset("q", layout)
        else:
            file.create_dataset("q", (100,), "f8", external=[(tmp_path / "notes.bin", 0, 800)])
    with pytest.raises(FileError, match=r"q has its values in other files.*h5repack"):
        open_table(tmp_path / "a.h5", Format())


def test_links_to_other_files_are_no_columns(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["q"] = np.ones(100)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = np.arange(100.0)
        file["q"] = h5py.ExternalLink("other.h5", "q")
    assert open_table(tmp_path / "a.h5", Format()).names == ("t",)


def test_a_bag_whose_file_is_a_link_to_elsewhere_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    (tmp_path / "notes.db3").write_bytes(b"mine")
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    (bag / "a.db3").symlink_to(tmp_path / "notes.db3")
    with pytest.raises(FileError, match=r"outside the bag's folder; copy the file"):
        open_table(bag, Format())
    (bag / "a.db3").unlink()
    (bag / "a.db3").symlink_to(bag / "b.db3")
    with pytest.raises(FileError, match="bag"):
        open_table(bag, Format())


def test_large_messages_are_read_in_smaller_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    joint_states = pytest.importorskip("hil.imports.readers.joint_states")
    monkeypatch.setattr(joint_states, "LARGEST", 250)
    messages = iter([(k, bytes(100)) for k in range(7)])
    sizes = []
    while block := list(joint_states._some(messages)):
        sizes.append(len(block))
    assert sizes == [3, 3, 1]
