"""From a run to a model, by any of the methods; nothing is written."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING

from hil.estimation.identify import estimate
from hil.model import recursion  # noqa: F401 - compiled from the first: rows are needed by million
from hil.results.error_budget import error_budget
from hil.results.model import Model
from hil.results.model_file import Provenance
from hil.results.naming import named
from hil.runs.journal import now
from hil.runs.pooling import pooled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.estimate import Estimate
    from hil.runs.run import Run


def identify(run: Run, method: str = "improved", others: Sequence[Run] = ()) -> Model:
    """Identify the base parameters from a run.

    Parameters
    ----------
    run : Run
    method : str
        One of `hil.estimation.identify.METHODS`.
    others : sequence of Run
        Further runs of the same robot, identified together with the first.

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        Runs of different robots, or the same one twice.
    UnknownName
        There is no such method.
    NotIdentifiable, NotEnoughData
        Measurements that do not suffice.
    """
    with named(run):
        found = estimate(run.robot, pooled([run, *others]), method)
    return model_of(run, found, others)


def model_of(run: Run, found: Estimate, others: Sequence[Run] = ()) -> Model:
    """Return an estimate from a run, and others together with it, as a model."""
    return Model(
        robot=run.robot,
        values=found.p,
        scatter_covariance=found.covariance,
        drive_covariance=found.drive_covariance,
        degrees_of_freedom=found.degrees_of_freedom,
        residual=found.residual,
        condition=found.condition,
        provenance=_provenance(run, found, others),
        local=found.local,
        error_budget=error_budget(found, run.robot),
    )


def _provenance(run: Run, found: Estimate, others: Sequence[Run]) -> Provenance:
    sessions = run.journal.sessions
    return Provenance(
        robot=run.robot.name,
        robot_digest=run.robot.digest,
        plan_digest=run.plan.digest,
        measured=sessions[-1].started if sessions else "",
        bus=sessions[-1].bus if sessions else "",
        measurements=found.n_measurements,
        missing=sum(len(each.missing) for each in (run, *others)),
        together_with=tuple(str(each.path) for each in others),
        left_out=tuple(str(left) for left in found.left_out),
        identified=now(),
        method=found.method,
        version=version("canopen-robot-identification"),
    )
