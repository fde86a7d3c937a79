"""Joint states of ROS in MCAP, rosbag2 or rosbag files, read without ROS.

A message names its joints, in any order and not always all of them; so columns go by name:
``position/elbow``, ``velocity/elbow``, ``effort/elbow``. The columns ``sec`` and ``nanosec`` are
the stamp of the message's header, ``time`` is this stamp, ``received`` that of the bag, both in ns.

Messages that name no joints have numbers instead: ``position/1``; so does a part with another
number of values than of names, as efforts without those of a gripper. An MCAP file without its
end is read as far as it goes (`cut_mcap`).

Messages of one layout are read at once (`joint_state_layout`), others one by one by rosbags.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from checked_files.budget import refuse_beyond
from checked_files.yaml_file import FileError
from hil.imports.readers.bags import Bag
from hil.imports.readers.joint_state_layout import PARTS, OtherLayout, layout_of
from hil.imports.tables import ROWS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.arrays import Array, Integers, Mask
    from hil.imports.map_file import Format
    from hil.imports.readers.bags import OpenBag
    from hil.imports.readers.joint_state_layout import MessageLayout

    Places = dict[str, tuple[Integers, Integers]]

TYPE = "sensor_msgs/msg/JointState"
NAME = 300
"""Maximum memory of the name of a column [bytes]; by RSS 104, for 300 000 names."""
LAYOUTS = 32
"""Maximum number of layouts per recording for fast reading; other messages are read one by one."""
LARGEST = 1 << 26
"""Bytes of messages read at once, equal to a block of text."""
LOOKED_AT = 201
"""Number of messages in which columns are found."""
SHOWN = 12
"""Maximum number of names in a note."""
_TIMES = ("time", "received", "sec", "nanosec")


class JointStates:
    """Messages of a topic of a file or folder, as a table (see `hil.imports.tables.Table`)."""

    time: tuple[int, ...] = (_TIMES.index("sec"), _TIMES.index("nanosec"))

    def __init__(self, path: Path, layout: Format) -> None:
        self.path = path
        self._bag = Bag(path)
        self._unequal: dict[str, None] = {}
        self._topic = _topic_of(path, self._bag, layout.topic)
        self.names = (*_TIMES, *self._joints())
        present = {name.partition("/")[0] for name in self.names}
        self.left_out: Mapping[str, str] = {
            part: f"without values in the messages on {self._topic}"
            for part in PARTS
            if part not in present
        }
        self.notes = tuple(self._notes())

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block; messages without any wanted joint are left out."""
        wanted = [self.names[index].partition("/")[::2] for index in columns]
        with self._bag.opened() as bag:
            rows = Rows(wanted, lambda data: bag.deserialize(data, TYPE), cdr=bag.is_cdr)
            messages = bag.messages(self._topic, TYPE)
            while block := list(_some(messages)):
                found = rows.convert(
                    [data for _, data in block], np.array([r for r, _ in block], float)
                )
                if len(found):
                    yield found

    def _joints(self) -> list[str]:
        """Return the columns of the joints in the first messages."""
        names: dict[str, None] = {}
        with self._bag.opened() as bag:
            for _, data in islice(bag.messages(self._topic, TYPE), LOOKED_AT):
                message = bag.deserialize(data, TYPE)
                for part in PARTS:
                    n = len(getattr(message, part))
                    joints = _joints_of(tuple(message.name), n)
                    names |= {f"{part}/{joint}": None for joint in joints}
                    refuse_beyond(self.path, NAME * len(names), f"{len(names)} columns")
                    if n and n != len(message.name) and message.name:
                        self._unequal[
                            f"{n} values of {part} for {len(message.name)} names: columns {part}/1 "
                            f"to {part}/{n}, in order; the names are "
                            f"{', '.join(message.name[:SHOWN])}"
                        ] = None
        return sorted(names, key=lambda name: PARTS.index(name.partition("/")[0]))

    def _notes(self) -> Iterator[str]:
        columns = self.names[len(_TIMES) :]
        if columns and all(column.partition("/")[2].isdigit() for column in columns):
            yield (
                f"its messages have no joint names: columns are {columns[0]} and so on, in order"
            )
        yield from (f"its messages have {each}" for each in self._unequal)
        if self._bag.lacks_end:
            yield "it is truncated (recorder killed?): all complete messages are read"


def _joints_of(names: tuple[str, ...], n: int) -> tuple[str, ...]:
    """Return the joints of `n` values: the names, or numbers where names do not correspond."""
    if len(names) == n:
        return names
    return () if any(map(str.isdigit, names)) else tuple(str(number + 1) for number in range(n))


