"""Notebooks as pages: Python files whose cells begin with ``# %%``, as editors open them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

CELL = re.compile(r"(?m)^# %%(.*)\n")
PROSE = " [markdown]"


def page(source: str) -> str:
    """Return the page of a notebook: its prose as it stands, its code in blocks.

    Raises
    ------
    ValueError
        Something stands before the first cell.
    """
    before, *parts = CELL.split(source)
    if before.strip():
        raise ValueError(f"{before.strip()[:40]!r} stands before the first cell; begin with # %%")
    kinds, cells = parts[::2], parts[1::2]
    return "\n\n".join(map(_shown, kinds, cells)) + "\n"


def write_pages(folder: Path) -> None:
    """Write the page of each notebook of a folder beside it."""
    for notebook in sorted(folder.glob("*.py")):
        text = page(notebook.read_text(encoding="utf-8"))
        notebook.with_suffix(".md").write_text(text, encoding="utf-8")


def _shown(kind: str, cell: str) -> str:
    if kind == PROSE:
        return re.sub(r"(?m)^# ?", "", cell).strip()
    return f"```python\n{cell.strip()}\n```"
