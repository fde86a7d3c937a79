"""Feed-forward on the virtual plant, from a recording to following errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from checked_files.yaml_file import load_yaml
from drivers.drive_bus import LimitExceeded
from hil.cli import app, import_command
from hil.cli.measuring import OnBus, measure
from hil.commands.track import NAME, PASSES, Tracking, judge, notes
from hil.measuring.feeding import DELAY, LOOP, motion_of, refuse_beyond_torque
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.by_counts import design
from hil.planning.design.trajectories import Basis
from hil.planning.plan import Plan, PlannedRobot, dump_plan
from hil.results.identification import identify
from hil.results.model import Model
from hil.runs import SIMULATED
from hil.runs.run import Run

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

    from hil.planning.trajectory import Trajectory

ROBOT = Robot.load("manutec-r15")
SPEED, ACCELERATION = 0.8, 0.4
"""Shares of the limits used by the fast trajectory, which needs up to 0.8 of the torque."""
WINDOW = 0.2
"""Following error window, wide for axes without feed-forward [rad]."""

pytestmark = pytest.mark.usefixtures("skip_causes")


def trajectory(seed: int, cycles: int, period: float, harmonics: int, fast: bool) -> Trajectory:
    basis = Basis(ROBOT, period, harmonics)
    if fast:
        limits = SPEED * ROBOT.velocity_limit, ACCELERATION * ROBOT.acceleration_limit
        basis._limits = np.stack([basis._reach, *limits])
    return basis.trajectory(basis.random(np.random.default_rng(seed)), cycles, "t")


def plan_of(planned: Trajectory) -> Plan:
    robot = PlannedRobot(name=ROBOT.name, digest=ROBOT.digest)
    return Plan(robot=robot, measurements=(planned,))


def called(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Model from 20 s of motion on the plant, with drifting friction."""
    folder = tmp_path_factory.mktemp("model") / "run"
    plan = plan_of(trajectory(3, 4, 5.0023, 10, fast=False))
    measure(plan, ROBOT, folder, folder, OnBus(SIMULATED, None, None, None))
    identify(Run.open(folder)).save(folder / "model.yaml")
    return folder / "model.yaml"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Plan of a fast trajectory, and drives with a wide following error window."""
    folder = tmp_path_factory.mktemp("files")
    plan, drives = folder / "plan.yaml", folder / "drives.yaml"
    plan.write_bytes(dump_plan(plan_of(trajectory(21, 1, 4.0, 4, fast=True))).encode())
    stated = yaml.safe_load((ROBOTS / "manutec-r15.drives.yaml").read_text())
    for axis in stated["axes"]:
        axis["following_error_window"] = WINDOW
    drives.write_text(yaml.safe_dump(stated))
    return {"plan": plan, "drives": drives}


@pytest.fixture(scope="module")
def tracked(model: Path, files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a tracking experiment."""
    folder = tmp_path_factory.mktemp("tracking") / "fast"
    done = called(
        "track", files["plan"], "--model", model, "-o", folder, "--drives", files["drives"]
    )
    assert done.exit_code == 0, done.output
    assert "following errors in" in done.output
    return folder


def found(folder: Path) -> Tracking:
    return load_yaml(folder / NAME, Tracking)


def test_torque_makes_the_errors_of_velocity_alone_five_times_smaller(tracked: Path) -> None:
    assert found(tracked).gain("velocity", "both") > 5
    assert all(axis.rms["both"] < axis.rms["velocity"] / 2 for axis in found(tracked).axes)


def test_neither_means_neither_and_is_an_order_worse(tracked: Path) -> None:
    assert found(tracked).gain("neither", "velocity") > 10


def test_the_delay_that_is_stated_is_the_one_that_shows(tracked: Path) -> None:
    assert found(tracked).shown_delay == pytest.approx(1.5, abs=0.05)
    wrong = found(tracked).model_copy(update={"delay": 1.0})
    assert "repeat with --delay 1.5" in " ".join(notes(wrong))


def test_a_drive_that_feeds_forward_by_itself_besides_is_named(tracked: Path) -> None:
    kept = found(tracked)
    axes = list(kept.axes)
    axes[1] = axes[1].model_copy(update={"rms": {"neither": 0.1, "velocity": 0.2, "both": 0.2}})
    doubled = kept.model_copy(update={"axes": tuple(axes)})
    assert "axis 2: velocity feed-forward makes the errors larger" in " ".join(notes(doubled))
    assert not any("larger" in note for note in notes(kept))
    assert [judge(each).kind for each in (kept, doubled)] == ["good", "doubtful"]