def _some(messages: Iterator[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
    """Yield the next `ROWS` messages, or fewer large ones."""
    size = 0
    for received, data in islice(messages, ROWS):
        yield received, data
        if (size := size + len(data)) > LARGEST:
            return


def _topic_of(path: Path, bag: Bag, stated: str | None) -> str:
    with bag.opened() as opened:
        kinds = opened.topics  # a closed bag has none
        topics = sorted(topic for topic, kind in kinds.items() if kind == TYPE)
        if stated is None and len(topics) > 1:
            topics = [t for t in topics if _has_efforts(opened, t)] or topics
    if not topics:
        others = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(kinds.items()))
        has = f"its topics are {others}" if others else "it has no topics"
        if bag.lacks_end:
            has = f"it is truncated (recorder killed?), and before the cut {has}"
        raise FileError(
            f"{path}: has no topic of {TYPE}; {has}; record a topic of {TYPE}, or save positions"
            " and torques as columns of a CSV or Parquet file"
        )
    if stated is None and len(topics) > 1:
        raise FileError(
            f"{path}: has joint states on {' and '.join(topics)}; name one in format: topic, or"
            f" with --draft by --format topic={topics[0]}"
        )
    if stated is not None and stated not in topics:
        raise FileError(f"{path}: has no joint states on {stated}, but on {', '.join(topics)}")
    return stated or topics[0]


def _has_efforts(bag: OpenBag, topic: str) -> bool:
    """Return True if the first joint state of a topic has efforts; set-points have none."""
    for _, data in bag.messages(topic, TYPE):
        return len(bag.deserialize(data, TYPE).effort) > 0
    return False


class Rows:
    """Conversion of messages to rows of the wanted columns; names of joints are looked up once.

    Parameters
    ----------
    wanted : sequence of (str, str)
        Part of a message and joint, for all columns; no joint for times.
    general : callable
        Reader of messages of any layout.
    cdr : bool
        True if messages are in CDR, with known layouts.
    """

    def __init__(
        self, wanted: Sequence[tuple[str, str]], general: Callable[[bytes], Any], *, cdr: bool
    ) -> None:
        self._wanted = wanted
        self._times = {part: column for column, (part, joint) in enumerate(wanted) if not joint}
        self._general, self._cdr = general, cdr
        self._places: dict[tuple[tuple[str, ...], tuple[int, ...]], Places] = {}
        self._layouts: list[MessageLayout] = []

    def convert(self, messages: Sequence[bytes], received: Array) -> Array:
        """Return the rows of messages, without messages that have none of the joints.

        Parameters
        ----------
        received : array (n_messages,)
            Stamps of the bag [ns].
        """
        rows = np.full((len(messages), len(self._wanted)), np.nan)
        self._put(rows, slice(None), "received", received)
        present = np.zeros(len(messages), dtype=bool)
        every = np.arange(len(messages))
        for number in self._fill_alike(messages, rows, present) if self._cdr else every:
            message = self._general(messages[number])
            values = {part: np.asarray(getattr(message, part))[np.newaxis] for part in PARTS}
            for part in ("sec", "nanosec"):
                values[part] = np.array([float(getattr(message.header.stamp, part))])
            this = np.array([number])
            present[number] = self._fill(rows, this, tuple(message.name), values)
        return rows[present]

    def _fill_alike(self, messages: Sequence[bytes], rows: Array, present: Mask) -> Integers:
        """Fill the rows of messages of known layouts; return the numbers of all other messages."""
        sizes, left = np.array([len(message) for message in messages]), np.arange(len(messages))
        odd: list[int] = []
        tried = 0
        while len(left) and (tried < len(self._layouts) or len(self._layouts) < LAYOUTS):
            if tried == len(self._layouts) and not self._learn(messages[left[0]]):
                odd.append(int(left[0]))
                left = left[1:]
                continue
            layout, tried = self._layouts[tried], tried + 1
            these = left[sizes[left] == layout.values.itemsize]
            joined = b"".join([messages[number] for number in these])
            fits = layout.fits(joined)
            these, alike = these[fits], np.frombuffer(joined, layout.values)[fits]
            present[these] = self._fill(rows, these, layout.names, alike)
            left = np.setdiff1d(left, these, assume_unique=True)
        return np.concatenate([np.array(odd, dtype=np.int64), left])

    def _learn(self, message: bytes) -> bool:
        """Note the layout of a message, if there is one."""
        try:
            self._layouts.append(layout_of(message))
        except OtherLayout:
            return False
        return True

    def _fill(
        self,
        rows: Array,
        these: Integers,
        names: tuple[str, ...],
        values: Mapping[str, Array] | NDArray[np.void],
    ) -> bool:
        """Fill the rows of messages with equal names; return True if any joint is wanted."""
        key = names, tuple(values[part].shape[1] for part in PARTS)
        if (places := self._places.get(key)) is None:
            places = self._find(*key)
            if len(self._places) < LAYOUTS:
                self._places[key] = places
        for part, (columns, joints) in places.items():
            rows[these[:, np.newaxis], columns] = values[part][:, joints]
        self._put(rows, these, "sec", values["sec"])
        self._put(rows, these, "nanosec", values["nanosec"])
        self._put(rows, these, "time", values["sec"] * 1e9 + values["nanosec"])
        return bool(places)

    def _put(self, rows: Array, these: Integers | slice, name: str, times: Array) -> None:
        if name in self._times:
            rows[these, self._times[name]] = times

    def _find(self, names: tuple[str, ...], sizes: tuple[int, ...]) -> Places:
        """Return the columns filled by a message with the given joints, and the places, by part."""
        found: dict[str, list[tuple[int, int]]] = {}
        joints = {part: _joints_of(names, n) for part, n in zip(PARTS, sizes, strict=True)}
        for column, (part, joint) in enumerate(self._wanted):
            if joint and joint in joints[part]:
                found.setdefault(part, []).append((column, joints[part].index(joint)))
        return {
            part: (np.array([c for c, _ in pairs]), np.array([j for _, j in pairs]))
            for part, pairs in found.items()
        }
