"""The check of English in `make lint` finds docstrings without technical nouns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tools.english import Bounds, check, is_flagged

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    "summary",
    [
        "Of the unknowns, shape (n,).",
        "What was found of a run's recordings.",
        "The same with another load on one axis.",
        "Take what was latched, which decides nothing here.",
        "The drive renews its position less often than it sends it.",
    ],
)
def test_a_summary_without_its_nouns_is_flagged(summary: str) -> None:
    assert is_flagged(summary)


@pytest.mark.parametrize(
    "summary",
    [
        "Covariance of the unknowns, shape (n,).",
        "Send every outgoing frame twice.",
        "Return `it` and `which` of a drive. What follows is no summary, and that is all of it.",
    ],
)
def test_a_summary_that_stands_alone_is_not(summary: str) -> None:
    assert not is_flagged(summary)


def test_each_figure_and_each_name_beyond_its_bound_is_stated(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text('"""What it is that they do."""\n\n\ndef _of_speed():\n    pass\n')
    name, *figures = check(tmp_path, Bounds(1.8, 2.8, 5.0))
    assert name == f"{path}:4: _of_speed: name it by a verb or a noun"
    assert figures[0] == f"{tmp_path}: 33.33 relative words per 100, at most 1.8 may be"
    assert figures[1] == f"{path}:1: What it is that they do."
    assert check(tmp_path, Bounds(100.0, 100.0, 100.0)) == [name]
