"""What was identified of imported recordings: parameters, friction, and what is left of torques."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.report.plots.free_motions import measured_and_predicted
from hil.report.section import Plot, Section
from hil.results.recorded_torque import in_si, predict_recording
from hil.results.tables.free_motion import friction, left_by_free_motions, statements
from hil.results.tables.parameters import parameters

if TYPE_CHECKING:
    from hil.report.reported_run import ForeignRun


def section(run: ForeignRun) -> Section:
    """Tables, what was chosen, and the longest recording beside its prediction."""
    model = run.model
    longest, recording = max(run.recordings, key=lambda each: each[1].n_samples)
    torque = predict_recording(model, in_si(model, longest, recording))
    plot = Plot(
        "torques",
        partial(measured_and_predicted, torque, run.robot),
        "Measured and predicted torque of every axis over time, and their difference.",
        f"Recording {longest.id}: torques after the low-pass, measured and as the model with its"
        " friction predicts them; below, what is left.",
    )
    return Section(
        "Parameters, friction and torques",
        "free_motions.html",
        {
            "parameters": parameters(model),
            "laws": friction(model),
            "left": left_by_free_motions(model),
            "statements": () if model.friction is None else statements(model.friction),
            "lengths": run.robot.file.lengths,
        },
        (plot,),
        leads=True,
    )
