"""Release by one command, in a clone of this repository, installed from a folder as an index."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
VERSION = "9.0.0"
NAME = "canopen-robot-identification"


def done(*command: object, cwd: Path, status: int = 0) -> str:
    ended = subprocess.run(  # noqa: S603 - our own, and git
        [str(word) for word in command], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert ended.returncode == status, ended.stdout + ended.stderr
    return ended.stdout + ended.stderr


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Clone of this repository with the working tree committed."""
    place = tmp_path_factory.mktemp("release") / "clone"
    done("git", "clone", "--shared", "--quiet", ROOT, place, cwd=ROOT)
    listed = done("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", cwd=ROOT)
    for name in listed.split("\0")[:-1]:
        if (ROOT / name).is_file():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, place / name)
        else:
            (place / name).unlink(missing_ok=True)
    done("git", "config", "user.name", "nobody", cwd=place)
    done("git", "config", "user.email", "nobody@localhost", cwd=place)
    (place / "changes" / "+test.fixed.md").write_text("What a test has mended.\n")
    done("git", "add", "--all", cwd=place)
    done("git", "commit", "--quiet", "--message", "as it is", cwd=place)
    return place


@pytest.fixture(scope="module")
def released(clone: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, in the folder of a package index."""
    folder = tmp_path_factory.mktemp("index") / NAME
    done(sys.executable, "tools/release.py", VERSION, "-o", folder, cwd=clone)
    (wheel,) = folder.glob("*.whl")
    (folder / "index.html").write_text(f'<a href="{wheel.name}">{wheel.name}</a>')
    return wheel


def test_a_version_that_is_none_or_a_changed_checkout_is_refused(clone: Path) -> None:
    for version in ("0.0.1", "2"):
        refused = done(sys.executable, "tools/release.py", version, cwd=clone, status=1)
        assert "state three numbers" in refused
    (clone / "stray.txt").touch()
    refused = done(sys.executable, "tools/release.py", VERSION, cwd=clone, status=1)
    (clone / "stray.txt").unlink()
    assert "?? stray.txt" in refused


def test_it_is_tagged_and_stated_in_changelog_and_citation(clone: Path, released: Path) -> None:
    assert released.name.startswith(f"canopen_robot_identification-{VERSION}-")
    assert done("git", "describe", cwd=clone) == f"v{VERSION}\n"
    assert done("git", "status", "--porcelain", cwd=clone) == ""
    changelog = (clone / "CHANGELOG.md").read_text()
    (section,) = re.findall(rf"(?ms)^## \[{VERSION}\] - [-\d]+\n(.*?)(?:^## |\Z)", changelog)
    assert "- What a test has mended.\n" in section
    assert [path.name for path in (clone / "changes").iterdir()] == ["release.md.j2"]
    citation = (clone / "CITATION.cff").read_text()
    assert re.search(rf"(?m)^version: {re.escape(VERSION)}\ndate-released: [-\d]+$", citation)


def test_it_is_installed_from_the_index_and_starts(released: Path, tmp_path: Path) -> None:
    """Dependencies are installed already, so no other index is needed."""
    pip = (sys.executable, "-m", "pip", "--quiet", "install", "--no-deps")
    index = ("--isolated", "--index-url", released.parents[1].as_uri())
    done(*pip, *index, "--target", tmp_path / "installed", f"{NAME}=={VERSION}", cwd=tmp_path)
    program = tmp_path / "installed" / "bin" / "hil"
    code = f"import sys; sys.path.insert(0, {str(tmp_path / 'installed')!r}); "
    code += f"sys.argv = ['hil', '--version']; exec(open({str(program)!r}).read())"
    assert done(sys.executable, "-I", "-c", code, cwd=tmp_path) == f"hil {VERSION}\n"
