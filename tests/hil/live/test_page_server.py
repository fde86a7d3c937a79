"""Permitted clients of the live page, and its content."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from itertools import takewhile
from threading import Thread
from typing import TYPE_CHECKING, Any

import pytest
from live_page import PUSH, SERVER, STOP, Served, events, hand, served, watching

from drivers.drive_bus import Sample
from hil.live import page_requests, page_server, streams
from hil.live.listener import Listener, ListenerFailed
from hil.live.page_requests import (
    FILES,
    LONGEST,
    REQUEST_MAX,
    STRONGEST,
    WAITING_MAX,
    Site,
    is_ours,
    takes_time,
)
from hil.live.page_server import PageServer
from hil.live.streams import CLIENTS_MAX, Streams
from sim_plant.serving import hand as plants_hand

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from conftest import IdealBus

    from hil.model.robot import Robot
    from hil.planning.plan import Plan

HEAVY = {"numpy", "scipy", "numba", "h5py", "canopen", "can", "pydantic", "yaml", "typer", "rich"}


@pytest.fixture
def page() -> Iterator[Served]:
    with served() as found:
        yield found


def wait_until(condition: Any, seconds: float = 20.0) -> None:
    ends = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < ends, "waited in vain"
        time.sleep(0.01)


def test_the_page_and_its_parts_are_served_small(page: Served) -> None:
    size = 0
    for name, (kind, _) in FILES.items():
        status, headers, text = page.ask("GET", f"/{name}")
        assert (status, headers["Content-Type"]) == (200, kind)
        size += len(text)
    assert size < 700_000
    assert page.ask("GET", "/passwd")[0] == 404
    assert page.ask("GET", "/../page_server.py")[0] == 404


def test_the_headline_is_in_the_page_before_any_script(page: Served) -> None:
    assert '<p id="headline" role="status"></p>' in page.ask("GET", "/")[2]
    page.publish("headline", text="Planning <i>the</i> measurements", more="")
    escaped = "Planning &lt;i&gt;the&lt;/i&gt; measurements"
    wait_until(lambda: f'<p id="headline" role="status">{escaped}</p>' in page.ask("GET", "/")[2])


def test_a_browser_may_load_nothing_from_elsewhere(page: Served) -> None:
    headers = page.ask("GET", "/")[1]
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Server"] == "hil"


def test_the_loopback_address_alone_is_listened_to(page: Served) -> None:
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", page.port), timeout=5)


@pytest.mark.parametrize(
    "host", ["evil.example:{}", "127.0.0.1.evil.example:{}", "127.0.0.1:x", "", "[:{}"]
)
def test_a_stranger_s_host_name_is_refused(page: Served, host: str) -> None:
    given = {**STOP, "Host": host.format(page.port)}
    for method, path in (("GET", "/"), ("GET", "/events"), ("POST", "/stop")):
        assert page.ask(method, path, given)[0] == 403
    assert page.stops == []


@pytest.mark.parametrize("host", ["localhost:{}", "127.0.0.1:{}", "LOCALHOST:{}", "localhost:9000"])
def test_our_own_names_are_not_whatever_port_a_tunnel_takes(page: Served, host: str) -> None:
    given = {**STOP, "Host": host.format(page.port)}
    given["Origin"] = f"http://{given['Host']}"
    assert page.ask("GET", "/", given)[0] == 200
    assert page.ask("POST", "/stop", {**given, "Origin": "http://localhost:1"})[0] == 403
    assert page.ask("POST", "/stop", given)[0] == 202


def test_a_refused_name_comes_with_the_one_to_open(page: Served) -> None:
    answer = page.ask("GET", "/", {"Host": "robot.example:8420"})[2]
    assert f"http://localhost:{page.port}/" in answer
    assert "--live-address" in answer


def test_a_page_of_another_site_can_stop_nothing(page: Served) -> None:
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{page.port}"):
        assert page.ask("POST", "/stop", {**STOP, "Origin": origin})[0] == 403
    assert page.ask("POST", "/stop")[0] == 403  # like a form of another site
    assert page.ask("GET", "/stop", STOP)[0] == 404
    assert page.stops == []


def test_our_own_page_can_stop(page: Served) -> None:
    given = {**STOP, "Origin": f"http://127.0.0.1:{page.port}"}
    assert page.ask("POST", "/stop", given)[0] == 202
    wait_until(lambda: page.stops)
    page.ask("POST", "/stop", given)
    assert page.stops == [1]  # a second interrupt would disturb the shutdown by the first


def test_nothing_but_a_stop_can_be_asked_for(page: Served) -> None:
    for path in ("/", "/move", "/events"):
        assert page.ask("POST", path, STOP)[0] == 404
    assert page.ask("PUT", "/stop", STOP)[0] == 501


ENDLESS = f'{{"torque": [0], "lasts": 1{"0" * 400}}}'
PUSHED = '{"torque": [0, 30, 0, 0, 0, 0], "lasts": 0.3}'


def test_a_push_goes_to_the_plant_and_nowhere_else(tmp_path: Path) -> None:
    path = tmp_path / "hand"
    with hand(path) as plant, served("127.0.0.1", 0, "--hand", str(path)) as page:
        given = {**PUSH, "Origin": f"http://127.0.0.1:{page.port}"}
        assert page.ask("POST", "/push", given, PUSHED)[0] == 202
        assert plant.recv(4096).decode() == PUSHED
        assert page.ask("POST", "/push", None, PUSHED)[0] == 403  # like a form of another site
        foreign = {**PUSH, "Origin": "http://evil.example"}
        assert page.ask("POST", "/push", foreign, PUSHED)[0] == 403
        for wrong in ("", "{", "[]", '{"torque": 3, "lasts": 1}', '{"torque": ["x"], "lasts": 1}',
                      '{"torque": [0], "lasts": 1e9}', '{"torque": [0], "lasts": -1}',
                      '{"torque": [0], "lasts": NaN}', '{"torque": [1e9], "lasts": 1}',
                      '{"torque": [Infinity], "lasts": 1}', ENDLESS):  # fmt: skip
            assert page.ask("POST", "/push", PUSH, wrong)[0] == 400
        plant.setblocking(False)
        with pytest.raises(BlockingIOError):
            plant.recv(4096)
        plant.close()
        status, _, text = page.ask("POST", "/push", PUSH, PUSHED)
        assert (status, text) == (503, "the arm cannot be pushed now\n")
        page.publish("end", how="finished", text="")
        wait_until(lambda: page.ask("POST", "/push", PUSH, PUSHED)[0] == 409)
        assert page.stops == []


def test_a_push_is_refused_while_it_would_spoil_what_is_learned(tmp_path: Path) -> None:
    path = tmp_path / "hand"
    with hand(path) as plant, served("127.0.0.1", 0, "--hand", str(path)) as page:
        page.publish("hand", closed="Do not push yet")
        wait_until(lambda: page.ask("POST", "/push", PUSH, PUSHED)[0] == 409)
        assert page.ask("POST", "/push", PUSH, PUSHED)[2] == "Do not push yet\n"
        page.publish("hand", closed="")
        wait_until(lambda: page.ask("POST", "/push", PUSH, PUSHED)[0] == 202)
        assert plant.recv(4096).decode() == PUSHED


def test_the_report_is_served_once_it_is_there_under_its_own_policy(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    with served("127.0.0.1", 0, "--report", str(path)) as page:
        assert page.ask("GET", "/report")[0] == 404
        path.write_text("<p>the report</p>")
        status, headers, text = page.ask("GET", "/report")
        assert (status, text) == (200, "<p>the report</p>")
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert "default-src" not in headers["Content-Security-Policy"]  # the report has its own
        assert page.ask("GET", "/report", {"Origin": "http://evil.example"})[0] == 403
    with served() as page:
        assert page.ask("GET", "/report")[0] == 404


def test_who_waits_for_the_last_page_to_be_closed_does_not_wait_where_none_is_open() -> None:
    with served("127.0.0.1", 0, "--while-open") as page:
        page.publish("report", folder="runs/try", commands=[])
        wait_until(lambda: page.stops != [])


def test_a_push_is_bounded_as_the_plant_bounds_it() -> None:
    assert (STRONGEST, LONGEST) == (plants_hand.STRONGEST, plants_hand.LONGEST)


def test_where_there_is_no_hand_nothing_can_be_pushed(page: Served) -> None:
    assert page.ask("POST", "/push", PUSH, PUSHED)[0] == 404


@pytest.mark.long
def test_a_stop_is_asked_for_once_the_last_page_is_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(page_server, "CLOSED", 1.5)
    passed_on, closed = Streams(), []
    inlet, outlet = os.pipe()
    stdin = os.fdopen(inlet)
    monkeypatch.setattr("sys.stdin", stdin)
    thread = Thread(target=page_server._pass_on, args=(passed_on, lambda: closed.append(1)))
    thread.start()
    time.sleep(2.0)
    assert closed == []  # no client has connected yet
    ours, theirs = socket.socketpair()
    passed_on.add(ours, b"")
    time.sleep(2.5)
    assert closed == []
    theirs.close()
    wait_until(lambda: closed == [1])
    os.close(outlet)
    thread.join()
    stdin.close()
    ours.close()


def test_a_page_that_was_open_for_an_instant_asks_for_the_stop_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(page_server, "CLOSED", 0.2)
    streams, closed = Streams(), list[int]()
    inlet, outlet = os.pipe()
    monkeypatch.setattr("sys.stdin", stdin := os.fdopen(inlet))
    thread = Thread(target=page_server._pass_on, args=(streams, lambda: closed.append(1)))
    thread.start()
    ours, theirs = socket.socketpair()
    streams.add(ours, b"")
    theirs.close()
    streams.take(b'{"kind": "headline", "text": "still here"}')  # drops the page
    assert streams.pages == 0
    wait_until(lambda: closed == [1])
    os.close(outlet)
    thread.join()
    stdin.close()
    ours.close()


def test_on_another_address_a_secret_is_demanded() -> None:
    with served("0.0.0.0") as page:  # noqa: S104 - on purpose
        secret = page.path.strip("/")
        assert len(secret) >= 20
        for path in ("/", "/events", "/wrong/", f"/{secret[:-1]}/", "/live.js"):
            assert page.ask("GET", path)[0] == 403
        assert page.ask("POST", "/stop", STOP)[0] == 403
        assert page.ask("POST", "/wrong/stop", STOP)[0] == 403
        assert page.ask("GET", page.path)[0] == 200
        assert page.stops == []
        assert page.ask("POST", f"{page.path}stop", STOP)[0] == 202


def test_who_knows_the_secret_may_call_this_computer_by_any_name() -> None:
    with served("0.0.0.0") as page:  # noqa: S104 - on purpose
        given = {**STOP, "Host": f"robot.example:{page.port}"}
        given["Origin"] = f"http://{given['Host']}"
        assert page.ask("GET", page.path, given)[0] == 200
        assert page.ask("GET", "/", given)[0] == 403
        assert page.ask("POST", f"{page.path}stop", given)[0] == 202


def test_no_two_secrets_are_alike() -> None:
    with served("0.0.0.0") as one, served("0.0.0.0") as other:  # noqa: S104 - on purpose
        assert one.path != other.path


def test_a_port_that_is_taken_is_refused_with_the_remedy(page: Served) -> None:
    refusal = f"port {page.port} .* --live PORT, or 0"
    with pytest.raises(ListenerFailed, match=refusal), served(port=page.port):
        pass


def test_an_address_of_another_computer_is_refused_with_the_remedy() -> None:
    elsewhere = Listener("the live page", SERVER, "203.0.113.9", "0")
    with pytest.raises(ListenerFailed, match="give an address of this computer with --live-addr"):
        elsewhere.start(lambda: None)


def test_a_late_page_is_told_what_has_passed(
    page: Served, manutec: Robot, small_plan: Plan, ideal_bus: IdealBus
) -> None:
    page.begin(manutec, small_plan, ideal_bus.axes)
    page.publish("note", text="a drive noted something")
    page.publish("event", name="Travelled", doing="measuring g1 (gravity)", notice="", t=1.0)
    page.publish("level", axis=1, level=50.0)
    page.publish("level", axis=1, level=51.0)
    for t in (1.0, 2.0):
        page.sample(Sample(t, (0.0,) * 6, (1.0,) * 6, (0,) * 6, False))
    page.publish("end", how="finished", text="")
    with watching(page.port) as early:
        assert any(line["kind"] == "end" for line in events(early))  # all lines received
    assert page.ask("POST", "/stop", STOP)[0] == 409
    with watching(page.port) as late:
        got = [*takewhile(lambda line: line["kind"] != "end", events(late))]
    assert [line["kind"] for line in got] == [
        "start", "note", "armed", "event", "level", "sample",
    ]  # fmt: skip
    assert got[-2]["level"] == 51.0
    assert got[-1]["t"] == 2.0


@pytest.mark.long
def test_one_page_too_many_is_refused_and_the_others_go_on(page: Served) -> None:
    pages = [watching(page.port) for _ in range(CLIENTS_MAX)]
    streams_of = [events(each) for each in pages]
    assert all(next(each)["kind"] == "alive" for each in streams_of)
    status, _, text = page.ask("GET", "/events")
    assert (status, text) == (503, "too many pages are open; close one\n")
    page.publish("note", text="still here")
    for each in streams_of:
        assert any(line.get("text") == "still here" for line in each)
    closed = pages.pop()
    closed.shutdown(socket.SHUT_RDWR)
    wait_until(lambda: _is_served(page))
    for each in (*streams_of, *pages, closed):
        each.close()


def _is_served(page: Served) -> bool:
    with watching(page.port) as one:
        return b"200" in one.recv(100).split(b"\r\n")[0]


def test_connections_that_ask_for_nothing_cost_only_themselves(page: Served) -> None:
    """With too many connections the oldest get their answer at once, and service continues."""
    with watching(page.port) as one:
        got = events(one)
        idle = [socket.create_connection(("127.0.0.1", page.port)) for _ in range(WAITING_MAX + 1)]
        idle[0].settimeout(30)
        assert b"503" in idle[0].recv(100)
        page.publish("note", text="still here")
        assert any(line.get("text") == "still here" for line in got)
    for each in idle:
        each.close()


def test_a_stop_takes_a_tenth_of_a_second_beside_200_connections_that_send_byte_by_byte(
    page: Served,
) -> None:
    request = iter(b"POST /stop HTTP/1.0\r\n" + b"X-Slow: 1\r\n" * 40)
    slow = [socket.create_connection(("127.0.0.1", page.port)) for _ in range(200)]
    took = []
    for _ in range(5):
        byte = bytes([next(request)])
        for each in slow:
            with suppress(OSError):  # closed in favour of a newer one
                each.send(byte)
        begun = time.monotonic()
        assert page.ask("POST", "/stop", STOP)[0] == 202
        took.append(time.monotonic() - begun)
    assert sorted(took)[2] < 0.1
    for each in slow:
        each.close()


def test_a_stop_is_taken_where_every_place_of_a_page_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(page_server, "CONNECTIONS_MAX", 1)
    with _serve_in_process() as (port, stops):
        with watching(port) as one:
            assert b"200" in one.recv(100)
            with watching(port) as other:
                assert b"503" in other.recv(100)
            with socket.create_connection(("127.0.0.1", port), timeout=30) as asking:
                asking.sendall(
                    b"POST /stop HTTP/1.0\r\nHost: 127.0.0.1:%d\r\nX-Hil-Stop: 1\r\n\r\n" % port
                )
                assert b"202" in asking.recv(100)
        assert stops == [1]


def test_a_request_that_does_not_come_whole_in_time_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(page_requests, "DEADLINE", 0.2)
    with (
        _serve_in_process() as (port, _),
        socket.create_connection(("127.0.0.1", port), timeout=30) as slow,
    ):
        slow.sendall(b"GET / HTTP/1.0\r\n")
        begun = time.monotonic()
        assert slow.recv(100) == b""
        assert time.monotonic() - begun < 5.0


def test_a_request_that_is_too_large_is_left(page: Served) -> None:
    with socket.create_connection(("127.0.0.1", page.port), timeout=30) as large:
        with suppress(OSError):
            large.sendall(b"GET / HTTP/1.0\r\n" + b"X: 1\r\n" * REQUEST_MAX)
        with suppress(ConnectionResetError):
            assert large.recv(100) == b""
    assert page.ask("GET", "/")[0] == 200


@contextmanager
def _serve_in_process() -> Iterator[tuple[int, list[int]]]:
    """Serve in a thread of this process; it ends with the tests."""
    stops: list[int] = []
    site = Site(Streams(), lambda: stops.append(1), "")
    server = PageServer("127.0.0.1", 0, site)
    Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
    yield server.server_port, stops


def test_who_does_not_know_the_secret_takes_no_place() -> None:
    site = Site(Streams(), list, "s3cret")
    for path, known in (("/s3cret/events", True), ("/s3cret/", True), ("/s3cret/none", False),
                        ("/events", False), ("/", False), ("/wrong/events", False)):  # fmt: skip
        assert takes_time(f"GET {path} HTTP/1.0\r\n\r\n".encode(), site) == known
    assert not takes_time(b"POST /s3cret/stop HTTP/1.0\r\n\r\n", site)


AS_ANOTHER_USER = """
import encodings.idna, json, os, socket, sys
os.setgroups([]); os.setresgid(*[61_002] * 3); os.setresuid(*[61_002] * 3)
port, got = int(sys.argv[1]), []
for what in ("GET /", "GET /events", "POST /stop", "POST /push"):
    with socket.create_connection(("127.0.0.1", port), timeout=30) as asked:
        head = f"Host: 127.0.0.1:{port}\\r\\nX-Hil-Stop: 1\\r\\nX-Hil-Push: 1\\r\\n\\r\\n"
        asked.sendall(f"{what} HTTP/1.0\\r\\n{head}".encode())
        got.append(int(asked.recv(100).split()[1]))
