"""Self-contained HTML pages, without server and network."""

from __future__ import annotations

import base64
import hashlib
from typing import TYPE_CHECKING

from markupsafe import Markup

from hil.runs.atomic_file import write_file
from hil.runs.journal import now, versions
from hil.show.html import TEMPLATES, deflate, environment

if TYPE_CHECKING:
    from pathlib import Path

    from hil.show.outcome import Outcome


def write_outcome(path: Path, found: Outcome) -> Path:
    """Write the page of a result atomically, and return the path.

    Raises
    ------
    FileError
        A damaged recording, or a full disk.
    """
    played = found.played()
    write_html(
        path, "result.html", played.player, found=found, title=found.title, carried=played.carried,
        picture=played.picture, plots=(*found.plots, *played.plots),
    )  # fmt: skip
    return path


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
