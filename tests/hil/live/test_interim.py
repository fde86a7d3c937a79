"""Interim estimates during a run: shrinking intervals, predicted torques."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_run import write_run
from synthetic import TABLE_3_A
from unpacked import unpacked

from hil.cli.try_plans import interleave
from hil.live import estimator
from hil.live.interim import Interim
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, manutec: Robot) -> Run:
    """Run with known truth, with one measurement in a separate folder."""
    path = tmp_path_factory.mktemp("interim") / "run"
    write_run(path, manutec)
    return Run.open(path)


@pytest.fixture(scope="module")
def shown(run: Run) -> tuple[list[Any], list[Any]]:
    """Return lines of estimates and of torques, recording by recording."""
    interim, recorded = Interim(run.robot), {each.measurement.id: each for each in run}
    estimates, torques = [], []
    for motion in interleave(run.plan.measurements):
        torques += interim.take(motion, recorded[motion.id].recording)
        estimates.append(interim.parameters())
    return estimates, torques


def shares(estimate: Any) -> np.ndarray:
    found = [each["share"] for each in estimate["parameters"]]
    return np.array([np.nan if each is None else each for each in found])


def test_intervals_shrink_and_hold_the_truth(shown: tuple[list[Any], list[Any]]) -> None:
    estimates, _ = shown
    assert [each["recordings"] for each in estimates] == list(range(1, len(estimates) + 1))
    first, last = shares(estimates[0]), shares(estimates[-1])
    assert np.isnan(first).sum() > 10  # one measurement determines a few parameters at most
    half_way = shares(estimates[len(estimates) // 2])
    assert np.all(half_way < 0.5)
    assert np.all(last < 5e-3)
    assert np.median(last / half_way) < 0.3
    rows = estimates[-1]["parameters"]
    missed = [abs(row["value"] - p) > row["half"] for row, p in zip(rows, TABLE_3_A, strict=True)]
    assert sum(missed) <= 2
    json.dumps(estimates, allow_nan=False)


def test_torques_are_predicted_before_they_are_used_and_lie_in_their_band(
    shown: tuple[list[Any], list[Any]],
) -> None:
    _, torques = shown
    inside: list[bool] = []
    for line in torques:
        tracks = [line[name][0]["value"] for name in ("torque", "predicted", "band")]
        measured, predicted, band = map(unpacked, tracks)
        assert len(line["torque"][0]["time"]["differences"]) == len(band) <= 120
        if np.isfinite(band).all():
            inside += list(np.abs(measured - predicted) <= band)
    assert len(inside) > 500
    assert 0.9 < np.mean(inside) <= 1.0
    json.dumps(torques, allow_nan=False)


def test_torques_are_shown_from_the_first_recording_on(shown: tuple[list[Any], list[Any]]) -> None:
    _, torques = shown
    known = [np.isfinite(unpacked(line["predicted"][0]["value"])).all() for line in torques]
    assert (known[0], known[-1]) == (False, True)
    assert np.isfinite(unpacked(torques[0]["torque"][0]["value"])).all()
    assert unpacked(torques[0]["torque"][0]["value"]).any()


def test_the_process_reads_what_lines_name_and_passes_over_the_rest(
    run: Run, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Earlier recordings come first if a run is resumed."""
    names = [motion.id for motion in run.motions]
    lines = [{"kind": "event", "name": "Recorded", "measurement": each} for each in (*names, "x")]
    text = "".join(json.dumps(each) + "\n" for each in ({"kind": "start"}, *lines)).encode()
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text)))
    monkeypatch.setattr("os.nice", lambda _: 0)
    estimator.main(str(run.path))
    said = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert said[0] == {"kind": "ready", "text": ""}
    assert said[-1]["kind"] == "estimate"
    assert said[-1]["recordings"] == len(names)
    assert np.all(shares(said[-1]) < 5e-3)


def test_the_process_ends_with_a_run_that_recorded_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"")))
    monkeypatch.setattr("os.nice", lambda _: 0)
    estimator.main(str(tmp_path / "none"))
    assert len(capsys.readouterr().out.splitlines()) == 1
