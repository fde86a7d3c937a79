"""User's wheel: all files of the program, nothing else, and a program that starts."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("checked_files", "hil", "drivers", "sim_plant")
PROGRAM = """
import sys
from importlib.metadata import entry_points
from hil.cli import main
channels = {each.name for each in entry_points(group="can.interface")}
assert {"sim_plant", "replay", "local"} <= channels, channels
main(sys.argv[1:])
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Wheel built by pip from the files known to git."""
    place = tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "README.md", "LICENSE", *tracked()):
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, place / name)
    build = [sys.executable, "-m", "pip", "--quiet", "wheel", "--no-deps", "-w", "dist", "."]
    # with the setuptools of the development extra: no package index is needed
    build.insert(-1, "--no-build-isolation")
    subprocess.run(build, cwd=place, check=True, capture_output=True)  # noqa: S603 - our own
    return next((place / "dist").glob("*.whl"))


def tracked() -> set[str]:
    """Return files of the packages known to git."""
    listed = subprocess.run(  # noqa: S603 - git on our own folders
        ["git", "ls-files", *PACKAGES],  # noqa: S607 - wherever git is
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return {name for name in listed.stdout.splitlines() if (ROOT / name).exists()}


def test_it_holds_all_files_of_the_packages_and_no_others(wheel: Path) -> None:
    """Templates, robots, plants, data sheets and the page's scripts among them."""
    held = {name for name in ZipFile(wheel).namelist() if ".dist-info/" not in name}
    built = {name for name in held if re.fullmatch(r"hil/.*\.(so|pyd)", name)}
    assert built or not shutil.which("cc")
    assert held - built == tracked()
    assert {"hil/robots/manutec-r15.yaml", "hil/view/assets/view.js"} <= held


def test_it_weighs_little(wheel: Path) -> None:
    assert wheel.stat().st_size < 2_000_000


def test_the_program_starts_from_it_alone(wheel: Path, tmp_path: Path) -> None:
    """The import path has the wheel's files and installed dependencies, but nothing of the
    checkout."""
    with ZipFile(wheel) as files:
        files.extractall(tmp_path / "installed")
    for arguments, printed in (
        (["--version"], f"hil {wheel.name.split('-')[1]}"),
        (["robot", "manutec-r15"], "14 base parameters"),
        (["drives", "example", "-o", "."], "drives.yaml and cia402_drive.eds"),
        (["drives", "new", "--eds", "cia402_drive.eds", "-o", "draft.yaml"], "axes in draft.yaml"),
    ):
        done = subprocess.run(  # noqa: S603 - our own program
            [sys.executable, "-c", PROGRAM, *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path / "installed")},
            capture_output=True,
            text=True,
            check=True,
        )
        assert printed in done.stdout
