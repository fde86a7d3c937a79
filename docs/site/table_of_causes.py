"""Directive ``{causes}``: table of the causes of identification errors, with remedies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList

from hil.estimation.excluded.causes import CAUSES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sphinx.application import Sphinx


class Causes(Directive):
    """Table of all causes, with the words of messages and the remedies."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        container = nodes.container()
        self.state.nested_parse(StringList(list(_lines())), self.content_offset, container)
        return container.children


def _lines() -> Iterator[str]:
    yield from ("| cause | message | what to do |", "|---|---|---|")
    for name, cause in CAUSES.items():
        unit = cause.unit.format(torque="N m", position="rad")
        words = f"… {cause.words} … {unit}".rstrip() if cause.words else ""
        yield f"| {name} | {words} | {cause.remedy} |"


def setup(app: Sphinx) -> None:
    """Register the directive with Sphinx."""
    app.add_directive("causes", Causes)