print(json.dumps(got))
"""


@pytest.mark.skipif(
    os.geteuid() != 0 or not os.path.exists("/proc/net/tcp"),  # noqa: PTH110
    reason="root alone can become another user, and Linux alone says whose a connection is",
)
def test_another_user_of_this_computer_neither_watches_nor_stops_the_run(page: Served) -> None:
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", AS_ANOTHER_USER, str(page.port)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == [403, 403, 403, 403]
    assert page.stops == []
    assert page.ask("GET", "/")[0] == 200


@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6])
def test_a_connection_of_our_own_is_ours(family: socket.AddressFamily) -> None:
    with socket.socket(family) as listening:
        try:
            listening.bind(("::1" if family == socket.AF_INET6 else "127.0.0.1", 0))
        except OSError:
            pytest.skip("this computer has no such addresses")
        listening.listen()
        with socket.create_connection(listening.getsockname()[:2]):
            connection, _ = listening.accept()
            with connection:
                assert is_ours(connection)


def test_a_connection_that_was_closed_at_once_is_nobody_s() -> None:
    """The kernel reports root as the owner of any closed socket, also of another user."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        client = socket.create_connection(server.getsockname())
        connection, _ = server.accept()
        with connection:
            assert is_ours(connection)
            client.close()
            assert not is_ours(connection)


