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

    Indices = NDArray[np.int64]

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
        picked = _Rows([self.names[index].partition("/")[::2] for index in columns])
        rows: list[NDArray[np.float64]] = []
        for message, received in self._messages():
            row = picked.of(message, received)
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
        with _opened(self.path) as reader, _Sound(self.path):
            here = [c for c in reader.connections if c.topic == self._topic and c.msgtype == TYPE]
            for connection, received, data in reader.messages(here):
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


class _Rows:
    """Rows of the columns asked for; where joints stand in a message is looked up once a list.

    Parameters
    ----------
    wanted : sequence of (str, str)
        Of each column the part of a message, and the joint; no joint for times.
    """

    def __init__(self, wanted: Sequence[tuple[str, str]]) -> None:
        self._wanted = wanted
        self._places: dict[tuple[str, ...], dict[str, tuple[Indices, Indices]]] = {}

    def of(self, message: Any, received: int) -> NDArray[np.float64] | None:
        """Row of a message; None where it has none of the joints."""
        names = tuple(message.name)
        if names not in self._places:
            self._places[names] = self._find(names)
        if not (places := self._places[names]):
            return None
        row = np.full(len(self._wanted), np.nan)
        for part, (columns, joints) in places.items():
            values = getattr(message, part)
            if len(values) == len(names):
                row[columns] = values[joints]
        stamp = message.header.stamp
        for column, (part, joint) in enumerate(self._wanted):
            if not joint:
                row[column] = received if part == "received" else stamp.sec * 1e9 + stamp.nanosec
        return row

    def _find(self, names: tuple[str, ...]) -> dict[str, tuple[Indices, Indices]]:
        """Of each part the columns that a message with these joints fills, and from where."""
        found: dict[str, list[tuple[int, int]]] = {}
        for column, (part, joint) in enumerate(self._wanted):
            if joint in names:
                found.setdefault(part, []).append((column, names.index(joint)))
        return {
            part: (np.array([c for c, _ in pairs]), np.array([j for _, j in pairs]))
            for part, pairs in found.items()
        }
