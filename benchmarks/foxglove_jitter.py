"""SYNC of `hil run` on the wall clock without a stream to Foxglove, with one, and with a client.

Plant and pacing are those of `live_jitter`; the client subscribes to all that is streamed. The
cases take turns. Options go to `hil run`, as --realtime::

    python benchmarks/foxglove_jitter.py [TURNS] [OPTION ...]
"""

from __future__ import annotations

import json
import multiprocessing
import socket
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from live_jitter import make_plan, measured
from websockets.sync.client import connect

from hil.planning.plan import dump_plan

if TYPE_CHECKING:
    from numpy.typing import NDArray

CASES = {"no stream": None, "a stream, no client": 0, "a stream, a client": 1}
"""Of each case the number of clients; None where nothing is streamed."""


def free_port() -> int:
    """Return a port that is free."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


def follow(port: int) -> None:
    """Read all that is streamed, from as soon as it is served to the end."""
    while True:
        try:
            with connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"]) as client:
                for message in client:
                    if isinstance(message, str) and '"advertise"' in message:
                        channels = [each["id"] for each in json.loads(message)["channels"]]
                        wanted = [{"id": each, "channelId": each} for each in channels]
                        client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                return
        except OSError:
            time.sleep(0.05)


def of_case(
    plan: Path, folder: Path, clients: int | None, options: tuple[str, ...]
) -> NDArray[np.float64]:
    """Errors of all SYNCs of one run; see `live_jitter.measured`."""
    if clients is None:
        return measured(plan, folder, None, options)
    port, spawn = free_port(), multiprocessing.get_context("spawn")
    following = [spawn.Process(target=follow, args=(port,), daemon=True) for _ in range(clients)]
    for client in following:
        client.start()
    found = measured(plan, folder, None, ("--foxglove", str(port), *options))
    for client in following:
        client.join()
        assert client.exitcode == 0, "a client has failed"
    return found


def main(turns: int = 4, *options: str) -> None:
    """Measure in turns, then print."""
    jitter: dict[str, list[NDArray[np.float64]]] = {name: [] for name in CASES}
    with tempfile.TemporaryDirectory() as scratch:
        plan = Path(scratch) / "plan.yaml"
        plan.write_text(dump_plan(make_plan()))
        for turn in range(turns):
            for name, clients in CASES.items():
                folder = Path(scratch) / f"{turn}-{name}"
                jitter[name].append(of_case(plan, folder, clients, options))
    print("SYNC off its period, ms    rms    99 %    99.9 %    worst    left out    SYNCs")
    for name, each in jitter.items():
        off = np.concatenate(each)
        kept = 1e3 * off[np.isfinite(off)]
        rms = np.sqrt(np.mean(kept**2))
        print(
            f"{name:<24}{rms:>6.2f}{np.quantile(kept, 0.99):>8.2f}{np.quantile(kept, 0.999):>10.2f}"
            f"{kept.max():>9.2f}{len(off) - len(kept):>12}{len(off):>9}"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
