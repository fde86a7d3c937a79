"""Foxglove receives the measured data, and no client disturbs a run."""

from __future__ import annotations

import json
import re
import socket
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import typer

pytest.importorskip("foxglove")
pytest.importorskip("rosbags")

from foxglove_client import PATIENCE, FoxgloveClient, connected, subscribe
from rosbags.typesys import Stores, get_typestore

from hil.cli.measuring import OnBus, Shown, insert_ports, listeners, measure
from hil.export.recordings.ros_messages import FAULT, OK, STALE, WARNING, RosMessages
from hil.live import lines
from hil.live.foxglove_server import TOPICS, RosLines
from hil.live.listener import Listener, ListenerFailed, encode
from hil.planning.measurement import Gravity
from hil.planning.plan import Plan, PlannedRobot
from hil.runs import SIMULATED
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.model.robot import Robot

MODULE = "hil.live.foxglove_server"


def free_port() -> int:
    """Return a port that was free a moment ago."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


@pytest.fixture
def port() -> int:
    return free_port()


def run(plan: Plan, robot: Robot, folder: Path, port: int) -> Listener:
    listener = Listener("the stream to Foxglove", MODULE, "127.0.0.1", str(port))
    how = OnBus(SIMULATED, None, None, None, listeners=[listener])
    measure(plan, robot, Path("plan.yaml"), folder, how)
    return listener


def wait_until(true: Callable[[], object]) -> None:
    """Wait for a condition."""
    end = time.monotonic() + 3 * PATIENCE
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def values_of(status: Any) -> dict[str, str]:
    return {each.key: each.value for each in status.values}


@pytest.fixture(scope="module")
def shown(
    manutec: Robot, tmp_path_factory: pytest.TempPathFactory
) -> tuple[FoxgloveClient, RunFolder]:
    """Client that watched a run, and its recording."""
    folder, port = tmp_path_factory.mktemp("shown") / "run", free_port()
    measurements = (
        Gravity(
            id=f"g{k}", axis=2, q=(0.0, -0.3, 0.2, 0.0, 0.5, 0.0), stroke=0.4, velocity=0.4,
            acceleration=8.0, cycles=2,
        )
        for k in (1, 2)
    )  # fmt: skip
    robot = PlannedRobot(name=manutec.name, digest=manutec.digest)
    with pytest.MonkeyPatch.context() as patch, FoxgloveClient(port) as client:
        patch.setattr("hil.live.feed._EVERY", 0.002)  # lock-step takes only a moment
        run(Plan(robot=robot, measurements=tuple(measurements)), manutec, folder, port)
    return client, RunFolder.open(folder)


def test_joint_states_are_what_was_measured(shown: tuple[FoxgloveClient, RunFolder]) -> None:
    client, folder = shown
    recordings = {
        f"{t:.4f}": (q, tau)
        for each in folder
        for t, q, tau in zip(each.recording.time, each.recording.q, each.recording.tau, strict=True)
    }
    diagnostics = client.select("/diagnostics")
    times = {stamp: values_of(content.status[0])["bus time [s]"] for stamp, content in diagnostics}
    stamps = Counter(stamp for stamp, _ in diagnostics)
    compared = 0
    for stamp, state in client.select("/joint_states"):
        # a slow client misses messages, and a busy computer stamps two with the same ms
        if stamps[stamp] == 1 and times[stamp] in recordings:
            q, tau = recordings[times[stamp]]
            np.testing.assert_allclose(state.position, q, atol=1e-6)
            np.testing.assert_allclose(state.effort, tau, atol=1e-4)
            compared += 1
        assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == stamp
        assert state.velocity.size == 0
    assert compared > 5


def test_channels_are_of_ros_2_and_clients_may_only_look(
    shown: tuple[FoxgloveClient, RunFolder],
) -> None:
    client, _ = shown
    assert {each["topic"]: each["schemaName"] for each in client.channels.values()} == TOPICS
    assert {each["encoding"] for each in client.channels.values()} == {"cdr"}
    assert {each["schemaEncoding"] for each in client.channels.values()} == {"ros2msg"}
    assert client.info["capabilities"] == []


def test_events_go_on_to_the_end(shown: tuple[FoxgloveClient, RunFolder]) -> None:
    client, _ = shown
    said = [(content.name, content.msg) for _, content in client.select("/events")]
    assert ("g2", "measured g2 (gravity)") in said
    assert said[-2:] == [("run", "the axes are stopped and without power"), ("run", "finished")]
    assert {content.level for _, content in client.select("/events")} == {20}


def test_clients_that_never_read_or_die_disturb_nobody(
    small_plan: Plan, manutec: Robot, tmp_path: Path, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hil.live.feed._EVERY", 0.0)  # every sample: more than sockets hold
    many = tuple(
        each.model_copy(update={"id": f"{each.id}-{k}"})
        for k in range(3)
        for each in small_plan.measurements
    )
    plan = small_plan.model_copy(update={"measurements": many})
    bad = [Thread(target=_never_read, args=(port,)), Thread(target=_die, args=(port,))]
    with FoxgloveClient(port) as good:
        for each in bad:
            each.start()
        run(plan, manutec, tmp_path / "run", port)
        for each in bad:
            each.join()
    assert not RunFolder.open(tmp_path / "run").missing
    assert good.select("/events")[-1].content.msg == "finished"


def _never_read(port: int) -> None:
    """Subscribe five times, and read only the first bytes."""
    with ExitStack() as deaf:
        for _ in range(5):
            subscribe(deaf.enter_context(connected(port, max_queue=1)), range(1, 4))
        wait_until(lambda: _refused(port))  # the server ends with the run


def _die(port: int) -> None:
    """Subscribe five times, and disconnect without closing."""
    for _ in range(5):
        with connected(port) as client:
            subscribe(client, range(1, 4))
            client.socket.shutdown(socket.SHUT_RDWR)


def _refused(port: int) -> bool:
    with socket.socket() as asking:
        return asking.connect_ex(("127.0.0.1", port)) != 0


def test_nobody_is_served_but_at_the_address_that_was_asked_for(port: int) -> None:
    listener = Listener("the stream to Foxglove", MODULE, "127.0.0.1", str(port))
    assert listener.start(lambda: None) == (f"Foxglove: open a connection to ws://127.0.0.1:{port}")
    with socket.socket() as other:  # another address of the same computer
        assert other.connect_ex(("127.0.0.2", port)) != 0
    assert not _refused(port)
    listener.close()
    assert _refused(port)


def test_port_0_takes_a_free_one_and_states_it() -> None:
    listener = Listener("the stream to Foxglove", MODULE, "127.0.0.1", "0")
    text = listener.start(lambda: None)
    assert not _refused(int(re.search(r":(\d+)$", text)[1]))
    listener.close()


def test_a_port_that_is_taken_is_refused_before_anything_moves(
    small_plan: Plan, manutec: Robot, tmp_path: Path, port: int
) -> None:
    with socket.create_server(("127.0.0.1", port)), pytest.raises(ListenerFailed) as refused:
        run(small_plan, manutec, tmp_path / "run", port)
    assert f"cannot be served on port {port} of 127.0.0.1" in str(refused.value)
    assert "choose another with --foxglove PORT, or 0 for a free one" in str(refused.value)
    assert not (tmp_path / "run").exists()


def test_a_package_that_is_missing_is_named_with_its_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    absent = 'raise ModuleNotFoundError("no foxglove", name="foxglove")'
    (tmp_path / "foxglove.py").write_text(absent)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(ListenerFailed) as refused:
        Listener("the stream to Foxglove", MODULE, "127.0.0.1", "0").start(lambda: None)
    assert "--foxglove: needs the package foxglove" in str(refused.value)
    remedy = "pip install foxglove-sdk; or, in a checkout, pip install '.[foxglove]'"
    assert remedy in str(refused.value)


# --- lines become messages ------------------------------------------------------------------------


@pytest.fixture
def published(manutec: Robot, small_plan: Plan) -> Callable[..., dict[str, Any]]:
    """Publish lines; return the messages of the last line by topic, deserialized."""
    ros = RosLines(RosMessages("--foxglove", "foxglove"))
    store = get_typestore(Stores.ROS2_HUMBLE)

    def take(kind: str, **values: object) -> dict[str, Any]:
        line = json.loads(encode(kind, **values))
        found = {said.topic: said for said in ros.take(line)}
        return {
            topic: store.deserialize_cdr(said.data, TOPICS[topic]) for topic, said in found.items()
        }

    take("start", **lines.start(manutec, small_plan, None, simulated=True))
    return take


def a_sample(flags: int = 0, tau: float | None = 94.5) -> dict[str, Any]:
    return {"t": 1.5, "q": [0.25] * 6, "tau": [tau] * 6, "flags": [flags, 0, 0, 0, 0, 0]}


def test_a_diagnosis_states_torque_beside_its_limit(published: Any, manutec: Robot) -> None:
    published("armed", axes=[])
    _, first, *_ = published("sample", **a_sample())["/diagnostics"].status
    limit = manutec.torque_limit[0]
    assert (first.name, first.level, first.message) == ("run: joint1", OK, "under power")
    assert values_of(first) == {
        "position [rad]": "0.25",
        "torque [N m]": "94.5",
        "torque limit [N m]": f"{limit:g}",
        "share of the torque limit [%]": f"{9450 / limit:.1f}",
    }


@pytest.mark.parametrize(
    ("flags", "text"), [(8, "the drive limits its torque"), (1, "no sample received")]
)
def test_flags_of_a_sample_warn(published: Any, flags: int, text: str) -> None:
    published("armed", axes=[])
    run, first, second, *_ = published("sample", **a_sample(flags))["/diagnostics"].status
    assert (first.level, first.message) == (WARNING, text)
    assert (run.level, second.level) == (OK, OK)


def test_a_missing_sample_is_nan(published: Any) -> None:
    state = published("sample", **a_sample(1, None))["/joint_states"]
    assert np.isnan(state.effort).all()
    assert (state.position == 0.25).all()


def test_levels_follow_power_and_faults(published: Any) -> None:
    def levels() -> set[int]:
        return {each.level for each in published("sample", **a_sample())["/diagnostics"].status}

    assert levels() == {STALE}
    published("armed", axes=[])
    assert levels() == {OK}
    fault = published("fault", text="axis 1: overcurrent; look at the motor's cable")["/events"]
    assert (fault.level, fault.msg) == (40, "axis 1: overcurrent; look at the motor's cable")
    assert levels() == {FAULT}
    published("off")
    assert levels() == {FAULT}


@pytest.mark.parametrize(
    ("line", "level", "text"),
    [
        ({"kind": "event", "notice": "paused", "doing": "paused"}, 30, "paused"),
        ({"kind": "event", "notice": "", "doing": "warming up"}, 20, "warming up"),
        ({"kind": "note", "text": "a fan stands still"}, 30, "a fan stands still"),
        ({"kind": "end", "how": "failed", "text": "no answer"}, 40, "failed: no answer"),
        ({"kind": "end", "how": "stopped", "text": ""}, 20, "stopped"),
    ],
)
def test_what_is_said_stands_in_the_log(
    published: Any, line: dict[str, str], level: int, text: str
) -> None:
    said = published(**line)["/events"]
    assert (said.level, said.msg, said.name) == (level, text, "run")


# --- the command ----------------------------------------------------------------------------------


def test_without_a_port_the_usual_one_is_meant() -> None:
    assert insert_ports(["run", "--foxglove", "--live", "0"]) == [
        *("run", "--foxglove", "8765", "--live", "0"),
    ]


def test_an_address_needs_what_is_served_at_it() -> None:
    with pytest.raises(typer.BadParameter, match="needs --foxglove"):
        listeners(Shown(foxglove_address="192.168.0.5"))
