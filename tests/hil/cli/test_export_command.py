"""`hil export`: written files, their stated origin, and refusals."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from small_run import identified_run, write_run

from hil.export.formats import FORMATS, RECORDINGS, SIMULATORS
from hil.results.judgement import Judgement, KeptJudgement
from hil.results.model import Model
from hil.results.model_file import NAME

if TYPE_CHECKING:
    from command_line import Hil

    from hil.model.robot import Robot


GUIDES = Path(__file__).parents[3] / "docs" / "how-to"
HOW_TO = (GUIDES / "export.md").read_text(encoding="utf-8")
HOW_TO_RECORDINGS = GUIDES / "other-tools.md"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of an identified run."""
    return identified_run(tmp_path_factory.mktemp("export") / "run")


def judged(model: Model, word: str) -> Model:
    judgement = KeptJudgement(
        run="../other", validated="2026-01-02T03:04:05Z", word=word, reason="why", relative=0.01
    )
    return replace(model, validations=(judgement,))


def test_the_json_file_holds_the_model_s_numbers(hil: Hil, run: Path, tmp_path: Path) -> None:
    status, out, _ = hil("export", run, "--to", "json", "-o", tmp_path / "out")
    assert status == 0
    assert "model.json" in out
    model, content = Model.load(run), json.loads((tmp_path / "out" / "model.json").read_text())
    stated = content["base_parameters"]
    assert [each["value"] for each in stated] == model.values.tolist()
    assert [each["name"] for each in stated] == list(model.names)
    assert np.array_equal(content["covariance"], model.covariance)
    inertias = [joint["reflected_inertia"] for joint in content["joints"]]
    assert inertias == model.robot.reflected_inertia.tolist()


def test_file_and_terminal_say_that_no_validation_passed(
    hil: Hil, run: Path, tmp_path: Path
) -> None:
    _, out, _ = hil("export", run, "--to", "json", "-o", tmp_path)
    assert "no validation passed" in out
    origin = json.loads((tmp_path / "model.json").read_text())["origin"]
    assert any("no validation passed" in line for line in origin)


@pytest.mark.parametrize(("word", "confirmed"), [("good", True), ("doubtful", False)])
def test_a_verdict_is_stated_with_its_reason(
    hil: Hil, run: Path, tmp_path: Path, word: str, confirmed: bool
) -> None:
    judged(Model.load(run), word).save(tmp_path / NAME)
    _, out, _ = hil("export", tmp_path / NAME, "--to", "json", "-o", tmp_path)
    assert f"validation on ../other (2026-01-02T03:04:05Z): {word}: why" in out
    assert ("no validation passed" in out) is not confirmed
    origin = "\n".join(json.loads((tmp_path / "model.json").read_text())["origin"])
    assert f"{word}: why" in origin
    assert "robot manutec-r15" in origin
    assert "improved method" in origin


def spoilt(run: Path, folder: Path) -> Path:
    """Return a folder whose model's identification failed."""
    model = Model.load(run)
    outcome = Judgement(word="failed", reason="axes 2 and 3 exchanged", remedy="exchange them")
    folder.mkdir(exist_ok=True)
    replace(model, verdict=outcome).save(folder / NAME)
    return folder


@pytest.fixture(autouse=True)
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.export.data_files.SAMPLES", 1)


@pytest.mark.parametrize("to", [*FORMATS, *SIMULATORS])
def test_a_failed_model_is_written_by_force_alone_and_every_file_says_so_on_top(
    hil: Hil, run: Path, tmp_path: Path, to: str
) -> None:
    folder = spoilt(run, tmp_path / "failed")
    status, _, err = hil("export", folder, "--to", to, "-o", tmp_path / "out")
    assert status == 3
    assert "identification failed: axes 2 and 3 exchanged; exchange them; --force" in err
    assert not (tmp_path / "out").exists()
    status, out, _ = hil("export", folder, "--to", to, "-o", tmp_path / "out", "--force")
    assert status == 0
    assert "FAILED: axes 2 and 3 exchanged" in out
    for file in (tmp_path / "out").iterdir():
        head = "".join(file.read_text().splitlines(keepends=True)[:4])
        assert "FAILED: axes 2 and 3 exchanged; exchange them" in head, file


