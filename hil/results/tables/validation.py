"""How well a model predicts other recordings: axis by axis, and in one word each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.rounding import significant
from hil.results.tables.table import Column, Marked, Part, Table, figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.results.tables.table import Row
    from hil.results.verdict import AxisScore, KeptVerdict, Validation


REFITTED = ("friction fitted, %", "inside, %")
_EXPLAINED = (
    " All with the friction that the model states, but the gain and the last two columns: ratio and"
    " share inside with friction fitted in this recording."
)


def validation(found: Validation, notes: tuple[str, ...] = ()) -> Table:
    """Scores of all axes that the recording moves."""
    heads = ("torque", "residual", "%", "mean, %", "inside, %", "gain")
    fitted = any(each.refitted is not None for each in found.axes)
    more, explained = (REFITTED, _EXPLAINED) if fitted else ((), "")
    return Table(
        title="Torques predicted of this recording",
        columns=(Column("axis"), *figures(*heads, *more)),
        parts=(Part(tuple(_row(each, fitted=fitted) for each in found.axes)),),
        explanation=(
            "Root mean squares of torque and residual, and their ratio; the same ratio where the"
            " axis's mean torque is the prediction; share of samples inside the predicted intervals"
            " of 95 %; factor of what the model states that would fit best." + explained
        ),
        notes=notes,
    )


def verdicts(kept: Sequence[KeptVerdict]) -> Table:
    """What a model was worth on other recordings."""
    return Table(
        title="Judged by other recordings",
        columns=(
            Column("run"),
            Column("verdict"),
            *figures("off by, %"),
            Column("reason", folds=True),
        ),
        parts=(Part(tuple(_verdict(each) for each in kept)),),
        explanation=(
            "By hil validate: verdict, error of the predicted torques, and the worst of what was"
            " found."
        ),
    )


def _verdict(each: KeptVerdict) -> Row:
    off = "" if each.relative is None else significant(100 * each.relative, 2)
    word = each.verdict if each.verdict == "PASS" else Marked(each.verdict)
    return each.run, word, off, each.reason


def _row(score: AxisScore, *, fitted: bool) -> Row:
    return (
        str(score.axis),
        f"{significant(score.torque, 3)} {score.unit}",
        f"{significant(score.residual, 3)} {score.unit}",
        significant(100 * score.relative, 2),
        f"{100 * score.naive:.0f}",
        f"{100 * score.inside:.0f}",
        f"{score.gain:.3f}",
        *(_refitted(score) if fitted else ()),
    )


def _refitted(score: AxisScore) -> Row:
    shares = score.refitted, score.refitted_inside
    off, inside = (None if share is None else 100 * share for share in shares)
    return (
        "" if off is None else significant(off, 2),
        "" if inside is None else f"{inside:.0f}",
    )
