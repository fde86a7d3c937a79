"""What terminal and report say about friction, as plain rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.estimation.friction.models import UNIT
from hil.results.rounding import rounded, signed, significant

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.estimation.friction.drift import Drift, TimeConstant
    from hil.estimation.friction.models import FrictionModel
    from hil.estimation.friction.symmetry import Symmetry
    from hil.results.friction import FrictionResult

    Row = tuple[str, ...]


def model_rows(result: FrictionResult) -> list[Row]:
    """Every model of every axis: errors [N m], whether it is recommended, parameters."""
    rows: list[Row] = []
    for fit in result.axes:
        for number, (kind, model) in enumerate(fit.models.items()):
            rows.append((
                "" if number else str(fit.axis + 1),
                kind,
                significant(model.mean_square**0.5, 3),
                significant(fit.held_out[kind] ** 0.5, 3),
                "chosen" if kind == fit.chosen else "",
                _parameters(model),
            ))  # fmt: skip
    return rows


def _parameters(model: FrictionModel) -> str:
    pairs = zip(model.a, model.standard_error, UNIT[model.kind], strict=True)
    return ", ".join(
        f"a{k} {rounded(float(a), float(e))} ± {rounded(float(e), float(e))} {unit}"
        for k, (a, e, unit) in enumerate(pairs, start=1)
    )


def words(result: FrictionResult) -> list[str]:
    """Tell which parameters of which models the data do not determine."""
    return [
        f"axis {fit.axis + 1}, {kind}: {word}"
        for fit in result.axes
        for kind, model in fit.models.items()
        for word in model.unidentifiable
    ]


def symmetry_rows(tests: Iterable[Symmetry]) -> list[Row]:
    """Outcome of the test of every axis; asymmetry in per cent of the friction level."""
    return [
        (
            str(test.axis + 1),
            str(test.n),
            rounded(100 * test.asymmetry, 100 * test.standard_error),
            rounded(100 * test.standard_error, 100 * test.standard_error),
            probability(test.p_zero),
            probability(test.p_bound),
            test.verdict,
        )
        for test in tests
    ]


def drift_rows(drifts: Iterable[Drift]) -> list[Row]:
    """Time constants of every axis with their effects on the level."""
    rows: list[Row] = []
    for each in drifts:
        effects = (each.warm_effect, each.rest_effect, None)
        for number, (constant, effect) in enumerate(zip(each.constants, effects, strict=True)):
            rows.append((
                "" if number else str(each.axis + 1),
                constant.name,
                *_times(constant),
                "" if effect is None or constant.word else signed(f"{100 * effect:.1f}") + " %",
                constant.word,
            ))  # fmt: skip
    return rows


def _times(constant: TimeConstant) -> Row:
    if constant.word:
        return "", ""
    error = constant.standard_error
    return rounded(constant.value, error), rounded(error, error)


def probability(p: float) -> str:
    """Write a p-value; tiny ones by their bound."""
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"
