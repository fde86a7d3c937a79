"""Jumps of an encoder on the wall clock while a core is busy: how many are found, how many falsely.

The plant is a process of its own. An axis goes there and back and rests between; in every second
stroke its encoder jumps by 10 mrad to 1 rad, in motion or at rest. A jump is found where the driver
stops the axes or the checks of the recording refuse it, for the encoder; a stroke without a jump
that ends so is a false alarm. Strokes that end because this computer was late count for neither::

    python benchmarks/jumps.py --interface local
    python benchmarks/jumps.py --interface ethercat   # as root, in a network namespace
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from figures import Figure, keep
from plant_process import load

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from foreign_ethercat import THEIRS, carried_out

from drivers.axis import AxisScale
from drivers.drive_bus import DriveError, Move
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from hil.measuring.checks.encoder_jumps import finished
from hil.model.robot import ROBOTS
from hil.runs.recording import Recorder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.session.servo_axes import ServoAxes

DRIVES = load_drives(ROBOTS / "manutec-r15.drives.yaml")
AXIS = 0
STROKE, VELOCITY, ACCELERATION = 0.4, 1.0, 4.0
REST = 0.6
"""After each stroke [s]."""
MOVING, RESTING = 0.3, 1.0
"""How long after a set-point the encoder jumps [s]."""
LEAST, MOST = 0.01, 1.0
"""Sizes of jumps [rad]."""
ENCODER = ("jump", "encoder", "8611", "outside")
"""Words of errors that are about an encoder: a jump moves the axis out of its corridor."""
BUSY = 1
"""Cores."""


def fault_plan(jumps: int) -> dict[str, object]:
    """Plan a jump in every second stroke, there and back by turns so that they cancel."""
    per_count = abs(AxisScale.derive(DRIVES.axes[AXIS]).position)
    sizes = np.geomspace(LEAST, MOST, jumps // 2)
    return {
        "faults": [
            {
                "what": "encoder-jump",
                "axis": AXIS + 1,
                "size": round((-1) ** n * float(sizes[n // 2]) / per_count),
                "at": {"set_point": 2 * n + 2, "after": RESTING if n // 2 % 2 else MOVING},
            }
            for n in range(jumps)
        ]
    }


def strokes(interface: str, channel: str, count: int) -> Iterator[str]:
    """Yield what ended each stroke; empty where it came to its end and its recording is good.

    Drives that stopped since this computer was late take part again in a new session.
    """
    home, number = None, 0
    while number < count:
        bus = open_drive_bus(DRIVES, interface, channel, pacing="wall-clock")
        with suppress(DriveError), bus:  # those that are off by themselves answer nothing
            home = bus.sample().q[AXIS] if home is None else home
            for reason in _of_session(bus, home, range(number, count)):
                number += 1
                yield reason


def _of_session(bus: ServoAxes, home: float, numbers: range) -> Iterator[str]:
    """Yield what ended each stroke, until the drives cannot be powered on again."""
    for number in numbers:
        recorder, ends, reason = Recorder(), None, ""
        try:
            sample = bus.sample()
            target = home + STROKE * (number % 2 == 0)
            bus.move({AXIS: Move(target, VELOCITY, ACCELERATION)})
        except DriveError:  # no set-point went out, so the plant counts none either
            return
        try:
            while ends is None or sample.time < ends:
                sample = bus.sample()
                recorder.add(sample)
                if ends is None and sample.reached:
                    ends = sample.time + REST
            finished(bus, recorder, ACCELERATION)
        except DriveError as error:
            reason = str(error)
        yield reason
        if reason:
            try:
                bus.reset()
            except DriveError:
                return


def measured(interface: str, channel: str, jumps: int) -> dict[str, object]:
    """Return what became of strokes with jumps and without."""
    missed: list[int] = []
    false: list[str] = []
    late: list[str] = []
    tried = 0
    begun = time.monotonic()
    with load(BUSY):
        for number, reason in enumerate(strokes(interface, channel, 2 * jumps)):
            of_encoder = any(word in reason for word in ENCODER)
            if reason and not of_encoder:
                late.append(reason)
            elif number % 2:
                tried += 1
                missed += [] if reason else [number // 2]
            elif reason:
                false.append(reason)
    seconds = time.monotonic() - begun
    return {"tried": tried, "missed": missed, "false": false, "late": late, "seconds": seconds}


def beside_the_plant(interface: str, jumps: int) -> dict[str, object]:
    """Return the same with the plant started for it."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as plan:
        yaml.safe_dump(fault_plan(jumps), plan)
        plan.flush()
        if interface == "ethercat":
            options = f"--clock wall --faults {plan.name}"
            arguments = ("--jumps", str(jumps), "--beside", THEIRS)
            text = carried_out(__file__, *arguments, options=options, timeout=30.0 + 6.0 * jumps)
            found: dict[str, object] = json.loads(text.splitlines()[-1])
            return found
        place = ("--interface", interface, "--channel", "jumps")
        rest = ("--clock", "wall", "--faults", plan.name)
        command = (sys.executable, "-m", "sim_plant", *place, *rest)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as plant:
            try:
                assert plant.stdout is not None
                assert plant.stdout.readline(), "the plant did not start"
                return measured(interface, "jumps", jumps)
            finally:
                plant.kill()


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description="Encoder jumps on the wall clock.")
    parser.add_argument("--interface", default="local", choices=("local", "ethercat"))
    parser.add_argument("--jumps", type=int, default=96)
    parser.add_argument("--beside", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.beside:
        print(json.dumps(measured("ethercat", options.beside, options.jumps)))
        return
    found = beside_the_plant(options.interface, options.jumps)
    missed, false = list(found["missed"]), list(found["false"])  # type: ignore[call-overload]
    tried, late = int(str(found["tried"])), list(found["late"])  # type: ignore[call-overload]
    share = 1 - len(missed) / tried
    print(f"{options.interface}: {share:.1%} of {tried} jumps found, missed {missed}")
    print(f"{len(false)} false alarms in {found['seconds']:.0f} s: {false[:5]}")
    print(f"{len(late)} strokes ended otherwise: {late[:5]}")
    kept = {
        "found": Figure(share),
        "false": Figure.count(len(false)),
        "jumps": Figure.count(tried),
    }
    command = f"python benchmarks/jumps.py --interface {options.interface} --jumps {options.jumps}"
    depends = ("drivers", "hil/measuring/checks")
    keep(f"jumps-{options.interface}", kept, depends=depends, command=command)
    sys.exit(share < 0.95 or bool(false))


if __name__ == "__main__":
    main()
