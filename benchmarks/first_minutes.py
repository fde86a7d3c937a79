"""Stopwatch of `hil try` in a browser: first sentence, motion, push, end, and report.

    python benchmarks/first_minutes.py [--times 3]

The clock starts with the command. Chromium is already open, as with most users, and loads the page
once its address is printed. The page itself notes the instants, at the frame that shows each:

sentence
    First headline on the page.
motion
    First sample of an axis away from its initial position.
push
    Arm ready to be pushed. It is then pulled by the elbow until a push is found.
found
    First push in the notices.
end, report
    Headline with the result; link to the report, whose answer is then checked.

All calls use byte code as after an installation; the first call, stated separately, has no compiled
functions of Numba on disk. The robot is drawn without a graphics card, which takes processor time;
the load average states other work of the computer.
"""

from __future__ import annotations

import argparse
import compileall
import os
import re
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple
from urllib.request import urlopen

import numpy as np
from figures import Figure, keep

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from selenium.webdriver import Chrome

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))
from browser import opened_browser, resize  # noqa: E402 - it stands among the tests

BOUNDS = {"sentence": 1.0, "motion": 3.0, "push": 45.0, "end": 120.0, "report": 120.0}
"""Promised instants after the command [s]."""
PUSHED = "Push the arm"
"""Beginning of the page's headline once the arm may be pushed."""
NOTE = """
window.noted = {};
const note = (name) => { window.noted[name] ??= Date.now() / 1000; };
const look = () => {
  const headline = document.getElementById('headline')?.textContent ?? '';
  if (headline) note('sentence');
  if (headline.startsWith(PUSHED)) note('push');
  if (headline.startsWith('Done')) note('end');
  if (document.querySelector('#ended a')?.checkVisibility()) note('report');
  const q = window.live?.recorded && window.live.q;
  window.began ??= q?.slice();
  if (q?.some((each, j) => Math.abs(each - window.began[j]) > 1e-4)) note('motion');
  if (document.getElementById('notices')?.textContent.includes('push 1')) note('found');
  requestAnimationFrame(look);
};
requestAnimationFrame(look);
"""
"""Script of the page; an encoder's noise is below 0.0001 rad."""
ELBOW = """
const { scene } = window.live;
const at = scene.camera.position.clone().setFromMatrixPosition(scene.chain.frames[3]);
const { x, y } = at.project(scene.camera);
const { left, top, width, height } = scene.renderer.domElement.getBoundingClientRect();
return [left + ((x + 1) / 2) * width, top + ((1 - y) / 2) * height];
"""


class Tried(NamedTuple):
    """Running demonstration: process, address of its page, and instant of its start [s]."""

    process: subprocess.Popen[str]
    address: str
    began: float


@contextmanager
def tried(*options: str, **variables: str) -> Iterator[Tried]:
    """Run `hil try` without opening a browser; yield once the page is served."""
    command = [sys.executable, "-m", "hil", "try", "--no-browser", *options]
    environment = {**os.environ, **variables}
    began = time.time()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        (address,) = re.findall(r"http://\S+", next(iter(process.stdout or ())))
        try:
            yield Tried(process, address, began)
        finally:
            process.terminate()


def pull_elbow(browser: Chrome, step: int) -> None:
    """Pull the elbow downwards with the mouse for three steps, then release it, repeatedly."""
    kind = {1: "mousePressed", 2: "mouseMoved", 4: "mouseReleased"}.get(step % 12)
    if kind is None:
        return
    x, y = browser.execute_script(ELBOW)
    if kind != "mousePressed":
        x, y = x + 40, y + 70
    at = {"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1}
    browser.execute_cdp_cmd("Input.dispatchMouseEvent", at)


def stopwatch(browser: Chrome, folder: Path, **variables: str) -> dict[str, float]:
    """Return the instants of a demonstration after its command [s]."""
    browser.get("about:blank")
    with tried("-o", str(folder), **variables) as (process, address, began):
        browser.get(address)
        step, noted = 0, dict[str, float]()
        while "report" not in noted:
            assert process.poll() is None, f"ended without a report: {noted}"
            noted = browser.execute_script("return window.noted")
            if "push" in noted and "found" not in noted:
                pull_elbow(browser, step)
                step += 1
            time.sleep(1.0)
        with urlopen(f"{address}report") as answer:  # noqa: S310 - an address of this computer
            assert answer.status == 200
            assert b"</html>" in answer.read()
        browser.get("about:blank")  # closing the page ends the demonstration
        process.wait()
    return {name: noted[name] - began for name in [*BOUNDS, "found"]}


def main() -> None:
    """Measure in turns, print and keep the medians; exit status 1 for a broken bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=3)
    times = parser.parse_args().times
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    for package in ("checked_files", "hil", "drivers", "sim_plant"):
        compileall.compile_dir(ROOT / package, quiet=2)
    turns, loads = [], []
    with TemporaryDirectory() as name, opened_browser(Path(name) / "profile") as browser:
        resize(browser, 1440, 900)
        script = NOTE.replace("PUSHED", repr(PUSHED))
        browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})
        for turn in range(times + 1):
            loads.append(os.getloadavg()[0])
            found = stopwatch(browser, Path(name) / str(turn), NUMBA_CACHE_DIR=f"{name}/compiled")
            print(_stated(found), f"load {loads[-1]:.1f} before", flush=True)
            turns.append(found)
    first, *later = turns
    kept = {f"first-{key}": Figure(at, "s") for key, at in first.items()}
    kept |= {key: Figure.median([each[key] for each in later], "s") for key in first}
    kept["load"] = Figure(float(np.median(loads)), digits=2)
    keep(
        "first-minutes", kept, depends=("hil/cli/trying.py", "hil/cli/try_plans.py", "hil/live"),
        command=f"python benchmarks/first_minutes.py --times {times}",
    )  # fmt: skip
    middle = {key: kept[key].value for key in first}
    late = [f"{key} after {bound:g} s" for key, bound in BOUNDS.items() if middle[key] > bound]
    print("promised:", _stated(BOUNDS), "; late:", ", ".join(late) or "none")
    sys.exit(bool(late))


def _stated(instants: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {at:.1f} s" for name, at in instants.items())


if __name__ == "__main__":
    main()
