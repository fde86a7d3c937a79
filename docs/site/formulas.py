"""Formulas as SVG in the page, drawn when the site is built: no script, no network."""

from __future__ import annotations

import io
import re
from functools import cache
from html import escape
from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

SIZE = 12.0
"""Size of the letters in formulas [pt], equal to the size of the text."""
WORDS = {r"\lvert": "|", r"\rvert": "|"}
"""Replacements of LaTeX commands that mathtext does not support."""
PROLOGUE = re.compile(r"(?s)^.*?(?=<svg)|<metadata>.*?</metadata>")
LOOK = {"svg.fonttype": "path", "savefig.facecolor": "none", "mathtext.fontset": "cm"}


@cache
def drawn(formula: str) -> tuple[str, float]:
    """Return a formula as SVG, and its depth below the baseline of the text [pt].

    Raises
    ------
    ValueError
        Mathtext cannot draw the formula.
    """
    for word, sign in WORDS.items():
        formula = formula.replace(word, sign)
    file = io.StringIO()
    with mpl.rc_context({**LOOK, "svg.hashsalt": formula}):
        depth = math_to_image(
            f"${' '.join(formula.split())}$", file, prop=FontProperties(size=SIZE), format="svg"
        )
    picture = PROLOGUE.sub("", file.getvalue())
    return picture.replace("<svg ", '<svg fill="currentColor" ', 1), float(depth)


def _inline(translator: HTML5Translator, node: nodes.Element) -> None:
    text = node.astext()
    picture, depth = drawn(text)
    translator.body.append(
        f'<span class="formula" role="img" aria-label="{escape(text)}"'
        f' style="vertical-align: -{depth:.2f}pt">{picture}</span>'
    )
    _skip(translator)


def _block(translator: HTML5Translator, node: nodes.Element) -> None:
    text = node.astext()
    lines = "".join(drawn(line)[0] for line in text.split(r"\\"))
    translator.body.append(
        f'<div class="formula" role="img" aria-label="{escape(text)}"'
        f' style="text-align: center; margin: 1em 0; overflow-x: auto">{lines}</div>'
    )
    _skip(translator)


def _skip(_: HTML5Translator) -> None:
    from docutils.nodes import SkipNode  # noqa: PLC0415 - docutils ends a node by this exception

    raise SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer of formulas with Sphinx."""
    app.add_html_math_renderer("svg", (_inline, None), (_block, None))
    return {"parallel_read_safe": True}
