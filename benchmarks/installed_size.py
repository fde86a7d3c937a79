"""What an installation takes on the disk: what `pip install` brings, by the package that needs it.

Counted are the files of each distribution that this environment holds, compiled Python included::

    python benchmarks/installed_size.py
"""

from __future__ import annotations

import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from typing import TYPE_CHECKING

from figures import ROOT, Figure, keep
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

if TYPE_CHECKING:
    from collections.abc import Iterable

MEGABYTE = 1e6
SHOWN = ("llvmlite", "numba", "scipy", "numpy", "h5py")


def needed(names: Iterable[str]) -> dict[str, float]:
    """Return what these packages and all that they need take [MB], by name."""
    sizes: dict[str, float] = {}
    asked = list(names)
    while asked:
        name = canonicalize_name(asked.pop())
        if name in sizes:
            continue
        try:
            found = distribution(name)
        except PackageNotFoundError:  # of another platform
            continue
        files = [path for each in found.files or () if (path := each.locate()).is_file()]
        sizes[name] = sum(path.stat().st_size for path in files) / MEGABYTE
        wanted = map(Requirement, found.requires or ())
        asked += [r.name for r in wanted if r.marker is None or r.marker.evaluate({"extra": ""})]
    return sizes


def main() -> None:
    """Print and keep what takes how much."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    core = [Requirement(each).name for each in project["dependencies"]]
    all_of_it = needed(core)
    total = sum(all_of_it.values())
    kept = {"total": Figure(total, "MB", 3)}
    kept |= {name: Figure(all_of_it[name], "MB") for name in SHOWN if name in all_of_it}
    rest = sum(needed(each for each in core if each != "numba").values())
    kept["with-numba"] = Figure(total - rest, "MB")
    for name, figure in kept.items():
        print(f"{name:16} {figure.text}")
    command = "python benchmarks/installed_size.py"
    keep("installed-size", kept, depends=("pyproject.toml",), command=command)


if __name__ == "__main__":
    main()
