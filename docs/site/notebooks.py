"""Notebooks as pages and as .ipynb, with the outputs of the cells.

A notebook is a Python file with cells that begin with ``# %%``, a format of common editors. The
build executes each notebook in a temporary folder.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

CELL = re.compile(r"(?m)^# %%(.*)\n")
PROSE = " [markdown]"


class Cell(NamedTuple):
    """Cell: prose in Markdown, or code with printed text and the value of the last expression."""

    prose: bool
    text: str
    printed: str = ""
    shown: object = None


def cells(source: str) -> list[Cell]:
    """Return the cells of a notebook.

    Raises
    ------
    ValueError
        There is text before the first cell.
    """
    before, *parts = CELL.split(source)
    if before.strip():
        raise ValueError(f"{before.strip()[:40]!r} stands before the first cell; begin with # %%")
    pairs = zip(parts[::2], parts[1::2], strict=True)
    return [
        Cell(True, re.sub(r"(?m)^# ?", "", text).strip()) if kind == PROSE else Cell(False, text)
        for kind, text in pairs
    ]


def carried_out(found: list[Cell]) -> list[Cell]:
    """Execute the code in a temporary folder; return the cells with outputs."""
    names: dict[str, Any] = {"__name__": "notebook"}
    before = Path.cwd()
    os.environ.setdefault("EXAMPLES", str(before / "examples"))
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            return [each if each.prose else _carried_out(each, names) for each in found]
        finally:
            os.chdir(before)


def _carried_out(cell: Cell, names: dict[str, Any]) -> Cell:
    tree, shown = ast.parse(cell.text), None
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, "cell", "exec"), names)  # noqa: S102 - our own notebook
        if isinstance(last, ast.Expr):
            shown = eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # noqa: S307
    return cell._replace(printed=printed.getvalue(), shown=shown)


def page(source: str, found: list[Cell] | None = None) -> str:
    """Return the page of a notebook: prose, blocks of code, and outputs."""
    return "\n\n".join(map(_page_text, cells(source) if found is None else found)) + "\n"


def _page_text(cell: Cell) -> str:
    if cell.prose:
        return cell.text
    parts = [f"```python\n{cell.text.strip()}\n```"]
    if cell.printed.strip():
        parts.append(f"```text\n{cell.printed.rstrip()}\n```")
    if hasattr(cell.shown, "_repr_html_"):
        parts.append(f"````{{raw}} html\n{cell.shown._repr_html_()}\n````")
    elif cell.shown is not None:
        parts.append(f"```text\n{cell.shown!r}\n```")
    return "\n\n".join(parts)


def notebook(found: list[Cell]) -> str:
    """Return a notebook as JSON of nbformat 4.5."""
    content = {
        "cells": [_notebook_cell(k, cell) for k, cell in enumerate(found)],
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _notebook_cell(number: int, cell: Cell) -> dict[str, Any]:
    about: dict[str, Any] = {"id": f"cell-{number}", "metadata": {}}
    lines = cell.text.strip().splitlines(keepends=True)
    if cell.prose:
        return {"cell_type": "markdown", **about, "source": lines}
    outputs: list[dict[str, Any]] = []
    if cell.printed:
        text = cell.printed.splitlines(keepends=True)
        outputs.append({"output_type": "stream", "name": "stdout", "text": text})
    if cell.shown is not None:
        data = {"text/plain": repr(cell.shown)}
        for kind, method in (("text/html", "_repr_html_"), ("image/svg+xml", "_repr_svg_")):
            if hasattr(cell.shown, method):
                data[kind] = getattr(cell.shown, method)()
        outputs.append(
            {"output_type": "execute_result", "execution_count": number, "metadata": {},
             "data": data}
        )  # fmt: skip
    return {
        "cell_type": "code", **about, "execution_count": number, "source": lines,
        "outputs": outputs,
    }  # fmt: skip


def write_pages(folder: Path, *, carry_out: bool = True) -> None:
    """Write page and .ipynb of each notebook into its folder; with `carry_out`, with outputs."""
    for path in sorted(folder.glob("*.py")):
        source = path.read_text(encoding="utf-8")
        found = carried_out(cells(source)) if carry_out else cells(source)
        path.with_suffix(".md").write_text(page(source, found), encoding="utf-8")
        path.with_suffix(".ipynb").write_text(notebook(found), encoding="utf-8")
