"""Options of a simulated plant, as passed on by python-can."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import can

from sim_plant.slave_network import CLOCKS, CYCLE_DEFAULT

if TYPE_CHECKING:
    from typing import Self

    from sim_plant.slave_network import Clock

BITRATE = 1_000_000


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """Options of a plant.

    Attributes
    ----------
    seed : int, optional
        Seed in place of the plant file's.
    clock : {"sync", "wall"}
        See `sim_plant.slave_network`.
    cycle : float
        SYNC period while no drive has a period (1006h) [s].
    personality : str, optional
        Personality of all drives, by name or path, in place of those of the plant file.
    faults : str, optional
        Path of a fault plan.
    hand : str, optional
        Path of a socket that receives external pushes (`sim_plant.serving.hand`).
    bitrate : int
        Bit rate for the distances between the time stamps of frames [bit/s].
    """

    seed: int | None = None
    clock: Clock = "sync"
    cycle: float = CYCLE_DEFAULT
    personality: str | None = None
    faults: str | None = None
    hand: str | None = None
    bitrate: int = BITRATE

    @classmethod
    def parse(cls, given: dict[str, object]) -> Self:
        """Parse options given by name, as text or as values.

        Raises
        ------
        can.CanInitializationError
            An unknown option, or a value that it cannot take.
        """
        known = [field.name for field in fields(cls)]
        unknown = [name for name in given if name not in known]
        if unknown:
            raise can.CanInitializationError(
                f"{', '.join(unknown)}: unknown option of the simulated plant; options: "
                f"{', '.join(known)} and receive_own_messages"
            )
        return cls(**{name: _read(name, value) for name, value in given.items()})  # type: ignore[arg-type]

    def refuse_others(self, given: dict[str, object], name: str) -> None:
        """Check that options agree with those of an open plant.

        Raises
        ------
        can.CanInitializationError
        """
        for option, value in given.items():
            wanted, present = _read(option, value), getattr(self, option)
            if option != "bitrate" and wanted != present:
                raise can.CanInitializationError(
                    f"{name}: is open in this process with {option}={present}, not "
                    f"{option}={wanted}; omit {option} or shut the other bus down"
                )


def _read(option: str, value: object) -> object:
    match option:
        case "seed":
            return _number(option, value, 0)
        case "bitrate":
            return _number(option, value, 1)
        case "cycle":
            return _seconds(option, value)
        case "clock" if value not in CLOCKS:
            raise can.CanInitializationError(f"clock={value!r}: must be one of {', '.join(CLOCKS)}")
        case _:
            return str(value)


def _number(option: str, value: object, least: int) -> int:
    try:
        number = int(str(value))
    except ValueError:
        number = least - 1
    if number < least:
        raise can.CanInitializationError(
            f"{option}={value!r}: must be an integer of at least {least}"
        )
    return number


def _seconds(option: str, value: object) -> float:
    try:
        seconds = float(str(value))
    except ValueError:
        seconds = 0.0
    if not 1e-4 <= seconds <= 10.0:
        raise can.CanInitializationError(f"{option}={value!r}: must be from 0.0001 to 10 seconds")
    return seconds
