"""YAML files into validated models, with errors that name the line.

Every file that a user writes (robot, plan, drives, plant) is a pydantic model derived from
`FileModel`. pydantic says which field is wrong and why; the YAML node tree says on which line that
field stands. Together they make one message a problem, such as ``robot.yaml:15:
joints.2.velocity_limit: -1.2 must be greater than 0``.

A file that a command has drafted marks what only the user knows: ``gear_ratio: !state "motor angle
over joint angle"``. Such a file is refused until every marked value is stated.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

if TYPE_CHECKING:
    from collections.abc import Iterator


class FileError(Exception):
    """A file that cannot be used; one line a problem, each with its place."""


class FileModel(BaseModel):
    """Base of everything that is read from a file: frozen, no unknown keys, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


M = TypeVar("M", bound=BaseModel)

UNSTATED = "!state"
"""Tag of a value that the user must state; its text says what to state."""


def load_yaml(path: Path | str, model: type[M]) -> M:
    """Read one YAML document into `model`.

    Raises
    ------
    FileError
        The file cannot be read, is no YAML, or does not fit the model.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise FileError(f"{path}: cannot be read: {reason}") from error
    return parse_yaml(text, model, str(path))


def parse_yaml(text: str, model: type[M], source: str) -> M:
    """Parse YAML text into `model`; `source` names it in messages."""
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        _refuse_duplicate_keys(root, source)
        _refuse_unstated(root, source)
        data = yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise FileError(f"{source}:{line}: is no valid YAML: {error.problem}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise FileError(f"{source}: is no valid YAML: {error}") from error
    if not isinstance(data, dict):
        raise FileError(f"{source}:1: must hold keys and values, not {type(data).__name__}")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        lines = [_describe(problem, root, source) for problem in error.errors()]
        raise FileError("\n".join(lines)) from error


def line_of(text: str, location: tuple[str | int, ...]) -> int:
    """Line (from 1) on which the value at `location` stands in YAML `text`."""
    return _line(yaml.compose(text, Loader=yaml.SafeLoader), location)


def _describe(problem: object, root: yaml.Node | None, source: str) -> str:
    assert isinstance(problem, dict)  # noqa: S101 - pydantic's ErrorDetails
    location = tuple(problem["loc"])
    message = str(problem["msg"]).removeprefix("Value error, ")
    message = re.sub(r"^\w+ should (be|have|match)\b", r"must \1", message)
    if problem["type"] == "extra_forbidden":
        message = "unknown key; remove it or correct its spelling"
    elif problem["type"] == "missing":
        message = "missing; add this key"
    elif isinstance(problem["input"], str | int | float | bool) and "Value error" not in str(
        problem["msg"]
    ):
        message = f"{problem['input']!r}: {message[:1].lower()}{message[1:]}"
    place = ".".join(str(part) for part in location)
    return f"{source}:{_line(root, location)}: {place + ': ' if place else ''}{message}"


def _line(node: yaml.Node | None, location: tuple[str | int, ...]) -> int:
    line = node.start_mark.line + 1 if node else 1
    for part in location:
        found = _child(node, part)
        if found is None:
            continue  # a union's tag, or the missing key itself
        key, node = found
        line = key.start_mark.line + 1
    return line


def _child(node: yaml.Node | None, part: str | int) -> tuple[yaml.Node, yaml.Node] | None:
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if str(key.value) == str(part):
                return key, value
    if isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
        return node.value[part], node.value[part]
    return None


def _refuse_duplicate_keys(node: yaml.Node | None, source: str) -> None:
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            name = str(key.value)
            if name in seen:
                line = key.start_mark.line + 1
                raise FileError(f"{source}:{line}: {name}: stands twice; remove one of them")
            seen.add(name)
            _refuse_duplicate_keys(value, source)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            _refuse_duplicate_keys(value, source)


def _refuse_unstated(root: yaml.Node | None, source: str) -> None:
    unstated = list(_unstated(root, ()))
    if unstated:
        raise FileError(
            "\n".join(
                f"{source}:{node.start_mark.line + 1}: {'.'.join(place)}: must be stated: "
                f"{node.value if isinstance(node, yaml.ScalarNode) else 'a value'}; "
                f"put it in the place of {UNSTATED} and its text"
                for place, node in unstated
            )
        )


def _unstated(
    node: yaml.Node | None, place: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], yaml.Node]]:
    if node is not None and node.tag == UNSTATED:
        yield place, node
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            yield from _unstated(value, (*place, str(key.value)))
    elif isinstance(node, yaml.SequenceNode):
        for number, value in enumerate(node.value):
            yield from _unstated(value, (*place, str(number)))
