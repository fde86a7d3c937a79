"""Interface to the operator: consent to motion, stop keys, and questions.

Terminal and keyboard implement this protocol. Keys are polled between two SYNCs, since powered axes
must be served during a question.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from drivers.drive_bus import DriveError

if TYPE_CHECKING:
    from drivers.drive_bus import DriveBus, Sample

STOP_KEYS = frozenset(" q\x1b")
"""Keys that stop a motion: space, q and Esc."""


class StoppedByOperator(DriveError):
    """The operator pressed a stop key, or did not consent to a motion."""


class Operator(Protocol):
    """Person in front of the robot."""

    @property
    def present(self) -> bool:
        """True if keys can be pressed at all."""

    def agrees(self, intent: str) -> bool:
        """Ask for consent before power-on, without a time limit."""

    def show(self, text: str) -> None:
        """Show a line."""

    def pressed(self) -> str:
        """Return the keys pressed since the last call, without waiting."""


def require_consent(operator: Operator, intent: str) -> None:
    """Ask the operator for consent before power-on.

    Raises
    ------
    StoppedByOperator
        The operator does not consent.
    """
    if not operator.agrees(intent):
        raise StoppedByOperator("nothing was powered on: the operator did not agree")


def pressed(operator: Operator) -> str:
    """Return the keys pressed since the last call; raise at a stop key.

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
    """Ask for one of `choices` (keys) while the axes are served (see `pressed`)."""
    operator.show(question)
    while True:
        chosen = [key for key in pressed(operator).lower() if key in choices]
        if chosen:
            return chosen[0]
        bus.sample()
