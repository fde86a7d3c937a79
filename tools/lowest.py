"""Print the requirements of `make lowest`: lowest supported versions, and the tools of the tests.

The dependencies of the package and of its extras are pinned; further packages of the tests may have
any version. Tools of the lint are left out, since their requirements would conflict.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

BOUND = re.compile(r"([\w-]+)\s*>=\s*([\d.]+)(.*)")
LINT = {"import-linter", "mypy", "ruff", "scipy-stubs", "towncrier"}


def main() -> None:
    """Print one line per package."""
    path = Path(__file__).parents[1] / "pyproject.toml"
    stated = tomllib.loads(path.read_text(encoding="utf-8"))
    project = stated["project"]
    users = [*project["dependencies"]]
    users += [each for extra in project["optional-dependencies"].values() for each in extra]
    pinned = {BOUND.sub(r"\1==\2\3", each) for each in users}
    names = {BOUND.sub(r"\1", each) for each in users} | LINT
    own = stated["dependency-groups"]["dev"]
    others = {each for each in own if BOUND.sub(r"\1", each) not in names}
    sys.stdout.writelines(f"{each}\n" for each in sorted(pinned | others))


if __name__ == "__main__":
    main()
