"""Disk space of an installation, by the package required from `pip install`.

The sizes are those of the files of each installed distribution, and separately of compiled Python,
which `pip` compiles at once and `uv` at the first import::

    python benchmarks/installed_size.py
"""

from __future__ import annotations

import py_compile
import tempfile
import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING

from figures import ROOT, Figure, keep
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

if TYPE_CHECKING:
    from collections.abc import Iterable

MEGABYTE = 1e6
SHOWN = ("llvmlite", "numba", "scipy", "numpy", "h5py")


def needed(names: Iterable[str]) -> dict[str, float]:
    """Return the sizes of these packages and of all their requirements [MB], by name."""
    return {name: sum(map(_size, files)) for name, files in _files(names).items()}


def compiled(names: Iterable[str]) -> float:
    """Return the size of compiled Python of these packages and of all their requirements [MB]."""
    modules = [path for each in _files(names).values() for path in each if path.suffix == ".py"]
    with tempfile.NamedTemporaryFile() as into:
        return sum(_compiled(path, into.name) for path in modules)


def _compiled(module: Path, into: str) -> float:
    """Return the size of a compiled module, 0 for templates that no Python can compile."""
    done = py_compile.compile(str(module), into, quiet=2)
    return _size(Path(done)) if done else 0.0


def _size(path: Path) -> float:
    return path.stat().st_size / MEGABYTE


def _files(names: Iterable[str]) -> dict[str, list[Path]]:
    """Return the files of these packages and of all their requirements, without compiled Python."""
    found_of: dict[str, list[Path]] = {}
    asked = list(names)
    while asked:
        name = canonicalize_name(asked.pop())
        if name in found_of:
            continue
        try:
            found = distribution(name)
        except PackageNotFoundError:  # of another platform
            continue
        files = [Path(str(each.locate())) for each in found.files or () if each.suffix != ".pyc"]
        found_of[name] = [path for path in files if path.is_file()]
        wanted = map(Requirement, found.requires or ())
        asked += [r.name for r in wanted if r.marker is None or r.marker.evaluate({"extra": ""})]
    return found_of


def main() -> None:
    """Print and keep the sizes."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    core = [Requirement(each).name for each in project["dependencies"]]
    all_of_it = needed(core)
    total = sum(all_of_it.values())
    kept = {"total": Figure(total, "MB", 3), "compiled": Figure(compiled(core), "MB")}
    kept |= {name: Figure(all_of_it[name], "MB") for name in SHOWN if name in all_of_it}
    rest = sum(needed(each for each in core if each != "numba").values())
    kept["with-numba"] = Figure(total - rest, "MB")
    for name, figure in kept.items():
        print(f"{name:16} {figure.text}")
    command = "python benchmarks/installed_size.py"
    keep("installed-size", kept, depends=("pyproject.toml",), command=command)


if __name__ == "__main__":
    main()
