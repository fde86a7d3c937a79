"""Tables on a page, drawn by one Jinja template; and how names of parameters are typeset there."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from hil.results.tables.table import Marked

if TYPE_CHECKING:
    from jinja2 import Template

    from hil.results.tables.table import Table

_NAME = re.compile(r"([A-Za-z])(\w*)")
_POWER = re.compile(r"\^(\d+)")


def environment(*folders: Path) -> Environment:
    """Templates of `folders`, in which the filters ``table`` and ``symbols`` typeset."""
    made = Environment(
        loader=FileSystemLoader(folders), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    made.filters.update(symbols=symbols, table=html)
    made.tests["marked"] = lambda cell: isinstance(cell, Marked)
    return made


def html(table: Table) -> Markup:
    """Return a table as HTML, with its notes below."""
    return Markup(_template().render(content=table))  # noqa: S704 - the template has escaped it


def symbols(expression: str) -> Markup:
    """Typeset names and powers: ``l1^2 Izz2`` with subscripts and superscripts."""
    typeset = _NAME.sub(r"<i>\1</i><sub>\2</sub>", str(escape(expression)))
    typeset = _POWER.sub(r"<sup>\1</sup>", typeset).replace("<sub></sub>", "")
    return Markup(typeset.replace(" - ", " − "))  # noqa: S704 - escaped above


@cache
def _template() -> Template:
    return environment(Path(__file__).parent).get_template("table.html")
