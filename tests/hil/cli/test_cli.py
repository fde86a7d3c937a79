"""Command line: output, and refusals without a traceback."""

import re
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Hil

from drivers import opening
from drivers.drive_bus import DriveFault, NodeSilent, Sample, SampleFlag
from hil import cli
from hil.cli.arguments import parse_pairs
from hil.model.robot import ROBOTS, Robot
from hil.planning.design.by_counts import COUNTS
from hil.planning.design.trajectories import HARMONICS, PERIOD
from hil.planning.plan import Plan, dump_plan
from hil.runs.run_folder import RunFolder

DRIVES = ROBOTS / "manutec-r15.drives.yaml"


@pytest.fixture
def plan_file(tmp_path: Path, small_plan: Plan) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(dump_plan(small_plan))
    return path


@pytest.fixture
def bus(ideal_bus, monkeypatch: pytest.MonkeyPatch):
    """Replace the bus of the command line with ideal axes."""
    monkeypatch.setattr(opening, "open_drive_bus", lambda *_, **__: ideal_bus)
    return ideal_bus


def changed(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


def test_robot_prints_parameters_groups_and_dependencies(hil: Hil) -> None:
    status, out, _ = hil("robot", "manutec-r15")
    assert status == 0
    assert "14 base parameters" in out
    assert "off-diagonal" in out
    assert "10, 11, 14" in out


URDF = """<robot name="pan tilt">
<link name="base"/><link name="yoke"/><link name="head"/>
<joint name="pan" type="continuous"><parent link="base"/><child link="yoke"/>
<axis xyz="0 0 1"/><limit effort="4" velocity="2"/></joint>
<joint name="tilt" type="revolute"><parent link="yoke"/><child link="head"/>
<origin xyz="0 0 0.2" rpy="1.5708 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="3" velocity="2"/></joint>
</robot>"""


def test_a_first_robot_file_comes_from_a_urdf(hil: Hil, tmp_path: Path) -> None:
    urdf, robot = tmp_path / "head.urdf", tmp_path / "head.yaml"
    urdf.write_text(URDF)
    status, out, _ = hil("robot", "new", "--urdf", urdf, "-o", robot)
    assert status == 0
    assert "2 joints from base to head: pan, tilt" in out
    assert "angles within 3.7e-06 rad of a multiple of pi/2 were rounded to that multiple" in out
    assert "10 lines marked !state must be filled in by you" in out
    assert "name: tilt\n    frame: {alpha: pi/2}\n" in robot.read_text()
    status, _, err = hil("robot", robot)
    assert status == 1
    assert "joints.0.q_min: must be stated: least position [rad]" in err
    status, _, err = hil("robot", "new", "--urdf", urdf, "-o", robot)
    assert status != 0
    assert "already exists" in err


def test_gravity_is_stated_in_the_link_that_stands_still(hil: Hil, tmp_path: Path) -> None:
    urdf, robot = tmp_path / "wall.urdf", tmp_path / "wall.yaml"
    urdf.write_text(URDF)
    status, _, _ = hil("robot", "new", "--urdf", urdf, "-o", robot, "--gravity", "9.81", "0", "0")
    assert status == 0
    assert "gravity: [9.81, 0, 0]" in robot.read_text()


def test_a_first_robot_file_comes_from_an_mjcf_as_a_refused_plan_demands(
    hil: Hil, tmp_path: Path
) -> None:
    pytest.importorskip("mujoco")
    mjcf, robot = tmp_path / "hand.xml", tmp_path / "hand.yaml"
    mjcf.write_text(
        '<mujoco model="hand"><option gravity="0 -9.81 0"/><worldbody><body name="palm">'
        '<joint name="wrist" axis="0 0 1" range="-90 90" stiffness="2"/>'
        '<inertial pos="0 0 0.1" mass="1" diaginertia="0.02 0.02 0.02"/>'
        '<body name="thumb" pos="0.1 0 0"><joint name="t" axis="0 1 0" range="-90 90"/>'
        '<inertial pos="0 0 0.1" mass="0.1" diaginertia="0.01 0.01 0.01"/></body>'
        '<body name="finger" pos="-0.1 0 0"><joint name="f" axis="0 1 0" range="-90 90"/>'
        '<inertial pos="0 0 0.1" mass="0.1" diaginertia="0.01 0.01 0.01"/></body></body>'
        "</worldbody></mujoco>"
    )
    status, _, err = hil("plan", mjcf, "-o", tmp_path / "plan.yaml")
    assert status == 1
    assert f"hil robot new --urdf {mjcf}" in err
    status, out, _ = hil("robot", "new", "--urdf", mjcf, "-o", robot)
    assert status == 0
    assert "3 joints from world to thumb, finger: wrist, t, f" in out
    text = re.sub(r": !state .*", ": 0.1", robot.read_text())
    assert "drafted from an MJCF" in text
    robot.write_text(text)
    drafted = Robot.load(robot)
    assert drafted.parents == (-1, 0, 0)
    assert drafted.gravity.tolist() == [0.0, -9.81, 0.0]
    assert drafted.added_parameters == ("k1",)


@pytest.mark.parametrize(("option", "frame"), [
    ("--dh", "name: \"joint 2\"\n    frame: {alpha: pi/2, d: d2, theta: -pi/2}\n"),
    ("--mdh", "name: \"joint 2\"\n    frame: {alpha: 0, theta: -pi/2}\n"),
])  # fmt: skip
def test_a_first_robot_file_comes_from_a_table(
    hil: Hil, tmp_path: Path, option: str, frame: str
) -> None:
    table, robot = tmp_path / "arm.csv", tmp_path / "arm.yaml"
    table.write_text("alpha [deg],a [mm],d,theta\n90,250,400,0\n0,0,0,-90\n")
    status, out, _ = hil("robot", "new", option, table, "-o", robot)
    assert status == 0
    assert "joint 1 revolute, joint 2 revolute" in out
    assert "16 lines marked !state must be filled in by you" in out
    assert frame in robot.read_text()


@pytest.mark.parametrize("options", [(), ("--dh", "a.csv", "--urdf", "a.urdf"),
                                     ("--mdh", "a.csv", "--from", "base")])  # fmt: skip
def test_a_first_robot_file_comes_from_one_source(
    hil: Hil, tmp_path: Path, options: tuple[str, ...]
) -> None:
    assert hil("robot", "new", *options, "-o", tmp_path / "arm.yaml")[0] == 2


@pytest.mark.long
def test_a_plan_finds_the_file_of_its_robot_again(
    hil: Hil, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots, plans = tmp_path / "robots", tmp_path / "plans"
    robots.mkdir()
    plans.mkdir()
    text = (ROBOTS / "manutec-r15.yaml").read_text().replace("name: manutec-r15", "name: mine")
    (robots / "mine.yaml").write_text(text)
    plan = plans / "plan.yaml"
    few = ("--gravity", 4, "--inertia", 10, "--coupling", 1)
    assert hil("plan", robots / "mine.yaml", "-o", plan, *few)[0] == 0
    assert "file: ../robots/mine.yaml" in plan.read_text()
    monkeypatch.chdir(robots)
    status, out, err = hil("dry-run", plan)
    assert status == 0, err
    assert "total" in out
    (robots / "mine.yaml").rename(robots / "moved.yaml")
    status, _, err = hil("dry-run", plan)
    assert status == 1
    assert "mine.yaml does not exist; name the robot file with --robot" in err
    assert hil("dry-run", plan, "--robot", robots / "moved.yaml")[0] == 0


def test_an_unknown_robot_is_refused_with_the_known_ones(hil: Hil) -> None:
    status, _, err = hil("robot", "puma")
    assert status == 1
    assert "unknown robot" in err
    assert "manutec-r15" in err


def test_a_dry_run_needs_no_bus(hil: Hil, plan_file: Path) -> None:
    status, out, _ = hil("dry-run", plan_file)
    assert status == 0
    assert "bus load 21.6%" in out
    assert "total" in out


def test_a_dry_run_with_problems_fails(hil: Hil, plan_file: Path) -> None:
    changed(plan_file, "velocity: 0.4", "velocity: 4")
    status, _, err = hil("dry-run", plan_file)
    assert status == 1
    assert f"{plan_file}:14: measurements.0.velocity: g1: 4 rad/s is above the limit" in err


def test_a_run_measures_everything_into_its_folder(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    status, out, err = hil("run", plan_file, "-o", tmp_path / "first")
    assert (status, err) == (0, "")
    assert "3 measurements in" in out
    assert "of robot time, begun cold)" in out
    folder = RunFolder.open(tmp_path / "first")
    assert len(list(folder)) == 3
    assert folder.journal.sessions[0].bus == "sim_plant manutec-r15"
    assert (folder.path / "drives.yaml").read_text() == DRIVES.read_text()


def test_a_run_states_why_it_repeated_and_that_what_it_kept_began_warm(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    def saturated(sample: Sample) -> Sample:
        if sample.time > 63:
            return sample
        limit, late = int(SampleFlag.LIMIT), int(SampleFlag.LATE)
        return sample._replace(flags=(limit | late,) * 6)

    bus.tamper = saturated
    changed(plan_file, "measurements:", "warm_up: {duration: 60}\nmeasurements:")
    status, out, _ = hil("run", plan_file, "-o", tmp_path / "first")
    assert status == 0
    assert re.search(
        r"g1: attempt 1 is repeated: .* late telegrams .*; axis .* is at its internal limit", out
    )
    assert re.search(r"of robot time, begun after 1\.\d min of motion\)", out)


def test_a_second_run_into_the_same_folder_is_refused(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    hil("run", plan_file, "-o", tmp_path / "first")
    samples = bus.n_samples
    status, _, err = hil("run", plan_file, "-o", tmp_path / "first")
    assert status == 1
    assert "already exists; continue with --resume" in err
    assert bus.n_samples == samples


def interrupted_after(seconds: float) -> Callable[[Sample], Sample]:
    def tamper(sample: Sample) -> Sample:
        if sample.time > seconds:
            raise KeyboardInterrupt
        return sample

    return tamper


def test_ctrl_c_keeps_what_was_measured_and_resume_finishes(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "first"
    bus.tamper = interrupted_after(8)
    status, _, err = hil("run", plan_file, "-o", folder)
    assert status == 130
    assert f"recordings so far are in {folder}; finish with hil run ... --resume" in err
    assert bus.log[-1] == "powered off"
    bus.tamper = lambda sample: sample
    assert hil("run", plan_file, "-o", folder, "--resume")[0] == 0
    assert RunFolder.open(folder).missing == ()
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_resuming_after_the_plan_was_changed_is_refused(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    bus.tamper = interrupted_after(8)
    hil("run", plan_file, "-o", tmp_path / "first")
    changed(plan_file, "stroke: 0.6", "stroke: 0.5")
    status, _, err = hil("run", plan_file, "-o", tmp_path / "first", "--resume")
    assert status == 1
    assert "the plan differs from that of the run's start" in err


def test_a_damaged_recording_is_told_and_measured_again(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    hil("run", plan_file, "-o", tmp_path / "first")
    path = tmp_path / "first" / "recordings" / "i1.h5"
    path.write_bytes(path.read_bytes()[:1000])
    status, out, _ = hil("run", plan_file, "-o", tmp_path / "first", "--resume")
    assert status == 0
    assert "kept as i1.h5.damaged, will be measured again" in out
    assert "1 measurement in" in out
    assert RunFolder.open(tmp_path / "first").missing == ()


def test_a_fault_in_the_middle_is_one_message(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    def fail(sample: Sample) -> Sample:
        if sample.time > 8:
            raise DriveFault("joint 3 (node 3): over-current (2310); check the load")
        return sample

    bus.tamper = fail
    status, _, err = hil("run", plan_file, "-o", tmp_path / "first")
    assert status == 1
    assert err.startswith("joint 3 (node 3): over-current (2310); check the load\n")
    assert "--resume" in err


def test_a_run_in_which_nothing_was_measured_leaves_no_folder(
    hil: Hil, plan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody(*_: object, **__: object) -> None:
        raise NodeSilent("joint 2 (node 2) does not answer; check its power and node number")

    monkeypatch.setattr(opening, "open_drive_bus", nobody)
    status, _, err = hil("run", plan_file, "-o", tmp_path / "first")
    assert status == 1
    assert "joint 2 (node 2) does not answer" in err
    assert "nothing was measured" in err
    assert not (tmp_path / "first").exists()


def test_real_interfaces_need_a_channel(hil: Hil, plan_file: Path, tmp_path: Path) -> None:
    status, _, err = hil("run", plan_file, "-o", tmp_path / "r", "--interface", "socketcan")
    assert status == 2
    assert "interface socketcan needs a channel too" in err
    assert not (tmp_path / "r").exists()


def test_a_finished_run_is_resumed_without_a_bus(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "first"
    assert hil("run", plan_file, "-o", folder)[0] == 0
    bus.log.clear()
    status, out, _ = hil("run", plan_file, "-o", folder, "--resume")
    assert (status, bus.log) == (0, [])
    assert f"{folder}: complete" in out.replace("\n", "")


def test_a_bus_that_is_not_there_is_refused(hil: Hil, plan_file: Path, tmp_path: Path) -> None:
    bus = ("--interface", "nonsense", "--channel", "can0")
    status, _, err = hil("run", plan_file, "-o", tmp_path / "r", *bus)
    assert status == 1
    assert "interface 'nonsense' is unknown to python-can" in err
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("name: manutec-r15", "name: puma", "puma: unknown robot"),
        ("digest: ", "digest: f", "the robot file of manutec-r15 was changed since the plan"),
        ("stroke: 0.4", "strike: 0.4", "plan.yaml:13: measurements.0.strike: unknown key"),
        ("stroke: 0.4", "stroke: 40", "joint 2, with half its stroke, at -20.3 rad is outside"),
        ("measurements:", "measurements: [", "is not valid YAML"),
    ],
)
def test_a_wrong_plan_is_refused_before_anything_moves(
    hil: Hil, bus, plan_file: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    changed(plan_file, old, new)
    status, _, err = hil("run", plan_file, "-o", tmp_path / "first")
    assert status == 1
    assert message in err
    assert not bus.log
    assert not (tmp_path / "first").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("gear_ratio: 105", "gear_ratio: 100", "axes.0.gear_ratio: 100 of axis joint 1 must be"),
        ("torque_constant: 1.1616", "torque_constant: 1.2", "1.2 of axis joint 1 must be 1.1616"),
        ("q_max: 2.880", "q_max: 3.2", "limits.q_max: 3.2 rad of axis joint 1 is wider than 2.88"),
        ("q_min: -2.880", "q_min: -1", "limits.q_min: -1 rad of axis joint 1 is narrower than"),
        ("velocity: 3.0", "velocity: 1.0", "limits.velocity: 1 rad/s of axis joint 1 is narrower"),
        ("node: 2", "node: 1", "node 1"),
        ("sign: 1", "sign: 2", "sign"),
    ],
)
def test_drives_that_contradict_the_robot_are_refused(
    hil: Hil, bus, plan_file: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    drives = tmp_path / "drives.yaml"
    drives.write_text(DRIVES.read_text())
    changed(drives, old, new)
    status, _, err = hil("run", plan_file, "-o", tmp_path / "first", "--drives", drives)
    assert status == 1
    assert f"{drives}:" in err
    assert message in err
    assert not bus.log


def test_missing_files_are_told_by_name(hil: Hil, tmp_path: Path) -> None:
    status, _, err = hil("dry-run", tmp_path / "none.yaml")
    assert status == 1
    assert err == f"{tmp_path / 'none.yaml'}: cannot be read: No such file or directory\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "plan.yaml"),
        ("run", "plan.yaml", "-o", "x", "--pacing", "sometimes"),
        ("dry-run", "plan.yaml", "--bitrate", "12"),
        ("jump",),
    ],
)
def test_wrong_usage_exits_with_2(hil: Hil, arguments: tuple[str, ...]) -> None:
    assert hil(*arguments)[0] == 2


def test_a_bus_option_without_a_value_is_wrong_usage(
    hil: Hil, bus, plan_file: Path, tmp_path: Path
) -> None:
    status, _, err = hil("run", plan_file, "-o", tmp_path / "x", "--bus-option", "bitrate")
    assert status == 2
    assert "must read key=value" in err


def test_bus_options_become_numbers_and_switches() -> None:
    options = parse_pairs(["bitrate=500000", "timeout=0.5", "fd=false", "name=can0"])
    assert options == {"bitrate": 500_000, "timeout": 0.5, "fd": False, "name": "can0"}


@pytest.mark.parametrize(
    ("command", "defaults"),
    [
        (("plan",), {f"--{kind}": count for kind, count in COUNTS.items()}),
        (("plan",), {"--period": PERIOD, "--harmonics": HARMONICS}),
    ],
)
def test_help_states_the_defaults_that_are_taken(
    hil: Hil, command: tuple[str, ...], defaults: dict[str, float]
) -> None:
    printed = " ".join(hil(*command, "--help")[1].replace("│", " ").split())
    for option, value in defaults.items():
        assert re.search(rf"{option}\b.*?\[default: ([\d.]+)\]", printed)[1] == str(value)


@pytest.mark.parametrize(
    "asked", [("--gravity", "100000000"), ("--minutes", "1e12"), ("--warm-up", "1e300")]
)
def test_a_plan_of_absurd_size_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], asked: tuple[str, str]
) -> None:
    with pytest.raises(SystemExit) as left:
        cli.main(["plan", "manutec-r15", "-o", str(tmp_path / "plan.yaml"), *asked])
    assert left.value.code == 2
    said = " ".join(capsys.readouterr().err.split())
    # wording depends on the version of typer
    assert re.search("less than or equal|not in the range", said)


@pytest.mark.long
def test_a_built_in_robot_has_a_twin_and_an_unknown_one_is_named(hil: Hil, tmp_path: Path) -> None:
    assert hil("twin", "manutec-r15", "-o", tmp_path / "twin")[0] == 0
    assert {path.name for path in (tmp_path / "twin").iterdir()} == {"plant.yaml", "drives.yaml"}
    status, _, err = hil("twin", "nobody", "-o", tmp_path / "other")
    assert (status, "nobody: unknown robot" in err) == (1, True)
