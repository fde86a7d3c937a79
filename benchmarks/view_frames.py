"""Smoothness of the page of hil view: frames per second, and cost of a frame in the scripts.

    python benchmarks/view_frames.py [SECONDS]

The plan of the manutec-r15 with a workspace is played in headless Chromium. Without a graphics card
the processor draws (SwiftShader), so the frames per second are a lower bound. The cost of a frame
in the page's own scripts is the same with a card; the bound is 16.7 ms, for 60 frames per second.
For comparison the page is played with the swept volume hidden.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from browser import opened_browser, resize
from figures import Figure, keep

from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.planning.workspace import Box, Workspace
from hil.view.page import write_page
from hil.view.scene import plan_scene

WORKSPACE = Workspace(boxes=(Box(name="cabinet", low=(0.9, 0.6, -0.8), high=(1.4, 1.2, 0.2)),))
PLAY = """
const [seconds, swept, done] = arguments;
const { player, scene } = window.view;
document.getElementById('show-swept').checked || document.getElementById('show-swept').click();
if (!swept) document.getElementById('show-swept').click();
const costs = [];
const seek = player.seek.bind(player);
player.seek = (t) => {
  const begin = performance.now();
  seek(t);
  costs.push(performance.now() - begin);
};
const [frames, begun] = [scene.frames, performance.now()];
player.seek(30);
player.play();
setTimeout(() => {
  player.pause();
  player.seek = seek;
  done([scene.frames - frames, (performance.now() - begun) / 1000, costs]);
}, 1000 * seconds);
"""


def main(seconds: float = 10.0) -> None:
    """Write the page, open it and play it; keep the times."""
    robot = Robot.load("manutec-r15")
    plan = design(robot, {}, 0.0, WORKSPACE)
    with (
        tempfile.TemporaryDirectory() as folder,
        opened_browser(Path(folder) / "profile") as browser,
    ):
        page = Path(folder) / "plan.html"
        begun = perf_counter()
        size = write_page(page, lambda most: plan_scene(plan, robot, most))
        took, n = perf_counter() - begun, len(plan.measurements)
        print(f"{n} measurements: {size / 1e6:.2f} MB, written in {took:.1f} s")
        kept = {
            "measurements": Figure.count(n),
            "size": Figure(size / 1e6, "MB"),
            "written": Figure(took, "s"),
        }
        resize(browser, 1440, 900)
        begun = perf_counter()
        browser.get(page.as_uri())
        browser.set_script_timeout(10 * seconds + 60)
        browser.execute_async_script(
            "const d = arguments[0]; const w = () => window.view ? d() : setTimeout(w, 5); w();"
        )
        kept["opened"] = Figure(perf_counter() - begun, "s")
        print(f"opened in {kept['opened'].value:.2f} s")
        medians = []
        for swept in (True, False):
            frames, took, costs = browser.execute_async_script(PLAY, seconds, swept)
            slowest = sorted(costs)[int(0.99 * (len(costs) - 1))]
            name = "shown" if swept else "hidden"
            medians.append(statistics.median(costs))
            print(
                f"swept volume {name}: {frames / took:.0f} frames/s drawn"
                f" by the processor at 1440 x 900; scripts take {medians[-1]:.2f} ms a"
                f" frame (median), {slowest:.2f} ms (99 %)"
            )
            kept |= {
                f"{name}-frames": Figure(frames / took, "frames/s"),
                f"{name}-scripts": Figure.median(costs, "ms"),
                f"{name}-scripts-99-percent": Figure(slowest, "ms"),
            }
    kept = {"shown-over-hidden": Figure(medians[0] / medians[1]), **kept}
    command = f"python benchmarks/view_frames.py {seconds:g}"
    keep("view-frames", kept, depends=("hil/view", "web"), command=command)


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
