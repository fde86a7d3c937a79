"""Figures as data: a benchmark writes a file of results, and documents quote figures by name.

A benchmark ends with `keep`, which writes ``benchmarks/results/NAME.json``: its figures with units,
the commit and machine that they were measured at, its seeds, and the code that they depend on. A
document has::

    <!--figure:claims-default.published-inside-->64.6 %<!--end-->
    <!--number:claims-default.published-inside-->64.6<!--end-->

with the unit or, for columns of a table, without the unit. The text between the marks is written by
``make figures`` (``python benchmarks/figures.py``, in README.md and docs/) and when the site is
built; the site has a page of all figures over time (`over_time`). `tests/documents/test_figures.py`
fails if a document states another figure, or if more than `MOST_COMMITS` commits have changed the
measured code since.
"""

from __future__ import annotations

import json
import math
import os
import platform
import re
import subprocess
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
DOCUMENTS = ("README.md", "docs/**/*.md")
MOST_COMMITS = 400
"""Bound of the commits, since a figure was measured, with changes of its code: a week of the
busiest time of this repository, and a year of quiet times. Golden results (`benchmarks/golden.py`)
show changed estimates sooner.
"""
MARKED = re.compile(r"(<!--(figure|number):([\w-]+)\.([\w-]+)-->)(.*?)(<!--end-->)", re.DOTALL)


@dataclass(frozen=True)
class Figure:
    """Figure of a benchmark.

    Attributes
    ----------
    value : float
    unit : str
        Unit in print; empty for a count.
    digits : int
        Number of significant digits, equal in another run or with another seed.
    scatter : float, optional
        Standard deviation over seeds or turns, in the same unit.
    """

    value: float
    unit: str = ""
    digits: int = 2
    scatter: float | None = None

    @classmethod
    def count(cls, number: int) -> Figure:
        """Return a number of items as a figure with all digits."""
        return cls(int(number), digits=len(str(int(number))))

    @classmethod
    def median(
        cls, turns: Sequence[float] | NDArray[Any], unit: str = "", digits: int = 2
    ) -> Figure:
        """Return the median of turns; the scatter is half the range of the middle 68 %.

        This is the standard deviation of the turns, insensitive to some disturbed ones.
        """
        low, middle, high = map(float, np.quantile(turns, [0.16, 0.5, 0.84]))
        return cls(middle, unit, digits, (high - low) / 2)

    @property
    def number(self) -> str:
        """Printed number without its unit."""
        rounded = float(f"{self.value:.{self.digits - 1}e}")
        places = self.digits - 1 - int(f"{rounded:e}".split("e")[1])
        return f"{rounded:.{max(places, 0)}f}"

    @property
    def text(self) -> str:
        """Printed number with its unit."""
        return f"{self.number} {self.unit}".strip()

    @property
    def stated(self) -> str:
        """Printed number with its scatter, if known."""
        scatter = "" if self.scatter is None else f" ± {self.scatter:.1g}"
        return f"{self.number}{scatter} {self.unit}".strip()


class Kept(NamedTuple):
    """Kept figures of a benchmark, with machine and time of the measurement."""

    commit: str
    measured: str
    command: str
    depends: list[str]
    figures: dict[str, Figure]


def keep(
    name: str,
    figures: Mapping[str, Figure],
    *,
    depends: Sequence[str],
    command: str,
    seeds: Sequence[int] = (),
) -> None:
    """Write the figures of a benchmark, and print the changes since the last write.

    Parameters
    ----------
    name : str
        Name of the file, used by documents.
    figures : mapping of str to Figure
    depends : sequence of str
        Files and folders of the measured code.
    command : str
        Command that measures the figures.
    seeds : sequence of int

    Raises
    ------
    ValueError
        A figure is not a finite number: nothing was measured.
    """
    if none := [key for key, figure in figures.items() if not math.isfinite(figure.value)]:
        raise ValueError(f"{name}: no figures, so nothing is kept: {', '.join(none)}")
    path = RESULTS / f"{name}.json"
    before = read(name).figures if path.exists() else {}
    print(*changes(name, before, figures), sep="\n")
    content = {
        "commit": git("describe", "--always", "--dirty", "--abbrev=8", "--exclude=*"),
        "measured": datetime.now(UTC).date().isoformat(),
        "machine": f"{os.cpu_count()} cores, {platform.machine()}",
        "command": command,
        "seeds": list(seeds),
        "depends": list(depends),
        "figures": {
            key: {k: v for k, v in asdict(figure).items() if v is not None}
            for key, figure in figures.items()
        },
    }
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def changes(name: str, before: Mapping[str, Figure], now: Mapping[str, Figure]) -> list[str]:
    """Return lines: figures changed by more than their scatter, and the number of these."""
    both = {key: (before[key], figure) for key, figure in now.items() if key in before}
    lines = [
        f"{name}.{key}: {old.stated} -> {new.stated}"
        for key, (old, new) in both.items()
        if abs(new.value - old.value) > max(old.scatter or 0.0, new.scatter or 0.0)
    ]
    return [*lines, f"{name}: {len(lines)} of {len(both)} figures have changed"]


def read(name: str) -> Kept:
    """Return the kept figures of a benchmark.

    Raises
    ------
    KeyError
        No figures are kept under this name.
    """
    path = RESULTS / f"{name}.json"
    if not path.exists():
        raise KeyError(f"{name}: there is no {path.relative_to(ROOT)}")
    content = json.loads(path.read_text(encoding="utf-8"))
    figures = {key: Figure(**given) for key, given in content["figures"].items()}
    return Kept(**{name: content[name] for name in Kept._fields[:-1]}, figures=figures)


def expanded(text: str) -> str:
    """Return a document with its figures replaced by those of the results.

    Raises
    ------
    KeyError
        A figure that no benchmark has kept.
    """

    def write(found: re.Match[str]) -> str:
        begin, kind, name, key, _, end = found.groups()
        figures = read(name).figures
        if key not in figures:
            raise KeyError(f"{name}.{key}: there is no such figure in benchmarks/results")
        return begin + (figures[key].text if kind == "figure" else figures[key].number) + end

    return MARKED.sub(write, text)


def documents() -> list[Path]:
    """Return all documents with possible figures."""
    return sorted(path for pattern in DOCUMENTS for path in ROOT.glob(pattern))


def commits_since(name: str) -> int:
    """Return the number of commits since the measurement with changes of the measured code.

    If the measured commit is unknown, because history was rewritten, later days are counted.
    """
    kept = read(name)
    commit = kept.commit.removesuffix("-dirty")
    since: tuple[str, ...]
    try:
        since = (f"{git('rev-parse', '--verify', '--quiet', commit + '^{commit}')}..HEAD",)
    except subprocess.CalledProcessError:
        since = (f"--since={kept.measured}T23:59:59Z", "HEAD")
    return int(git("rev-list", "--count", *since, "--", *kept.depends))


def git(*arguments: str) -> str:
    """Return the output of git in this repository."""
    command = ["/usr/bin/env", "git", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


if __name__ == "__main__":
    for document in documents():
        before = document.read_text(encoding="utf-8")
        after = expanded(before)
        if after != before:
            document.write_text(after, encoding="utf-8")
            print(document.relative_to(ROOT))
