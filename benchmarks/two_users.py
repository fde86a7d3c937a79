"""Attack on another user's local bus and live page on this computer, as root for two users.

    sudo .venv/bin/python benchmarks/two_users.py

Both users are numbers without an account. Each line states an attempt and its result; the exit
status is 1 if data of the other user were read, stopped or deleted.
"""

from __future__ import annotations

import os
import shutil
import socket
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import can

from drivers.can_bus.local_bus import LocalBus
from hil.live import page_server

if TYPE_CHECKING:
    from collections.abc import Callable

OWNER, STRANGER = 54321, 54322


def become(user: int) -> None:
    """Change this process to a user without further groups."""
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)


def act_as_user(user: int, act: Callable[[], object]) -> str:
    """Return the result of an action of a user, from a separate process."""
    reading, writing = os.pipe()
    if not (child := os.fork()):
        become(user)
        try:
            said = f"done: {act()!r}"
        except Exception as error:
            said = f"refused: {type(error).__name__}: {error}"
        os.write(writing, said.encode()[:4000])
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as answer:
        said = answer.read().decode()
    os.waitpid(child, 0)
    return said


def stop_and_close(port: int, *, wait: bool) -> bytes:
    """Request a stop from the live page; with `wait` return the answer, else close at once."""
    request = f"POST /stop HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\nX-Hil-Stop: 1\r\n\r\n"
    with socket.create_connection(("127.0.0.1", port)) as page:
        page.sendall(request.encode())
        return page.recv(100) if wait else b""


def bus_actions(folder: Path, sockets: list[Path]) -> dict[str, Callable[[], object]]:
    """Return the actions of another user against a channel of the local bus, by name."""

    def send() -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as mine:
            mine.sendto(bytes(16), str(sockets[0]))

    return {
        "list the channel": lambda: list(folder.iterdir()),
        "send to its sockets": send,
        "delete a socket": sockets[0].unlink,
        "rename the channel": lambda: folder.rename(folder.parent / "gone"),
        "rename the user's folder": lambda: folder.parent.rename(folder.parents[1] / "gone"),
        "make a channel in it": (folder.parent / "other").mkdir,
    }


def attack_bus() -> list[str]:
    """Attack a channel with two members, and a channel with a folder made by the attacker."""
    os.environ.pop("XDG_RUNTIME_DIR", None)
    wrong = []
    folder = Path(tempfile.gettempdir()) / f"can-local-{OWNER}" / "two-users"
    reading, writing = os.pipe()
    if not (child := os.fork()):
        become(OWNER)
        with LocalBus("two-users") as first, LocalBus("two-users") as second:
            os.write(writing, b"ready")
            called = second.recv(60)
            first.send(can.Message(arbitration_id=2, is_extended_id=False))
            os._exit(0 if called and second.recv(1) else 1)
    os.read(reading, 5)
    sockets = sorted(folder.iterdir())
    for what, act in bus_actions(folder, sockets).items():
        said = act_as_user(STRANGER, act)
        print(f"bus, {what}: {said}")
        wrong += [what] if said.startswith("done") else []
    if sorted(folder.iterdir()) != sockets:
        wrong.append("sockets are gone")

    def call() -> None:
        with LocalBus("two-users") as bus:
            bus.send(can.Message(arbitration_id=1, is_extended_id=False))

    print(f"bus, the owner sends: {act_as_user(OWNER, call)}")
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        wrong.append("frames of the owner were lost")
    shutil.rmtree(planted := folder.parent)
    act_as_user(STRANGER, lambda: planted.mkdir(mode=0o777))
    said = act_as_user(OWNER, lambda: LocalBus("two-users"))
    print(f"bus, the owner joins a folder that the stranger made: {said}")
    wrong += ["planted folder"] if said.startswith("done") else []
    shutil.rmtree(planted)
    return wrong


def attack_page() -> list[str]:
    """Attempt to watch and to stop the owner's live page as another user."""
    wrong: list[str] = []
    (given, end), (reading, said_by) = os.pipe(), os.pipe()
    if not (child := os.fork()):
        os.dup2(given, 0)
        os.dup2(said_by, 1)
        for each in (given, end, reading, said_by):
            os.close(each)
        become(OWNER)
        page_server.main("127.0.0.1", "0")
        os._exit(0)
    os.close(given)
    os.close(said_by)
    port = int(os.read(reading, 1000).split(b"127.0.0.1:")[1].split(b"/")[0])

    def ask(path: str) -> bytes:
        with socket.create_connection(("127.0.0.1", port)) as asking:
            asking.sendall(f"GET {path} HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            return asking.recv(100).split(b"\r\n")[0]

    for path in ("/", "/events"):
        said = act_as_user(STRANGER, lambda path=path: ask(path))
        print(f"page, get {path}: {said}")
        wrong += [path] if b"403" not in said.encode() else []
    print(f"page, stop: {act_as_user(STRANGER, lambda: stop_and_close(port, wait=True)[:30])}")
    for _ in range(50):
        act_as_user(STRANGER, lambda: stop_and_close(port, wait=False))
    os.set_blocking(reading, False)
    try:
        stopped = b"stop" in os.read(reading, 10_000)
    except BlockingIOError:
        stopped = False
    print(f"page, 50 stops of connections that were closed at once: stopped {stopped}")
    wrong += ["stopped"] if stopped else []
    said = act_as_user(OWNER, lambda: ask("/"))
    print(f"page, the owner gets /: {said}")
    wrong += ["owner refused"] if "200" not in said else []
    os.close(end)
    os.waitpid(child, 0)
    return wrong


if __name__ == "__main__":
    if os.getuid():
        sys.exit("two_users.py: must be root, to become both users")
    "localhost".encode("idna")  # loads modules that the users may have no right to read
    found = attack_bus() + attack_page()
    print("of the other's was read, stopped or deleted:", ", ".join(found) or "nothing")
    sys.exit(bool(found))
