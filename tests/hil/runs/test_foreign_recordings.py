"""Recordings of a run folder with too much declared data, or with data in other files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest

from checked_files import budget
from checked_files.yaml_file import FileError
from hil.runs.recording_file import read_measured

if TYPE_CHECKING:
    from pathlib import Path

NAMES = ("time", "q", "tau")


def _write(path: Path, instead: str) -> None:
    with h5py.File(path, "w") as file:
        for name in NAMES:
            if instead == "declared":
                file.create_dataset(name, (10**9, 6), "f8", chunks=(1000, 6))
            elif instead == "external":
                file.create_dataset(name, (9,), "f8", external=[(path.parent / "notes", 0, 72)])
            else:
                file[name] = h5py.ExternalLink("other.h5", "q")


@pytest.mark.parametrize("instead", ["declared", "external", "linked"])
def test_it_is_refused_before_anything_of_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, instead: str
) -> None:
    (tmp_path / "notes").write_bytes(bytes(72))
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["q"] = np.ones(9)
    _write(tmp_path / "a.h5", instead)
    read: list[object] = []
    monkeypatch.setattr("hil.runs.recording_file._array", lambda *at: read.append(at))
    words = "MB allowed" if instead == "declared" else "a link to another file"
    with pytest.raises(FileError, match=words):
        read_measured(tmp_path / "a.h5")
    assert read == []
    assert budget.allowed(tmp_path / "a.h5") < 10**9
