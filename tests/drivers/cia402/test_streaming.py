"""Set-points streamed at every SYNC: drive, driver and sequencer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from fake_fieldbus import axes_of
from local_bench import drives_file

from drivers.axis import AxisScale
from drivers.cia402.cyclic_position import CyclicPosition
from drivers.drive_bus import DriveRefused, LimitExceeded, Move, StreamingBus, Tripped
from drivers.drives_file import load_drives
from drivers.opening import open_drive_bus
from drivers.safety.trips import Trips
from hil.measuring.checks.recording_checks import check
from hil.measuring.travel import pass_slowly, stream
from hil.model.robot import ROBOTS, Robot
from hil.planning.trajectory import Trajectory
from sim_plant.physics import profile_generator
from sim_plant.physics import state as st

if TYPE_CHECKING:
    from collections.abc import Iterator

    from canopen_drive_bus import CanopenDriveBus
    from desk import Desk
    from ideal_machine import IdealMachine

PERIOD = 0.004
TRAJECTORY = Trajectory(
    id="t",
    q=(0.0,) * 6,
    period=2.0,
    cycles=2,
    sine=((0.02, -0.01),) * 6,
    cosine=((0.08, -0.02),) * 6,
)


# The drive


def test_between_regular_set_points_the_demand_is_smooth_and_half_a_period_late() -> None:
    profile = np.zeros((1, st.N_PROFILE))
    t = PERIOD * np.arange(200)
    targets = 0.1 * (1 - np.cos(3 * t))
    seen, speed = [], []
    for number, target in enumerate(targets):
        profile_generator.follow(profile[0], t[number], float(target), PERIOD)
        for part in (0.25, 0.5, 0.75, 1.0):
            profile_generator.evaluate(profile, 0, t[number] + part * PERIOD)
            seen.append(t[number] + part * PERIOD)
            speed.append((profile[0, st.DEMAND], profile[0, st.DEMAND_V]))
    q, v = np.array(speed)[40:].T
    late = np.array(seen)[40:] - 1.5 * PERIOD
    assert q == pytest.approx(0.1 * (1 - np.cos(3 * late)), abs=1e-5)
    assert v == pytest.approx(0.3 * np.sin(3 * late), abs=1e-3)


def test_when_set_points_stay_out_the_demand_rests_at_the_last() -> None:
    profile = np.zeros((1, st.N_PROFILE))
    for number in range(5):
        profile_generator.follow(profile[0], number * PERIOD, 0.001 * number, PERIOD)
        profile_generator.evaluate(profile, 0, (number + 1) * PERIOD)
    profile_generator.evaluate(profile, 0, 6 * PERIOD)
    assert profile[0, st.DEMAND] == pytest.approx(0.004)
    assert profile[0, st.DEMAND_V] == 0.0


def test_a_target_counts_at_once_in_cyclic_mode_and_only_there(
    desk: Desk, ideal_machine: IdealMachine
) -> None:
    desk.enable()
    desk.write(0x607A, 100)
    desk.write(0x6060, 8)
    assert ("follow", 100, PERIOD) not in ideal_machine.axes[0].calls
    desk.write(0x607A, 200)
    assert ideal_machine.axes[0].calls[-1] == ("follow", 200, pytest.approx(PERIOD))
    assert desk.status() & 1 << 12


def test_the_interpolation_period_is_that_of_60c2(desk: Desk, ideal_machine: IdealMachine) -> None:
    desk.write(0x60C2, 25, 1)
    desk.write(0x60C2, -4, 2)
    desk.write(0x6060, 8)
    desk.enable()
    desk.write(0x607A, 200)
    assert ideal_machine.axes[0].calls[-1] == ("follow", 200, pytest.approx(0.0025))


def test_a_target_beyond_the_software_limits_is_clipped(
    desk: Desk, ideal_machine: IdealMachine
) -> None:
    desk.write(0x6060, 8)
    desk.enable()
    desk.write(0x607A, 2_000_000)
    assert ideal_machine.axes[0].calls[-1][:2] == ("follow", 1_000_000)
    assert desk.status() & 1 << 11


def test_halt_stops_a_stream(desk: Desk, ideal_machine: IdealMachine) -> None:
    desk.write(0x6060, 8)
    desk.enable()
    desk.write(0x6040, 0x10F)
    calls = len(ideal_machine.axes[0].calls)
    desk.write(0x607A, 300)
    assert len(ideal_machine.axes[0].calls) == calls
    assert not desk.status() & 1 << 12


# The driver


@pytest.fixture
def bus() -> Iterator[CanopenDriveBus]:
    drives = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    with open_drive_bus(drives, "sim_plant", "manutec-r15") as entered:
        yield entered


def samples(bus: Any, count: int) -> None:
    for _ in range(count):
        bus.sample()


def reach(bus: Any, *targets: float) -> None:
    bus.move({axis: Move(q, 1.0, 5.0) for axis, q in enumerate(targets)})
    while not bus.sample().reached:
        pass


def test_all_axes_follow_a_path_and_move_on_by_themselves_afterwards(bus: CanopenDriveBus) -> None:
    assert isinstance(bus, StreamingBus)
    reach(bus, *TRAJECTORY.start)
    recording = stream(bus, TRAJECTORY)
    path = TRAJECTORY.path(PERIOD)
    away = np.abs(recording.q[1 : len(path) + 1] - path)
    assert away.max() < 0.01
    assert recording.along == pytest.approx(
        PERIOD * (np.arange(recording.n_samples) - 75).clip(max=len(path) - 76)
    )
    assert not recording.slowed.any()
    assert recording.q[-1] == pytest.approx(TRAJECTORY.start, abs=2e-3)
    assert sorted(set(recording.group.tolist())) == [-1, 0, 1]
    assert set(recording.stroke.tolist()) == {-1}
    assert check(recording, TRAJECTORY, Robot.load("manutec-r15")) == []
    reach(bus, *(0.01,) * 6)
    assert bus.sample().q == pytest.approx((0.01,) * 6, abs=2e-3)


def test_a_rehearsal_takes_longer_over_the_same_way(bus: CanopenDriveBus) -> None:
    reach(bus, *TRAJECTORY.start)
    begin = bus.sample().time
    last = pass_slowly(bus, TRAJECTORY, 0.5)
    assert last.time - begin > 2 * TRAJECTORY.period
    assert last.q == pytest.approx(TRAJECTORY.start, abs=2e-3)


@pytest.mark.parametrize(
    ("scale", "shift", "words"),
    [
        (1.0, 0.1, "the path begins at 0.1 rad, the axis is at"),
        (100.0, 0.0, "set-point"),
        (1.0, None, "must have 2 rows or more of 6 axes"),
        (float("nan"), 0.0, "the path begins at nan"),
    ],
)
def test_a_path_beyond_the_limits_is_refused_and_nothing_moves(
    bus: CanopenDriveBus, scale: float, shift: float | None, words: str
) -> None:
    here = np.array(bus.sample().q)
    bump = 0.1 * np.sin(np.linspace(0, np.pi, 200))[:, None] ** 3 * np.ones(6)
    path = here + scale * bump + (shift or 0.0)
    with pytest.raises(LimitExceeded, match=words):
        bus.stream((path[:, :5] if shift is None else path).tolist())
    assert bus.sample().q == pytest.approx(here, abs=1e-3)


@pytest.mark.parametrize(
    ("duration", "size", "words"), [(1.0, 0.6, "velocity"), (0.4, 0.08, "acceleration")]
)
def test_a_path_too_fast_is_refused(
    bus: CanopenDriveBus, duration: float, size: float, words: str
) -> None:
    here = np.array(bus.sample().q)
    t = np.linspace(0, 1, round(duration / PERIOD))[:, None]
    path = here + size * (1 - np.cos(2 * np.pi * t)) * np.array([1, 0, 0, 0, 0, 0])
    with pytest.raises(LimitExceeded, match=words):
        bus.stream(path.tolist())


def test_an_axis_that_leaves_its_path_trips(bus: CanopenDriveBus) -> None:
    reach(bus, *TRAJECTORY.start)
    bus.stream(TRAJECTORY.path(PERIOD).tolist())
    samples(bus, 150)
    assert bus._session is not None
    cyclic = bus._session._cyclic_position
    cyclic._lows = cyclic._highs = [[10**7] * 6] * 5000
    with pytest.raises(Tripped, match="outside"):
        samples(bus, 10)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(("behind", "trips"), [(6, False), (7, True)])
def test_an_axis_may_be_six_periods_and_its_window_behind_what_was_sent(
    axis: int, behind: int, trips: bool
) -> None:
    axes = drives_file().axes
    corridor = Trips(axes_of(axes), PERIOD)
    silent: Any = SimpleNamespace(
        lead=lambda *_: None, command=lambda *_: None, time=0.0, on_arrival=()
    )
    streams = CyclicPosition(silent, axes_of(axes), corridor, PERIOD, lambda: None)
    streams.cyclic = True
    path = np.full((100, 3), 0.4 * PERIOD) * np.arange(100)[:, None]
    q = path[50].copy()
    q[axis] = path[50 - behind, axis] - 0.999 * axes[axis].following_error_window
    scales = [AxisScale.derive(each) for each in axes]
    counts = [scale.position_to_counts(each) for scale, each in zip(scales, q, strict=True)]
    corridor.arm(0.0, counts)
    streams.begin(path)
    for _ in range(50):
        silent.time += PERIOD
        streams.advance()
    brought: Any = SimpleNamespace(positions=counts, irregular=False, currents=[0] * 3)
    looks = [corridor.look(number * PERIOD, brought) for number in range(2)]  # axes take turns
    assert any(looks) is trips


def test_a_stream_can_be_halted(bus: CanopenDriveBus) -> None:
    reach(bus, *TRAJECTORY.start)
    bus.stream(TRAJECTORY.path(PERIOD).tolist())
    for _ in range(250):
        bus.sample()
    bus.halt()
    while not bus.sample().reached:
        pass
    rest = bus.sample().q
    assert bus.sample().q == pytest.approx(rest, abs=1e-3)
    reach(bus, *(0.0,) * 6)


@pytest.mark.parametrize("fed", [False, True])
def test_a_stream_at_full_speed_is_halted_where_the_ramp_ends(fed: bool) -> None:
    """The axis stops beyond the last set-point, within the lag that drives allow."""
    drives, speed = load_drives(ROBOTS / "manutec-r15.drives.yaml"), 2.4
    with open_drive_bus(drives, "sim_plant", "manutec-r15", feed_forward=fed) as bus:
        reach(bus, *(0.0,) * 6)
        turn = round(2 * np.pi * 0.7 / speed / PERIOD)
        phase = 2 * np.pi * np.linspace(0, 1, turn + 1)
        path, velocity = np.tile(bus.sample().q, (turn + 1, 1)), np.zeros((turn + 1, 6))
        path[:, 4] += 0.7 * (1 - np.cos(phase))
        velocity[:, 4] = speed * np.sin(phase)
        bus.stream(path.tolist(), velocity.tolist() if fed else None)
        samples(bus, turn // 4)
        before = bus.sample().q[4]
        bus.halt()
        while not bus.sample().reached:
            pass
        way = bus.sample().q[4] - before
        assert way == pytest.approx(speed**2 / (2 * 5.0), rel=0.1)


def test_a_bus_that_cannot_stream_is_refused() -> None:
    with pytest.raises(DriveRefused, match="accept no cyclic set-points"):
        stream(SimpleNamespace(period=PERIOD), TRAJECTORY)  # type: ignore[arg-type]
