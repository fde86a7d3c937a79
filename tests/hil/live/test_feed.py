"""Data sent to listeners of a run, none of which can disturb it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import typer
from synthetic import TABLE_3_A, Friction, record
from trajectory_run import recorded as periods
from trajectory_run import some_trajectory

from hil.cli.measuring import OnBus, measure
from hil.live.audience import Audience
from hil.live.feed import FedBus, Feed
from hil.live.lines import level, level_of
from hil.live.listener import Listener, ListenerFailed
from hil.planning.measurement import Gravity
from hil.planning.plan import repeat_measurements
from hil.runs import SIMULATED
from hil.runs.run_folder import RunFolder
from hil.terminal.keys import STATUS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from conftest import IdealBus

    from drivers.drive_bus import Sample
    from hil.model.robot import Robot
    from hil.planning.plan import Plan

SUPPORT = Path(__file__).parents[2] / "support"
HELD = 1.0
"""Time after which a hanging listener is ended, plus a margin [s]."""


@pytest.fixture(autouse=True)
def _support_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(SUPPORT))


def run(plan: Plan, robot: Robot, folder: Path, *manners: str) -> list[Listener]:
    """Measure on the plant with a listener of each behaviour; each writes a file of its name."""
    listeners = [
        Listener(f"listener {manner}", "noting_listener", str(folder.parent / manner), manner)
        for manner in manners
    ]
    how = OnBus(SIMULATED, None, None, None, listeners=listeners)
    measure(plan, robot, Path("plan.yaml"), folder, how)
    return listeners


def lines_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def recorded(folder: Path) -> list[str]:
    return [each.measurement.id for each in RunFolder.open(folder)]


def test_a_listener_is_told_of_everything_in_order(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    run(small_plan, manutec, tmp_path / "run", "note")
    lines = lines_of(tmp_path / "note")
    kinds = [line["kind"] for line in lines]
    assert kinds[0] == "start"
    assert kinds[-2:] == ["off", "end"]
    assert kinds.index("armed") < kinds.index("sample")
    assert lines[-1]["how"] == "finished"
    assert [joint["unit"] for joint in lines[0]["robot"]["joints"]] == ["rad"] * 6
    assert lines[0]["measurements"] == 3
    assert lines[0]["simulated"] is True
    events = [(line["name"], line.get("measurement")) for line in lines if line["kind"] == "event"]
    of_each = [(name, m) for m in ("g1", "i1", "c1") for name in ("Travelled", "Recorded")]
    assert events == [("Started", None), *of_each, ("Finished", None)]
    numbers = [line["number"] for line in lines if line.get("name") == "Recorded"]
    assert numbers == [1, 2, 3]


def test_samples_are_those_of_the_run_and_few(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    run(small_plan, manutec, tmp_path / "run", "note")
    samples = [line for line in lines_of(tmp_path / "note") if line["kind"] == "sample"]
    begun, ended = samples[0]["at"], samples[-1]["at"]
    assert 2 <= len(samples) <= 25 * (ended - begun) + 2
    recordings = {
        round(t, 4): (q, tau)
        for each in RunFolder.open(tmp_path / "run")
        for t, q, tau in zip(each.recording.time, each.recording.q, each.recording.tau, strict=True)
    }
    compared = [(line, recordings[line["t"]]) for line in samples if line["t"] in recordings]
    assert compared
    for line, (q, tau) in compared:
        np.testing.assert_allclose(line["q"], q, atol=1e-6)
        np.testing.assert_allclose(line["tau"], tau, atol=1e-4)


def test_a_live_run_takes_as_many_samples_at_once_as_any_other(
    ideal_bus: IdealBus, manutec: Robot, small_plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    feed = Feed(Audience([]), simulated=True)
    feed.turn_to(manutec, small_plan, None, hand=False, watcher=None)
    asked: list[int] = []

    def samples(limit: int) -> Sequence[Sample]:
        asked.append(limit)
        return [ideal_bus.sample() for _ in range(limit)]

    monkeypatch.setattr(ideal_bus, "samples", samples)
    with FedBus(ideal_bus, feed) as bus:
        taken = bus.samples(9)
        assert (len(taken), taken[-1].time) == (9, ideal_bus.time)
        assert bus.sample().time == ideal_bus.time
    assert asked == [9, 1]


def test_friction_so_far_is_that_of_the_measured_axes(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    run(small_plan, manutec, tmp_path / "run", "note")
    found = [line for line in lines_of(tmp_path / "note") if line["kind"] == "level"]
    assert [(line["axis"], line["measurement"]) for line in found] == [
        (1, "g1"),
        (2, "i1"),
        (0, "c1"),
    ]
    assert all(line["level"] > 0 for line in found)


def test_half_the_difference_forth_and_back_is_the_friction(manutec: Robot) -> None:
    g = Gravity(
        id="g", axis=2, q=(0.0, -0.3, 0.2, 0.0, 0.5, 0.0), stroke=0.8, velocity=0.4,
        acceleration=8.0, cycles=2,
    )  # fmt: skip
    friction = Friction()
    recording = record(manutec, g, TABLE_3_A, friction)
    level = level_of(g, recording)
    assert level is not None
    assert level[1] == pytest.approx(0.4, rel=0.02)
    wanted = friction.torque(np.full((1, 6), 0.4), np.zeros(1))[0, 1]
    assert level[0] == pytest.approx(wanted, rel=0.01)


def test_periods_of_a_trajectory_are_no_strokes(manutec: Robot) -> None:
    trajectory = some_trajectory(manutec)
    ((_, recording),) = periods(manutec, trajectory)
    first = replace(recording, q=recording.q[:, :1], tau=recording.tau[:, :1])
    alone = trajectory.model_copy(
        update={"q": trajectory.q[:1], "sine": trajectory.sine[:1], "cosine": trajectory.cosine[:1]}
    )
    assert alone.read == (0,)
    assert level_of(alone, first) is None


def test_levels_so_far_state_their_number_and_range(manutec: Robot, small_plan: Plan) -> None:
    g1 = small_plan.measurements[0]
    so_far: dict[int, list[float]] = {}
    recording = record(manutec, g1, TABLE_3_A, Friction())
    first = level(g1, recording, so_far)
    again = level(g1, recording, so_far)
    assert first is not None
    assert again is not None
    assert (first["count"], again["count"]) == (1, 2)
    assert again["least"] == again["most"] == first["level"]


def test_a_recording_without_samples_in_the_middle_shows_no_level(
    manutec: Robot, small_plan: Plan
) -> None:
    g1 = small_plan.measurements[0]
    recording = record(manutec, g1, TABLE_3_A, Friction())
    recording.q[:, 1] = math.nan
    assert level_of(g1, recording) is None


def test_a_stop_of_a_listener_is_one_of_the_operator(
    small_plan: Plan, manutec: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as left:
        run(repeat_measurements(small_plan, 10), manutec, tmp_path / "run", "stop", "note")
    assert left.value.exit_code == STATUS
    assert "stopped, the axes are off" in capsys.readouterr().err
    end = lines_of(tmp_path / "note")[-1]
    assert (end["kind"], end["how"]) == ("end", "stopped")
    folder = RunFolder.open(tmp_path / "run")
    assert folder.journal.sessions[0].reason == "interrupted by the operator"
    assert 1 <= len(recorded(tmp_path / "run")) < 30


def test_a_stop_that_comes_when_all_is_over_is_none(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    run(small_plan, manutec, tmp_path / "run", "late")
    folder = RunFolder.open(tmp_path / "run")
    assert [session.reason for session in folder.journal.sessions] == ["finished"]
    assert folder.missing == ()


def test_a_listener_that_ends_is_missed_once_and_the_run_goes_on(
    small_plan: Plan, manutec: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(repeat_measurements(small_plan, 5), manutec, tmp_path / "run", "leave", "note")
    assert capsys.readouterr().out.count("listener leave has ended") == 1
    assert RunFolder.open(tmp_path / "run").missing == ()
    assert lines_of(tmp_path / "note")[-1]["kind"] == "end"


@pytest.mark.long
def test_a_listener_that_never_reads_is_never_waited_for(
    small_plan: Plan, manutec: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hil.live.feed._EVERY", 0.0)  # every sample: more than pipes hold
    monkeypatch.setattr("drivers.session.session.AHEAD", 1)
    (deaf,) = run(small_plan, manutec, tmp_path / "run", "deaf")
    assert deaf.dropped > 100
    assert recorded(tmp_path / "run") == ["g1", "i1", "c1"]


def test_a_listener_that_cannot_serve_is_refused_before_anything_moves(
    small_plan: Plan, manutec: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ListenerFailed, match="port 8765 is taken; choose another; nothing has"):
        run(small_plan, manutec, tmp_path / "run", "refuse")
    assert "goes on" not in capsys.readouterr().out
    assert not (tmp_path / "run").exists()


def test_a_fault_is_told_with_its_text_before_the_end(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    listener = Listener("listener", "noting_listener", str(tmp_path / "note"), "note")
    faults = tmp_path / "faults.yaml"
    faults.write_text("faults: [{what: fault, axis: 1, code: 0x2310, at: {time: 12.5}}]\n")
    how = OnBus(SIMULATED, None, None, [f"faults={faults}"], listeners=[listener])
    with pytest.raises(typer.Exit):
        measure(small_plan, manutec, Path("plan.yaml"), tmp_path / "run", how)
    lines = lines_of(tmp_path / "note")
    kinds = [line["kind"] for line in lines]
    assert kinds[-3:] == ["fault", "off", "end"]
    assert "2310" in lines[-3]["text"]
    assert (lines[-1]["how"], lines[-1]["text"]) == ("failed", lines[-3]["text"])