def test_all_passes_are_runs_that_lose_nothing(tracked: Path) -> None:
    page = (tracked / "tracking.html").read_text()
    assert page.count("<svg viewBox") > 6
    assert judge(found(tracked)).text in page
    assert 'data-r="' in page  # with playback
    for name in PASSES:
        run = Run.open(tracked / name)
        assert run.ids == ("t",)
        assert not np.isnan(run["t"].recording.q).any()


def test_a_model_without_friction_moves_nothing(
    model: Path, files: dict[str, Path], tmp_path: Path
) -> None:
    stripped = yaml.safe_load(model.read_text())
    stripped["friction_law"] = None
    bare = model.with_name("bare.yaml")
    bare.write_text(yaml.safe_dump(stripped))
    done = called("track", files["plan"], "--model", bare, "-o", tmp_path / "x")
    assert done.exit_code != 0
    assert "has no law of friction" in str(done.exception)
    assert not (tmp_path / "x").exists()


def test_a_plan_of_strokes_is_refused(model: Path, tmp_path: Path) -> None:
    plan = tmp_path / "plan.yaml"
    plan.write_bytes(
        dump_plan(design(ROBOT, {"gravity": 12, "inertia": 24, "coupling": 3})).encode()
    )
    done = called("track", plan, "--model", model, "-o", tmp_path / "x")
    assert "only trajectories can be streamed" in str(done.exception)
    assert not (tmp_path / "x").exists()


def test_torque_beyond_an_axis_s_limit_is_refused_before_anything_moves() -> None:
    with pytest.raises(
        LimitExceeded, match=r"axis 5 needs a torque of 200 N m at .* at most 186 N m"
    ):
        refuse_beyond_torque(
            trajectory(1, 1, 4.0, 4, fast=True),
            ROBOT,
            lambda q, _qd, _qdd: 200.0 * np.eye(6)[4] + 0 * q,
        )


def test_friction_goes_over_from_one_direction_to_the_other_without_a_jump(model: Path) -> None:
    found = Model.load(model)
    width = 0.005 * ROBOT.velocity_limit
    v = np.linspace(-2, 2, 401)[:, None] * width
    still = np.zeros_like(v)
    tau = found.drive_torque(still, v, still)
    jumps = np.abs(np.diff(tau, axis=0)).max(axis=0)
    level = np.abs(tau[-1] - tau[0]) / 2
    assert (level > 0.02 * ROBOT.torque_limit).all()
    assert (jumps < level / 50).all()


def test_friction_slower_than_any_sample_goes_on_plainly(model: Path) -> None:
    """The law itself may have any shape there."""
    found = Model.load(model)
    q = np.zeros((2, 6))
    v = np.stack([0.02 * ROBOT.velocity_limit, 0.2 * ROBOT.velocity_limit])
    slow, fast = found.drive_torque(q, v, q) - found.predict(q, v, q, ("rigid bodies", "motors"))
    assert (slow > 0).all()
    assert (slow < 1.2 * fast).all()


@pytest.mark.parametrize("ahead", [-1.0, -0.625, 0.0, 0.5])
def test_what_is_fed_forward_is_that_of_a_somewhat_other_instant(ahead: float) -> None:
    period, t = 0.004, 0.004 * np.arange(500)
    path = np.column_stack([1 - np.cos(3 * t), t**2])
    q, qd, qdd = (each[100:400] for each in motion_of(path, period, ahead))
    at = (t + ahead * period)[100:400]
    assert q == pytest.approx(np.column_stack([1 - np.cos(3 * at), at**2]), abs=1e-4)
    assert qd == pytest.approx(np.column_stack([3 * np.sin(3 * at), 2 * at]), abs=1e-3)
    assert qdd == pytest.approx(np.column_stack([9 * np.cos(3 * at), 2 + 0 * at]), abs=1e-2)


def test_the_command_takes_the_delays_that_feeding_does_by_default() -> None:
    stated = {each.name: each.default for each in import_command("track").params}
    assert (stated["delay"], stated["loop"]) == (DELAY, LOOP)
