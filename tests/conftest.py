"""Fixtures shared by several test modules."""

from __future__ import annotations

import gc
import os
import signal
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small, and each core has a worker

import canopen
import numpy as np
import pytest
from canopen.sdo import SdoClient
from desk import Desk
from hypothesis import settings
from hypothesis.database import DirectoryBasedExampleDatabase
from ideal_machine import IdealMachine

from drivers.drive_bus import AxisInfo, LimitExceeded, Sample
from hil.model.robot import Robot, parse_robot
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.planning.plan import Plan, PlannedRobot
from hil.planning.strokes import Partner
from hil.planning.trapezoid import Trapezoid
from hil.terminal.console import out
from sim_plant.canopen.eds import EDS_PATH
from sim_plant.serving import plant_channel
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from drivers.drive_bus import Move

FOUND = Path(__file__).parents[1] / ".hypothesis" / "found"
"""Folder of failed examples, kept by `ci-long` and tried first in its next run."""

settings.register_profile("repeatable", deadline=None, derandomize=True, print_blob=True)
settings.register_profile(
    "ci-long", deadline=None, print_blob=True, database=DirectoryBasedExampleDatabase(FOUND)
)
settings.load_profile("repeatable")  # select another profile by --hypothesis-profile

LONG = (
    "benchmarks",
    "system",
    "hil/cli/test_causes_of_a_change.py",
    "hil/cli/test_try_command.py",
    "hil/watching/test_watch_command.py",
    "drivers/ethercat/test_over_a_cable.py",
    "hil/estimation/test_trees.py",
    "hil/estimation/test_excluded.py",
    "hil/estimation/test_distinguishing.py",
    "hil/report/test_report_of_load_and_diagnosis.py",
    "hil/results/test_measured_load.py",
    "hil/report/test_report_shows_what_identify_found.py",
    "hil/cli/test_tutorials.py",
    "hil/cli/test_export_command.py",
    "hil/cli/test_interruption.py",
    "hil/cli/test_ended_by_a_signal.py",
    "hil/cli/test_mixture.py",
    "hil/cli/test_without_numba.py",
    "hil/estimation/free_motion/test_real_recordings.py",
    "hil/results/test_problem.py",
    "hil/imports/test_real_recordings.py",
    "sim_plant/twin/test_twin.py",
    "hil/live/test_live_run.py",
    "hil/runs/test_pooling.py",
    "hil/results/test_model_file.py",
    "sim_plant/ethercat/test_foreign_masters.py",
    "hil/cli/test_validate_command.py",
    "hil/results/test_validation.py",
    "hil/results/test_findings.py",
    "hil/test_public_names.py",
    "hil/ground_truth/test_comparison.py",
    "hil/runs/test_foreign_run_folder.py",
    "hil/cli/test_accept_command.py",
    "hil/report/test_report.py",
    "hil/planning/test_by_minutes.py",
    "hil/report/test_sections.py",
    "hil/export/test_recordings.py",
    "hil/estimation/test_load_of_free_motions.py",
    "hil/estimation/test_prior.py",
    "hil/cli/test_start_up.py",
    "hil/cli/test_foxglove_option.py",
    "hil/cli/test_verdict_command.py",
    "hil/results/test_tracking.py",
    "hil/test_notebook.py",
    "sim_plant/serving/test_foreign_master.py",
    "test_signal_dispositions.py",
    "hil/cli/test_recording_tutorial.py",
    "hil/imports/test_many_maps.py",
    "hil/live/test_foxglove.py",
    "hil/results/test_back_and_forth_results.py",
    "hil/results/test_error_budget.py",
    "hil/results/test_verdict_of_free_motions.py",
    "hil/results/test_payload_of_free_motions.py",
    "hil/planning/test_any_robot.py",
    "hil/estimation/free_motion/test_unknown_gains.py",
    "hil/estimation/test_excluded_battery.py",
    "hil/imports/test_mechanics.py",
    "hil/measuring/test_designed_trajectories.py",
    "sim_plant/physics/test_soft_gears.py",
    "hil/estimation/free_motion/test_soft_gears.py",
    "hil/report/test_friction_in_report.py",
    "sim_plant/faults",
    "drivers/found_settings",
    "drivers/test_two_processes.py",
    "drivers/can_bus/test_frame_log.py",
)  # fmt: skip
"""Folders and files of long tests (whole sessions, studies, tutorials), the longest first, so that
no worker is alone with one of them at the end.
"""
LONG_FIXTURES = {"browser"}
"""Fixtures whose tests are long; the long files name those fixtures that their tests use."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Skip the import of files without any of the requested tests."""
    asked, long = config.option.markexpr, _place(collection_path) is not None
    if asked == "not long":
        return True if long else None
    if asked != "long" or long or not collection_path.match("test_*.py"):
        return None
    text = collection_path.read_text(encoding="utf-8")
    return None if any(word in text for word in ("mark.long", *LONG_FIXTURES)) else True


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark long tests, and exclude them from coverage, which makes them three times as slow."""
    for item in items:
        fixtures = LONG_FIXTURES.intersection(getattr(item, "fixturenames", ()))
        if item.get_closest_marker("long") or fixtures or _place(item.path) is not None:
            item.add_marker("long")
            item.add_marker("no_cover")
    # single long tests of other files come first: some take half a minute
    places = [None, *LONG]
    items.sort(key=lambda item: places.index(_place(item.path)))


def pytest_collection_finish() -> None:
    """Exclude tests and libraries from garbage collection, and collect less often.

    Collecting tests and libraries took an eighth of all time. At its end, a campaign thaws all
    frozen objects, which would include tests and libraries.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)  # in place of 700, since tests create and delete many objects
    gc.freeze = gc.unfreeze = lambda: None  # type: ignore[assignment]


