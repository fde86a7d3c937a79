"""Completion of words in the shell, without imports of the project."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

METHODS = (
    "improved", "published", "joint", "back and forth", "free motion", "least squares",
    "weighted least squares", "instrumental variables",
)  # fmt: skip
FORMATS = (
    "c", "python", "st", "json", "friction", "ros2", "urdf", "mjcf", "ranges",
    "csv", "parquet", "mcap",
)  # fmt: skip
"""Names offered by completion; a test compares these with the accepted ones."""
_ROBOTS = Path(__file__).parents[1] / "robots"
_DRIVES = ".drives"


def robots(incomplete: str) -> list[str]:
    """Complete built-in robots and possible robot files."""
    names = sorted({path.stem.removesuffix(_DRIVES) for path in _ROBOTS.glob("*.yaml")})
    return [*_beginning(names, incomplete), *_paths(incomplete, {".yaml", ".yml", ".urdf"})]


def drives(incomplete: str) -> list[str]:
    """Complete robots with built-in drives and possible drives files."""
    found = _ROBOTS.glob(f"*{_DRIVES}.yaml")
    names = sorted(path.stem.removesuffix(_DRIVES) for path in found)
    return [*_beginning(names, incomplete), *_paths(incomplete, {".yaml", ".yml"})]


def methods(incomplete: str) -> list[str]:
    """Complete estimation methods."""
    return [name.replace(" ", "\\ ") for name in _beginning(METHODS, incomplete)]


def formats(incomplete: str) -> list[str]:
    """Complete formats of models and recordings."""
    return _beginning(FORMATS, incomplete)


def runs(incomplete: str) -> list[str]:
    """Complete folders of runs and their parents."""
    return list(_paths(incomplete, set()))


def files(incomplete: str) -> list[str]:
    """Complete YAML files and folders."""
    return list(_paths(incomplete, {".yaml", ".yml"}))


def _beginning(names: list[str] | tuple[str, ...], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _paths(incomplete: str, suffixes: set[str]) -> Iterator[str]:
    """Yield files with these suffixes, and folders; only a run's folder ends the word."""
    before, _, begun = incomplete.rpartition("/")
    folder = Path(f"{before}/") if before or incomplete.startswith("/") else Path()
    if not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        name = path.name
        if not name.startswith(begun) or (name.startswith(".") and not begun):
            continue
        shown = f"{before}/{name}" if "/" in incomplete else name
        if path.is_dir():
            yield shown if (path / "run.json").exists() else f"{shown}/"
        elif path.suffix in suffixes:
            yield shown
