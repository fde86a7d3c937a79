"""Findings of a run are kept exactly as long as they remain valid."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any
from unittest.mock import Mock

import numpy as np
import pytest
from small_run import write_run

from checked_files.yaml_file import FileModel
from hil.report.page import report
from hil.results import findings
from hil.results.findings import NAME, _digest, follow_from, keep, kept
from hil.results.identification import identified
from hil.runs.pooling import recorded
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot
    from hil.results.findings import Findings


@pytest.fixture(scope="module")
def run(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_run(tmp_path_factory.mktemp("kept") / "run", manutec)


@pytest.fixture(scope="module")
def found(run: Run) -> Findings:
    campaign = tuple(run)
    made = follow_from(run, identified(run).model, campaign, tuple(recorded(campaign)))
    keep(run, made)
    return made


@pytest.fixture
def copy(run: Run, found: Findings, tmp_path: Path) -> Path:
    del found
    shutil.copytree(run.path, tmp_path / "run")
    return tmp_path / "run"


def differences(one: Any, other: Any, place: str = "") -> list[str]:
    """Return the different fields of two records; the robot comes from its own file."""
    if isinstance(one, np.ndarray | float):
        same = np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f")
        return [] if same else [place]
    if type(one) is not type(other):
        return [f"{place}: {type(one).__name__} and {type(other).__name__}"]
    if isinstance(one, FileModel | str | int | None):
        return [] if one == other else [place]
    if is_dataclass(one):
        parts = {each.name: getattr(one, each.name) for each in fields(one)}
        theirs = {name: getattr(other, name) for name in parts}
    else:
        both = (x if isinstance(x, dict) else dict(enumerate(x)) for x in (one, other))
        parts, theirs = both
    assert parts.keys() == theirs.keys(), place
    return [
        each
        for name, part in parts.items()
        if name != "robot"
        for each in differences(part, theirs[name], f"{place}.{name}")
    ]


def test_what_is_read_is_what_was_kept_to_the_last_digit(run: Run, found: Findings) -> None:
    again = kept(Run.open(run.path))
    assert again is not None
    assert differences(found, again) == []
    assert again.model.robot.digest == found.model.robot.digest


def test_a_run_without_it_has_nothing_kept(copy: Path) -> None:
    (copy / NAME).unlink()
    assert kept(Run.open(copy)) is None


def test_another_recording_ends_it(copy: Path) -> None:
    (copy / "recordings" / "i05.h5").unlink()
    assert kept(Run.open(copy)) is None


def test_so_does_a_measurement_left_out(copy: Path) -> None:
    assert kept(Run.open(copy)) is not None
    assert kept(Run.open(copy).exclude(["i05"])) is None


def test_and_another_program(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(findings, "_program", lambda: "another one")
    assert kept(Run.open(copy)) is None


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[:-100],
        lambda text: text.replace("improved", "improvised", 1),
        lambda _: "[]",
        lambda _: json.dumps({"state": "", "digest": "", "content": 1}),
        lambda _: "[" * 100_000,
    ],
)
def test_a_damaged_file_is_as_none(copy: Path, damage: Any) -> None:
    path = copy / NAME
    path.write_text(damage(path.read_text()))
    assert kept(Run.open(copy)) is None


@pytest.mark.parametrize(
    "foreign",
    [
        {"record": "hil.results.findings:import_module", "value": "stranger"},
        {"record": "hil.view.page:CDLL", "value": None},
        {"record": "hil.results.findings:Path", "value": "a"},
        {"record": "hil.runs.run:Run.open", "value": "a"},
        {"record": "hil.view.page:Markup", "value": "<b>"},
        {"record": "hil.results.findings:RunStamp", "value": "a"},
        {"array": ["a"], "kind": "<U1000000"},
        {"array": ["a"], "kind": "O"},
    ],
    ids=lambda foreign: foreign.get("record", foreign.get("kind")),
)
def test_a_stranger_s_file_restores_records_of_findings_and_calls_nothing_else(
    copy: Path, foreign: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    (copy / "stranger.py").write_text("from pathlib import Path\nPath('ran').touch()\n")
    monkeypatch.chdir(copy)
    monkeypatch.syspath_prepend(copy)
    whole = json.loads((copy / NAME).read_bytes())
    content = json.loads(whole["content"])
    content[3] = [foreign]  # advice may have any length
    text = json.dumps(content)
    digest = _digest(text)  # simulate a stranger with the key
    (copy / NAME).write_text(json.dumps(whole | {"content": text, "digest": digest}))
    assert kept(Run.open(copy)) is None
    assert not (copy / "ran").exists()


@pytest.mark.parametrize("value", ["text", None, [], {"array": [1.0], "kind": "<f8"}])
@pytest.mark.parametrize("field", ["residual", "local", "friction_law"])
def test_a_report_of_a_stranger_s_records_with_wrong_fields_is_estimated_anew(
    copy: Path, found: Findings, field: str, value: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    anew = Mock(return_value=found)
    monkeypatch.setattr(findings, "identify_and_keep", anew)
    whole = json.loads((copy / NAME).read_bytes())
    content = json.loads(whole["content"])
    content[0]["fields"][field] = value
    text = json.dumps(content)
    digest = hashlib.sha256(text.encode()).hexdigest()
    (copy / NAME).write_text(json.dumps(whole | {"content": text, "digest": digest}))
    assert report(copy).is_file()
    anew.assert_called_once()


def test_findings_of_another_user_are_none_whatever_they_state(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert kept(Run.open(copy)) is not None
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "another"))
    assert kept(Run.open(copy)) is None
    assert (tmp_path / "another" / "hil" / "key").stat().st_mode & 0o777 == 0o600


def test_without_a_folder_for_a_key_findings_are_those_of_the_process(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    assert kept(Run.open(copy)) is None
    report(Run.open(copy))
    assert kept(Run.open(copy)) is not None


def test_a_report_with_it_is_the_report_without(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hil.show.html.now", lambda: "2026-01-02T03:04:05+00:00")
    quick = report(Run.open(copy)).read_text()
    (copy / NAME).unlink()
    assert report(Run.open(copy)).read_text() == quick
    assert kept(Run.open(copy)) is not None


def test_with_it_nothing_is_estimated(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("estimated although it is kept")

    monkeypatch.setattr("hil.results.identification.identified", refuse)
    assert report(Run.open(copy)).exists()
