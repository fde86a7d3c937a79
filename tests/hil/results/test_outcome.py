"""What an identification is worth: the worst of what speaks against it, a mistake before all."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from small_run import write_run

from checked_files.yaml_file import FileError
from hil.estimation.mistakes.mistake import Mistake, MistakeName
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.outcome import outcome
from hil.results.validation import validate
from hil.results.verdict import judged

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot


@pytest.fixture(scope="module")
def model(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Model:
    return identify(write_run(tmp_path_factory.mktemp("run") / "run", manutec, seed=1))


def test_a_mistake_comes_before_everything_else(model: Model) -> None:
    mistake = Mistake(MistakeName.ZERO, (3,), "its zero is off by 20.1 ± 0.2 degrees", left=0.1)
    found = outcome(replace(model, scatter_covariance=1e6 * model.scatter_covariance), mistake)
    assert str(found).startswith("failed: axis 3: its zero is off by 20.1 ± 0.2 degrees; correct")
    assert outcome(model, replace(mistake, left=0.98)).word == "doubtful"


def test_an_axis_that_is_not_excited_is_named(model: Model) -> None:
    found = outcome(replace(model, scatter_covariance=400.0**2 * model.scatter_covariance))
    assert found.word in ("doubtful", "failed")
    assert "not excited" in found.reason


def test_too_few_measurements_are_a_doubt_in_identification_and_validation(model: Model) -> None:
    few = replace(model, provenance=model.provenance.model_copy(update={"measurements": 15}))
    found = outcome(few)
    assert (found.word, found.reason.split(" are")[0]) == (
        "doubtful",
        f"15 measurements of {len(model.values)} parameters",
    )
    assert judged((), 6, [str(found)]).word == "REFUSE"  # there are no scores either
    assert validate(few, ()).verdict == "REFUSE"


def test_a_bad_condition_is_a_doubt(model: Model) -> None:
    found = outcome(replace(model, condition=model.condition | {"gravity": 4000.0}))
    assert found.word == "doubtful"
    assert found.reason.startswith("condition number 4e+03 of the gravity parameters")


def test_a_model_that_was_edited_or_cut_off_is_refused(model: Model, tmp_path: Path) -> None:
    path = tmp_path / NAME
    model.save(path)
    whole = path.read_text(encoding="utf-8")
    value = f"value: {float(model.values[0])}"
    assert value in whole
    path.write_text(whole.replace(value, "value: 12.0", 1), encoding="utf-8")
    with pytest.raises(FileError, match=r"model.yaml:\d+: p1: .* was edited; .*hil identify"):
        Model.load(path)
    path.write_text(whole[: len(whole) // 3], encoding="utf-8")
    with pytest.raises(
        FileError, match=r"model.yaml:\d+: .*, or write the file anew with: hil identify"
    ) as refused:
        Model.load(path)
    assert len(str(refused.value).splitlines()) == 1
