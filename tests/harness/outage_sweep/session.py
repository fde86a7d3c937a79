"""Session of fast moves of all six axes, in lock-step, with an outage.

Powering up, three moves at up to full speed, powering down; then the drives are left alone. The
judgement is that of the witness of the machine (`fault_table.witness`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from fault_table.logged_bus import SYNC, LoggedBus
from fault_table.stopping_way import allowed_ways, reaction_time
from fault_table.trial import drives

from drivers.canopen.bus import CanopenBus
from drivers.drive_bus import DriveError, Move, MoveFailed
from drivers.session.servo_axes import ServoAxes
from sim_plant.physics import state as st

if TYPE_CHECKING:
    from fault_table.witness import Witness
    from numpy.typing import NDArray

    from outage_sweep.draws import Outage

REACH = (1.2, 0.8, 1.2, 1.5, 1.0, 1.5)
"""Targets of the moves on either side of zero [rad]."""
SHARES = ((1, 1.0), (-1, 0.6), (1, 1.0))
"""Side and share of the speed limit of each move."""
ACCELERATION = 0.5
"""Share of the acceleration limit; higher values saturate the plant's motors."""


class Verdict(NamedTuple):
    """Verdict on an outage.

    Attributes
    ----------
    ended : str
        Error that ended the session early; empty if there was none.
    unwatched : tuple of int
        Axes that were energised with their watchdog off.
    energised : tuple of int
        Axes that still had power after the time without a master.
    way, share : float
        Longest distance of an axis after the event [rad], and its share of the allowed distance; 0
        if the session continued.
    """

    ended: str
    unwatched: tuple[int, ...]
    energised: tuple[int, ...]
    way: float
    share: float

    @property
    def broken(self) -> bool:
        """Return True if a promise was broken."""
        return bool(self.unwatched or self.energised or self.share > 1.0)


def move_about(bus: LoggedBus) -> None:
    """Power up, move, power down.

    Raises
    ------
    DriveError, KeyboardInterrupt
        Error of the driver after an outage, or Ctrl-C.
    """
    with ServoAxes(CanopenBus(bus), drives) as axes:
        try:
            for side, share in SHARES:
                axes.move(moves(side, share))
                while not axes.sample().reached:
                    pass
        except MoveFailed:
            # The driver notices a set-point lost in a short outage only by its time-out. Until then
            # the other axes continue to their targets, which is no event.
            bus.witness.begin()
            raise


def moves(side: int, share: float) -> dict[int, Move]:
    """Return one move of all axes."""
    return {
        axis: Move(
            side * reach,
            share * drive.limits.velocity,
            ACCELERATION * drive.limits.acceleration,
        )
        for axis, (reach, drive) in enumerate(zip(REACH, drives.axes, strict=True))
    }


def frames_sent() -> range:
    """Return numbers of the driver's frames in an undisturbed session, from the first SYNC on.

    Before the first SYNC, the driver reads and configures drives that are off.
    """
    with LoggedBus(()) as bus:
        move_about(bus)
    ours = [frame.identifier for frame in bus.log if frame.ours]
    return range(ours.index(SYNC) + 1, len(ours) + 1)


def judged(ended: str, state: NDArray[np.float64], witness: Witness, length: float) -> Verdict:
    """Judge an outage of this duration [s], by the plant's state and its witness."""
    ways = witness.ways if ended else np.zeros(len(REACH))
    shares = ways / allowed_ways(witness.speeds, length, drives)
    return Verdict(
        ended,
        tuple(sorted(witness.unwatched)),
        tuple((np.flatnonzero(state[:, st.ENABLED]) + 1).tolist()),
        float(ways.max()),
        float(shares.max()),
    )


def happen(outage: Outage) -> Verdict:
    """Run a session with an outage and judge the result."""
    ended = ""
    reaction = reaction_time(outage.length, drives)
    with LoggedBus(outage.faults, interrupted=outage.interrupted, reaction=reaction) as bus:
        try:
            move_about(bus)
        except (DriveError, KeyboardInterrupt) as error:
            ended = type(error).__name__
        bus.leave_alone()
    return judged(ended, bus.plant.state, bus.witness, outage.length)
