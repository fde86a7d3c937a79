"""Every option composes with every method, or is refused with what would have an effect."""

from __future__ import annotations

import re
from itertools import product

import pytest

from hil.errors import Mismatch
from hil.estimation.identify import CONVENTIONAL, EFFECTIVE, METHODS, refuse_without_effect
from hil.estimation.options import COVARIANCES, DEFAULTS, NUISANCES, Options
from hil.friction.terms import LAWS

ASKED = [
    *(("friction", law) for law in LAWS),
    *(("nuisance", name) for name in NUISANCES),
    *(("covariance", rule) for rule in COVARIANCES if rule != DEFAULTS.covariance),
]


def options(option: str, value: str) -> Options:
    return Options(**{option: (value,) if option == "nuisance" else value})  # type: ignore[arg-type]


@pytest.mark.parametrize("method", METHODS)
def test_defaults_go_with_every_method(method: str) -> None:
    refuse_without_effect(method, DEFAULTS)


@pytest.mark.parametrize(("method", "asked"), list(product(METHODS, ASKED)))
def test_an_option_has_an_effect_or_is_refused(method: str, asked: tuple[str, str]) -> None:
    option, value = asked
    effective = dict(
        zip(
            ("friction", "nuisance", "covariance"), EFFECTIVE.get(method, CONVENTIONAL), strict=True
        )
    )
    if value in effective[option]:
        refuse_without_effect(method, options(option, value))
        return
    words = f"{option} {value!r} has no effect on method {method!r}"
    with pytest.raises(Mismatch, match=re.escape(words)):
        refuse_without_effect(method, options(option, value))


def test_nothing_may_be_looked_for() -> None:
    for method in METHODS:
        refuse_without_effect(method, Options(nuisance=()))
