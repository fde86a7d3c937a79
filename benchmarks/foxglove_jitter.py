"""SYNC of `hil run` on the wall clock without a stream to Foxglove, with one, and with a client.

Plant, drives and pacing are those of `live_jitter`; the client subscribes to all that is streamed.
The cases take turns. Options go to `hil run`, as --realtime::

    python benchmarks/foxglove_jitter.py [TURNS] [OPTION ...]
"""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

from figures import keep
from live_jitter import Case, measured, prepared, show
from websockets.sync.client import connect

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def follow(url: str) -> None:
    """Subscribe to all streamed channels, and read the stream to its end."""
    with connect(url, subprotocols=["foxglove.sdk.v1"]) as client:
        for message in client:
            if isinstance(message, str) and '"advertise"' in message:
                channels = [each["id"] for each in json.loads(message)["channels"]]
                wanted = [{"id": each, "channelId": each} for each in channels]
                client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


STREAM = ("--foxglove", "0")
CASES = {
    "no stream": Case(),
    "a stream, no client": Case(STREAM),
    "a stream, a client": Case(STREAM, follow),
}


def main(turns: int = 4, *options: str) -> None:
    """Measure in turns, then print and keep the figures."""
    jitter: dict[str, list[NDArray[np.float64]]] = {name: [] for name in CASES}
    with prepared(*options) as (scratch, plan, given):
        for turn in range(turns):
            for name, case in CASES.items():
                jitter[name].append(measured(plan, scratch / f"{turn}-{name}", case, given))
    keep(
        "foxglove-jitter", show(jitter),
        depends=("hil/live", "hil/measuring", "drivers/sync_clock.py"),
        command=" ".join(["python benchmarks/foxglove_jitter.py", str(turns), *options]),
    )  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
