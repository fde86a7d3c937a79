"""Foreign bags unpack to no more than the budget, and contain the declared data.

Harmless input: the budget is lowered, so that bags of some kilobytes exceed it.
"""

from __future__ import annotations

import sqlite3
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from checked_files import budget
from checked_files.yaml_file import FileError
from hil.imports.map_file import Format
from hil.imports.readers import open_table

rosbag2 = pytest.importorskip("rosbags.rosbag2")

from rosbags.rosbag1 import Writer as Writer1  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from hil.imports.readers import bags  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

TYPE = "sensor_msgs/msg/JointState"
ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
N = 40
POSITIONS = np.arange(N, dtype=float)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "BASE", 50_000)
    monkeypatch.setattr(budget, "SHARE", 0)


def _messages(types: Any, size: int) -> Iterator[bytes]:
    """Return joint states of one joint, each with a frame's name of `size` bytes."""
    kinds = types.types
    for k in range(N):
        header = {"seq": k} if types is ROS1 else {}
        stamp = kinds["builtin_interfaces/msg/Time"](sec=k, nanosec=0)
        message = kinds[TYPE](
            header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="f" * size, **header),
            name=["a"], position=POSITIONS[k : k + 1], velocity=np.zeros(1), effort=np.zeros(1),
        )  # fmt: skip
        yield bytes((types.serialize_ros1 if header else types.serialize_cdr)(message, TYPE))


def _ros1(folder: Path, compression: str | None, size: int) -> Path:
    path = folder / "a.bag"
    writer = Writer1(path)
    if compression:
        writer.set_compression(writer.CompressionFormat[compression])
    with writer:
        topic = writer.add_connection("/joint_states", TYPE, typestore=ROS1)
        for k, data in enumerate(_messages(ROS1, size)):
            writer.write(topic, k, data)
    return path


def _ros2(folder: Path, plugin: str, mode: str | None, size: int) -> Path:
    path = folder / "bag"
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
    if mode:
        writer.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with writer:
        topic = writer.add_connection("/joint_states", TYPE, typestore=ROS2)
        for k, data in enumerate(_messages(ROS2, size)):
            writer.write(topic, k, data)
    return path


def positions(path: Path) -> list[float]:
    table = open_table(path, Format())
    return np.concatenate(list(table.blocks([table.names.index("position/a")])))[:, 0].tolist()


MODES: dict[str, Callable[[Path, int], Path]] = {
    "BZ2": lambda folder, size: _ros1(folder, "BZ2", size),
    "LZ4": lambda folder, size: _ros1(folder, "LZ4", size),
    "FILE of MCAP": lambda folder, size: _ros2(folder, "MCAP", "FILE", size),
    "FILE of SQLite": lambda folder, size: _ros2(folder, "SQLITE3", "FILE", size),
    "STORAGE": lambda folder, size: _ros2(folder, "MCAP", "STORAGE", size),
    "MESSAGE": lambda folder, size: _ros2(folder, "SQLITE3", "MESSAGE", size),
}


@pytest.mark.parametrize("mode", MODES)
def test_a_compressed_bag_is_read(tmp_path: Path, mode: str) -> None:
    assert positions(MODES[mode](tmp_path, 10)) == POSITIONS.tolist()


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("mode", sorted(MODES.keys() - {"MESSAGE"}))
def test_a_bag_that_unpacks_beyond_the_budget_is_refused(tmp_path: Path, mode: str) -> None:
    path = MODES[mode](tmp_path, 3000)
    with pytest.raises(FileError, match=r"would take .* at most 0.05 MB allowed .*HIL_READ_LIMIT"):
        positions(path)


@pytest.mark.parametrize("mode", ["MESSAGE", "LZ4"])
def test_a_message_beyond_what_joint_states_are_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    path = MODES[mode](tmp_path, 3000)
    monkeypatch.setattr(bags, "MESSAGE_MAX", 2000)
    with pytest.raises(FileError, match=r"a message of more than 2000 bytes.*another topic"):
        positions(path)


