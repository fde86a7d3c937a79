"""All that a run of measurements gives: estimates by both methods, and what follows from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.estimate import Estimate
    from hil.estimation.friction.drift import Drift
    from hil.estimation.mistakes.mistake import Mistake
    from hil.planning.measurement import RecordedMotion
    from hil.results.advice import Advice
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
        By the improved method.
    model, check : Model
        By the improved method, and by the published one as a check.
    prediction : Prediction
        What the improved method's parameters mean in torques.
    advice : tuple of Advice
    drifts : tuple of Drift
        Time constants of friction, of axes with enough levels over time.
    """

    estimate: Estimate
    model: Model
    check: Model
    prediction: Prediction
    advice: tuple[Advice, ...]
    drifts: tuple[Drift, ...]


def findings(run: Run, campaign: Sequence[Measured], recordings: Recordings) -> Findings:
    """Estimate a run by both methods.

    Raises
    ------
    NotIdentifiable
        Measurements that do not suffice.
    """
    # a report whose findings are kept needs nothing that is loaded here
    from hil.estimation.mistakes.finding import find_mistake  # noqa: PLC0415
    from hil.estimation.two_step_methods import estimates  # noqa: PLC0415
    from hil.results.naming import named  # noqa: PLC0415

    with named(run):
        found = estimates(run.robot, recordings)
    mistake = find_mistake(run.robot, recordings)
    return following(run, campaign, recordings, found["improved"], found["published"], mistake)


def following(
    run: Run,
    campaign: Sequence[Measured],
    recordings: Recordings,
    improved: Estimate,
    published: Estimate,
    mistake: Mistake | None,
) -> Findings:
    """Return all that follows from the estimates of a run."""
    from hil.estimation.friction.history import history  # noqa: PLC0415 - as above
    from hil.results.advice import advice  # noqa: PLC0415
    from hil.results.friction import campaign_drifts  # noqa: PLC0415
    from hil.results.identification import model_of  # noqa: PLC0415
    from hil.results.prediction import predict  # noqa: PLC0415

    robot = run.robot
    model, prediction = model_of(run, improved, mistake=mistake), predict(improved, robot)
    budget = model.error_budget
    return Findings(
        estimate=improved,
        model=model,
        check=model_of(run, published),
        prediction=prediction,
        advice=tuple(advice(improved, prediction, budget, robot, run.planned, campaign)),
        drifts=campaign_drifts(robot, improved.local, history(robot, recordings)),
    )
