"""The paper recomputed: campaigns over the bus, one file of results, a page with its figures.

::

    python -m benchmarks.paper [CASE ...] [--seeds 20] [--keep FOLDER]
    python -m benchmarks.paper --page

The first form measures and judges what FOLDER does not hold yet, writes results, page and figures;
cases that are not named stay as the results have them. The second makes page and figures alone.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from matplotlib import rc_context

from hil.model.robot import load_robot
from hil.report.pictures import image, plotting

from .campaigns import ARTICLE, CASES, FIRST_SEED, ROBOT
from .figures import FIGURES, LOOK
from .page import HOME, PAGE, RESULTS, rendered
from .results import gather, plain

GIT = ("/usr/bin/env", "git", "-C", str(HOME), "describe", "--always", "--dirty")


def main() -> None:
    """Measure, judge, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--keep", type=Path, help="folder for plans and runs; reused if there")
    parser.add_argument("--page", action="store_true", help="page and figures alone")
    given = parser.parse_args()
    if unknown := set(given.cases) - set(CASES):
        parser.error(f"no such case: {', '.join(unknown)}")
    robot = load_robot(ROBOT)
    results: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if not given.page:
        seeds = range(FIRST_SEED, FIRST_SEED + given.seeds)
        with tempfile.TemporaryDirectory() as temporary:
            found = gather(given.keep or Path(temporary), robot, given.cases or list(CASES), seeds)
        results |= {part: results.get(part, {}) | each for part, each in found.items()}
        results["commit"] = subprocess.check_output(GIT, text=True).strip()
        RESULTS.write_text(json.dumps(results, default=plain, separators=(",", ":")) + "\n")
        results = json.loads(RESULTS.read_text())
    text, failed = rendered(ARTICLE, results, robot)
    PAGE.write_text(text)
    for name, draw in FIGURES.items():
        with plotting(), rc_context(LOOK):
            drawn = image(draw(results["drawn"], robot), "svg")
        (PAGE.parents[1] / "img" / "paper" / f"figure-{name}.svg").write_bytes(drawn)
    sys.exit("\n".join(failed) or None)


if __name__ == "__main__":
    main()
