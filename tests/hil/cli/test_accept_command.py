"""`hil accept`: judgement of a run by limits, page, JUnit XML, and
limits drafted from a good run.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import pytest
import yaml
from small_run import identified_run

from drivers.drive_bus import SampleFlag
from hil.runs.recording_file import read_measured, write_measured
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from command_line import Hil


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return identified_run(tmp_path_factory.mktemp("accept") / "run")


@pytest.fixture
def limits(run: Path, tmp_path: Path, hil: Hil) -> Path:
    path = tmp_path / "limits.yaml"
    status, out, _ = hil("accept", run, "--draft", "-o", path)
    assert (status, str(path) in out) == (0, True)
    content = yaml.safe_load(path.read_text())
    content["outcome"] = "failed"  # few measurements: not good
    path.write_text(yaml.safe_dump(content))
    return path


def change(limits: Path, **values: object) -> None:
    limits.write_text(yaml.safe_dump(yaml.safe_load(limits.read_text()) | values))


def test_a_run_passes_the_limits_that_were_drafted_from_it(
    hil: Hil, run: Path, limits: Path, tmp_path: Path
) -> None:
    output = tmp_path / "accepted"
    given = "--serial", "R15-0042", "--operator", "A. <Smith>"
    status, out, _ = hil("accept", run, "--limits", limits, "-o", output, *given)
    assert (status, "good: " in out) == (0, True)
    page = (output / "acceptance.html").read_text()
    assert "R15-0042" in page
    assert "A. &lt;Smith&gt;" in page
    assert "drive no. 3" in page
    suite = ET.parse(output / "acceptance.xml").getroot()  # noqa: S314 - written by us
    assert suite.get("failures") == "0"
    assert "gravity of axis 2 (p5)" in {case.get("name") for case in suite}


def test_a_value_outside_its_limits_fails_with_exit_status_3(
    hil: Hil, run: Path, limits: Path, tmp_path: Path
) -> None:
    p5 = {"name": "p5", "unit": "kg m", "least": 50.0, "most": 51.0}
    change(limits, quantities=[p5])
    status, out, _ = hil("accept", run, "--limits", limits, "-o", tmp_path / "out")
    assert (status, "failed: 1 of " in out) == (3, True)
    assert "is outside its limits: gravity of axis 2 (p5)" in out
    suite = ET.parse(tmp_path / "out" / "acceptance.xml").getroot()  # noqa: S314 - written by us
    (failure,) = suite.iter("failure")
    assert "must be at least 50 and at most 51" in str(failure.get("message"))
    page = (tmp_path / "out" / "acceptance.html").read_text()
    assert "<strong>failed</strong> 1 of " in page
    first = page.split("<tbody>", 2)[1].split("</tr>")[0]
    assert "gravity of axis 2 (p5)" in first


@pytest.mark.parametrize(
    "unknown",
    [
        {"name": "p99", "unit": "kg m", "least": 0.0, "most": 1.0},
        {"name": "friction", "unit": "N m", "axis": 9, "speed": 1.0, "least": 0.0, "most": 1.0},
    ],
)
def test_what_was_not_identified_does_not_pass(
    hil: Hil, run: Path, limits: Path, tmp_path: Path, unknown: dict[str, object]
) -> None:
    change(limits, quantities=[unknown], residual={})
    assert hil("accept", run, "--limits", limits, "-o", tmp_path / "out")[0] == 3
    assert "was not identified" in (tmp_path / "out" / "acceptance.xml").read_text()


def test_a_missing_measurement_fails_unless_the_limits_allow_it(
    hil: Hil, run: Path, limits: Path, tmp_path: Path
) -> None:
    copy = shutil.copytree(run, tmp_path / "run")
    (copy / "recordings" / f"{Run.open(copy).ids[0]}.h5").unlink()
    assert hil("accept", copy, "--limits", limits, "-o", tmp_path / "a")[0] == 3
    change(limits, missing=1)
    assert hil("accept", copy, "--limits", limits, "-o", tmp_path / "b")[0] == 0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"robot": "kr16"}, "the limits are for kr16"),
        ({"outcome": "fine"}, "limits.yaml:"),
        ({"quantites": []}, "did you mean quantities?"),
        (
            {"quantities": [{"name": "p5", "unit": "kg m", "least": 2.0, "most": 1.0}]},
            "least 2 must not exceed most 1",
        ),
    ],
)
def test_unfit_limits_are_refused_with_status_1(
    hil: Hil, run: Path, limits: Path, tmp_path: Path, values: dict[str, object], message: str
) -> None:
    change(limits, **values)
    status, _, err = hil("accept", run, "--limits", limits, "-o", tmp_path / "out")
    assert (status, message in err) == (1, True)


def test_a_draft_is_not_written_over_limits_that_are_there(
    hil: Hil, run: Path, limits: Path
) -> None:
    status, _, err = hil("accept", run, "--draft", "-o", limits)
    assert (status, "already exists" in err) == (1, True)


def test_a_run_without_a_model_names_the_command_that_makes_it(
    hil: Hil, run: Path, limits: Path, tmp_path: Path
) -> None:
    copy = shutil.copytree(run, tmp_path / "run")
    (copy / "model.yaml").unlink()
    status, _, err = hil("accept", copy, "--limits", limits, "-o", tmp_path / "out")
    assert (status, f"hil identify {copy}" in err) == (1, True)


def test_samples_are_counted_from_the_recordings(
    hil: Hil, run: Path, limits: Path, tmp_path: Path
) -> None:
    """The journal of a killed session may lack recordings."""
    copy = tmp_path / "killed"
    shutil.copytree(run, copy)
    for path in sorted((copy / "recordings").glob("*.h5"))[:3]:
        measured = read_measured(path)
        flags = measured.recording.flags.copy()
        flags[:40] = SampleFlag.LATE
        recording = replace(measured.recording, flags=flags)
        write_measured(path, replace(measured, recording=recording), Run.open(copy).robot)
    assert all(session.sync.samples == 0 for session in Run.open(copy).journal.sessions)
    change(limits, flagged=1e-4)
    status, out, _ = hil("accept", copy, "--limits", limits, "-o", tmp_path / "accepted")
    assert status == 3
    assert "samples flagged" in out
