"""Pushes on the virtual plant with drifting friction: live detection, replay, and stops."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from compiled_code import needs_compiler
from exported_watch import alarms_in_c, alarms_in_python, alarms_in_structured_text
from terminal import Terminal
from typer.testing import CliRunner

from checked_files.yaml_file import load_yaml
from drivers.drive_bus import Sample
from hil.cli import app
from hil.cli.measuring import OnBus, measure
from hil.errors import Mismatch
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.trajectories import Basis
from hil.planning.measurement import Gravity, Inertia
from hil.planning.plan import Plan, PlannedRobot, dump_plan
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.watch import LEARNING, NAME, Watched
from hil.runs import SIMULATED
from hil.runs.run import Run
from hil.runs.run_folder import RunFolder
from hil.watching.watcher import Watcher

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result
    from exported_watch import Samples

    from hil.planning.measurement import Measurement

ROBOT = Robot.load("manutec-r15")
LEARNED = 6.0
"""Time in which thresholds are learned [s]."""
PUSHES = {2: (8.0, 0.10), 4: (9.5, -0.10)}
"""Start of each push [s] and its share of the torque limit, by axis."""

pytestmark = pytest.mark.usefixtures("skip_causes")


def plan_of(seed: int, cycles: int, period: float, shares: tuple[float, float]) -> Plan:
    basis = Basis(ROBOT, period, 8)
    limits = shares[0] * ROBOT.velocity_limit, shares[1] * ROBOT.acceleration_limit
    basis._limits = np.stack([basis._reach, *limits])
    drawn = basis.trajectory(basis.random(np.random.default_rng(seed)), cycles, "t")
    robot = PlannedRobot(name=ROBOT.name, digest=ROBOT.digest)
    return Plan(robot=robot, measurements=(drawn,))


def strokes_of(axes: tuple[int, ...], cycles: int) -> Plan:
    """Return strokes without pauses at corners, and slow ones with a rest in between."""
    drawn: list[Measurement] = []
    for axis in axes:
        speed, acceleration = (
            float(share * limit[axis - 1])
            for share, limit in ((0.5, ROBOT.velocity_limit), (0.5, ROBOT.acceleration_limit))
        )
        q = (0.0, -0.3, 0.3, 0.2, 0.4, 0.1)
        slow = {"stroke": 0.3, "velocity": 0.1 * speed, "acceleration": 0.1 * acceleration}
        fast = {"stroke": 0.5, "velocity": speed, "acceleration": acceleration}
        drawn += [
            Gravity(id=f"g{axis}", kind="gravity", axis=axis, q=q, cycles=2, **slow),
            Inertia(id=f"i{axis}", kind="inertia", axis=axis, q=q, cycles=cycles, **fast),
        ]
    robot = PlannedRobot(name=ROBOT.name, digest=ROBOT.digest)
    return Plan(robot=robot, measurements=tuple(drawn))


def called(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Model from 20 s of motion on the plant."""
    folder = tmp_path_factory.mktemp("model") / "run"
    plan = plan_of(3, 4, 5.0023, (0.9, 0.49))
    measure(plan, ROBOT, folder, folder, OnBus(SIMULATED, None, None, None))
    identify(Run.open(folder)).save(folder / "model.yaml")
    return folder / "model.yaml"


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "plan.yaml"
    path.write_bytes(dump_plan(plan_of(21, 2, 5.5, (0.8, 0.4))).encode())
    return path


