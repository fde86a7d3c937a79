"""Two million hostile frames: one at the virtual plant, one at the driver.

Both series of frames are seeded, in one process and in lock-step; `hostile.plant_audit` and
`hostile.driver_storm` describe the checks at every frame. The first broken check ends the run, and
can be reproduced by the seed. Otherwise a closing line is printed::

    python benchmarks/hostile_frames.py [--frames 1000000] [--seed 1]
"""

from __future__ import annotations

import argparse
import logging
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "harness"))

from figures import Figure, keep
from hostile.driver_storm import DriverStorm
from hostile.harm import Harm
from hostile.plant_storm import recorded_session, storm
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

if TYPE_CHECKING:
    from hostile.driver_storm import DriverFigures
    from hostile.plant_storm import PlantFigures


def main() -> int:
    """Return 0 if no frame did any harm."""
    parser = argparse.ArgumentParser(description="Hostile frames at plant and driver.")
    parser.add_argument("--frames", type=int, default=1_000_000, help="at each of the two")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    logging.disable()  # log of the driver, with a message for every disturbed session
    session = recorded_session()
    try:
        with Progress("{task.description}", BarColumn(), MofNCompleteColumn(),
                      TimeRemainingColumn()) as bars:  # fmt: skip
            task = bars.add_task("plant ", total=given.frames)
            plant = storm(given.frames, given.seed, session, lambda n: bars.advance(task, n))
            other = bars.add_task("driver", total=given.frames)
            driver = DriverStorm(given.seed, session).run(
                given.frames, lambda n: bars.advance(other, n)
            )
    except Harm as harm:
        print(f"harm: {harm}")
        return 1
    _report(plant, driver)
    counts = {f"plant-{name}": n for name, n in asdict(plant).items() if name != "slowest"}
    counts |= {f"driver-{name}": n for name, n in asdict(driver).items() if name != "ended"}
    counts["driver-ended"] = sum(driver.ended.values())
    kept = {name: Figure.count(n) for name, n in counts.items()}
    keep(
        "hostile-frames", kept | {"plant-slowest": Figure(1e3 * plant.slowest, "ms", 1)},
        depends=("drivers/canopen", "drivers/cia402", "sim_plant/canopen", "sim_plant/drive"),
        command=f"python benchmarks/hostile_frames.py --frames {given.frames} --seed {given.seed}",
        seeds=[given.seed],
    )  # fmt: skip
    return 0


def _report(plant: PlantFigures, driver: DriverFigures) -> None:
    print(
        f"plant : {plant.answers} answers, {plant.controlwords} legal controlwords, "
        f"{plant.enabled} times enabled and {plant.moved} times moved by them; "
        f"at most {plant.most} answers and {1e3 * plant.slowest:.0f} ms a frame"
    )
    ended = ", ".join(f"{n} x {name}" for name, n in sorted(driver.ended.items()))
    print(
        f"driver: {driver.samples} samples in {driver.sessions} sessions ({ended}); "
        f"{driver.flagged} of {driver.forged} forged TPDOs flagged"
    )
    print(
        f"{plant.frames + driver.frames} hostile frames: 0 crashes, 0 axes moved without command, "
        "0 wrong samples unflagged"
    )


if __name__ == "__main__":
    sys.exit(main())
