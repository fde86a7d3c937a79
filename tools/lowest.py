"""Print the lowest versions of what this package needs, as constraints for pip: `make lowest`.

Those of the package and of its extras; what serves its development alone may be of any version.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

BOUND = re.compile(r"([\w-]+)\s*>=\s*([\d.]+)")


def main() -> None:
    """Print a line a package."""
    path = Path(__file__).parents[1] / "pyproject.toml"
    project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [
        *project["dependencies"],
        *(r for name in extras if name != "dev" for r in extras[name]),
    ]
    for name, version in sorted({found.groups() for r in wanted if (found := BOUND.match(r))}):
        sys.stdout.write(f"{name}=={version}\n")


if __name__ == "__main__":
    main()
