"""What the processes beside a run have in common: what they say to it, their address."""

from __future__ import annotations

import json
import os
import sys
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


def begin_listening() -> Callable[..., None]:
    """Let the run go first; return what says something to it, from any thread.

    For the process itself: a kind of line, and its text.
    """
    os.nice(10)
    lock = Lock()

    def say(kind: str, text: str = "") -> None:
        with lock:
            sys.stdout.write(json.dumps({"kind": kind, "text": text}) + "\n")
            sys.stdout.flush()

    return say


def url_host(address: str) -> str:
    """Return an IP address as it stands in a URL."""
    return f"[{address}]" if ":" in address else address
