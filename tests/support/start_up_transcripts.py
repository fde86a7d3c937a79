"""Sessions with drives of each personality, and their stored transcripts.

`python tests/support/start_up_transcripts.py [NAME ...]` writes the files of
`tests/drivers/transcripts` anew, all of them or those of the personalities that are named; changes
are shown by `git diff` and judged by a reader. The transcript of the plain drive is complete; the
others contain the differences from it, so that common transfers are stored once. Joint 5, whose
sign is negative, represents all joints; a separate test shows that all drives of a robot are
treated alike.
"""

from __future__ import annotations

import sys
from contextlib import contextmanager, nullcontext, suppress
from difflib import unified_diff
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import can
from canopen_drive_bus import CanopenDriveBus
from personalities import UNFIT, drives_for, plant_file
from probing_bench import Scripted
from sdo_transcript import transcript

from drivers.canopen.bus import CanopenBus
from drivers.canopen.monitor import scan_bus
from drivers.drive_bus import DriveRefused, Move
from drivers.operator_tools.check import check
from drivers.operator_tools.check_powered import SmallMoves
from drivers.operator_tools.operator import StoppedByOperator
from sim_plant.personality import PLAIN, packaged_personalities

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from drivers.drives_file import DrivesFile

FOLDER = Path(__file__).parents[1] / "drivers" / "transcripts"
NAMES = (PLAIN.name, *packaged_personalities())
NODE = 5
STROKE, VELOCITY, ACCELERATION = 0.01, 0.5, 2.0
"""Values of the move, far below the limits of every joint [rad, rad/s, rad/s^2]."""


def path_of(name: str) -> Path:
    """Return the path of a personality's transcript."""
    return FOLDER / f"{name}.txt"


def kept_of(name: str) -> str:
    """Return the stored text of a personality: the plain drive's transcript, or the differences."""
    if name == PLAIN.name:
        return text_of(name)
    plain, other = (text_of(each).splitlines() for each in (PLAIN.name, name))
    lines = list(unified_diff(plain, other, n=0, lineterm=""))[2:]
    return "\n".join("@@" if line.startswith("@@") else line for line in lines) + "\n"


@cache
def text_of(name: str) -> str:
    """Return the transcript of the sessions with a drive of a personality, one after the other."""
    return "\n".join(line for session in SESSIONS for line in lines_of(session, name)) + "\n"


def lines_of(session: Callable[[can.BusABC, str, DrivesFile], None], name: str) -> list[str]:
    """Return one session with the drive of joint 5, with its heading."""
    drives = drives_for(name)
    alone = drives.model_copy(update={"axes": drives.axes[NODE - 1 : NODE]})
    with listened(name) as (bus, frames):
        session(bus, name, alone)
    return [f"# {session.__doc__}", *transcript(frames, [NODE])]


@contextmanager
def listened(name: str) -> Iterator[tuple[can.BusABC, list[can.Message]]]:
    """Open the bus of a plant whose drives have a personality; collect the frames at the end."""
    frames: list[can.Message] = []
    with TemporaryDirectory() as folder:
        channel = plant_file(Path(folder), name)
        with (
            can.Bus(channel, "sim_plant", ignore_config=True) as listener,
            can.Bus(channel, "sim_plant", ignore_config=True) as bus,
        ):
            yield bus, frames
            while (frame := listener.recv(0)) is not None:
                frames.append(frame)


def run(bus: can.BusABC, name: str, drives: DrivesFile) -> None:
    """CanopenDriveBus: power on, one move of each axis, power off"""
    refusal = suppress(DriveRefused) if name in UNFIT else nullcontext()
    with refusal, CanopenDriveBus(bus, drives) as drive_bus:
        here = drive_bus.sample().q
        drive_bus.move({k: Move(q + STROKE, VELOCITY, ACCELERATION) for k, q in enumerate(here)})
        while not drive_bus.sample().reached:
            pass


def checked(bus: can.BusABC, name: str, drives: DrivesFile) -> None:
    """hil drives check: the operator does not agree to power"""
    del name
    with suppress(StoppedByOperator):
        for _ in check(CanopenBus(bus), drives, SmallMoves(), Scripted(agreed=False)):
            pass


def scanned(bus: can.BusABC, name: str, drives: DrivesFile) -> None:
    """hil drives scan: of the drives' node numbers"""
    del name
    scan_bus(bus, only=tuple(axis.node for axis in drives.axes))


SESSIONS = (run, checked, scanned)

if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for each in sys.argv[1:] or NAMES:
        path_of(each).write_text(kept_of(each))
