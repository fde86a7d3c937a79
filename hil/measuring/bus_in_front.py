"""A bus that stands in front of another one and passes everything on.

What adds something to a bus derives from it and states no more than what it adds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.drive_bus import DriveRefused, StreamingBus

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import TracebackType
    from typing import Self

    from drivers.drive_bus import AxisInfo, DriveBus, Move, Sample


class BusInFront:
    """A `drivers.drive_bus.StreamingBus` in front of another bus.

    Parameters
    ----------
    bus : DriveBus
        Not entered yet.
    """

    def __init__(self, bus: DriveBus) -> None:
        self._bus = bus

    @property
    def period(self) -> float:
        """Time between two samples [s]."""
        return self._bus.period

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        """The axes in joint order; known once entered."""
        return self._bus.axes

    @property
    def notes(self) -> tuple[str, ...]:
        """What the operator should know though it stops nothing; grows."""
        return self._bus.notes

    def __enter__(self) -> Self:
        """Check, configure and power on every drive."""
        self._bus.__enter__()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop the axes and power off."""
        self._bus.__exit__(exc_type, exc, traceback)

    def move(self, moves: Mapping[int, Move]) -> None:
        """Give set-points to axes."""
        self._bus.move(moves)

    def sample(self) -> Sample:
        """Wait for the next SYNC."""
        return self._bus.sample()

    def halt(self) -> None:
        """Bring every axis to rest."""
        self._bus.halt()

    def reset(self) -> None:
        """Power the axes on again after something has stopped them."""
        self._bus.reset()

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Begin to send a path.

        Raises
        ------
        DriveRefused
            The drives follow no stream of set-points.
        """
        if not isinstance(self._bus, StreamingBus):
            raise DriveRefused("these drives follow no stream of set-points")
        self._bus.stream(path, velocity, torque)