@pytest.fixture(scope="module")
def faults(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("faults") / "faults.yaml"
    pushes = [
        {
            "what": "push",
            "axis": axis,
            "size": share * float(ROBOT.torque_limit[axis - 1]),
            "at": {"time": when},
            "lasts": {"time": 0.2},
        }
        for axis, (when, share) in PUSHES.items()
    ]
    path.write_text(yaml.safe_dump({"faults": pushes}))
    return path


@pytest.fixture(scope="module")
def pushed(
    model: Path, plan: Path, faults: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Result]:
    """Folder of a watch with two pushes, and the command's output."""
    folder = tmp_path_factory.mktemp("watch") / "pushed"
    words = ("watch", plan, "--model", model, "-o", folder, "--learn", LEARNED)
    return folder, called(*words, "--bus-option", f"faults={faults}")


def test_pushes_are_found_on_their_axes_and_nothing_else_is(pushed: tuple[Path, Result]) -> None:
    folder, done = pushed
    found = load_yaml(folder / NAME, Watched)
    assert done.exit_code == 3, done.output
    assert [alarm.axis for alarm in found.alarms] == list(PUSHES)
    for alarm, (axis, (_, share)) in zip(found.alarms, PUSHES.items(), strict=True):
        assert alarm.peak == pytest.approx(share * ROBOT.torque_limit[axis - 1], rel=0.25)
        assert 0.1 < alarm.lasted < 0.35
    apart = found.alarms[1].time - found.alarms[0].time
    assert apart == pytest.approx(1.5, abs=0.03)


def test_what_was_found_is_stated_kept_and_drawn(pushed: tuple[Path, Result]) -> None:
    folder, done = pushed
    assert "external torque" in done.output
    assert "2 alarms in" in done.output
    assert "no single cause explains it" in done.output  # two pushes are no lasting change
    page = (folder / "watch.html").read_text()
    assert "<svg viewBox" in page
    assert ">SIMULATED<" in page
    assert "<strong>doubtful</strong> 2 alarms in" in page
    assert re.search(r"2 alarms in \d:\d\d: axis 2 at [\d.]+ s, axis 4 at [\d.]+ s", page)
    assert 'data-r="t"' in page  # the recording with the alarms is played
    found = load_yaml(folder / NAME, Watched)
    assert found.learned == pytest.approx(LEARNED, abs=0.01)
    for axis in found.axes:  # a push in the first 15 s of motion is also taken for scatter
        assert axis.soon
        assert axis.soon < (0.15 if axis.axis in PUSHES else 0.08) * axis.limit
    assert all(0 <= axis.blind <= 1 for axis in found.axes)
    assert max(axis.dim for axis in found.axes) > 0.02  # every axis turns round
    assert not np.isnan(Run.open(folder / "run")["t"].recording.q).any()


def test_strokes_raise_no_alarm_and_axes_that_stand_are_named(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, folder = tmp_path / "strokes.yaml", tmp_path / "watch"
    plan.write_bytes(dump_plan(strokes_of((2, 4, 1), 12)).encode())
    done = called("watch", plan, "--model", model, "-o", folder, "--learn", 5, "--repeat", 2)
    found = load_yaml(folder / NAME, Watched)
    assert found.alarms == ()
    assert done.exit_code == 0, done.output
    assert found.watched > 60
    moved, stood = [found.axes[k] for k in (1, 3)], [found.axes[k] for k in (2, 4, 5)]
    assert all(axis.soon and axis.soon < 0.1 * axis.limit for axis in moved)
    assert all(axis.still > 0.9 and axis.blind > 0.9 for axis in stood)
    assert "hardly watched" in found.verdict.text
    assert done.output.count("hardly watched") == 1


@pytest.mark.parametrize("motion", [0.004, 1.0, 3.0, 8.0])
def test_an_interrupted_watch_keeps_what_it_has_seen(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, motion: float
) -> None:
    plan, folder = tmp_path / "strokes.yaml", tmp_path / "watch"
    plan.write_bytes(dump_plan(strokes_of((2,), 12)).encode())
    take = Watcher.take

    def interrupted(watcher: Watcher, *samples: Sample) -> tuple[object, ...]:
        for sample in samples:
            if watcher.learned + watcher.watched >= motion:
                raise KeyboardInterrupt
            take(watcher, sample)
        return ()

    monkeypatch.setattr(Watcher, "take", interrupted)
    called("watch", plan, "--model", model, "-o", folder, "--learn", 5)
    found = load_yaml(folder / NAME, Watched)
    assert found.learned + found.watched == pytest.approx(motion, abs=0.01)
    assert found.axes[5].soon is None
    page = (folder / "watch.html").read_text()
    assert ("<strong>doubtful</strong> no motion watched" in page) == (motion < 5)
    assert 'class="outcome good"' not in page  # axes other than the second did not move


@pytest.mark.parametrize("at_once", [1, 5])
def test_samples_one_by_one_or_in_small_groups_show_what_all_together_show(
    pushed: tuple[Path, Result], model: Path, at_once: int
) -> None:
    recording = Run.open(pushed[0] / "run")["t"].recording
    live, later = (Watcher(Model.load(model), 0.004, 5.0) for _ in range(2))
    times = slice(0, 1500)
    later.take_all(recording.time[times], recording.q[times], recording.tau[times])
    samples = [
        Sample(float(t), tuple(q), tuple(tau), (0,) * 6, reached=False)
        for t, q, tau in zip(recording.time[times], recording.q, recording.tau, strict=False)
    ]
    for first in range(0, len(samples), at_once):
        live.take(*samples[first : first + at_once])
    assert live.torques() == pytest.approx(later.torques(), rel=1e-9)
    for one, all_ in zip(live.sights(), later.sights(), strict=True):
        assert (one.soon, one.late) == pytest.approx((all_.soon, all_.late), rel=1e-9)
        assert (one.blind, one.dim, one.distance) == (all_.blind, all_.dim, all_.distance)


@needs_compiler
@pytest.mark.parametrize("learned", [False, True])
def test_exported_code_raises_the_alarms_of_the_watch(
    pushed: tuple[Path, Result], model: Path, tmp_path: Path, learned: bool
) -> None:
    recording, found = Run.open(pushed[0] / "run")["t"].recording, pushed[0] / NAME
    whole = recording.time, recording.q, recording.tau
    around = (recording.time > 7.0) & (recording.time < 8.2)  # the first push
    part = recording.time[around], recording.q[around], recording.tau[around]
    loaded, thresholds = Model.load(model), load_yaml(found, Watched)

    def wanted(samples: Samples) -> list[tuple[int, float]]:
        watcher = Watcher(loaded, 0.004, LEARNED, thresholds.axes if learned else ())
        watcher.take_all(*samples)
        return [(alarm.axis, alarm.time) for alarm in watcher.alarms]

    assert [axis for axis, _ in wanted(whole)] == list(PUSHES)
    assert alarms_in_c(loaded, thresholds, whole, tmp_path, learned=learned) == wanted(whole)
    assert alarms_in_python(loaded, thresholds, whole, learned=learned) == wanted(whole)
    assert [axis for axis, _ in wanted(part)] == [2] * learned
    assert alarms_in_structured_text(loaded, thresholds, part, learned=learned) == wanted(part)


@needs_compiler
def test_thresholds_of_an_earlier_watch_hold_from_the_start(
    pushed: tuple[Path, Result], model: Path, plan: Path, tmp_path: Path
) -> None:
    words = ("--model", model, "--thresholds", pushed[0], "-o", tmp_path / "clean")
    done = called("watch", plan, *words)
    assert done.exit_code == 0, done.output
    clean = load_yaml(tmp_path / "clean" / NAME, Watched)
    assert (clean.learned, clean.alarms) == (0, ())
    assert clean.watched > 10
    assert "thresholds learned from" not in done.output
    code = tmp_path / "code"
    done = called("export", model, "--to", "json", "--watch", tmp_path / "clean", "-o", code)
    assert done.exit_code == 0, done.output
    assert (code / "manutec_r15_watch.json").exists()
    recording = Run.open(tmp_path / "clean" / "run")["t"].recording
    samples = recording.time, recording.q, recording.tau
    assert alarms_in_c(Model.load(model), clean, samples, tmp_path, learned=True) == []


def test_thresholds_of_another_size_are_refused(pushed: tuple[Path, Result], model: Path) -> None:
    loaded, found = Model.load(model), load_yaml(pushed[0] / NAME, Watched)
    first, *others = found.axes
    shorter = first.model_copy(update={"scatter": first.scatter[:-1]})
    fewer = first.model_copy(update={"reversals": first.reversals[:-1]})
    for wrong, words in (
        ((shorter, *others), "axis 1: thresholds of .* must be"),
        ((fewer, *others), "axis 1: thresholds of .* must be"),
        (others, "thresholds of 5 axes must be 6"),
    ):
        with pytest.raises(Mismatch, match=words):
            Watcher(loaded, 0.004, LEARNED, wrong)


def test_the_help_states_the_time_of_learning() -> None:
    shown = re.sub(r"[│\s]+", " ", called("watch", "--help").output)
    assert f"thresholds are learned [s]. [default: {LEARNING:g}]" in shown


def test_a_time_of_learning_has_no_effect_beside_thresholds(
    pushed: tuple[Path, Result], model: Path, plan: Path, tmp_path: Path
) -> None:
    words = ("--thresholds", pushed[0], "--learn", 10, "-o", tmp_path / "x")
    done = called("watch", plan, "--model", model, *words)
    assert done.exit_code == 2
    assert "nothing is learned with --thresholds" in " ".join(done.output.split())
    assert not (tmp_path / "x").exists()


def test_a_gap_is_no_push(pushed: tuple[Path, Result], model: Path) -> None:
    recording = Run.open(pushed[0] / "run")["t"].recording
    q = recording.q.copy()
    q[1450:1453] = np.nan
    kept = np.delete(np.arange(1600), slice(1550, 1570))
    watcher = Watcher(Model.load(model), 0.004, 5.0)
    assert watcher.take_all(recording.time[kept], q[kept], recording.tau[kept]) == ()
    assert watcher.watched > 0


def test_a_push_may_stop_all_axes(model: Path, plan: Path, faults: Path, tmp_path: Path) -> None:
    words = ("watch", plan, "--model", model, "-o", tmp_path / "x", "--learn", LEARNED)
    done = called(*words, "--bus-option", f"faults={faults}", "--stop", "--live", "0")
    assert done.exit_code == 1
    assert "live page: http://127.0.0.1:" in done.output
    assert [alarm.axis for alarm in load_yaml(tmp_path / "x" / NAME, Watched).alarms] == [2]
    assert "all axes stop" in done.output
    assert "emergency stop" not in done.output  # all have confirmed that they are off
    assert not (tmp_path / "x" / "run").exists()


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        (("--learn", 30), "--repeat 4"),
        (("--repeat", 2, "--hours", 1), "give only one"),
    ],
)
def test_a_watch_that_would_watch_nothing_is_refused(
    model: Path, plan: Path, tmp_path: Path, options: tuple[object, ...], remedy: str
) -> None:
    done = called("watch", plan, "--model", model, "-o", tmp_path / "x", *options)
    assert remedy in str(done.exception)
    assert not (tmp_path / "x").exists()


