"""Files with a line of JSON for each value are YAML, and are read like any other YAML."""

from __future__ import annotations

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from checked_files.foreign_text import whole_lines
from checked_files.yaml_file import DEPTH_MAX, VALUES_MAX, FileError, FileModel, parse_yaml
from checked_files.yaml_lines import read_lines, write_lines

WORDS = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=30) | st.sampled_from(
    ["a\n", "a\n\nb\n", " a\n", "a\n\n", "\ta\nb\n", "a\n  b \n", "1e5", "null", "|", "# a", "- a"]
)
VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats(allow_nan=False, allow_infinity=False)
    | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(WORDS | TEXTS, inner, max_size=4),
    max_leaves=20,
)


def read(text: str, verbatim: tuple[str, ...] = ()) -> dict[str, object] | None:
    return read_lines(text, verbatim, DEPTH_MAX, VALUES_MAX)


@given(st.dictionaries(WORDS, VALUES, min_size=1, max_size=4))
@example({"null": 1, "yes": 2, "on": {"off": [[1.0]]}})
@example({"a": {"b": [1e-5, 1e22, -0.0, 5e-324]}, "c": [[[]], [{}]], "d": {}})
@example({"a": {"\x85": "\u2028\ufeff\x7f\U0001f916"}})
def test_what_is_written_is_what_any_yaml_reader_reads(content: dict[str, object]) -> None:
    text = write_lines(content)
    assert repr(yaml.safe_load(text)) == repr(content)
    found = read(text)
    assert found is None or repr(found) == repr(whole_lines(content, ()))


USUAL = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | st.sampled_from(["", "one", "two words", "1e5", "null", "- a", "# b", "joint's offset"]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.sampled_from(["a", "b2", "c_d", "value"]), inner, max_size=4),
    max_leaves=20,
)  # fmt: skip


@given(st.dictionaries(st.sampled_from(["a", "b2", "c_d"]), USUAL, min_size=1))
def test_usual_content_is_read_line_by_line(content: dict[str, object]) -> None:
    assert repr(read(write_lines(content))) == repr(content)


@given(st.text(st.sampled_from('ab:-| \n"[]{}1,\\.e#'), max_size=60))
@example('a: 1\na: "2"\n')
@example('a: {"b": 1, "b": 2}\n')
@example("a:\n  b: 1\n c: 2\n")
def test_any_other_text_is_left_to_the_yaml_reader(text: str) -> None:
    if (found := read(text, ("a", "b"))) is not None:
        assert found == yaml.safe_load(text)


@pytest.mark.parametrize(
    "text",
    [
        "", "a: b\n", "a: 1", "a: [1,\n  2]\n", 'a: {"b": 1, "b": 2}\n', "a: 1\na: 2\n", "a:\n",
        "no: 1\n", "a: NaN\n", "a: 1 # b\n", "a:\n  - 1\n  b: 2\n", f"a: {'[' * 5000}\n",
        "a:\n" + "".join(f"{'  ' * k}b:\n" for k in range(1, 50)), f"a: [{'1,' * VALUES_MAX}1]\n",
    ],
)  # fmt: skip
def test_texts_of_another_form_are_told(text: str) -> None:
    assert read(text) is None


class _File(FileModel):
    a: float
    b: str = ""


def test_a_wrong_value_is_refused_with_its_line() -> None:
    text = write_lines({"a": "one", "b": "two"})
    assert read(text) is not None
    with pytest.raises(FileError, match=r"^file\.yaml:1: a: 'one': must be a valid number"):
        parse_yaml(text, _File, "file.yaml")


def test_a_foreign_text_becomes_one_line() -> None:
    for text in ("one\ntwo\n", "one\u2028two", 'one\t"two"'):
        written = write_lines({"a": 1, "b": text})
        other = f"{written}# read as any other YAML\n"
        assert read(other) is None
        assert "\n" not in (found := parse_yaml(written, _File, "file.yaml")).b
        assert found == parse_yaml(other, _File, "file.yaml")


def test_keys_that_are_not_asked_for_are_passed_over() -> None:
    text = write_lines({"a": 1.0, "records": [{"a": [1]}, {"a": [2]}], "b": "two"})
    assert read_lines(text, (), DEPTH_MAX, VALUES_MAX, without=("records",)) == {
        "a": 1.0,
        "b": "two",
    }
    assert parse_yaml(text, _File, "file.yaml", without=("records",)) == _File(a=1.0, b="two")
    with pytest.raises(FileError, match="records: unknown key"):
        parse_yaml(text, _File, "file.yaml")
