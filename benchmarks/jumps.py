"""Detection of jumps of an encoder on the wall clock with a busy core, and false alarms.

The plant is a separate process. An axis moves back and forth with rests in between. In every second
stroke the encoder jumps by 10 mrad to 1 rad, in motion or at rest. A jump is detected if the driver
stops the axes, or the checks refuse the recording, because of the encoder. The same end of a stroke
without a jump is a false alarm. Strokes that end because this computer was late are not counted::

    python benchmarks/jumps.py --interface local
    python benchmarks/jumps.py --interface ethercat   # as root, in a network namespace
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from figures import Figure, keep
from plant_process import load, served

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
"""Rest after each stroke [s]."""
MOVING, RESTING = 0.3, 1.0
"""Ranges of the time from a set-point to the encoder's jump, in motion and at rest [s]."""
LEAST, MOST = 0.01, 1.0
"""Smallest and largest jump [rad]."""
ENCODER = ("jump", "encoder", "8611", "outside")
"""Words of errors about an encoder; a jump moves the axis out of its corridor."""
BUSY = 1
"""Number of busy cores."""
EACH = 48
"""Number of jumps per start of a plant."""


@dataclass
class Found:
    """Results of strokes: numbers of missed jumps, reasons of false alarms and of late ends."""

    tried: int = 0
    missed: list[int] = field(default_factory=list)
    false: list[str] = field(default_factory=list)
    late: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def add(self, other: Found) -> None:
        """Add the strokes of another plant."""
        for name, value in asdict(other).items():
            setattr(self, name, getattr(self, name) + value)


def fault_plan(jumps: int) -> dict[str, object]:
    """Plan a jump in every second stroke, with alternating sign so that the sum stays zero."""
    per_count = abs(AxisScale.derive(DRIVES.axes[AXIS]).position)
    sizes = np.geomspace(LEAST, MOST, (jumps + 1) // 2)
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


def strokes(bus: ServoAxes, count: int) -> Iterator[str]:
    """Yield the reason of the end of each stroke; empty for a good recording.

    Ends early if the drives stop because this computer was late: the plant may not have counted the
    last set-point, so it is unknown which of the next strokes jump.
    """
    home = bus.sample().q[AXIS]
    for number in range(count):
        recorder, ends, reason = Recorder(), None, ""
        try:
            sample = bus.sample()
            target = home + STROKE * (number % 2 == 0)
            bus.move({AXIS: Move(target, VELOCITY, ACCELERATION)})
        except DriveError:
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


def measured(interface: str, channel: str, jumps: int) -> Found:
    """Return the results of strokes with and without jumps, until the drives fail."""
    found = Found()
    begun = time.monotonic()
    bus = open_drive_bus(DRIVES, interface, channel, pacing="wall-clock")
    with load(BUSY), suppress(DriveError), bus:  # drives switched off by themselves do not answer
        for number, reason in enumerate(strokes(bus, 2 * jumps)):
            of_encoder = any(word in reason for word in ENCODER)
            if reason and not of_encoder:  # unknown: has the plant taken the set-point?
                found.late.append(reason)
                break
            if number % 2:
                found.tried += 1
                found.missed += [] if reason else [number // 2]
            elif reason:
                found.false.append(reason)
    found.seconds = time.monotonic() - begun
    return found


def run_beside_plant(interface: str, jumps: int) -> Found:
    """Return the results of `measured` with the plant in another process."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as plan:
        yaml.safe_dump(fault_plan(jumps), plan)
        plan.flush()
        if interface == "ethercat":
            options = f"--clock wall --faults {plan.name}"
            arguments = ("--jumps", str(jumps), "--beside", THEIRS)
            text = carried_out(__file__, *arguments, options=options, timeout=30.0 + 6.0 * jumps)
            return Found(**json.loads(text.splitlines()[-1]))
        with served(interface, "jumps", "--clock", "wall", "--faults", plan.name):
            return measured(interface, "jumps", jumps)


def main() -> None:
    """Measure, print and keep the figures."""
    parser = argparse.ArgumentParser(description="Encoder jumps on the wall clock.")
    parser.add_argument("--interface", default="local", choices=("local", "ethercat"))
    parser.add_argument("--jumps", type=int, default=96)
    parser.add_argument("--beside", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.beside:
        print(json.dumps(asdict(measured("ethercat", options.beside, options.jumps))))
        return
    found = Found()
    while found.tried < options.jumps:
        found.add(run_beside_plant(options.interface, min(EACH, options.jumps - found.tried)))
        share = 1 - len(found.missed) / max(found.tried, 1)
        print(
            f"{options.interface}: {share:.1%} of {found.tried} jumps found,"
            f" {len(found.false)} false alarms, {found.seconds:.0f} s",
            flush=True,
        )
    print(f"missed: {found.missed}; {len(found.false)} false alarms: {found.false[:5]}")
    print(f"{len(found.late)} strokes ended otherwise: {found.late[:5]}")
    kept = {
        "found": Figure(share),
        "false": Figure.count(len(found.false)),
        "jumps": Figure.count(found.tried),
    }
    command = f"python benchmarks/jumps.py --interface {options.interface} --jumps {options.jumps}"
    depends = ("drivers", "hil/measuring/checks")
    keep(f"jumps-{options.interface}", kept, depends=depends, command=command)
    sys.exit(share < 0.95 or bool(found.false))


if __name__ == "__main__":
    main()