@pytest.mark.parametrize("to", [*FORMATS, *SIMULATORS])
def test_a_model_of_simulated_runs_says_so_on_top_of_every_file(
    hil: Hil, run: Path, tmp_path: Path, to: str
) -> None:
    model = Model.load(run)
    made = model.provenance.model_copy(update={"simulated": None, "bus": "sim_plant manutec-r15"})
    replace(model, provenance=made).save(tmp_path / NAME)
    _, out, _ = hil("export", tmp_path / NAME, "--to", to, "-o", tmp_path / "out")
    assert "SIMULATED: measured on the virtual plant" in out
    for file in (tmp_path / "out").iterdir():
        head = "".join(file.read_text().splitlines(keepends=True)[:4])
        assert "SIMULATED: measured on the virtual plant, no real machine" in head, file


def test_the_how_to_s_commands_work_and_it_names_every_format(
    hil: Hil, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(run, "runs/first")
    commands = re.findall(r"(?m)^hil export runs/first [^#\n]*", HOW_TO)
    assert {line.split()[4] for line in commands} == {*FORMATS, *SIMULATORS}
    for line in commands:
        status, _, err = hil(*line.split()[1:])
        assert (status, err) == (0, ""), line
    header = (tmp_path / "code" / "manutec_r15_dynamics.h").read_text()
    for function in re.findall(r"`(manutec_r15_[a-z_]+)` \|", HOW_TO):
        assert f"static inline void {function}(" in header


def test_an_unknown_format_is_refused_and_all_are_named(
    hil: Hil, run: Path, tmp_path: Path
) -> None:
    status, _, err = hil("export", run, "--to", "simulink", "-o", tmp_path / "out")
    assert status == 1
    assert "simulink: unknown format; available: c, python, st, json, friction" in err
    assert "of recordings: mcap, csv, parquet" in err
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_there_is_not_replaced(hil: Hil, run: Path, tmp_path: Path) -> None:
    (tmp_path / "model.json").write_text("mine")
    status, _, err = hil("export", run, "--to", "json", "-o", tmp_path)
    assert status == 1
    assert "already exists" in err
    assert (tmp_path / "model.json").read_text() == "mine"


def test_a_run_that_was_not_identified_is_refused_with_the_remedy(hil: Hil, tmp_path: Path) -> None:
    status, _, err = hil("export", tmp_path, "--to", "json", "-o", tmp_path / "out")
    assert status == 1
    assert "hil identify" in err


def test_the_commands_of_other_tools_work_and_name_every_format(
    hil: Hil, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(run, "runs/first")
    text = HOW_TO_RECORDINGS.read_text(encoding="utf-8")
    commands = re.findall(r"(?m)^hil export runs/first [^#\n]*", text)
    assert {line.split()[4] for line in commands} == {*RECORDINGS}
    for line in commands:
        status, _, err = hil(*line.split()[1:])
        assert (status, err) == (0, ""), line
    for place in re.findall(r"`((?:mcap|csv|parquet)/[\w/.]+)`", text):
        assert (tmp_path / place).is_file()


def test_recordings_need_no_model(hil: Hil, manutec: Robot, tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", manutec)
    status, out, err = hil("export", folder.path, "--to", "csv", "-o", tmp_path / "out")
    assert (status, err) == (0, "")
    assert f"written: {tmp_path / 'out' / 'index.csv'}" in out
    status, _, err = hil("export", tmp_path / "run", "--to", "simulnk", "-o", tmp_path / "other")
    assert status == 1
    assert "simulnk: unknown format" in err


def test_a_model_s_file_has_no_recordings(hil: Hil, run: Path, tmp_path: Path) -> None:
    status, _, err = hil("export", run / NAME, "--to", "mcap", "-o", tmp_path / "out")
    assert status == 1
    assert "model.yaml: is a file, but format mcap holds the recordings of a run; name" in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("to", "option"),
    [
        ("csv", ("--urdf", "arm.urdf")),
        ("mcap", ("--mass", "1:0:5")),
        ("json", ("--without", "g01")),
        ("csv", ("--force",)),
    ],
)
def test_an_option_that_a_format_has_no_use_for_is_refused(
    hil: Hil, run: Path, tmp_path: Path, to: str, option: tuple[str, ...]
) -> None:
    status, _, err = hil("export", run, "--to", to, "-o", tmp_path / "out", *option)
    assert status == 2
    assert f"not applicable to {to}" in err
    assert not (tmp_path / "out").exists()
