"""Page of questions: each named page exists and contains the words of the answer."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "questions.md"
ROW = re.compile(r"(?m)^\| (.+\?) \| \[[^]]+\]\(([^)]+)\) \| (.+) \|$")
QUESTIONS = ROW.findall(PAGE.read_text(encoding="utf-8"))
PROSE = re.compile(r"<!--.*?-->|[`*]")
"""Markup that is not visible on the page."""


def test_there_are_twenty_of_different_pages() -> None:
    assert len(QUESTIONS) == 20
    assert len({page for _, page, _ in QUESTIONS}) > 15


@pytest.mark.parametrize(("question", "page", "words"), QUESTIONS)
def test_the_named_page_holds_the_answer(question: str, page: str, words: str) -> None:
    text = (PAGE.parent / page).read_text(encoding="utf-8")
    assert PROSE.sub("", words) in PROSE.sub("", text), question
