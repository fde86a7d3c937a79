"""Make a release of a clean checkout: versions, changelog, commit, tag and wheel.

::

    python tools/release.py 0.2.0 [-o dist]

One commit writes the version into `pyproject.toml` and `CITATION.cff` and the entries of `changes/`
into `CHANGELOG.md`; it gets an annotated tag. The wheel is built from the files of the tag with the
installed setuptools, without a package index. Nothing is pushed or uploaded: the last lines of the
output state the commands for push and upload, and the command that undoes the release.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import tomllib
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).parents[1]
VERSION = re.compile(r"\d+\.\d+\.\d+")
PLACES = {"pyproject.toml": 'version = "{}"', "CITATION.cff": "version: {}"}
"""Lines that state the version."""


class Refused(Exception):
    """Reason why a release is not possible, with the remedy."""


def main() -> None:
    """Make the release, or print the reason for a refusal, with exit status 1."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("version", help="the new one, such as 0.2.0")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist", help="of the wheel")
    given = parser.parse_args()
    try:
        wheel = release(given.version, given.output.resolve())
    except Refused as refused:
        sys.exit(f"no release: {refused}")
    sys.stdout.write(
        f"tag v{given.version}, {wheel}\n"
        f"to publish: git push --follow-tags; twine upload {wheel}\n"
        f"to take it back before that: git tag -d v{given.version} && git reset --hard HEAD~1\n"
    )


def release(version: str, output: Path) -> Path:
    """Make the release and return its wheel.

    Raises
    ------
    Refused
        The version is invalid or not above the present one, or the checkout has changes.
    """
    present = _present()
    if not VERSION.fullmatch(version) or _numbers(version) <= _numbers(present):
        raise Refused(f"{version!r} is not above {present}; state three numbers, such as 0.2.0")
    if changed := _git("status", "--porcelain"):
        raise Refused(f"the checkout holds changes, commit or remove them:\n{changed}")
    today = datetime.now(UTC).date().isoformat()
    for name, line in PLACES.items():
        _replace(name, line.format(present), line.format(version))
    released = re.compile(r"(?m)^(version: .*)\n(?:date-released: .*\n)?")
    citation = ROOT / "CITATION.cff"
    citation.write_text(released.sub(rf"\1\ndate-released: {today}\n", citation.read_text()))
    _run("-m", "towncrier", "build", "--yes", "--version", version, "--date", today)
    _git("commit", "--all", "--message", f"Release {version}")
    _git("tag", "--annotate", f"v{version}", "--message", f"Release {version}")
    return _wheel(f"v{version}", output)


def _present() -> str:
    return str(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"])


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def _replace(name: str, before: str, after: str) -> None:
    text = (ROOT / name).read_text()
    if text.count(f"{before}\n") != 1:
        raise Refused(f"{name} does not state {before!r} on one line; correct it")
    (ROOT / name).write_text(text.replace(f"{before}\n", f"{after}\n"))


def _wheel(tag: str, output: Path) -> Path:
    before = set(output.glob("*.whl"))
    with tempfile.TemporaryDirectory() as place:
        _git("-c", "advice.detachedHead=false", "worktree", "add", place, tag)
        try:
            _run("-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", output, place)
        finally:
            _git("worktree", "remove", "--force", place)
    (made,) = set(output.glob("*.whl")) - before
    return made


def _git(*arguments: str) -> str:
    return _called("git", *arguments)


def _run(*arguments: object) -> str:
    return _called(sys.executable, *map(str, arguments))


def _called(*command: str) -> str:
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Refused(f"{' '.join(command)} ended with:\n{done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    main()
