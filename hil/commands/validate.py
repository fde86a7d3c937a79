"""`hil validate`: judgement of a model by another run, written to `validation.yaml`.

The file of the model lists the judgement as well.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from hil.commands.torques import model_and_run, played
from hil.results.judgement import KeptJudgement
from hil.results.model import Model
from hil.results.provenance import KeptResult, RunStamp
from hil.results.tables.parameters import band_residual
from hil.results.validation import Validation
from hil.results.validation import validate as judge
from hil.runs.journal import now
from hil.show.outcome import Outcome
from hil.show.rounding import significant
from hil.show.table import Table, figures, table

if TYPE_CHECKING:
    from pathlib import Path

    from hil.results.validation import AxisScore
    from hil.runs.run import Run
    from hil.show.table import Row

NAME, PAGE = "validation.yaml", "validation.html"


class ValidationRecord(KeptResult):
    """Content of `validation.yaml`: a validation with run and model.

    Attributes
    ----------
    model : str
        Path of the model file, relative to the folder of the run.
    method, identified : str
        Method and time of the identification.
    validated : str
        Time of the validation.
    """

    names = (NAME,)
    width = 200
    run: RunStamp
    model: str
    method: str
    identified: str
    validated: str
    validation: Validation


def validate(model: Model, model_path: Path, run: Run, accuracy: float) -> Outcome:
    """Judge a model by a run; write the validation to the run's folder and the model file.

    The outcome has no tables if the run cannot judge the model.
    """
    found = judge(model, run, accuracy)
    record = ValidationRecord(
        run=RunStamp.create(run),
        model=os.path.relpath(model_path, run.path),
        method=model.method,
        identified=model.provenance.identified,
        validated=now(),
        validation=found,
    )
    record.write(run.path)
    # the judgement in the model file replaces an earlier one by the same run
    where = os.path.relpath(run.path, model_path.parent)
    kept = KeptJudgement.judge(
        found.reasons, lambda: found, run=where, validated=record.validated, relative=found.relative
    )
    judged = Model.load(model_path)
    others = tuple(each for each in judged.validations if each.run != where)
    replace(judged, validations=(*others, kept)).save(model_path)
    simulated, title = run.journal.simulated, f"{run.robot.name}: validation"
    if not found.axes:
        return Outcome(verdicts=found.verdicts, simulated=simulated)
    left = band_residual(found.residual, model.robot, "of this recording")
    tables = scores(found, remarks(model, run)), left
    return Outcome(
        tables, verdicts=found.verdicts, title=title, simulated=simulated,
        facts=model_and_run(model_path, model, run.path),
        played=partial(played, model, [run]),
    )  # fmt: skip


def remarks(model: Model, run: Run) -> tuple[str, ...]:
    """Return a remark if the plan of the validation was used for the model too."""
    if model.provenance.plan_digest != run.plan.digest:
        return ()
    return (
        "the model was identified with this plan: record another motion for a test on "
        "held-out data",
    )


def scores(found: Validation, notes: tuple[str, ...] = ()) -> Table:
    """Return the table of scores of moved axes."""
    heads = ["torque", "residual", "residual, %", "mean, %", "inside, %", "gain"]
    explained, fitted = "", any(each.refitted is not None for each in found.axes)
    if fitted:
        heads += ["friction fitted, %", "inside, %"]
        explained = (
            " The last two columns: ratio and share inside with friction fitted to this recording; "
            "the gain is computed with this friction too."
        )
    return table(
        "Predicted torques of this recording",
        ("axis", *figures(*heads)),
        (
            (
                str(each.axis),
                f"{significant(each.torque, 3)} {each.unit}",
                f"{significant(each.residual, 3)} {each.unit}",
                significant(100 * each.relative, 2),
                f"{100 * each.naive:.0f}",
                f"{100 * each.inside:.0f}",
                f"{each.gain:.3f}",
                *(_refitted(each) if fitted else ()),
            )
            for each in found.axes
        ),
        "Root mean squares of torque and residual, and their ratio; mean: the same ratio for a "
        "constant prediction, the axis's mean torque; share of samples inside the predicted 95 % "
        "intervals; gain: best-fitting factor of the predicted torque." + explained,
        notes,
    )


def _refitted(score: AxisScore) -> Row:
    if score.refitted is None or score.refitted_inside is None:
        return "", ""
    return significant(100 * score.refitted, 2), f"{100 * score.refitted_inside:.0f}"
