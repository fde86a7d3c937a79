"""Fixtures that several test modules share."""

from __future__ import annotations

import math
import os
import struct
from typing import TYPE_CHECKING, ClassVar

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices, and a worker on every core

import canopen
import numpy as np
import pytest
from canopen.sdo import SdoClient
from hypothesis import settings

from drivers.drive_bus import AxisInfo, LimitExceeded, Sample
from hil.model.robot import load_robot, parse_robot
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.measurement import Coupling, Gravity, Inertia
from hil.planning.plan import Plan, PlannedRobot
from hil.planning.strokes import Partner
from hil.planning.trapezoid import Trapezoid
from hil.terminal.console import out
from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.eds import EDS_PATH, drive_entries, key
from sim_plant.drive_settings import DriveSettings
from sim_plant.machine_protocol import AxisEvent, Reading
from sim_plant.serving import plant_channel
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from drivers.drive_bus import Move
    from hil.model.robot import Robot

settings.register_profile("repeatable", deadline=None, derandomize=True, print_blob=True)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile("repeatable")  # another by --hypothesis-profile

SdoClient.RESPONSE_TIMEOUT = 30.0  # canopen's clients have threads, and a busy machine stalls them


@pytest.fixture
def wide_console(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let commands print lines of 200 characters, so that tables are not wrapped."""
    monkeypatch.setattr(out, "width", 200)


class _Path:
    """A trapezoid on the grid of samples."""

    def __init__(self, begin: int, profile: Trapezoid, period: float) -> None:
        times = np.arange(0.0, profile.duration + period, period)
        self._points = list(zip(profile.q(times).tolist(), profile.qd(times).tolist(), strict=True))
        self._begin = begin
        self.rests = begin + len(times) + 5

    def at(self, sample: int) -> tuple[float, float]:
        return self._points[min(max(sample - self._begin, 0), len(self._points) - 1)]


class IdealBus:
    """A DriveBus whose axes follow their trapezoids exactly, and that notes its commands.

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
            here = self._paths[index].at(self.n_samples)[0]
            target = here if index in self.deaf else move.target
            profile = Trapezoid(here, target, move.velocity, move.acceleration)
            self._paths[index] = _Path(self.n_samples + self.LATENCY, profile, self.period)

    def sample(self) -> Sample:
        self.n_samples += 1
        self.time = self.n_samples * self.period
        q, velocity = zip(*(path.at(self.n_samples) for path in self._paths), strict=True)
        load = 3.0 + 1e-3 * (-1) ** self.n_samples
        sample = Sample(
            time=self.time,
            q=q,
            tau=tuple(load + 10.0 * (v > 0) - 10.0 * (v < 0) for v in velocity),
            flags=(0,) * len(self._paths),
            reached=not self.deaf and all(self.n_samples >= path.rests for path in self._paths),
        )
        return self.tamper(sample)

    def halt(self) -> None:
        self.log.append("halted")

    def reset(self) -> None:
        self.log.append("reset")


@pytest.fixture(scope="session", autouse=True)
def _state_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what runs leave in the user's state directory out of it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session")
def manutec() -> Robot:
    return load_robot("manutec-r15")


@pytest.fixture
def ideal_bus(manutec: Robot) -> IdealBus:
    return IdealBus(manutec)


@pytest.fixture
def small_plan(manutec: Robot) -> Plan:
    """One measurement of each kind; about 20 s."""
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


# --- the plant's CANopen side, in front of an ideal machine -------------------------------------


class IdealAxis:
    """An axis that follows its trapezoid exactly; tests may push it off or raise its events."""

    def __init__(self) -> None:
        self.enabled = False
        self.demand = 0.0
        self.velocity = 0.0
        self.offset = 0
        """Measured position minus demand [increments]."""
        self.forced = AxisEvent(0)
        """Events that a test wants to see."""
        self.calls: list[tuple[object, ...]] = []
        self._goal: tuple[float, float, float, float] | None = None
        self._stopping = 0.0

    def enable(self) -> None:
        self.enabled = True
        self.calls.append(("enable",))

    def disable(self) -> None:
        self.enabled = False
        self._goal, self.velocity, self._stopping = None, 0.0, 0.0
        self.calls.append(("disable",))

    def move(
        self, target: float, velocity: float, acceleration: float, deceleration: float
    ) -> None:
        self._goal, self._stopping = (target, velocity, acceleration, deceleration), 0.0
        self.calls.append(("move", target, velocity, acceleration, deceleration))

    def follow(self, target: float, period: float) -> None:
        self.demand, self.velocity = target, 0.0
        self.calls.append(("follow", target, period))

    def stop(self, deceleration: float) -> None:
        self._goal, self._stopping = None, deceleration
        self.calls.append(("stop", deceleration))

    def hold(self) -> None:
        self._goal, self.velocity, self._stopping = None, 0.0, 0.0
        self.calls.append(("hold",))

    def set_torque_limit(self, per_mille: int) -> None:
        self.calls.append(("torque", per_mille))

    def set_following_window(self, window: float, timeout: float) -> None:
        self.calls.append(("window", window, timeout))

    def rebase(self, shift: int) -> None:
        self.demand += shift

    @property
    def events(self) -> int:
        done = AxisEvent.DONE if self._goal is None and not self._stopping else AxisEvent(0)
        still = AxisEvent.STANDSTILL if self.velocity == 0.0 else AxisEvent(0)
        return int(done | still | self.forced)

    def step(self, dt: float) -> None:
        if self._stopping:
            change = min(abs(self.velocity), self._stopping * dt)
            self.velocity -= math.copysign(change, self.velocity)
            self._stopping = self._stopping if self.velocity else 0.0
        elif self._goal is not None:
            target, velocity, acceleration, deceleration = self._goal
            rest = target - self.demand
            wanted = math.copysign(min(velocity, math.sqrt(2 * deceleration * abs(rest))), rest)
            step = max(acceleration, deceleration) * dt
            self.velocity += min(max(wanted - self.velocity, -step), step)
            if abs(rest) <= abs(self.velocity) * dt + deceleration * dt**2:
                self.demand, self.velocity, self._goal = target, 0.0, None
        self.demand += self.velocity * dt

    def reading(self) -> Reading:
        demand = round(self.demand)
        position, velocity = demand + self.offset, round(self.velocity)
        return Reading(position, velocity, 11, -22, demand, -self.offset, self.events)


class IdealMachine:
    """A `Machine` of ideal axes in steps of a millisecond, with the drives that turn them."""

    STEP = 0.001

    def __init__(self, n_axes: int = 6) -> None:
        self.time = 0.0
        self.axes = tuple(IdealAxis() for _ in range(n_axes))
        self.on_event: Callable[[int, int], None] = lambda _axis, _events: None
        self._events = [axis.events for axis in self.axes]
        self.drives = tuple(
            DriveSettings(
                name=f"axis {i + 1}",
                node_id=i + 1,
                vendor_id=0x1234,
                product_code=0x402,
                revision=7,
                serial=100 + i,
                rated_current=5000,
                rated_torque=3000,
                max_torque=3000,
                increments_per_revolution=4096,
                gear=(100, 1),
                software_limits=(-1_000_000, 1_000_000),
                max_motor_speed=6000,
                max_acceleration=5_000_000,
            )
            for i in range(n_axes)
        )

    def advance(self, duration: float) -> None:
        self.time += duration
        steps = round(duration / self.STEP)
        for _ in range(steps):
            for number, axis in enumerate(self.axes):
                axis.step(self.STEP)
                events = axis.events
                if events != self._events[number]:
                    self._events[number] = events
                    self.on_event(number, events)

    def read(self) -> NDArray[np.int64]:
        return np.array([axis.reading() for axis in self.axes], dtype=np.int64).ravel()


@pytest.fixture
def ideal_machine() -> IdealMachine:
    """Six ideal axes behind nodes 1 to 6."""
    return IdealMachine()


@pytest.fixture
def ideal_network(ideal_machine: IdealMachine) -> SlaveNetwork:
    """The plant's drives in front of ideal axes, switched on, time passing by SYNC."""
    network = SlaveNetwork(ideal_machine)
    network.power_on()
    return network


@pytest.fixture
def ideal_channel(monkeypatch: pytest.MonkeyPatch, ideal_machine: IdealMachine) -> str:
    """Name of a `sim_plant` channel with an ideal machine behind it."""
    monkeypatch.setattr(plant_channel, "load_machine", lambda *_: ideal_machine)
    return "ideal"


@pytest.fixture
def master(ideal_channel: str) -> Iterator[canopen.Network]:
    """canopen's own master on the plant, with a remote node for each drive."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    network.connect(interface="sim_plant", channel=ideal_channel)
    for node_id in range(1, 7):
        network.add_node(node_id, str(EDS_PATH))
    yield network
    network.disconnect()


# --- robots of any shape --------------------------------------------------------------------------


class ChainBuilder:
    """Robot files of any serial chain, as text and as robots; limits and drives are all alike."""

    LENGTHS: ClassVar = {"a": 0.3, "b": 0.45}

    def joint(self, kind: str = "revolute", parameters: object = None, **frame: object) -> str:
        """One joint in YAML; `parameters` as a list, or None for all ten."""
        places = ", ".join(f"{key}: {value}" for key, value in {"alpha": 0, **frame}.items())
        present = "" if parameters is None else f", parameters: [{', '.join(parameters)}]"
        return (
            f"  - {{type: {kind}, frame: {{{places}}}{present}, q_min: -1, q_max: 1,"
            " velocity_limit: 1, acceleration_limit: 1, torque_limit: 1,"
            " drive: {gear_ratio: 100, rotor_inertia: 0.001, torque_constant: 1}}\n"
        )

    def robot(
        self, *joints: str, gravity: Sequence[float] = (0, 0, -9.81), ties: Sequence[str] = ()
    ) -> Robot:
        """A robot of these joints."""
        text = f"name: chain\ngravity: {list(gravity)}\nlengths: {self.LENGTHS}\njoints:\n"
        return parse_robot(text + "".join(joints) + f"ties: [{', '.join(ties)}]\n", "chain.yaml")

    def random(self, seed: int) -> Robot:
        """One of one to six joints, rich in parallel and square axes, some with few parameters."""
        rng = np.random.default_rng(seed)
        pick = lambda *choices: choices[rng.integers(len(choices))]  # noqa: E731
        names = np.array(LINK_PARAMETERS)
        joints = [
            self.joint(
                pick("revolute", "revolute", "prismatic"),
                rng.choice(names, rng.integers(8), replace=False) if rng.random() < 0.3 else None,
                alpha=pick("0", "0", "pi/2", "-pi/2", "pi", "pi/4", "0.3"),
                theta=pick("0", "pi/2", "0.7", "pi/4"),
                d=pick("0", "0", "a", "-b", "0.2", "a + 0.1"),
                r=pick("0", "0", "b", "0.11", "a - b"),
            )
            for _ in range(rng.integers(1, 7))
        ]
        gravity = pick((0, 0, -9.81), (0, 0, -9.81), (0, -9.81, 0), (3, 4, -7), (0, 0, 0))
        return self.robot(*joints, gravity=gravity)


@pytest.fixture(scope="session")
def chains() -> ChainBuilder:
    return ChainBuilder()


class Desk:
    """A master without bus and threads: SDO, SYNC and NMT straight into the slave network."""

    def __init__(self, network: SlaveNetwork, machine: IdealMachine) -> None:
        self.network = network
        self.machine = machine
        self.log: list[tuple[float, int, bytes]] = []
        """Every frame that the drives sent."""

    def send(self, identifier: int, data: bytes = b"") -> list[tuple[int, bytes]]:
        frames = self.network.receive(identifier, data)
        self.log += frames
        return [(number, payload) for _, number, payload in frames]

    def sync(self, count: int = 1) -> list[tuple[int, bytes]]:
        return [frame for _ in range(count) for frame in self.send(0x80)]

    def nmt(self, command: int, node: int = 0) -> list[tuple[int, bytes]]:
        return self.send(0, bytes([command, node]))

    def request(self, node: int, *data: int) -> bytes:
        """The response to one SDO frame."""
        frames = self.send(0x600 + node, bytes(data).ljust(8, b"\0"))
        return next(payload for number, payload in frames if number == 0x580 + node)

    def write(self, index: int, value: int, subindex: int = 0, node: int = 1) -> None:
        """Write by expedited SDO; `SdoAbort` when refused."""
        data = struct.pack("<" + drive_entries()[key(index, subindex)].code, value)
        command = 0x23 | (4 - len(data)) << 2
        self._checked(node, command, *struct.pack("<HB", index, subindex), *data)

    def read(self, index: int, subindex: int = 0, node: int = 1) -> int:
        """Read by expedited SDO; `SdoAbort` when refused."""
        response = self._checked(node, 0x40, *struct.pack("<HB", index, subindex))
        code = drive_entries()[key(index, subindex)].code
        return int(struct.unpack_from("<" + code, response, 4)[0])

    def _checked(self, node: int, *data: int) -> bytes:
        response = self.request(node, *data)
        if response[0] == 0x80:
            raise SdoAbort(AbortCode(struct.unpack_from("<I", response, 4)[0]))
        return response

    def map_tpdo(self, transmission: int, *objects: int, number: int = 0, node: int = 1) -> None:
        """Map objects (index << 16 | sub-index << 8 | bits) into a TPDO and switch it on."""
        self._map(0x1800 + number, 0x180 + 0x100 * number, transmission, objects, node)

    def map_rpdo(self, transmission: int, *objects: int, number: int = 0, node: int = 1) -> None:
        """Map objects into an RPDO and switch it on."""
        self._map(0x1400 + number, 0x200 + 0x100 * number, transmission, objects, node)

    def _map(
        self, record: int, identifier: int, kind: int, objects: Sequence[int], node: int
    ) -> None:
        self.write(record, 1 << 31 | identifier + node, 1, node)
        self.write(record, kind, 2, node)
        self.write(record + 0x200, 0, 0, node)
        for subindex, entry in enumerate(objects, start=1):
            self.write(record + 0x200, entry, subindex, node)
        self.write(record + 0x200, len(objects), 0, node)
        self.write(record, identifier + node, 1, node)

    def enable(self, node: int = 1) -> None:
        """To OPERATION ENABLED."""
        for controlword in (0x06, 0x07, 0x0F):
            self.write(0x6040, controlword, node=node)

    def status(self, node: int = 1) -> int:
        return self.read(0x6041, node=node)


@pytest.fixture
def desk(ideal_network: SlaveNetwork, ideal_machine: IdealMachine) -> Desk:
    """A synchronous master of the drives in front of ideal axes."""
    return Desk(ideal_network, ideal_machine)
