"""Joint states of ROS, as MCAP, rosbag2 or rosbag: read without ROS.

A message names its joints, in any order and not always all of them; so columns go by name:
``position/elbow``, ``velocity/elbow``, ``effort/elbow``. The columns ``sec`` and ``nanosec`` are
the stamp of the message's header, ``time`` is the same in ns, and ``received`` the bag's own in ns.

Messages of one layout are read at once (`joint_state_rows`), others one by one by rosbags.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.readers.joint_state_layout import PARTS
from hil.imports.readers.joint_state_rows import Rows
from hil.imports.tables import ROWS
from hil.optional_packages import needed_for
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.map_file import Format


TYPE = "sensor_msgs/msg/JointState"
_LOOKED_AT = 200
_TIMES = ("time", "received", "sec", "nanosec")


class JointStates:
    """Messages of one topic as a table; see `hil.imports.tables.Table`."""

    time: tuple[int, ...] = (_TIMES.index("sec"), _TIMES.index("nanosec"))

    def __init__(self, path: Path, topic: str | None) -> None:
        self.path = path
        self._topic = _topic_of(path, topic)
        self.names = (*_TIMES, *self._joints())

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block; messages with none of the joints asked for are no rows."""
        wanted = [self.names[index].partition("/")[::2] for index in columns]
        with _opened(self.path) as reader, _Sound(self.path):
            rows = Rows(wanted, lambda data: reader.deserialize(data, TYPE), cdr=reader.is2)
            messages = self._raw(reader)
            while block := list(islice(messages, ROWS)):
                found = rows.of([data for _, data in block], np.array([r for r, _ in block], float))
                if len(found):
                    yield found

    def _joints(self) -> list[str]:
        names: dict[str, None] = {}
        for number, message in enumerate(self._messages()):
            for part in PARTS:
                if len(getattr(message, part)) == len(message.name):
                    names |= {f"{part}/{joint}": None for joint in message.name}
            if number == _LOOKED_AT:
                break
        return sorted(names, key=lambda name: PARTS.index(name.partition("/")[0]))

    def _messages(self) -> Iterator[Any]:
        with _opened(self.path) as reader, _Sound(self.path):
            for _, data in self._raw(reader):
                yield reader.deserialize(data, TYPE)

    def _raw(self, reader: Any) -> Iterator[tuple[int, bytes]]:
        here = [c for c in reader.connections if c.topic == self._topic and c.msgtype == TYPE]
        for _, received, data in reader.messages(here):
            yield received, data


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
        if stated is None and len(topics) > 1:
            with _Sound(path):
                topics = [t for t in topics if _has_efforts(reader, t)] or topics
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


def _has_efforts(reader: Any, topic: str) -> bool:
    """Whether the first joint state of a topic has efforts; set-points have none."""
    here = [c for c in reader.connections if c.topic == topic and c.msgtype == TYPE]
    for _, _, data in reader.messages(here):
        return len(reader.deserialize(data, TYPE).effort) > 0
    return False


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
