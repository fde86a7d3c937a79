"""A diagnosis on the terminal: what the robot file leaves out, and how late currents were read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.tables.diagnosis import candidates, sentences
from hil.results.tables.drive_train import drive_train
from hil.results.tables.terminal import show, show_sentence

if TYPE_CHECKING:
    from rich.console import Console

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.results.diagnosis_file import DiagnosisFile


def render(found: DiagnosisFile, estimate: Estimate, robot: Robot, console: Console) -> None:
    """Print the candidates, the verdict on them, and the drive trains behind the estimate."""
    show(candidates(found), console)
    for sentence in sentences(found):
        show_sentence(sentence, console)
    show(drive_train(estimate, robot), console)
