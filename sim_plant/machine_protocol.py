"""Interface between a drive's firmware and its machine.

`cia402_node` (communication, object dictionary, state machine) sees an `Axis` for each drive and
the `Machine`, which advances time; `plant` implements both with physics. Units are the drive's own:
encoder increments of the motor shaft, per mille of rated torque and current. Joint side and SI
begin behind this interface.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from sim_plant.drive_settings import DriveSettings


class AxisEvent(enum.IntFlag):
    """Conditions of an axis, reported to the firmware."""

    DONE = 1
    """The profile generator has reached its target or has come to rest after a stop."""
    STANDSTILL = 2
    """The measured velocity stayed inside the standstill window."""
    SATURATED = 4
    """The torque command is at its limit."""
    FOLLOWING_ERROR = 8
    """The following error was outside its window for longer than its time."""


class Reading(NamedTuple):
    """Readings of power stage and encoder of an axis at an instant.

    Attributes
    ----------
    position, velocity : int
        Measured position [increments] and velocity [increments/s].
    torque, current : int
        Measured, with noise [per mille of rated torque, of rated current].
    demand : int
        Position demand of the profile generator [increments].
    following_error : int
        demand - position [increments].
    events : int
        `AxisEvent` bits.
    """

    position: int
    velocity: int
    torque: int
    current: int
    demand: int
    following_error: int
    events: int


class Axis(Protocol):
    """Servo as seen by its firmware: power stage, control loops and profile generator."""

    def enable(self) -> None:
        """Energise, release the brake and hold the present position."""

    def disable(self) -> None:
        """Remove the torque and close the brake."""

    def move(
        self, target: float, velocity: float, acceleration: float, deceleration: float
    ) -> None:
        """Start a trapezoid from the present demand to `target` [inc, inc/s, inc/s^2]."""

    def stop(self, deceleration: float) -> None:
        """Bring the demand to rest [inc/s^2] and hold."""

    def follow(self, target: float, period: float) -> None:
        """Lead the demand towards `target` [inc], a set-point of a stream, over `period` [s]."""

    def feed_forward(self, velocity: float, torque: float) -> None:
        """Add to the commands of velocity [inc/s] and of torque [per mille of rated]."""

    def withhold(self, share: float) -> None:
        """Reduce the feed-forward of the demand's velocity by a share from 0 to 1."""

    def hold(self) -> None:
        """Freeze the demand at the present measured position (stop at the current limit)."""

    def set_torque_limit(self, per_mille: int) -> None:
        """Limit the torque command [per mille of rated torque]."""

    def set_following_window(self, window: float, timeout: float) -> None:
        """Set the following error window [inc, inf = off] and its maximum duration [s]."""

    def rebase(self, shift: int) -> None:
        """Shift the shown positions by `shift` [increments]."""


class Machine(Protocol):
    """Axes of an arm, and the settings of the drives."""

    @property
    def time(self) -> float:
        """Time of the machine [s]."""

    @property
    def axes(self) -> Sequence[Axis]:
        """Axes commanded by the drives."""

    @property
    def drives(self) -> Sequence[DriveSettings]:
        """Settings of the drives, in joint order."""

    def advance(self, duration: float) -> None:
        """Run the physics for `duration` [s].

        Calls `handle_event` at each instant at which an axis's events change, so that the firmware
        acts at the right instant, however long `duration` is.
        """

    def advance_quietly(
        self, durations: Sequence[float], watch: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Run the physics for several durations [s] in turn and latch after every duration.

        Ends before the first latch with news of an axis.

        Parameters
        ----------
        durations : sequence of float
        watch : ndarray, shape (3, n_axes)
            See `sim_plant.drive.process_image.ProcessImage`.

        Returns
        -------
        ndarray, shape (k, 7 n_axes)
            Results of `read` after the durations; k is at most the number of durations.
        """

    def read(self) -> NDArray[np.int64]:
        """Latch encoders and current sensors of all axes at the present instant.

        Returns
        -------
        ndarray, shape (7 n_axes,)
            The fields of a `Reading` of each axis in turn; the next call may overwrite them.
        """

    handle_event: Callable[[int, int], None]
    """Handler of changed events during `advance`, called with axis index and `AxisEvent` bits."""
