"""Foreign text in YAML written line by line remains a value, a comment or a mark."""

from __future__ import annotations

from itertools import product

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from checked_files.foreign_text import LONGEST, one_line, printable
from checked_files.yaml_text import comment, mark_unstated, number, quoted, scalar

FOREIGN = st.text(st.characters(exclude_categories=()), max_size=40) | st.sampled_from(
    [f"a{end}key: 1{end}# b" for end in ("\n", "\r", "\r\n", "\x85", "\u2028", "\u2029")]
)
LOADERS = [yaml.SafeLoader, *([yaml.CSafeLoader] if yaml.__with_libyaml__ else [])]


@given(FOREIGN)
@example("null")
@example("1_0")
@example("\ud800")
def test_a_value_is_read_again_as_it_was_written(text: str) -> None:
    assert yaml.safe_load(f"key: {scalar(text)}") == {"key": text}
    assert yaml.safe_load(f"key: {{key: {quoted(text)}, end: 1}}")["key"]["key"] == text


@given(FOREIGN)
def test_a_comment_stays_a_comment(text: str) -> None:
    for loader, before in product(LOADERS, ("", "key: 1 ")):
        read = yaml.load(f"{before}{comment(text)}\nend: 2\n", loader)  # noqa: S506 - safe loaders
        assert read == ({"key": 1} if before else {}) | {"end": 2}


@given(FOREIGN)
def test_a_mark_holds_its_hint_and_nothing_else(text: str) -> None:
    root = yaml.compose(f"key: {mark_unstated(text)}\nend: 2\n")
    assert isinstance(root, yaml.MappingNode)
    assert [key.value for key, _ in root.value] == ["key", "end"]
    assert root.value[0][1].tag == "!state"


@given(st.floats(allow_nan=False, allow_infinity=False) | st.integers() | st.booleans() | st.none())
def test_a_number_is_read_again_as_it_was_written(value: float | bool | None) -> None:
    assert yaml.safe_load(scalar(value)) == value


def test_numbers_are_as_short_as_they_are_exact() -> None:
    assert [number(x) for x in (1.0, -0.0, 0.1, 1e-5, 1e22)] == [
        "1", "0", "0.1", "1.0e-05", "1.0e+22",
    ]  # fmt: skip


@given(FOREIGN, st.integers(1, 60))
def test_foreign_text_becomes_one_line_of_bounded_length(text: str, longest: int) -> None:
    line = one_line(text, longest)
    assert len(line) <= longest + len(f"... ({len(text)} characters)")
    assert line.splitlines() in ([], [line])


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("joint 1", "joint 1"),
        ("a\nb\tc", "a\nb\tc"),
        ("\x1b[2J", "\\x1b[2J"),
        ("\u202egood", "\\u202egood"),
        ("1\u202fN m", "1\u202fN m"),
        ("\x9b1m\x7f", "\\x9b1m\\x7f"),
    ],
)
def test_what_a_terminal_obeys_is_written_out(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_a_text_of_a_hundred_kilobytes_is_cut() -> None:
    line = one_line("x" * 100_000)
    assert line == f"{'x' * LONGEST}... (100000 characters)"
