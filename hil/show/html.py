"""HTML of tables and self-contained pages, from Jinja templates, without server and network."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from hil.runs.atomic_file import write_file
from hil.runs.journal import now, versions
from hil.show.rounding import when
from hil.show.table import Marked

if TYPE_CHECKING:
    from jinja2 import Template

    from hil.show.table import Table


def deflate(data: object) -> str:
    """Return compressed JSON of `data`, as text safe in HTML."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=5, mtime=0)).decode()


_NAME = re.compile(r"([A-Za-z])(\w*)")
_POWER = re.compile(r"\^(\d+)")


TEMPLATES = Path(__file__).parent / "templates"


def environment(*folders: Path) -> Environment:
    """Create the template environment of pages; filters ``table``, ``symbols``, ``when``."""
    made = Environment(
        loader=FileSystemLoader((TEMPLATES, *folders)), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    made.filters.update(symbols=symbols, table=html, when=when)
    made.tests["marked"] = lambda cell: isinstance(cell, Marked)
    return made


def html(table: Table) -> Markup:
    """Render a table as HTML, with notes below."""
    return Markup(_template().render(content=table))  # noqa: S704 - the template has escaped it


def symbols(expression: str) -> Markup:
    """Typeset names and powers: ``l1^2 Izz2`` with subscripts and superscripts."""
    typeset = _NAME.sub(r"<i>\1</i><sub>\2</sub>", str(escape(expression)))
    typeset = _POWER.sub(r"<sup>\1</sup>", typeset).replace("<sub></sub>", "")
    return Markup(typeset.replace(" - ", " − "))  # noqa: S704 - escaped above


@cache
def _template() -> Template:
    return environment().get_template("table.html")


def write_html(path: Path, template: str, player: str = "", **values: object) -> None:
    """Write a page atomically, with time and version.

    Parameters
    ----------
    player : str
        Script that plays the recordings; empty where the page carries none.
    **values : object
        Further values for the template.
    """
    own = (TEMPLATES / "report.js").read_text(encoding="utf-8")
    about = {
        "bundle": deflate(player),
        "written": now(),
        "version": versions()["canopen-robot-identification"],
        "script": Markup(own),  # noqa: S704 - our own
        "script_source": " ".join(map(_hash, filter(None, (own, player)))),
    }
    page = environment().get_template(template).render(**values, **about)
    write_file(path, page.encode())


def _hash(script: str) -> str:
    """Return the hash of a script for a content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
