"""Installed and executed packages are stated by hash, without the address of an index."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
LOCKS = ("run", "dev", "uv", "audit")
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = PYPROJECT["project"]


def locked(name: str) -> dict[str, list[str]]:
    """Return the versions of each package of a requirements file."""
    found: dict[str, list[str]] = {}
    for line in (ROOT / "requirements" / f"{name}.txt").read_text().splitlines():
        if match := re.match(r"([a-z0-9._-]+)==(\S+)", line):
            found.setdefault(match[1], []).append(match[2])
    return found


@pytest.mark.parametrize("name", LOCKS)
def test_every_package_has_a_hash_and_no_address(name: str) -> None:
    text = (ROOT / "requirements" / f"{name}.txt").read_text()
    assert "://" not in text
    assert "index" not in text
    for package in re.split(r"\n(?=\S)", text.strip()):
        assert re.search(r"==.*\\\n\s+--hash=sha256:[0-9a-f]{64}", package), package


@pytest.mark.parametrize(("name", "groups"), [("run", ()), ("dev", ("dev",))])
def test_the_lock_has_what_the_project_needs(name: str, groups: tuple[str, ...]) -> None:
    needed = [*PROJECT["dependencies"]]
    needed += [each for group in groups for each in PYPROJECT["dependency-groups"][group]]
    versions = locked(name)
    for each in map(Requirement, needed):
        found = versions.get(each.name.lower().replace("_", "-"), [])
        assert found, f"{each}: make lock"
        assert all(each.specifier.contains(version) for version in found), f"{each}: make lock"


def test_actions_are_pinned_by_their_commit() -> None:
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        used = re.findall(r"uses: (\S+)", path.read_text())
        assert used
        assert all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", each) for each in used), used


def test_the_licence_of_what_pages_contain_goes_with_the_package() -> None:
    licence = ROOT / "hil" / "view" / "assets" / "three.LICENSE"
    assert "three.js authors" in licence.read_text()
    assert str(licence.relative_to(ROOT)) in PROJECT["license-files"]
