"""Fuzzing of every reader with a valid file and a few changed ones; for an hour: tools/fuzz.py."""

from __future__ import annotations

import os
import shutil
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("rosbags")
fuzzing = pytest.importorskip("fuzzing")

if TYPE_CHECKING:
    from pathlib import Path

EXAMPLES = 5
"""Number of examples per format, in addition to the known failures."""
FOUND: dict[str, list[int]] = {}
"""Numbers of examples that once failed in a reader of ours.

Examples that crash a C library are not kept here; readers call such libraries in a separate
process.
"""


@pytest.fixture(scope="module", autouse=True)
def _folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    os.environ["FUZZING_FOLDER"] = str(tmp_path_factory.mktemp("fuzzing"))


@pytest.mark.parametrize("kind", fuzzing.KINDS)
def test_a_valid_file_is_read(kind: str, tmp_path: Path) -> None:
    valid = fuzzing._valid(kind)
    shutil.copytree(valid.parent, tmp_path / "example")
    outcome = fuzzing.attempt(kind, tmp_path / "example" / valid.name)
    assert (outcome.how, outcome.text, outcome.wrong) == ("read", "", "")


@pytest.mark.parametrize("kind", fuzzing.KINDS)
def test_a_changed_file_is_read_or_refused_in_bounded_memory(kind: str, tmp_path: Path) -> None:
    for number in (*range(EXAMPLES), *FOUND.get(kind, ())):
        path = fuzzing.made(kind, number, tmp_path / str(number))
        assert not fuzzing.attempt(kind, path).wrong, f"tools/fuzz.py 60 {kind} --only {number}"
