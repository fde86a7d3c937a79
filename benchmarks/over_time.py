"""Figures of benchmarks over time, from the committed versions of their files.

`page` returns the text of a page for the build of the site; ``python benchmarks/over_time.py``
prints the changes by `make bench` since the last commit. Without git, only the present figures are
shown.
"""

from __future__ import annotations

import json
import subprocess
from typing import TYPE_CHECKING, NamedTuple

import figures
from figures import Figure, changes

if TYPE_CHECKING:
    from collections.abc import Iterator

INTRODUCTION = """# Benchmarks over time

Every benchmark keeps its figures in `benchmarks/results/`, with the commit that they were measured
at. Columns are measurements, the newest first; ± is the standard deviation over seeds or turns.
Where the head names another machine, times are not to be compared."""


class Measured(NamedTuple):
    """Content of a file at one commit."""

    commit: str
    day: str
    machine: str
    command: str
    figures: dict[str, Figure]


def versions(name: str) -> list[Measured]:
    """Return all kept results of a benchmark, newest first, without repeated measurements."""
    path = figures.RESULTS / f"{name}.json"
    texts = [path.read_text(encoding="utf-8")] if path.exists() else []
    place = path.relative_to(figures.ROOT).as_posix()
    try:
        commits = figures.git("log", "--diff-filter=AM", "--format=%h", "--", place).split()
        texts += [figures.git("show", f"{commit}:{place}") for commit in commits]
    except subprocess.CalledProcessError:  # no repository
        pass
    found: dict[str, Measured] = {}
    for text in texts:
        kept = json.loads(text)
        if "measured" in kept:  # except the tables of the paper on their own page
            held = {key: Figure(**given) for key, given in kept["figures"].items()}
            one = Measured(kept["commit"], kept["measured"], kept["machine"], kept["command"], held)
            found.setdefault(one.commit, one)
    return list(found.values())


def page() -> str:
    """Return the page: a table per benchmark, a row per figure, a column per measurement."""
    names = sorted(path.stem for path in figures.RESULTS.glob("*.json"))
    tables = ("\n".join(_table(name, all_of_it)) for name in names if (all_of_it := versions(name)))
    return "\n\n".join([INTRODUCTION, *tables]) + "\n"


def _table(name: str, measured: list[Measured]) -> Iterator[str]:
    yield from (f"## {name}", "", f"`{measured[0].command}`", "")
    heads = (f"{one.day}, {one.commit} ({one.machine})" for one in measured)
    yield from (f"| | {' | '.join(heads)} |", "|---|" + "---|" * len(measured))
    for key in measured[0].figures:
        row = (one.figures[key].stated if key in one.figures else "" for one in measured)
        yield f"| {key} | {' | '.join(row)} |"


def main() -> None:
    """Print the differences from the figures of the last commit."""
    for path in sorted(figures.RESULTS.glob("*.json")):
        now, *before = versions(path.stem) or [None]
        for line in changes(path.stem, before[0].figures, now.figures) if now and before else ():
            print(line)


if __name__ == "__main__":
    main()