def test_a_model_without_friction_moves_nothing(model: Path, plan: Path, tmp_path: Path) -> None:
    stated = yaml.safe_load(model.read_text())
    stated["friction_law"] = None
    bare = model.with_name("bare.yaml")
    bare.write_text(yaml.safe_dump(stated))
    done = called("watch", plan, "--model", bare, "-o", tmp_path / "x")
    assert "has no law of friction" in str(done.exception)
    assert not (tmp_path / "x").exists()


def test_a_model_of_another_robot_moves_nothing(model: Path, tmp_path: Path) -> None:
    file, plan = tmp_path / "arm.yaml", tmp_path / "plan.yaml"
    text = (ROBOTS / "manutec-r15.yaml").read_text()
    file.write_text(text.replace("9.81", "9.80"))
    other = Robot.load(str(file))
    planned = PlannedRobot(name=other.name, digest=other.digest, file="arm.yaml")
    made = plan_of(21, 8, 5.5, (0.5, 0.2)).model_copy(update={"robot": planned})
    plan.write_bytes(dump_plan(made).encode())
    done = called("watch", plan, "--model", model, "-o", tmp_path / "x")
    assert "give the model of this robot with --model" in str(done.exception)
    assert not (tmp_path / "x").exists()


def wait_until(done: Callable[[], bool], watch: subprocess.Popen[bytes]) -> None:
    """Wait while the program runs."""
    end = time.monotonic() + 120
    while not done():
        assert watch.poll() is None
        assert time.monotonic() < end
        time.sleep(0.02)


