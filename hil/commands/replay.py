"""`hil replay`: recorded and simulated positions of a run."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.show.charts.chart import MEASURED, MODEL, Line, Panel, Rule
from hil.show.outcome import Outcome, Plot

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from hil.runs.run import Run
    from hil.simulation.replay import Replay

PAGE = "replay.html"
BEFORE = "The same with the values of the robot's file"


def replay(
    run: Run, found: Replay, limits: Mapping[bool, float], before: Replay | None = None
) -> Outcome:
    """Return the outcome of a simulated run: position errors, judged by limits.

    Parameters
    ----------
    before : Replay, optional
        The run simulated with the values of the user's file, which are not judged.
    limits : mapping of bool to float
        Largest accepted error of revolute (True) and prismatic (False) joints [rad], [m].
    """
    plot = Plot(
        "positions",
        partial(positions, found),
        "Recorded and simulated position of every axis over time, and their difference below.",
        "Recorded and simulated positions of the recording with the largest error of each axis;"
        " below, simulated less recorded position.",
    )
    return Outcome(
        (found.table(), *(() if before is None else (before.table(BEFORE),))),
        verdicts=(found.verdict(limits),),
        plots=(plot,),
        title=f"{run.robot.name}: replay",
        facts={"Recordings": run.path.name, "Simulation": found.how},
        simulated=run.journal.simulated,
    )


def positions(found: Replay) -> Iterator[Panel]:
    """Draw recorded and simulated positions of each axis in the recording of the largest error."""
    for axis in range(found.robot.n_joints):
        largest = [np.abs(each.scored[:, axis]).max(initial=0.0) for each in found.recordings]
        shown = found.recordings[int(np.argmax(largest))]
        every = slice(None, None, max(1, len(shown.time) // 700))
        time = shown.time[every]
        unit, factor = found.unit(axis)
        recorded, simulated, error = (
            factor * x[every, axis] for x in (shown.recorded, shown.simulated, shown.error)
        )
        yield Panel(
            (
                Line(time, recorded, MEASURED, "recorded"),
                Line(time, simulated, MODEL, "simulated", "5 3"),
            ),
            title=f"axis {axis + 1}, {shown.measurement}",
            x_label="time [s]",
            y_label=f"position [{unit}]",
            below=Panel(
                (Rule(0.0), Line(time, error, MODEL, width=0.9)), y_label=f"Δ [{unit}]", height=42.0
            ),
            width=357.0,
            height=112.0,
            recording=shown.measurement,
        )
