"""How well torques were predicted, and what a model was worth on other recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.rounding import significant
from hil.results.tables.table import Column, Marked, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.results.judgement import KeptJudgement
    from hil.results.tables.table import Row
    from hil.results.validation import AxisScore, Validation


def scores(found: Validation, notes: tuple[str, ...] = ()) -> Table:
    """Scores of all axes that the recording moves."""
    heads = ["torque", "residual", "residual, %", "mean, %", "inside, %", "gain"]
    explained, fitted = "", any(each.refitted is not None for each in found.axes)
    if fitted:
        heads += ["friction fitted, %", "inside, %"]
        explained = (
            " All with the friction that the model states, but the gain and the last two columns:"
            " ratio and share inside with friction fitted in this recording."
        )
    return table(
        "Torques predicted of this recording",
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
        "Root mean squares of torque and residual, and their ratio; the same ratio where the"
        " axis's mean torque is the prediction; share of samples inside the predicted intervals"
        " of 95 %; factor of what the model states that would fit best." + explained,
        notes,
    )


def _refitted(score: AxisScore) -> Row:
    if score.refitted is None or score.refitted_inside is None:
        return "", ""
    return significant(100 * score.refitted, 2), f"{100 * score.refitted_inside:.0f}"


def judgements(kept: Sequence[KeptJudgement]) -> Table:
    """What a model was worth on other recordings."""
    return table(
        "Judged by other recordings",
        ("run", "judgement", *figures("off by, %"), Column("reason", folds=True)),
        (
            (
                each.run,
                each.word if each.word == "good" else Marked(each.word),
                "" if each.relative is None else significant(100 * each.relative, 2),
                each.clause,
            )
            for each in kept
        ),
        "By hil validate: judgement, error of the predicted torques, and the worst of what was"
        " found.",
    )