def test_on_a_terminal_torques_are_shown_and_ctrl_c_keeps_what_was_seen(
    model: Path,
    plan: Path,
    tmp_path: Path,
) -> None:
    folder, terminal = tmp_path / "watched", Terminal()
    words = ("watch", plan, "--model", model, "-o", folder, "--learn", 5, "--repeat", 500)
    watch = subprocess.Popen(  # noqa: S603 - our own program
        [sys.executable, "-m", "hil", *map(str, words)],
        stdin=terminal.theirs,
        stdout=terminal.theirs,
        stderr=terminal.theirs,
        start_new_session=True,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "110", "LINES": "40"},
    )
    terminal.begin()
    try:
        wait_until(lambda: "watching, 0 alarms" in terminal.shown, watch)
        wait_until(lambda: bool(list(folder.glob("run/recordings/*.h5"))), watch)
        os.kill(watch.pid, signal.SIGINT)
        status = watch.wait(timeout=60)
    finally:
        watch.kill()
        terminal.close()
    assert status == 130, terminal.shown[-2000:]
    assert "learning thresholds, no alarms yet" in terminal.shown
    assert "external" in terminal.shown
    assert "stopped, the axes are off" in terminal.shown
    assert "Traceback" not in terminal.shown
    found = load_yaml(folder / NAME, Watched)
    assert found.alarms == ()
    assert found.watched > 0
    assert RunFolder.open(folder / "run").journal.sessions[0].reason == (
        "interrupted by the operator"
    )
