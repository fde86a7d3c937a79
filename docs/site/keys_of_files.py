"""Directive ``{keys} hil.planning.plan.Plan``: table of the keys of a file.

Keys and defaults are those of the class that reads the file; meanings come from the docstring of
the class.
"""

from __future__ import annotations

from enum import Enum
from importlib import import_module
from inspect import getdoc
from typing import TYPE_CHECKING, Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from numpydoc.docscrape import NumpyDocString

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pydantic import BaseModel
    from pydantic.fields import FieldInfo
    from sphinx.application import Sphinx

SHORT = 40
"""Maximum length of a default in the table."""


class Keys(Directive):
    """Table of the keys that a class reads from a file."""

    required_arguments: ClassVar[int] = 1

    def run(self) -> list[nodes.Node]:
        """Return heading, description of the class, and table."""
        module, _, name = self.arguments[0].rpartition(".")
        lines = [f"**{name}**", "", *_described(getattr(import_module(module), name))]
        container = nodes.container()
        self.state.nested_parse(StringList(lines), self.content_offset, container)
        return container.children


def _described(model: type[BaseModel]) -> Iterator[str]:
    documented = NumpyDocString(getdoc(model) or "")
    yield from [*documented["Summary"], "", *documented["Extended Summary"], ""]
    yield from ("| key | | meaning |", "|---|---|---|")
    meanings = {
        name: " ".join(entry.desc)
        for entry in documented["Attributes"]
        for name in entry.name.split(" : ")[0].split(", ")
    }
    for name, field in model.model_fields.items():
        meaning = meanings.get(name, "").replace("|", r"\|")
        yield f"| `{field.alias or name}` | {_default(field)} | {meaning} |"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value: Any = field.get_default(call_default_factory=True)
    value = value.value if isinstance(value, Enum) else value
    return f"`{value}`" if _is_shown(value) else "optional"


def _is_shown(value: Any) -> bool:
    return value not in (None, {}, (), "") and len(str(value)) < SHORT and "=" not in str(value)


def setup(app: Sphinx) -> None:
    """Register the directive with Sphinx."""
    app.add_directive("keys", Keys)
