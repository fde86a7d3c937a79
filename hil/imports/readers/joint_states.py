"""Joint states of ROS, as MCAP, rosbag2 or rosbag: read without ROS.

A message names its joints, in any order and not always all of them; so columns go by name:
``position/elbow``, ``velocity/elbow``, ``effort/elbow``. The column ``time`` is the stamp of the
message's header, and ``received`` the bag's own, both in ns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.readers.optional import needed_for
from hil.imports.tables import ROWS
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.imports.map_file import Format

TYPE = "sensor_msgs/msg/JointState"
PARTS = ("position", "velocity", "effort")
_LOOKED_AT = 200


class JointStates:
    """Messages of one topic as a table; see `hil.imports.tables.Table`."""

    time: int | None = 0

    def __init__(self, path: Path, topic: str | None) -> None:
        self.path = path
        self._topic = _topic_of(path, topic)
        self.names = ("time", "received", *self._joints())

    def blocks(self, columns: Sequence[int]) -> Iterator[NDArray[np.float64]]:
        """Read columns block by block; messages with none of the joints asked for are no rows."""
        wanted = [self.names[index].partition("/")[::2] for index in columns]
        rows: list[list[float]] = []
        for message, received in self._messages():
            row = _row(message, received, wanted)
            if row is not None:
                rows.append(row)
            if len(rows) == ROWS:
                yield np.array(rows)
                rows = []
        if rows:
            yield np.array(rows)

    def _joints(self) -> list[str]:
        names: dict[str, None] = {}
        for number, (message, _) in enumerate(self._messages()):
            for part in PARTS:
                if len(getattr(message, part)) == len(message.name):
                    names |= {f"{part}/{joint}": None for joint in message.name}
            if number == _LOOKED_AT:
                break
        return sorted(names, key=lambda name: PARTS.index(name.partition("/")[0]))

    def _messages(self) -> Iterator[tuple[Any, int]]:
        with _opened(self.path) as reader:
            here = [c for c in reader.connections if c.topic == self._topic and c.msgtype == TYPE]
            for connection, received, data in _sound(self.path, reader.messages(here)):
                yield reader.deserialize(data, connection.msgtype), received


def open_bag(path: Path, layout: Format) -> JointStates:
    """Open a file, or folder, of messages.

    Raises
    ------
    FileError
        It is no such file, rosbags is not installed, or its topic of joint states is not clear.
    """
    return JointStates(path, layout.topic)


def _topic_of(path: Path, stated: str | None) -> str:
    with _opened(path) as reader:
        topics = sorted({c.topic for c in reader.connections if c.msgtype == TYPE})
        others = sorted({c.topic for c in reader.connections})
    if not topics:
        has = f"its topics are {', '.join(others)}" if others else "it has no topics"
        raise FileError(f"{path}: has no topic of {TYPE}; {has}")
    if stated is None and len(topics) > 1:
        raise FileError(
            f"{path}: has joint states as {' and '.join(topics)}; name one in format: topic"
        )
    if stated is not None and stated not in topics:
        raise FileError(f"{path}: has no joint states as {stated}, but as {', '.join(topics)}")
    return stated or topics[0]


class _opened:  # noqa: N801 - a context manager, read like a function
    """A bag that is open; what it refuses is a `FileError`."""

    def __init__(self, path: Path) -> None:
        with needed_for(path):
            from rosbags.highlevel import AnyReader  # noqa: PLC0415 - optional
            from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
        self._path = path
        with file_errors(path, "read"), _Sound(path):
            self._reader = AnyReader([path], default_typestore=get_typestore(Stores.LATEST))

    def __enter__(self) -> Any:
        with file_errors(self._path, "read"), _Sound(self._path):
            self._reader.open()
        return self._reader

    def __exit__(self, *_: object) -> None:
        self._reader.close()


class _Sound:
    """What goes wrong inside a bag, of whatever kind, means that the bag is damaged."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None: ...

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if isinstance(error, Exception) and not isinstance(error, OSError | FileError):
            raise FileError(
                f"{self._path}: cannot be read as a bag: {error or type(error).__name__}; a"
                " recorder that was killed may leave one without its end: reindex it"
            ) from error


def _sound(path: Path, messages: Iterator[Any]) -> Iterator[Any]:
    while True:
        with _Sound(path):
            following = next(messages, None)
        if following is None:
            return
        yield following


def _row(message: Any, received: int, wanted: Sequence[tuple[str, str]]) -> list[float] | None:
    at = {name: index for index, name in enumerate(message.name)}
    if not any(joint in at for _, joint in wanted if joint):
        return None
    stamp = message.header.stamp
    times = {"time": stamp.sec * 1e9 + stamp.nanosec, "received": float(received)}
    return [times[p] if not j else _value(getattr(message, p), at.get(j)) for p, j in wanted]


def _value(values: Sequence[float], index: int | None) -> float:
    return float(values[index]) if index is not None and index < len(values) else np.nan
