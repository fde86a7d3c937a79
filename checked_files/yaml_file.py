"""YAML files into validated models, with errors that name the line.

Every file that a user writes (robot, plan, drives, plant) is a pydantic model derived from
`FileModel`. pydantic says which field is wrong and why; the YAML node tree gives the line of the
field. The result is one message per problem, such as ``robot.yaml:15: joints.2.velocity_limit: -1.2
must be greater than 0``. Reading any file ends in a valid model or in a `FileError`, within a short
time: nesting without end and aliases that multiply are refused before anything is built from them.

A file that a command has drafted marks values known only to the user: ``gear_ratio: !state "motor
angle over joint angle"``. Such a file is refused until every marked value is stated.
"""

from __future__ import annotations

import re
import stat
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError
from yaml.constructor import SafeConstructor
from yaml.resolver import Resolver

from checked_files.errors import HilError
from checked_files.foreign_text import whole_line, whole_lines
from checked_files.known_keys import known_keys
from checked_files.near import did_you_mean
from checked_files.yaml_events import Dumper, Events
from checked_files.yaml_lines import read_lines

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Iterator


class FileError(HilError):
    """Unusable file; the message has a line for every problem, with file and line."""


class FileModel(BaseModel):
    """Base of all models of files: frozen, no unknown keys, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    verbatim: ClassVar[frozenset[str]] = frozenset()
    """Keys of the file whose texts keep their lines."""

    def encode_yaml(self, width: int = 200) -> bytes:
        """Return YAML text with lines of at most about `width` characters."""
        content = self.model_dump(mode="json")
        return yaml.dump(
            content, Dumper=Dumper, sort_keys=False, width=width, allow_unicode=True
        ).encode()


M = TypeVar("M", bound=BaseModel)

UNSTATED = "!state"
"""Tag of a value to be stated by the user; its text describes the value."""
DEPTH_MAX = 32
"""Deepest nesting that a file may have."""
VALUES_MAX = 200_000
"""Maximum number of values of a file after resolution of aliases."""
NUMBER_MAX = 100
"""Maximum length of a number. Base-60 numbers of YAML take a time that grows with the square of
their length; a float has at most 24 characters."""
_SHOWN_MAX = 60
_MISSING = "missing; add this key"
_TOO_DEEP = f"nested deeper than {DEPTH_MAX} levels, or within itself; write it flat"
_TOO_MANY = (
    f"holds more than {VALUES_MAX} values with its aliases followed; write fewer, and no alias of"
    " aliases"
)
_TOO_DEEP_FOR_LIBYAML = "exceeded maximum nesting depth"
"""Message of libyaml (PyYAML 6.0.4) about nesting beyond its own limit."""
_NOT_CONVERTIBLE = (ValueError, LookupError, AttributeError, TypeError, ArithmeticError)


class _Loader(yaml.composer.Composer, Events, SafeConstructor, Resolver):
    """Safe YAML loader with a bound on nesting and with line numbers in errors."""

    def __init__(self, text: str) -> None:
        Events.__init__(self, text)
        yaml.composer.Composer.__init__(self)
        SafeConstructor.__init__(self)
        Resolver.__init__(self)
        self._depth = self._values = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Build a value and its nested values from the events of the text."""
        self._depth += 1
        self._values += 1
        if self._depth > DEPTH_MAX or self._values > VALUES_MAX:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            why = _TOO_DEEP if self._depth > DEPTH_MAX else _TOO_MANY
            raise yaml.composer.ComposerError(None, None, why, mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> object:
        """Build one value."""
        kind = node.tag.rpartition(":")[2]
        if kind in {"int", "float"} and len(node.value) > NUMBER_MAX:
            raise yaml.constructor.ConstructorError(
                None, None, f"{_shown(node.value)} is not a number of at most {NUMBER_MAX} "
                            "characters",
                node.start_mark,
            )  # fmt: skip
        try:
            return super().construct_object(node, deep)
        except _NOT_CONVERTIBLE as error:
            raise yaml.constructor.ConstructorError(
                None, None, f"{_shown(node.value)} is no {kind}", node.start_mark
            ) from error


def load_yaml(path: Path | str, model: type[M]) -> M:
    """Read one YAML document into `model`.

    Raises
    ------
    FileError
        The file cannot be read, is no YAML, or does not fit the model.
    """
    return parse_yaml(read_text(path), model, str(path))


def read_text(path: Path | str) -> str:
    """Read a text file.

    Raises
    ------
    FileError
        The file cannot be read, or is not UTF-8.
    """
    try:
        refuse_endless(Path(path))
        content = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise FileError(f"{path}: cannot be read: {reason}") from error
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise FileError(f"{path}:{line}: cannot be read: is not UTF-8 text") from error


def refuse_endless(path: Path) -> None:
    """Refuse pipes and devices, because a read may block or never end.

    Raises
    ------
    ValueError
        The path is a pipe or a device.
    OSError
        The file does not exist.
    """
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise ValueError("is a pipe or a device; name a file")


def parse_yaml(text: str, model: type[M], source: str, without: Container[str] = ()) -> M:
    """Parse YAML text into `model`; messages name `source`.

    Values of keys in `without` may be left out, to save time.
    """
    verbatim = getattr(model, "verbatim", ())
    if (content := read_lines(text, verbatim, DEPTH_MAX, VALUES_MAX, without)) is not None:
        with suppress(ValidationError):  # described below, with lines
            return model.model_validate(content)
    root, data = _parse(text, source)
    if not isinstance(data, dict):
        found = {type(None): "nothing", str: "text"}.get(type(data), type(data).__name__)
        raise FileError(f"{source}:1: must hold keys and values, not {found}")
    try:
        return model.model_validate(whole_lines(data, verbatim))
    except ValidationError as error:
        raise FileError("\n".join(_described(_wrong(error, model), root, source))) from error


def _parse(text: str, source: str) -> tuple[yaml.Node | None, object]:
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
        if root is None:
            return None, None
        _refuse_excess(root, source)
        _refuse_unstated(root, source)
        return root, loader.construct_document(root)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        why = _TOO_DEEP if error.problem == _TOO_DEEP_FOR_LIBYAML else error.problem
        at = error.problem_mark.index if error.problem_mark else len(text)
        if (first := text[at : at + 1]) and first in "%@`":
            why = f'{why}: quote a value that begins with {first}, as in "{first}"'
        prefix = "" if why in {_TOO_DEEP, _TOO_MANY} else "is not valid YAML: "
        raise FileError(f"{source}:{line}: {prefix}{why}") from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise FileError(f"{source}:{line}: is not valid YAML: {error.reason}") from error


def line_of(text: str, location: tuple[str | int, ...]) -> int:
    """Return the line (from 1) of the value at `location` in YAML `text`."""
    return _line(_Loader(text).get_single_node(), location)


def refuse(
    source: str, text: str | None, wrong: Iterable[tuple[tuple[str | int, ...], str]]
) -> None:
    """Refuse a file with a message for each place; no lines are stated without its text.

    Raises
    ------
    FileError
        Error with one line for each problem; no error without a problem.
    """
    lines = [
        f"{source}{'' if text is None else f':{line_of(text, at)}'}: {place(at)}: {why}"
        for at, why in wrong
    ]
    if lines:
        raise FileError("\n".join(lines))


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:  # Python refuses to print integers of more than some thousand digits
        return "an enormous number"
    return text if len(text) <= _SHOWN_MAX else f"{text[:_SHOWN_MAX]}..."


def problems(error: ValidationError) -> list[str]:
    """Return a line for each invalid value of a model without a file."""
    return [f"{place(at)}: {message}" for at, message in _wrong(error)]


def _wrong(
    error: ValidationError, model: type[BaseModel] | None = None
) -> list[tuple[tuple[str | int, ...], str]]:
    """Return places and messages of all problems of `model`.

    The message about a too short sequence is dropped if one of its items was refused.
    """
    wrong = [(_location(each), _message(each, model)) for each in error.errors()]
    return [
        (at, message)
        for at, message in wrong
        if not any(other[: len(at)] == at != other for other, _ in wrong)
    ]


def place(location: tuple[str | int, ...]) -> str:
    """Return the keys that lead to a value, joined by dots."""
    return ".".join(str(part) for part in location)


def _described(
    wrong: list[tuple[tuple[str | int, ...], str]], root: yaml.Node | None, source: str
) -> list[str]:
    """Return message lines by value; the members of a union share a line."""
    found: dict[tuple[str | int, ...], list[str]] = {}
    for location, message in wrong:
        messages = found.setdefault(_written(root, location, message), [])
        value = f"{messages[0].partition(': ')[0]}: " if messages else ""
        if message not in messages:
            messages.append(message.removeprefix(value))
    return [
        f"{source}:{_line(root, at)}: {f'{place(at)}: ' if at else ''}{', or '.join(messages)}"
        for at, messages in found.items()
    ]


def _written(
    node: yaml.Node | None, location: tuple[str | int, ...], message: str
) -> tuple[str | int, ...]:
    """Return the location of a value in the file, without the tags of unions such as ``float``."""
    kept: list[str | int] = []
    for part in location:
        found = _child(node, part)
        if found is not None:
            kept, node = [*kept, part], found[1]
    missing = message.startswith(_MISSING) and location[-1:] != tuple(kept[-1:])
    return (*kept, location[-1]) if missing else tuple(kept)


def _location(problem: object) -> tuple[str | int, ...]:
    assert isinstance(problem, dict)  # noqa: S101 - pydantic's ErrorDetails
    return tuple(problem["loc"])


def _message(problem: object, model: type[BaseModel] | None) -> str:
    assert isinstance(problem, dict)  # noqa: S101 - pydantic's ErrorDetails
    message = str(problem["msg"]).removeprefix("Value error, ")
    message = re.sub(r"^\w+ should (be|have|match)\b", r"must \1", message)
    if problem["type"] == "extra_forbidden":
        *above, key = _location(problem)
        known = known_keys(model, above) if model else ()
        for depth in range(len(above)):
            if model and str(key) in known_keys(model, above[:depth]):
                level = f"in {place(tuple(above[:depth]))}" if depth else "at the top level"
                return f"unknown key here; write it {level} of the file"
        return f"unknown key; remove it or correct its spelling{did_you_mean(str(key), known)}"
    if problem["type"] == "missing":
        return _MISSING
    if isinstance(problem["input"], str | int | float | bool) and "Value error" not in str(
        problem["msg"]
    ):
        return f"{_shown(problem['input'])}: {message[:1].lower()}{message[1:]}"
    return message


def _line(node: yaml.Node | None, location: tuple[str | int, ...]) -> int:
    line = node.start_mark.line + 1 if node else 1
    for part in location:
        found = _child(node, part)
        if found is None:
            continue  # tag of a union, or the missing key itself
        key, node = found
        line = key.start_mark.line + 1
    return line


def _child(node: yaml.Node | None, part: str | int) -> tuple[yaml.Node, yaml.Node] | None:
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if whole_line(str(key.value)) == str(part):
                return key, value
    if isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
        return node.value[part], node.value[part]
    return None


def _refuse_excess(root: yaml.Node, source: str) -> None:
    """Refuse duplicate keys, recursive nesting and multiplying aliases."""
    waiting, values = [(root, 1)], 0
    while waiting:
        node, depth = waiting.pop()
        values += 1
        line = node.start_mark.line + 1
        if depth > DEPTH_MAX:
            raise FileError(f"{source}:{line}: {_TOO_DEEP}")
        if values > VALUES_MAX:
            raise FileError(f"{source}:{line}: {_TOO_MANY}")
        if isinstance(node, yaml.MappingNode):
            _refuse_duplicate_keys(node, source)
            waiting += [(part, depth + 1) for pair in node.value for part in pair]
        elif isinstance(node, yaml.SequenceNode):
            waiting += [(part, depth + 1) for part in node.value]


def _refuse_duplicate_keys(node: yaml.MappingNode, source: str) -> None:
    seen: set[str] = set()
    for key, _ in node.value:
        name = str(key.value)
        if name in seen:
            line = key.start_mark.line + 1
            raise FileError(f"{source}:{line}: {whole_line(name)}: is stated twice; remove one")
        seen.add(name)


def _refuse_unstated(root: yaml.Node, source: str) -> None:
    unstated = list(_unstated(root, ()))
    if unstated:
        raise FileError(
            "\n".join(
                f"{source}:{node.start_mark.line + 1}: {whole_line('.'.join(place))}: must be "
                "stated: "
                f"{whole_line(node.value) if isinstance(node, yaml.ScalarNode) else 'a value'}; "
                f"write it instead of {UNSTATED} and its text"
                for place, node in unstated
            )
        )


def _unstated(
    node: yaml.Node, place: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], yaml.Node]]:
    if node.tag == UNSTATED:
        yield place, node
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            yield from _unstated(value, (*place, str(key.value)))
    elif isinstance(node, yaml.SequenceNode):
        for number, value in enumerate(node.value):
            yield from _unstated(value, (*place, str(number)))
