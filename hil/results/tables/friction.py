"""Friction of each axis: models over speed, law over a campaign, symmetry, time constants."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.results.identified_robot import friction_alone
from hil.show.rounding import probability, signed, significant, uncertain
from hil.show.table import Column, Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from hil.estimation.friction.points import Symmetry
    from hil.friction.drift import Drift
    from hil.friction.law import AxisLaw
    from hil.results.identified_robot import IdentifiedRobot
    from hil.show.table import Row


def campaign_friction(model: IdentifiedRobot) -> Table:
    """Return the table of friction laws, with friction at two speeds; empty without laws."""
    # a law estimated with the parameters has a separate table
    laws = enumerate(() if model.details.with_law else model.friction_law.axes)
    speed, torque = f"{model.robot.position_units}/s", model.robot.torque_units
    return table(
        "Friction over the campaign",
        (
            "axis",
            Column("law", folds=True),
            *figures(f"speeds, {speed}", *(f"at {at}, {torque}" for at in ("slowest", "fastest"))),
            *figures("wander, %"),
        ),
        (_law(model, axis, own) for axis, own in laws if own is not None),
        "Forward friction at no load and its standard error in predicted torques, at the slowest "
        "and the fastest speed; wander: deviation of the level from the law in single "
        "measurements.",
    )


def _law(model: IdentifiedRobot, axis: int, own: AxisLaw) -> Row:
    slowest, fastest = own.speeds or (0.0, own.speed)
    both = zip(*friction_alone(model, axis, np.array([slowest, fastest])), strict=True)
    shown = (" ± ".join(uncertain(float(value), float(error))) for value, error in both)
    speeds = f"{significant(slowest, 2)} to {significant(fastest, 3)}"
    return str(axis + 1), own.law, speeds, *shown, significant(100 * own.wander, 2)


def symmetry(tests: Mapping[int, Symmetry]) -> Table:
    """Return the tests for direction-dependent friction, by axis from 0."""
    return table(
        "Is friction the same in both directions?",
        (
            "axis",
            *figures("n", "asymmetry, %", "std. error, %", "p (none)", "p (bound)"),
            Column("verdict", folds=True),
        ),
        (
            (
                str(axis + 1),
                str(test.measurements),
                *uncertain(100 * test.asymmetry, 100 * test.standard_error),
                probability(test.p_zero),
                probability(test.p_bound),
                test.verdict,
            )
            for axis, test in tests.items()
        ),
        "Asymmetry in n measurements as a share of the friction level; p-values of no asymmetry, "
        "and of an asymmetry within the bound.",
    )


def drift(drifts: Iterable[Drift]) -> Table:
    """Return the time constants of friction, axis by axis, with effects on the friction level.

    Notes below the table name the unidentifiable constants, grouped by reason.
    """
    found = list(drifts)
    parts = (Part(tuple(_drift(each))) for each in found)
    return table(
        "Change of friction over time",
        ("axis", "time constant", *figures("value, s", "std. error, s", "effect")),
        (part for part in parts if part.rows),
        "Time constants, estimated from the friction level over time: warming up (effect: change "
        "of the level by the warming reached), settling of the lubricant at rest (effect: from "
        "stirred to settled), and stirring in motion at half the speed limit.",
        tuple(_unidentifiable(found)),
    )


def _drift(found: Drift) -> Iterator[Row]:
    effects, axis = (found.warm_effect, found.rest_effect, None), str(found.axis + 1)
    for constant, effect in zip(found.constants, effects, strict=True):
        if not constant.word:
            share = "" if effect is None else signed(f"{100 * effect:.1f}") + " %"
            yield axis, constant.name, *uncertain(constant.value, constant.standard_error), share
            axis = ""


def _unidentifiable(drifts: Sequence[Drift]) -> Iterator[str]:
    """Name unidentifiable time constants, a sentence per reason."""
    reasons = dict.fromkeys(each.word for found in drifts for each in found.constants if each.word)
    for reason in reasons:
        which: dict[tuple[str, ...], list[int]] = {}
        for found in drifts:
            names = tuple(each.name for each in found.constants if each.word == reason)
            which.setdefault(names, []).append(found.axis + 1)
        each = "; ".join(
            f"{', '.join(names)} of axis {', '.join(map(str, axes))}"
            for names, axes in which.items()
            if names
        )
        yield f"Time constants not identifiable: {each}: {reason}."