@cache
def _place(path: Path) -> str | None:
    """Return the entry of `LONG` that contains a path."""
    own = path.as_posix().removeprefix(f"{Path(__file__).parent.as_posix()}/") + "/"
    return next((place for place in LONG if own.startswith(f"{place}/")), None)


# the clients of canopen have threads, which a busy machine stalls
SdoClient.RESPONSE_TIMEOUT = 30.0


@pytest.fixture
def wide_console(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let commands print lines of 200 characters, so that tables are not wrapped."""
    monkeypatch.setattr(out, "width", 200)


class _Path:
    """Trapezoid of velocity on the grid of samples."""

    def __init__(self, begin: int, profile: Trapezoid, period: float) -> None:
        times = np.arange(0.0, profile.duration + period, period)
        self._points = list(
            zip(profile.q(times).tolist(), profile.motion(times)[1].tolist(), strict=True)
        )
        self._begin = begin
        self.rests = begin + len(times) + 5

    def point(self, sample: int) -> tuple[float, float]:
        return self._points[min(max(sample - self._begin, 0), len(self._points) - 1)]


class IdealBus:
    """DriveBus whose axes follow their trapezoids exactly; the commands are recorded.

    Torque is 10 N m of friction along the motion, 3 N m of load and a little ripple. `tamper` may
    change each sample before it is returned, or raise; `deaf` axes take set-points and stay where
    they are.
    """

    LATENCY = 3

    def __init__(self, robot: Robot, period: float = 0.004) -> None:
        self.period = period
        self.robot = robot
        self.time = 0.0
        self.n_samples = 0
        self.notes: tuple[str, ...] = ()
        self.log: list[str] = []
        self.moves: list[tuple[float, int, Move]] = []
        self.tamper: Callable[[Sample], Sample] = lambda sample: sample
        self.deaf: set[int] = set()
        self._paths = [_Path(0, Trapezoid(0.0, 0.0, 1.0, 1.0), period)] * robot.n_joints

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        return tuple(
            AxisInfo(f"axis {i + 1}", "ideal", -9.0, 9.0, 9.0, 99.0, 0.01, 1e-5)
            for i in range(self.robot.n_joints)
        )

    def __enter__(self) -> IdealBus:
        self.log.append("powered on")
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.log.append("powered off")

    def move(self, moves: Mapping[int, Move]) -> None:
        for index, move in moves.items():
            if not self.robot.q_min[index] <= move.target <= self.robot.q_max[index]:
                raise LimitExceeded(f"axis {index + 1}: target {move.target}")
        for index, move in moves.items():
            self.moves.append((self.time, index, move))
            here = self._paths[index].point(self.n_samples)[0]
            target = here if index in self.deaf else move.target
            profile = Trapezoid(here, target, move.velocity, move.acceleration)
            self._paths[index] = _Path(self.n_samples + self.LATENCY, profile, self.period)

    def sample(self) -> Sample:
        self.n_samples += 1
        self.time = self.n_samples * self.period
        q, velocity = zip(*(path.point(self.n_samples) for path in self._paths), strict=True)
        load = 3.0 + 1e-3 * (-1) ** self.n_samples
        sample = Sample(
            time=self.time,
            q=q,
            tau=tuple(load + 10.0 * (v > 0) - 10.0 * (v < 0) for v in velocity),
            flags=(0,) * len(self._paths),
            reached=not self.deaf and all(self.n_samples >= path.rests for path in self._paths),
        )
        return self.tamper(sample)

    def samples(self, limit: int) -> Sequence[Sample]:
        return (self.sample(),)

    def halt(self) -> None:
        self.log.append("halted")

    def reset(self) -> None:
        self.log.append("reset")


@pytest.fixture(scope="session", autouse=True)
def _signals_as_by_default() -> None:
    """Handle signals as in a terminal: nohup and background jobs of scripts ignore some of them.

    A program started by a test inherits ignored signals only.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in ("SIGHUP", "SIGTERM"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)


@pytest.fixture(scope="session", autouse=True)
def _state_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Redirect the user's state directory to a temporary one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session")
def manutec() -> Robot:
    return Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def skip_causes() -> Iterator[None]:
    """Let identifications look for no causes, which takes up to two thirds of their time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hil.results.identification.proved", lambda *_: None)
        yield


@pytest.fixture
def ideal_bus(manutec: Robot) -> IdealBus:
    return IdealBus(manutec)


@pytest.fixture
def small_plan(manutec: Robot) -> Plan:
    """Plan with a measurement of each kind; about 20 s."""
    return Plan(
        robot=PlannedRobot(name=manutec.name, digest=manutec.digest),
        measurements=(
            Gravity(
                id="g1",
                axis=2,
                q=(0.0, -0.3, 0.2, 0.0, 0.5, 0.0),
                stroke=0.4,
                velocity=0.4,
                acceleration=8.0,
                cycles=2,
            ),
            Inertia(
                id="i1",
                axis=3,
                q=(0.1, -0.2, 0.3, 0.0, 0.5, 0.0),
                stroke=0.6,
                velocity=1.5,
                acceleration=10.0,
            ),
            Coupling(
                id="c1",
                axis=1,
                q=(0.1, -0.2, 0.3, 0.0, 0.5, 0.0),
                stroke=0.15,
                velocity=0.05,
                acceleration=5.0,
                partner=Partner(axis=2, stroke=0.1, velocity=0.5, acceleration=5.0),
            ),
        ),
    )


# --- the plant's CANopen side, with an ideal machine --------------------------------------------


@pytest.fixture
def ideal_machine() -> IdealMachine:
    """Six ideal axes driven by nodes 1 to 6."""
    return IdealMachine()


@pytest.fixture
def ideal_network(ideal_machine: IdealMachine) -> SlaveNetwork:
    """The plant's drives with ideal axes, switched on; SYNC advances the time."""
    network = SlaveNetwork(ideal_machine)
    network.power_on()
    return network


@pytest.fixture
def ideal_channel(monkeypatch: pytest.MonkeyPatch, ideal_machine: IdealMachine) -> str:
    """Name of a `sim_plant` channel with an ideal machine."""
    monkeypatch.setattr(plant_channel, "load_machine", lambda *_: ideal_machine)
    return "ideal"


@pytest.fixture
def master(ideal_channel: str) -> Iterator[canopen.Network]:
    """Master of canopen on the plant, with a remote node for each drive."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    network.connect(interface="sim_plant", channel=ideal_channel)
    for node_id in range(1, 7):
        network.add_node(node_id, str(EDS_PATH))
    yield network
    network.disconnect()


# --- robots of any shape --------------------------------------------------------------------------


class ChainBuilder:
    """Builder of robot files of chains and trees, as text and as
    robots, with equal limits and drives.
    """

    LENGTHS: ClassVar = {"a": 0.3, "b": 0.45}

    def joint(
        self,
        kind: str = "revolute",
        parameters: object = None,
        parent: int | None = None,
        **frame: object,
    ) -> str:
        """Return a joint in YAML; `parameters` is a list, or None for all ten."""
        carrier = "" if parent is None else f"parent: {parent}, "
        places = ", ".join(f"{key}: {value}" for key, value in {"alpha": 0, **frame}.items())
        present = "" if parameters is None else f", parameters: [{', '.join(parameters)}]"
        return (
            f"  - {{type: {kind}, {carrier}frame: {{{places}}}{present}, q_min: -1, q_max: 1,"
            " velocity_limit: 1, acceleration_limit: 1, torque_limit: 1,"
            " drive: {gear_ratio: 100, rotor_inertia: 0.001, torque_constant: 1}}\n"
        )

    def robot(
        self, *joints: str, gravity: Sequence[float] = (0, 0, -9.81), ties: Sequence[str] = ()
    ) -> Robot:
        """Return a robot of these joints."""
        text = f"name: chain\ngravity: {list(gravity)}\nlengths: {self.LENGTHS}\njoints:\n"
        return parse_robot(text + "".join(joints) + f"ties: [{', '.join(ties)}]\n", "chain.yaml")

    def random(self, seed: int, tree: bool = False) -> Robot:
        """Return a random robot of one to six joints, or tree of two to ten, many parallel or
        perpendicular, some with few parameters.
        """
        rng = np.random.default_rng(seed)
        pick = lambda *choices: choices[rng.integers(len(choices))]  # noqa: E731
        names = np.array(LINK_PARAMETERS)

        def branch(number: int) -> dict[str, object]:
            if not tree or (number and rng.random() < 0.5):
                return {}
            angle, shift = pick("0", "pi/2", "-0.4"), pick("0", "a", "-0.2")
            return {"parent": int(rng.integers(0, number + 1)), "gamma": angle, "b": shift}

        joints = [
            self.joint(
                pick("revolute", "revolute", "prismatic"),
                rng.choice(names, rng.integers(8), replace=False) if rng.random() < 0.3 else None,
                alpha=pick("0", "0", "pi/2", "-pi/2", "pi", "pi/4", "0.3"),
                theta=pick("0", "pi/2", "0.7", "pi/4"),
                d=pick("0", "0", "a", "-b", "0.2", "a + 0.1"),
                r=pick("0", "0", "b", "0.11", "a - b"),
                **branch(number),
            )
            for number in range(rng.integers(2, 11) if tree else rng.integers(1, 7))
        ]
        gravity = pick((0, 0, -9.81), (0, 0, -9.81), (0, -9.81, 0), (3, 4, -7), (0, 0, 0))
        return self.robot(*joints, gravity=gravity)


@pytest.fixture(scope="session")
def chains() -> ChainBuilder:
    return ChainBuilder()


@pytest.fixture
def desk(ideal_network: SlaveNetwork, ideal_machine: IdealMachine) -> Desk:
    """Synchronous master of the drives with ideal axes."""
    return Desk(ideal_network, ideal_machine)
