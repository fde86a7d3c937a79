"""All that a run of measurements gives: what was identified, and what follows from it."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.estimate import Estimate
    from hil.estimation.friction.drift import Drift
    from hil.planning.measurement import RecordedMotion
    from hil.results.identification import Identified
    from hil.results.judgement import Reservation
    from hil.results.model import Model
    from hil.results.prediction import Prediction
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured
    from hil.runs.run import Run

    Recordings = Sequence[tuple[RecordedMotion, Recording]]


class Findings(NamedTuple):
    """What was found in a run whose base parameters are identifiable.

    Attributes
    ----------
    estimate : Estimate
    model : Model
        As `hil identify` found it.
    check : Model or None
        By the published method, of the improved one; None where it cannot be made, which needs
        measurements of elements of all groups.
    prediction : Prediction
        What the parameters mean in torques.
    advice : tuple of Reservation
        None of recordings that were imported, which cannot be measured again.
    drifts : tuple of Drift
        Time constants of friction, of axes with enough levels over time.
    """

    estimate: Estimate
    model: Model
    check: Model | None
    prediction: Prediction
    advice: tuple[Reservation, ...]
    drifts: tuple[Drift, ...]


def findings(
    run: Run, found: Identified, campaign: Sequence[Measured], recordings: Recordings
) -> Findings:
    """Return all that follows from what was identified in a run."""
    # a report whose findings are kept needs nothing that is loaded here
    from hil.errors import NotEnoughData, NotIdentifiable  # noqa: PLC0415
    from hil.estimation.friction.history import history  # noqa: PLC0415
    from hil.estimation.two_step_methods import estimates  # noqa: PLC0415
    from hil.results.advice import CampaignResult, advice  # noqa: PLC0415
    from hil.results.friction import campaign_drifts  # noqa: PLC0415
    from hil.results.identification import model_of  # noqa: PLC0415
    from hil.results.prediction import predict  # noqa: PLC0415

    robot, estimate, model, check = run.robot, found.estimate, found.model, None
    if model.method == "improved":
        with suppress(NotIdentifiable, NotEnoughData):
            published = estimates(robot, recordings, ("published",))["published"]
            check = model_of(run, published)
    prediction = predict(estimate, robot)
    return Findings(
        estimate=estimate,
        model=model,
        check=check,
        prediction=prediction,
        advice=()
        if run.imported
        else advice(
            CampaignResult(estimate, prediction, model.error_budget, robot, run.planned, campaign)
        ),
        drifts=campaign_drifts(robot, estimate.local, history(robot, recordings)),
    )
