"""Verdict of an identification: the worst finding, preceded by any cause found."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from small_run import identified_model, write_run

from checked_files.yaml_file import FileError
from hil.errors import NotIdentifiable
from hil.estimation.excluded.result import Excluded, Found, Limit
from hil.model.robot import Robot
from hil.results import identification
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.validation import judged, scored
from hil.results.verdict import verdict
from hil.runs.journal import FIRST, LAST

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STATED = {"torque_constant_uncertainty": 0.02, "rotor_inertia_uncertainty": 0.05}


@pytest.fixture(scope="module")
def model() -> Model:
    return identified_model()


def proof(*found: Found) -> Excluded:
    return Excluded(found=found, limits=(), tests=1)


def test_a_cause_that_was_found_comes_before_everything_else(model: Model) -> None:
    zero = Found(
        cause="joint offset", axes=(3,), detail="joint offset error 20.1 ± 0.2 degrees", left=0.1
    )  # fmt: skip
    loose = replace(model, scatter_covariance=1e6 * model.scatter_covariance)
    found = verdict(replace(loose, excluded=proof(zero)))
    assert str(found).startswith("failed: axis 3: joint offset error 20.1 ± 0.2 degrees; correct")
    little = zero.model_copy(update={"left": 0.98})
    assert verdict(replace(model, excluded=proof(little))).word == "doubtful"


def test_a_cause_counts_by_how_far_it_moves_the_torques(model: Model) -> None:
    def judged(share: float) -> str:
        change = tuple((share * model.values).tolist())
        zero = Found(
            cause="joint offset", axes=(5,), detail="joint offset error", left=0.9, change=change
        )
        return verdict(replace(model, excluded=proof(zero))).word

    assert judged(0.2) == "failed"
    assert judged(0.05) == "doubtful"
    assert judged(1e-5) == "good"  # less than the uncertainty of the torques


def test_a_cause_that_the_estimate_fits_itself_is_a_note(model: Model) -> None:
    change = tuple((0.2 * model.values).tolist())
    load = Found(
        cause="friction of the load", axes=(2,), left=0.3, change=change,
        detail="friction grows with the transmitted torque by 3.73 ± 0.4 %",
    )  # fmt: skip
    found = verdict(replace(model, excluded=proof(load)))
    assert found.word == "good"
    assert any("axis 2: friction grows with" in each.reason for each in found.reasons)


def test_of_two_causes_that_cannot_be_told_apart_none_is_to_be_corrected_at_once(
    model: Model,
) -> None:
    zero = "axis 5: joint offset error 18.9 ± 0.2 degrees"
    load = Found(
        cause="load", axes=(6,), detail="a load on the last link", left=0.87, others=(zero,)
    )
    assert str(verdict(replace(model, excluded=proof(load)))).startswith(
        "doubtful: axis 6: a load on the last link; or axis 5: joint offset error 18.9 ± 0.2 "
        "degrees: indistinguishable in these data; determine which of these causes applies before "
        "any change: take the load off"
    )


def test_a_cause_comes_before_what_a_method_refuses(
    manutec: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = "recordings exchanged"
    exchanged = proof(Found(cause="two axes exchanged", axes=(5, 6), detail=words, left=0.7))

    def refuse(*_given: object) -> None:
        raise NotIdentifiable("9 measurements do not identify p5; measure more configurations")

    monkeypatch.setattr(identification, "estimate", refuse)
    monkeypatch.setattr(identification, "proved", lambda *_given: exchanged)
    run = write_run(tmp_path / "run", manutec, seed=1)
    with pytest.raises(NotIdentifiable, match=r"axes 5 and 6: recordings exchanged; exchange"):
        identify(run)


def limit(cause: str, axis: int, size: float | None, torque: float = 0.01) -> Limit:
    return Limit(cause=cause, axis=axis, part="", unit="%", size=size, torque=torque)


def reasons_within(model: Model, *limits: Limit) -> tuple[str, Array]:
    """Return reasons of a good model with this excluded cause, and the figures in them."""
    found = verdict(replace(model, excluded=Excluded(found=(), limits=limits, tests=1)))
    assert found.word == "good"
    reason = "; ".join(each.reason for each in found.reasons)
    return reason, np.array(re.findall(r"within ([\d.]+) % \(1 sigma\)", reason), float)


def affected(model: Model) -> Model:
    """Return a model whose parameters change by ten times their errors by a usual drive error."""
    error = 10.0 * np.sqrt(np.diag(model.covariance))
    return replace(model, effect=error[:, np.newaxis] / model.robot.usual_uncertainty)


def test_a_note_states_what_must_be_right_since_it_does_not_show(model: Model) -> None:
    reason, (stated, usual) = reasons_within(
        model,
        limit("torque constant", 4, None),
        limit("torque constant", 6, 30.0),
        limit("joint offset", 5, 2.0, torque=0.02),
    )
    assert usual > stated
    assert (
        "provided that effects invisible in the recordings are as stated; not shown by recordings"
        in reason
    )
    assert (
        "torque constant (axes 4, 6) ±10 %, joint offset (axis 5) ±0.5 %; with these usual"
        in reason
    )


def test_what_shows_in_its_usual_size_is_no_condition(model: Model) -> None:
    reason, stated = reasons_within(affected(model), limit("torque constant", 4, 0.1))
    assert len(stated) == 1
    assert "if" not in reason


def test_a_tolerance_counts_as_far_as_it_would_not_be_found(model: Model) -> None:
    hidden, seen = limit("rotor inertia", 1, None), [
        limit(cause, axis, 0.01)
        for cause in ("torque constant", "rotor inertia")
        for axis in range(1, 7)
        if (cause, axis) != ("rotor inertia", 1)
    ]  # fmt: skip
    _, (_, alone) = reasons_within(affected(model), hidden, *seen)
    _, (_, every) = reasons_within(affected(model), hidden)
    assert every / alone == pytest.approx(np.sqrt(12), rel=0.1)


def test_what_parameters_span_and_what_makes_little_torque_is_no_condition(model: Model) -> None:
    reason, stated = reasons_within(
        model, limit("joint offset", 6, None, torque=0.1), limit("backlash", 2, 1.0, torque=1e-4)
    )
    assert len(stated) == 1
    assert "if" not in reason


def test_uncertainties_that_a_robot_file_states_take_the_place_of_usual_tolerances(
    model: Model,
) -> None:
    joints = [
        joint.model_copy(update={"drive": joint.drive.model_copy(update=STATED)})
        for joint in model.robot.file.joints
        if joint.drive
    ]
    file = model.robot.file.model_copy(update={"joints": tuple(joints)})
    robot = Robot(file, model.robot.source, model.robot.text)
    assert not robot.usual_uncertainty.any()
    assert model.robot.usual_uncertainty == pytest.approx(0.1 / np.sqrt(3))
    reason, _ = reasons_within(replace(model, robot=robot), limit("torque constant", 4, None))
    assert reason.count("within") == 1
    assert "stated uncertainties of the drives included" in reason


def test_an_axis_that_is_not_excited_is_named(model: Model) -> None:
    found = verdict(replace(model, scatter_covariance=400.0**2 * model.scatter_covariance))
    assert found.word in ("doubtful", "failed")
    assert "not excited" in found.reason


def test_too_few_measurements_are_a_doubt_in_identification_and_validation(model: Model) -> None:
    few = replace(model, provenance=model.provenance.model_copy(update={"measurements": 15}))
    found = verdict(few)
    assert (found.word, found.reason.split(" are too")[0]) == (
        "doubtful",
        "15 measurements",
    )
    assert judged((), 6, [found]).word == "failed"  # also without scores
    assert scored(few, ()).word == "failed"


def test_wrong_times_that_import_named_come_before_what_the_misfit_suggests(model: Model) -> None:
    warned = (
        "map.yaml:3: joints.1.position: moves by only 1 mm; correct the map, or write accept",
        f"map.yaml:2: time: the map states 400 Hz, 500 Hz fit; {FIRST}, or write accept",
    )
    provenance = model.provenance.model_copy(update={"warnings": warned})
    sign = Found(cause="wrong sign of a torque", axes=(3,), detail="sign", left=0.1)
    for cause, word in ((proof(sign), "failed"), (None, "doubtful")):
        found = verdict(replace(model, provenance=provenance, excluded=cause))
        assert found.word == word
        assert found.reason == "import warned: map.yaml:2: time: the map states 400 Hz, 500 Hz fit"
        assert found.remedy == f"{FIRST}, or write accept"
        assert sum("500 Hz" in each.reason for each in found.reasons) == 1


def test_a_bad_condition_is_a_doubt(model: Model) -> None:
    found = verdict(replace(model, condition=model.condition | {"gravity": 4000.0}))
    assert found.word == "doubtful"
    assert found.reason.startswith("condition number 4e+03 of the gravity parameters")


def test_all_reasons_are_kept_the_worst_first_and_those_of_earlier_versions_are_read(
    model: Model, tmp_path: Path
) -> None:
    path, condition = tmp_path / NAME, model.condition | {"gravity": 4000.0}
    few = model.provenance.model_copy(update={"measurements": 15})
    words = "wrong sign of the torque"
    sign = Found(cause="wrong sign of a torque", axes=(3,), detail=words, left=0.1)
    bad = replace(model, provenance=few, condition=condition, excluded=proof(sign))
    replace(bad, verdict=verdict(bad)).save(path)
    kept = Model.load(path).verdict
    assert kept == verdict(bad)
    assert [each.word for each in kept.reasons] == ["failed", "doubtful", "doubtful", "good"]
    assert all(each.remedy for each in kept.reasons[:-1])
    assert kept.reasons[-1].reason.startswith("residual up to 8 Hz")
    earlier = {"run": "../r", "validated": "", "verdict": "PASS", "reason": "so", "relative": 0.1}
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    del content["verdict"]  # earlier versions called it outcome
    content["outcome"] = {"word": "good", "reason": "so", "remedy": ""}
    path.write_text(yaml.safe_dump(content | {"validations": [earlier]}), encoding="utf-8")
    old = Model.load(path)
    assert (str(old.verdict), old.validations[0].word) == ("good: so", "good")


def test_a_model_that_was_edited_or_cut_off_is_refused(model: Model, tmp_path: Path) -> None:
    path = tmp_path / NAME
    model.save(path)
    whole = path.read_text(encoding="utf-8")
    value = f'"value": {float(model.values[0])}'
    assert value in whole
    path.write_text(whole.replace(value, '"value": 12.0', 1), encoding="utf-8")
    with pytest.raises(
        FileError, match=r"model.yaml:\d+: p1: .* \(edited file\?\); .*hil identify"
    ):
        Model.load(path)
    path.write_text(whole[: whole.index("drive_covariance") - 9], encoding="utf-8")
    with pytest.raises(
        FileError, match=r"model.yaml:\d+: .*, or write the file anew with: hil identify"
    ) as refused:
        Model.load(path)
    assert len(str(refused.value).splitlines()) == 1


def test_a_joint_at_rest_is_stated_after_weightier_doubts(model: Model) -> None:
    warned = (
        f"map.yaml:3: joints.1.position: moves by only 1 mm; {LAST}, or write accept",
        "map.yaml:5: joints.2.torque: is saturated; correct the map, or write accept",
    )
    provenance = model.provenance.model_copy(update={"warnings": warned})
    condition = model.condition | {"gravity": 4000.0}
    found = verdict(replace(model, provenance=provenance, condition=condition))
    begins = [each.reason.split(":")[0] for each in found.reasons]
    assert begins[0] == "import warned"
    assert "joints.2.torque" in found.reason
    doubts = [each.reason for each in found.reasons if each.word == "doubtful"]
    assert "joints.1.position" in doubts[-1]
    assert any("condition number" in each for each in doubts[1:-1])