def test_a_page_that_never_reads_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "PATIENCE", 0.0)
    ours, theirs = socket.socketpair()
    reading, read = socket.socketpair()
    passed_on = Streams()
    deaf = passed_on.add(ours, b"")
    other = passed_on.add(reading, b"")
    assert deaf
    assert other
    sample = b'{"kind":"sample","q":[' + b"0.123456," * 100 + b"0]}"
    for _ in range(2000):
        passed_on.take(sample)
        read.recv(1_000_000)
        if deaf.left.is_set():
            break
    assert deaf.left.is_set()
    assert not other.left.is_set()
    for each in (ours, theirs, reading, read):
        each.close()


def test_a_page_that_is_behind_misses_samples_and_no_notice() -> None:
    ours, theirs = socket.socketpair()
    passed_on = Streams()
    client = passed_on.add(ours, b"")
    assert client
    for number in range(3000):
        passed_on.take(b'{"kind":"sample","t":%d,"q":[%s0]}' % (number, b"0.123456," * 100))
        if number % 1000 == 500:
            passed_on.take(b'{"kind":"note","text":"note %d"}' % number)
    got = b""
    while client.is_behind:
        got += theirs.recv(1_000_000)
        passed_on.flush()
    ours.close()
    while chunk := theirs.recv(1_000_000):
        got += chunk
    assert got.count(b'"sample"') < 300
    assert [got.count(b"note %d" % number) for number in (500, 1500, 2500)] == [1, 1, 1]
    theirs.close()


def test_a_line_that_was_cut_off_is_left_out(page: Served) -> None:
    with watching(page.port) as one:
        got = events(one)
        page.listener.write(b'{"kind":"note","te\n')
        page.publish("note", text="whole")
        assert next(line for line in got if line["kind"] == "note")["text"] == "whole"


def test_the_server_ends_with_the_run_and_says_so(page: Served) -> None:
    """This includes a killed run, whose end of the pipe is then closed."""
    with watching(page.port) as one:
        got = events(one)
        next(got)
        begun = time.monotonic()
        page.listener.close()
        assert time.monotonic() - begun < 2.0
        *_, last = got
    assert (last["kind"], last["how"]) == ("end", "lost")


@pytest.mark.parametrize(
    ("module", "needed"),
    [(SERVER, set()), ("hil.cli.trying, hil.cli.measuring, hil.live.audience", {"rich", "typer"})],
)
def test_it_is_there_before_numerics_and_the_bus_are_loaded(module: str, needed: set[str]) -> None:
    program = f"import sys; import {module}; print(*sys.modules)"
    loaded = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not set(loaded.stdout.split()) & (HEAVY - needed)
