"""Numbers in YAML that take too long to parse are refused with their line."""

from __future__ import annotations

import pytest

from checked_files.yaml_file import NUMBER_MAX, FileError, FileModel, parse_yaml


class _Model(FileModel):
    value: float


@pytest.mark.parametrize(
    "text", ["1" + ":1" * NUMBER_MAX, "9" * (NUMBER_MAX + 1), "0." + "1" * NUMBER_MAX]
)
def test_a_number_of_more_characters_than_any_needs_is_refused(text: str) -> None:
    with pytest.raises(FileError, match=rf"a.yaml:1: .*not a number of at most {NUMBER_MAX} char"):
        parse_yaml(f"value: {text}", _Model, "a.yaml")


def test_a_number_that_fits_is_read() -> None:
    assert parse_yaml("value: 1:30", _Model, "a.yaml").value == 90
