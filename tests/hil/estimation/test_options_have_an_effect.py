"""Every option is compatible with every method, or refused with an alternative."""

from __future__ import annotations

import re

import pytest

from hil.errors import Mismatch
from hil.estimation.identify import METHODS, refuse_without_effect
from hil.estimation.options import COVARIANCES, DEFAULTS, NUISANCES, Options
from hil.friction.terms import LAWS

CHOSEN = {"joint", "free motion"}
"""Methods that choose friction law and all nuisance parameters themselves."""
ROBUST = {*CHOSEN, "improved", "back and forth"}
"""Methods whose standard errors are available by any covariance rule."""
COMPOSES = {
    **{("friction", law): CHOSEN for law in LAWS},
    **{("nuisance", name): CHOSEN for name in ("presliding", "drift")},
    **{("nuisance", name): CHOSEN | {"improved"} for name in ("lag", "compliance")},
    **{("covariance", rule): ROBUST for rule in COVARIANCES},
    ("covariance", "jackknife"): set(METHODS),
}
"""Methods on which an option has an effect, by option and value."""


@pytest.mark.parametrize("method", METHODS)
def test_defaults_go_with_every_method(method: str) -> None:
    refuse_without_effect(method, DEFAULTS)
    refuse_without_effect(method, Options(nuisance=()))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("option", "value"), COMPOSES)
def test_an_option_has_an_effect_or_is_refused(method: str, option: str, value: str) -> None:
    asked = Options(**{option: (value,) if option == "nuisance" else value})  # type: ignore[arg-type]
    if method in COMPOSES[option, value] or value == getattr(DEFAULTS, option):
        refuse_without_effect(method, asked)
        return
    words = f"{option} {value!r} has no effect on method {method!r} (with an effect: "
    with pytest.raises(Mismatch, match=re.escape(words)):
        refuse_without_effect(method, asked)


def test_every_value_is_stated() -> None:
    stated = {value for _, value in COMPOSES}
    assert stated == {*LAWS, *NUISANCES, *COVARIANCES}
