"""External pushes of the plant's arm, by a socket independent of the bus.

A push is a datagram to a Unix socket: a JSON object with ``torque``, a number for each axis [N m or
N], and ``lasts``, the duration until the push ends unless the next datagram has come [s of the
plant's time, at most `LONGEST`]. The duration counts from the instant at which the plant receives
the push. Other datagrams are ignored.
"""

from __future__ import annotations

import json
import math
import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from checked_files.yaml_file import FileError
from sim_plant.physics import state as st

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from sim_plant.plant import Plant

LONGEST = 1.0
"""Maximum duration of a push [s], since the sender may have gone."""
STRONGEST = 1e4
"""Maximum torque or force of a push [N m or N], ten times the limit of large arms."""
_SIZE = 4096  # enough for 64 axes


class Hand:
    """Receiver of pushes as datagrams.

    A push by a fault plan on the same axes is replaced while the hand pushes.

    Parameters
    ----------
    path : str
        Path of the socket; a socket of this user left by another plant is replaced.
    plant : Plant

    Raises
    ------
    FileError
        Another file has this path, or no socket can be made there.
    """

    def __init__(self, path: str, plant: Plant) -> None:
        self._path, self._state = path, plant.state
        self._ends = -math.inf
        self._socket = _bound(path)

    def act(self, time: float) -> None:
        """Apply the pushes received until a time of the plant [s], and end expired ones."""
        while True:
            try:
                pushed = _push(self._socket.recv(_SIZE), len(self._state))
            except BlockingIOError:
                break
            except OSError:  # closed
                return
            if pushed is not None:
                self._state[:, st.PUSH], self._ends = pushed[0], time + pushed[1]
        if time >= self._ends:
            self._state[:, st.PUSH], self._ends = 0.0, math.inf

    def close(self) -> None:
        """End the push and remove the socket."""
        self._state[:, st.PUSH] = 0.0
        self._socket.close()
        with suppress(OSError):
            Path(self._path).unlink()


def _push(datagram: bytes, n_axes: int) -> tuple[NDArray[np.float64], float] | None:
    """Return torques and duration; None for a datagram that is not a push of this plant."""
    try:
        said: Any = json.loads(datagram)
        torque = np.array(said["torque"], dtype=float)
        lasts = float(said["lasts"])
    except (ValueError, TypeError, KeyError, ArithmeticError, RecursionError):
        return None
    if torque.shape != (n_axes,) or not np.isfinite([*torque, lasts]).all():
        return None
    return torque.clip(-STRONGEST, STRONGEST), min(max(lasts, 0.0), LONGEST)


def _bound(path: str) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    made.setblocking(False)
    try:
        if _left_behind(Path(path)):
            Path(path).unlink()
        made.bind(path)
    except OSError as error:
        made.close()
        raise FileError(
            f"hand={path}: no socket can be made there: {error.strerror or error}; give the path of"
            " a file that does not exist, at most 100 bytes long, in a folder that may be written"
        ) from error
    return made


def _left_behind(path: Path) -> bool:
    """Return True if a path is a socket of this user (no link) without a listener."""
    if path.is_symlink() or not path.is_socket() or path.lstat().st_uid != os.getuid():
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as knock:
        try:
            knock.connect(str(path))
        except ConnectionRefusedError:
            return True
        except OSError:  # an error of another kind: the name is in use
            return False
    return False
