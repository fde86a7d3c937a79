"""Table of causes of error: found, excluded by the recordings, or invisible."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.show.rounding import clock, significant
from hil.show.table import Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.estimation.excluded.distinguishing import Distinguished
    from hil.estimation.excluded.result import Excluded, Limit
    from hil.show.table import Row

NEVER, FOUND, UNTESTED = "-", "found", "?"
"""Cells in place of a size, for an invisible, a found and an untestable cause."""


MORE = "measure more (--gravity, --inertia, --coupling)"
KEY = f"{NEVER}: no size is sure to show; in brackets: larger than usual"


def excluded(
    proof: Excluded,
    n_joints: int,
    title: str = "What these recordings exclude",
    note: str = KEY,
    source: str = "these recordings",
) -> Table:
    """Return the smallest detectable sizes of causes, axis by axis."""
    resting = sorted({each.axis for each in proof.limits if not each.testable})
    untested = [f"{UNTESTED}: {untestable(resting, source)}"] if resting else []
    # the column of the arm, 0, only for causes that concern no axis
    axes = range(0 if any(not each.axis for each in proof.limits) else 1, n_joints + 1)
    heads = (f"axis {axis}" if axis else "arm" for axis in axes)
    return table(
        title,
        ("cause larger than", "unit", *figures(*heads, "effect, %")),
        _rows(proof, axes),
        "Sizes found with a probability of 80 %, at a probability of 5 % for a false alarm in "
        f"{proof.tests} tests together; effect: largest torque of a cause of this size.",
        (note, *untested),
    )


def untestable(axes: Sequence[int], source: str) -> str:
    """Return the reason why causes of axes, from 1, have no size; axis 0 stands for the arm."""
    numbers = [str(axis) for axis in axes if axis]
    which = [f"{'axis' if len(numbers) == 1 else 'axes'} {', '.join(numbers)}"] if numbers else []
    arm = ["the arm"] if 0 in axes else []
    verb = "has" if len(axes) == 1 else "have"
    return f"not testable with {source}: {' and '.join(arm + which)} {verb} too little torque"


def foreseen(proof: Excluded, n_joints: int, source: str) -> Table:
    """Return the detectable sizes for a plan; `source`: origin of the expected base parameters."""
    note = (
        f"sizes found with a probability of 80 %; {KEY}; noise as in the "
        f"predicted precision; base parameters {source}"
    )
    return excluded(proof, n_joints, "What this plan will exclude", note, "this plan")


def change_by_cause(
    proof: Excluded | None, n_joints: int, before: str, known: Sequence[str] = ()
) -> tuple[Table | str, ...]:
    """Return the causes that changed since a run, named by folder, and detectable sizes."""
    if proof is None:
        return (f"too few recordings to find causes of a change since {before}",)
    besides = "".join(f", besides the {each}" for each in known)
    said = [f"cause of the difference from {before}{besides}: {each}" for each in proof.found]
    if proof.unexplained:
        return (
            f"no change since {before}{besides} can be told from model error: the model leaves more"
            " of these recordings, and no single cause explains it; to compare, record the motions"
            f" of {before} again",
        )
    if not said and not any(each.size is not None or not each.testable for each in proof.limits):
        return (f"no change since {before} would show in these recordings: measure longer",)
    nothing = f"no lasting cause of a difference from {before} found{besides}"
    title = "Changes that these recordings would show"
    return excluded(proof, n_joints, title), *(said or [nothing])


def _rows(proof: Excluded, axes: Sequence[int]) -> Iterator[Row]:
    for cause, part in dict.fromkeys((each.cause, each.part) for each in proof.limits):
        own = [each for each in proof.limits if (each.cause, each.part) == (cause, part)]
        name, units = f"{cause} {part}".strip(), dict.fromkeys(each.unit for each in own)
        # a limit is the size that would have been found, which is irrelevant for a found cause
        cells = [
            FOUND
            if (cause, axis) in proof.places
            else _cell([each for each in own if each.axis == axis])
            for axis in axes
        ]
        shown = [
            each.torque * each.size
            for each in own
            if each.size is not None and (cause, each.axis) not in proof.places
        ]
        worth = significant(100 * max(shown), 2) if shown else NEVER
        yield (name, " or ".join(units), *cells, worth)


def _cell(limits: Sequence[Limit]) -> str:
    """Return the size of the least visible limit; for torque ripple, over all orders."""
    if not limits:
        return ""
    sizes = [each.size for each in limits if each.size is not None]
    if len(sizes) < len(limits):
        return UNTESTED if not all(each.testable for each in limits) else NEVER
    text = significant(max(sizes), 2)
    return text if all(each.visible for each in limits) else f"({text})"


def sentences(proof: Excluded) -> Iterator[str]:
    """Yield sentences on found and invisible causes."""
    for cause in proof.found:
        yield f"found: {cause}"
    if hidden := proof.invisible:
        worst = max(hidden, key=lambda each: each.worth)
        where = f" of axis {worst.axis}" if worst.axis else ""
        names = ", ".join(dict.fromkeys(each.cause for each in hidden))
        yield (
            f"invisible at their usual sizes: {names}; largest effect: {worst.cause}{where}, "
            f"{significant(100 * worst.worth, 2)} % of the axis's torque"
        )


def distinguished(found: Distinguished, source: str) -> Table:
    """Return the table of sizes of causes that a plan detects and distinguishes."""
    heads = ("usual", "found, before", "after", "apart, before", "after")
    rows = (
        (after.name, after.unit, significant(after.usual, 2) if after.usual else "",
         _finite(before.shown), _finite(after.shown),
         *((_finite(before.distinct), _finite(after.distinct)) if after.like else ("", "")),
         after.like)
        for before, after in zip(found.before, found.after, strict=True)
    )  # fmt: skip
    note = (
        "found: smallest size detected; apart: smallest size distinguished from the cause most "
        f"alike, each with a probability of 80 %; {NEVER}: at no size; base parameters {source}"
    )
    return table(
        "Causes that this plan will distinguish",
        ("cause", "unit", *figures(*heads), "most alike"),
        rows,
        notes=(note,),
    )


def distinguishing(found: Distinguished) -> Iterator[str]:
    """Yield sentences on added measurements, and on causes still not distinguished."""
    before, after = map(clock, found.durations)
    ids = f" ({', '.join(found.added)})" if found.added else ""
    yield f"{len(found.added)} measurements added{ids}: {after} instead of {before}"
    for each in found.after:
        if each.remedy:
            yield f"{each.name}: invisible in measurements of strokes; {each.remedy}"
        elif each.resting:
            yield f"{each.name}: {untestable([each.resting], 'this plan')}; {MORE}"
        elif not each.enough:
            size = f"{significant(each.usual, 2)} {each.unit}" if each.usual else "a visible size"
            yield (
                f"{each.name}: {size} cannot be distinguished from {each.like or 'no effect'}, "
                f"even in twice the plan's time; {MORE}"
            )


def _finite(size: float) -> str:
    return significant(size, 2) if np.isfinite(size) else NEVER
