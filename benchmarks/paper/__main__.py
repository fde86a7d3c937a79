"""The paper recomputed: campaigns over the bus, one file of results, a page with its figures.

::

    python -m benchmarks.paper [FOLDER] [--seeds 20]

With a FOLDER it measures and judges what that does not hold yet and writes results, page and
figures; without one it makes page and figures from the results.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from matplotlib import rc_context

from hil.model.robot import load_robot
from hil.report.pictures import image, plotting

from .campaigns import ARTICLE, FIRST_SEED, ROBOT
from .figures import FIGURES, LOOK
from .page import HOME, PAGE, RESULTS, rendered
from .results import gather

GIT = ("/usr/bin/env", "git", "-C", str(HOME), "describe", "--always", "--dirty")


def main() -> None:
    """Measure, judge, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("::")[0])
    parser.add_argument("folder", nargs="?", type=Path, help="folder of all campaigns")
    parser.add_argument("--seeds", type=int, default=20)
    given = parser.parse_args()
    robot = load_robot(ROBOT)
    if given.folder:
        found = gather(given.folder, robot, range(FIRST_SEED, FIRST_SEED + given.seeds))
        found["commit"] = subprocess.check_output(GIT, text=True).strip()
        short = json.loads(json.dumps(found), parse_float=lambda x: float(f"{float(x):.5g}"))
        RESULTS.write_text(json.dumps(short, separators=(",", ":")) + "\n")
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
