"""YAML with a value of JSON on every line, read by the fast scanner of JSON.

Every YAML reader takes this form. Values are those of JSON, unlike those of `yaml_text`. A file in
another form of YAML is read as such::

    name: VALUE
    name:
      - VALUE
      -
        name: VALUE
    name: |
      text
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from pydantic_core import from_json

from checked_files.foreign_text import whole_line, whole_lines

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Mapping

_WORD = re.compile(r"(?!(?:y|n|yes|no|on|off|true|false|null):$)[a-z_]\w*:", re.ASCII | re.I)
"""Key without quotes and its colon; the excluded words are values of YAML 1.1."""
_STEP = "  "


class _OtherForm(Exception):
    """Text in another form of YAML."""


def write_lines(content: Mapping[str, Any]) -> str:
    """Return a mapping as YAML.

    Lists of numbers, records, and records in a list have a line each.

    Examples
    --------
    >>> print(write_lines({"a": {"b": 1e-5, "c": [[1, 2], [3, 4]]}}), end="")
    a:
      b: 1.0e-05
      c:
        - [1, 2]
        - [3, 4]
    """
    return "\n".join([*_write(content, ""), ""])


def _write(value: Any, indent: str) -> Iterator[str]:
    listed = not isinstance(value, dict)
    for key, each in enumerate(value) if listed else value.items():
        head = "-" if listed else f"{key}:" if _is_word(key) else f"{_json(key)}:"
        if isinstance(each, str) and _is_block(each):
            yield f"{indent}{head} |"
            yield from (f"{indent}{_STEP}{line}" if line else "" for line in each.split("\n")[:-1])
        elif _is_nested(each, 2 if listed else 1) and _has_words(each):
            yield f"{indent}{head}"
            yield from _write(each, indent + _STEP)
        else:
            yield f"{indent}{head} {_json(each)}"


def _is_block(text: str) -> bool:
    """Return whether a text of several lines has no character that a block of YAML changes."""
    first, *lines = text.split("\n")
    return (
        lines[-1:] == [""]
        and lines[-2:-1] != [""]
        and first[:1] not in {"", " ", "\t"}
        and all(line.isprintable() for line in (first, *lines))
    )


def _is_word(key: object) -> bool:
    return _WORD.fullmatch(f"{key}:") is not None


def _has_words(value: Any) -> bool:
    return not isinstance(value, dict) or all(map(_is_word, value))


def _is_nested(value: Any, levels: int) -> bool:
    """Return whether a value has more levels of mappings and lists."""
    kinds = dict, list, tuple
    if not isinstance(value, kinds):
        return False
    inner = [
        x for x in (value.values() if isinstance(value, dict) else value) if isinstance(x, kinds)
    ]
    return bool(inner) if levels == 1 else any(_is_nested(x, levels - 1) for x in inner)


def _json(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{{', '.join(f'{_json(str(k))}: {_json(v)}' for k, v in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join([_json(each) for each in value])}]"
    text = json.dumps(value, ensure_ascii=False)
    if isinstance(value, float):  # YAML 1.1 takes 1e-05 for a text
        return text if "." in text else text.replace("e", ".0e")
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or ord(c) > 0xFFFF else f"\\u{ord(c):04x}" for c in text)


def read_lines(
    text: str, verbatim: Container[str], depth: int, values: int, without: Container[str] = ()
) -> dict[str, Any] | None:
    """Return the content of a text in the form of `write_lines`; None for any other text.

    Parameters
    ----------
    text : str
    verbatim : container of str
        Keys whose texts keep their lines; other texts become lines (`foreign_text.whole_line`).
    depth, values : int
        Maximum nesting, and number of values.
    without : container of str
        Keys of the file whose values are not read, and not returned.
    """
    lines = text.split("\n")
    if lines.pop() or len(lines) + text.count(",") > values:
        return None
    try:
        if without:
            lines = _drop(lines, without)
        content, end = _read(lines, 0, "", verbatim, depth)
    except (_OtherForm, ValueError):
        return None
    return content if isinstance(content, dict) and end == len(lines) else None


def _drop(lines: list[str], without: Container[str]) -> list[str]:
    """Return the lines outside the values of some keys of the file."""
    kept, dropped = [], False
    for line in lines:
        if not line.startswith(_STEP):
            dropped = line.partition(":")[0] in without
        if not dropped:
            kept.append(line)
    return kept


def _read(
    lines: list[str], at: int, indent: str, verbatim: Container[str], depth: int
) -> tuple[Any, int]:
    """Return the value of a block and the number of the line below it."""
    value: Any
    items: list[Any] = []
    entries: dict[str, Any] = {}
    while at < len(lines) and lines[at].startswith(indent):
        head, _, rest = lines[at][len(indent) :].partition(" ")
        at += 1
        if rest == "|":
            block, at = _read_block(lines, at, indent + _STEP)
            value = block if head[:-1] in verbatim else whole_line(block)
        elif rest:
            value = _read_json(rest)
            if "\\" in rest or not rest.isprintable():
                value = value if head[:-1] in verbatim else whole_lines(value, verbatim)
        elif depth > 1:
            value, at = _read(lines, at, indent + _STEP, verbatim, depth - 1)
        else:
            raise _OtherForm
        if head == "-":
            items.append(value)
        elif _WORD.fullmatch(head) and head[:-1] not in entries:
            entries[head[:-1]] = value
        else:
            raise _OtherForm
    if bool(items) == bool(entries):
        raise _OtherForm
    return items or entries, at


def _read_block(lines: list[str], at: int, indent: str) -> tuple[str, int]:
    first = at
    while at < len(lines) and (lines[at].startswith(indent) or not lines[at]):
        at += 1
    text = "\n".join([*(line[len(indent) :] for line in lines[first:at]), ""])
    if not _is_block(text):
        raise _OtherForm
    return text, at


def _read_json(line: str) -> Any:
    value = from_json(line, allow_inf_nan=False)
    if "{" in line:
        stated = line.count('": ')
        flat = isinstance(value, dict) and stated == len(value)
        if not flat and stated != _number_of_keys(value):  # a key is stated twice
            raise _OtherForm
    return value


def _number_of_keys(value: dict[str, Any] | list[Any]) -> int:
    inner = value.values() if isinstance(value, dict) else value
    own = len(value) if isinstance(value, dict) else 0
    return own + sum(_number_of_keys(each) for each in inner if isinstance(each, dict | list))
