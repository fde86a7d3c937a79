"""Check the English of docstring summaries and the names of functions, by package.

Summaries with many relative words and pronouns need a second reading: the technical noun is
missing. Both are counted per 100 words of the first paragraphs of docstrings. A summary is flagged
for more than one relative word, more than one pronoun, or a preposition or question word as its
first word. The bounds of a package are its present figures, rounded up; new packages get bounds of
at most 1.8, 2.8 and 5 %. No function is named by a preposition, here and in `NAMED` folders.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

RELATIVE = re.compile(r"\b(that|which|what|who|whose|whoever|whatever)\b")
PRONOUNS = re.compile(
    r"\b(it|its|itself|they|them|their|themselves|these|those|each|others?|one|all)\b"
)
_PREPOSITION = "of|with|without|beside|from|by|at|in|on|for|to|over|under|around|along|behind|as"
NAME = re.compile(rf"_*({_PREPOSITION})(_|$)")
OPENING = re.compile(
    rf"({_PREPOSITION}|below|above|between|before|after|the same|what|whether|whence|where|how"
    r"|those|it|its|they|them|these|one of)\b",
    re.IGNORECASE,
)


class Bounds(NamedTuple):
    """Bounds of a package: words per 100 words, and percentage of flagged summaries."""

    relative: float
    pronouns: float
    flagged: float


BOUNDS = {
    "checked_files": Bounds(1.0, 2.7, 0.0),
    "drivers": Bounds(1.1, 2.3, 0.5),
    "hil": Bounds(0.6, 1.6, 1.0),
    "sim_plant": Bounds(0.4, 2.2, 0.5),
}

NAMED = ("benchmarks", "docs", "tests", "tools")
"""Further folders in which names of functions are checked, but no docstrings."""


def plain(text: str) -> str:
    """Return a text in lower case, without code in backquotes."""
    return re.sub(r"`[^`]*`", "", text).lower()


def is_flagged(paragraph: str) -> bool:
    """Return True if the first sentence of a paragraph breaks the rules."""
    sentence = plain(re.split(r"(?<=[a-z0-9\])])[.;]\s", paragraph)[0])
    counts = (len(rare.findall(sentence)) for rare in (RELATIVE, PRONOUNS))
    return max(counts) > 1 or OPENING.match(paragraph) is not None


def paragraphs(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and first paragraph of all docstrings."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = (ast.get_docstring(node) or "").strip()
            if text:
                yield node.body[0].lineno, " ".join(text.split("\n\n")[0].split())


def trees(folder: Path) -> Iterator[tuple[Path, ast.Module]]:
    """Yield the syntax trees of all Python files of a folder."""
    for path in sorted(folder.rglob("*.py")):
        yield path, ast.parse(path.read_text(encoding="utf-8"))


def check_names(folder: Path) -> list[str]:
    """Return a line for each function of a folder named by a preposition."""
    return [
        f"{path}:{node.lineno}: {node.name}: name it by a verb or a noun"
        for path, tree in trees(folder)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and NAME.match(node.name)
    ]


def check(folder: Path, bounds: Bounds) -> list[str]:
    """Return a line for each problem of a package; a figure beyond its bound lists summaries."""
    problems, flagged, found = check_names(folder), [], list[str]()
    for path, tree in trees(folder):
        for line, paragraph in paragraphs(tree):
            found.append(plain(paragraph))
            if is_flagged(paragraph):
                flagged.append(f"{path}:{line}: {paragraph}")
    text = "\n".join(found)
    share = 100.0 / max(len(re.findall(r"[a-z']+", text)), 1)
    for name, value, bound in (
        ("relative words per 100", share * len(RELATIVE.findall(text)), bounds.relative),
        ("pronouns per 100", share * len(PRONOUNS.findall(text)), bounds.pronouns),
        ("% of summaries flagged", 100.0 * len(flagged) / max(len(found), 1), bounds.flagged),
    ):
        if value > bound:
            problems += [f"{folder}: {value:.2f} {name}, at most {bound} may be", *flagged]
    return problems


def main() -> int:
    """Print all problems; return 1 if there are any."""
    problems = [line for name, bounds in BOUNDS.items() for line in check(Path(name), bounds)]
    problems += [line for name in NAMED for line in check_names(Path(name))]
    sys.stdout.writelines(f"{line}\n" for line in dict.fromkeys(problems))
    return min(len(problems), 1)


if __name__ == "__main__":
    sys.exit(main())
