"""Every option is compatible with every method and every kind of load, or refused."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from free_run import write_free_run
from small_run import write_run
from trajectory_run import recorded, some_trajectory

from hil.errors import Mismatch
from hil.estimation.identify import METHODS, refuse_without_effect
from hil.estimation.options import COVARIANCES, DEFAULTS, NUISANCES, Options
from hil.friction.terms import LAWS
from hil.planning.free_motion import FreeMotion
from hil.results.load import LoadProblem
from hil.results.problem import regression
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot

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


@pytest.fixture(scope="module")
def runs(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    """Runs of strokes and of free motions, twice each, by name."""
    place: Path = tmp_path_factory.mktemp("loads")
    ((of_strokes, recording),) = recorded(manutec, some_trajectory(manutec))
    motion = FreeMotion(id="csv", q=of_strokes.q, duration=30.0, cycles=2, source="made")
    found = {}
    for name in ("bare", "loaded"):
        write_run(place / f"{name} strokes", manutec)
        found[f"{name} strokes"] = Run.open(place / f"{name} strokes")
        imported = write_free_run(place / f"{name} import", manutec, [(motion, recording)])
        found[f"{name} import"] = imported
    return found


@pytest.mark.parametrize(("option", "value"), COMPOSES)
@pytest.mark.parametrize(
    ("bare", "loaded", "method"),
    [
        ("bare strokes", "loaded strokes", "improved"),
        ("bare import", "loaded import", "free motion"),
        ("bare strokes", "loaded import", "joint"),
        ("bare import", "loaded strokes", "joint"),
    ],
)
def test_an_option_has_an_effect_on_a_load_or_is_refused(
    bare: str, loaded: str, method: str, option: str, value: str, runs: dict[str, Run]
) -> None:
    asked: dict[str, Any] = {option: value}
    if method in COMPOSES[option, value]:
        problem = regression(runs[bare], loaded=[runs[loaded]], **asked)
        assert isinstance(problem, LoadProblem)
        assert getattr(problem.bare.options, option) in (value, (value,))
        return
    with pytest.raises(Mismatch, match=f"{option} '{value}' has no effect on method '{method}'"):
        regression(runs[bare], loaded=[runs[loaded]], **asked)


def test_every_value_is_stated() -> None:
    stated = {value for _, value in COMPOSES}
    assert stated == {*LAWS, *NUISANCES, *COVARIANCES}
