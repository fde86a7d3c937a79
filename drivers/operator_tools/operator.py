"""Who supervises a motion: confirms it, can stop it at any time, and is asked what only eyes see.

The logic of probing sees this protocol; terminal and keyboard stand behind it. Keys are polled
between two SYNCs, for powered axes want to be served while somebody thinks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from drivers.drive_bus import DriveError

if TYPE_CHECKING:
    from drivers.drive_bus import DriveBus, Sample

STOP_KEYS = frozenset(" q\x1b")
"""Space, q and Esc stop a motion."""


class StoppedByOperator(DriveError):
    """The operator pressed a key to stop, or did not agree to a motion."""


class Operator(Protocol):
    """The person in front of the robot."""

    @property
    def present(self) -> bool:
        """Whether keys can come at all."""

    def agrees(self, intent: str) -> bool:
        """Ask before anything is powered; may wait for as long as it takes."""

    def show(self, text: str) -> None:
        """Show a line."""

    def pressed(self) -> str:
        """Return the keys pressed since the last call, without waiting."""


def require_consent(operator: Operator, intent: str) -> None:
    """Ask the operator before anything is powered.

    Raises
    ------
    StoppedByOperator
        The operator does not agree.
    """
    if not operator.agrees(intent):
        raise StoppedByOperator("nothing was powered on, since the operator did not agree")


def pressed(operator: Operator) -> str:
    """Return the keys pressed since the last call; whoever presses a stop key ends it all.

    Raises
    ------
    StoppedByOperator
        A stop key was pressed; leaving the bus stops the axes.
    """
    keys = operator.pressed()
    if STOP_KEYS.intersection(keys):
        raise StoppedByOperator("stopped by the operator; the axes are stopped and off")
    return keys


def supervised_sample(bus: DriveBus, operator: Operator) -> Sample:
    """Return the next sample (errors as in `pressed` and `DriveBus.sample`)."""
    pressed(operator)
    return bus.sample()


def answer(bus: DriveBus, operator: Operator, question: str, choices: str) -> str:
    """Ask for one of `choices` (keys) while the axes go on being served (see `pressed`)."""
    operator.show(question)
    while True:
        chosen = [key for key in pressed(operator).lower() if key in choices]
        if chosen:
            return chosen[0]
        bus.sample()