def test_what_was_unpacked_goes_with_the_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bags.tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    bag = bags.Bag(MODES["FILE of MCAP"](tmp_path, 10))
    assert list((tmp_path / "temporary").iterdir())
    del bag
    assert not list((tmp_path / "temporary").iterdir())


@pytest.mark.usefixtures("small")
def test_an_mcap_is_read_chunk_by_chunk_where_all_together_exceed_the_budget(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = pytest.importorskip("mcap.writer")
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        out = writer.Writer(file, chunk_size=10_000, compression=writer.CompressionType.ZSTD)
        out.start(profile="ros2")
        definition = ROS2.generate_msgdef(TYPE)[0].encode()
        schema = out.register_schema(TYPE, "ros2msg", definition)
        channel = out.register_channel("/joint_states", "cdr", schema)
        for k, data in enumerate(_messages(ROS2, 3000)):
            out.add_message(channel, k, data, k)
        out.finish()
    assert sum(each.size for each in bags.mcap_chunks(path).values()) > budget.allowed(path)
    assert positions(path) == POSITIONS.tolist()
    # an index that points to a chunk in the middle of another record
    content = path.read_bytes()
    at = content.rindex(b"\x08", 0, content.rindex(b"zstd"))
    shifted = content[at + 25 : at + 33]
    moved = (int.from_bytes(shifted, "little") + 1).to_bytes(8, "little")
    path.write_bytes(content.replace(shifted, moved))
    monkeypatch.undo()
    with pytest.raises(FileError, match="its index lists a missing chunk"):
        positions(path)


def test_an_index_of_ros_1_that_reads_a_chunk_twice_is_refused(tmp_path: Path) -> None:
    path = _ros1(tmp_path, None, 10)
    content = bytearray(path.read_bytes())
    number = content.index(b"chunk_count=") + len("chunk_count=")
    content[number] = 2
    about = content.rindex(b"chunk_pos=")
    begin = content.rindex(b"ver=", 0, content.index(b"chunk_pos=", about - 200)) - 8
    path.write_bytes(content + content[begin:])
    with pytest.raises(FileError, match="its index refers twice to one place"):
        positions(path)


def test_an_index_of_ros_1_with_more_chunks_than_the_file_holds_is_refused(tmp_path: Path) -> None:
    path = _ros1(tmp_path, None, 10)
    content = bytearray(path.read_bytes())
    # number of connections whose messages the only chunk holds; read one by one it takes minutes
    number = content.rindex(b"count=") + len("count=")
    content[number : number + 4] = b"\xff\xff\xff\x7f"
    path.write_bytes(content)
    with pytest.raises(FileError, match="it ends within its index"):
        positions(path)


@pytest.mark.usefixtures("small")
def test_an_index_of_ros_1_beyond_the_budget_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _ros1(tmp_path, None, 10)
    monkeypatch.setattr(budget, "BASE", 5000)
    with pytest.raises(FileError, match=r"its index would take 0\.008 MB"):
        positions(path)


def _replaced(path: Path, *statements: str) -> None:
    with sqlite3.connect(next(path.glob("*.db3"))) as bag:
        for each in statements:
            bag.execute(each)


VALUES = "INSERT INTO messages SELECT id, topic_id, timestamp{} FROM old"
TABLES = {
    "messages.data' is computed": [
        "ALTER TABLE messages RENAME TO old",
        "CREATE TABLE messages(id, topic_id, timestamp, data AS (zeroblob(1000)))",
        VALUES.format(""),
    ],
    "schema' is computed": ["DROP TABLE schema", "CREATE VIEW schema AS SELECT 4 schema_version"],
    "its values would take": [
        f"ALTER TABLE messages ADD COLUMN more TEXT DEFAULT '{'x' * 2000}'",
    ],
    "'messages' has 34 columns, at most 20 allowed": [
        f"ALTER TABLE messages ADD COLUMN c{k} INTEGER" for k in range(30)
    ],
    "two topics have the same id": [
        "ALTER TABLE topics RENAME TO old",
        "CREATE TABLE topics AS SELECT * FROM old UNION ALL SELECT * FROM old",
    ],
}  # fmt: skip


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("reason", TABLES)
def test_a_database_that_computes_or_repeats_its_values_is_refused(
    tmp_path: Path, reason: str
) -> None:
    path = _ros2(tmp_path, "SQLITE3", None, 10)
    assert positions(path) == POSITIONS.tolist()
    _replaced(path, *TABLES[reason])
    with pytest.raises(FileError, match=reason):
        positions(path)


def test_the_name_of_a_database_opens_no_other_file(tmp_path: Path) -> None:
    """SQLite decodes a path: `..%2Fnotes.db3` in a bag would be notes.db3 beside the bag."""
    path = _ros2(tmp_path, "SQLITE3", None, 10)
    (file,) = path.glob("*.db3")
    (tmp_path / "notes.db3").write_bytes(file.read_bytes())
    listing = (path / "metadata.yaml").read_text()
    file.rename(path / "..%2Fnotes.db3")
    (path / "metadata.yaml").write_text(listing.replace(file.name, "..%2Fnotes.db3"))
    with pytest.raises(FileError, match=r"one of % \? # in its path.*rename"):
        positions(path)


@pytest.mark.parametrize(
    ("before", "after", "match"),
    [("relative_file_paths", "paths", "relative_file_paths: missing"),
     ("bag.db3", "other.db3", "other.db3: is missing; metadata.yaml lists it"),
     ("compression_mode: ''", "compression_mode: FILE", "compressed as '', not as zstd")],
)  # fmt: skip
def test_a_listing_that_is_wrong_is_refused(
    tmp_path: Path, before: str, after: str, match: str
) -> None:
    path = _ros2(tmp_path, "SQLITE3", None, 10)
    listing = (path / "metadata.yaml").read_text()
    assert before in listing
    (path / "metadata.yaml").write_text(listing.replace(before, after))
    with pytest.raises(FileError, match=match):
        positions(path)


OTHER = "std_msgs/msg/Float64MultiArray"


def _other(kinds: Any) -> Any:
    layout = kinds["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    return kinds[OTHER](layout=layout, data=np.zeros(2))


def _vendor_ros1(folder: Path) -> Path:
    path = folder / "a.bag"
    with Writer1(path) as writer:
        for name in ("/currents", "/angles"):
            topic = writer.add_connection(name, OTHER, typestore=ROS1)
            writer.write(topic, 0, ROS1.serialize_ros1(_other(ROS1.types), OTHER))
    return path


def _vendor_ros2(folder: Path, plugin: str) -> Path:
    path = folder / "bag"
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin]) as writer:
        for name in ("/currents", "/angles"):
            topic = writer.add_connection(name, OTHER, typestore=ROS2)
            writer.write(topic, 0, ROS2.serialize_cdr(_other(ROS2.types), OTHER))
    return path


def _vendor_cut(folder: Path) -> Path:
    (path,) = _vendor_ros2(folder, "MCAP").glob("*.mcap")
    path.write_bytes(path.read_bytes()[:-30])
    return path


@pytest.mark.parametrize(
    "write",
    [_vendor_ros1, _vendor_cut, lambda folder: _vendor_ros2(folder, "SQLITE3"),
     lambda folder: _vendor_ros2(folder, "MCAP")],
    ids=["rosbag", "MCAP without its end", "rosbag2 of SQLite", "rosbag2 of MCAP"],
)  # fmt: skip
def test_topics_of_other_messages_are_listed_with_types_and_remedy(
    tmp_path: Path, write: Callable[[Path], Path]
) -> None:
    path = write(tmp_path)
    listed = f"its topics are /angles ({OTHER}), /currents ({OTHER}); record a topic of {TYPE}"
    with pytest.raises(FileError) as refused:
        open_table(path, Format())
    assert listed in str(refused.value).replace("before the cut ", "")
    assert "save positions and torques as columns of a CSV or Parquet file" in str(refused.value)
