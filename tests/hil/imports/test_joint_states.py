"""Joint states of ROS, from MCAP, rosbag2 and rosbag, without ROS."""

import numpy as np
import pytest
from small_recording import a_map, table, write_map

from checked_files.yaml_file import FileError
from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings
from hil.imports.map_file import Format
from hil.imports.readers import open_table
from hil.imports.tables import NoColumn, column_of

rosbag2 = pytest.importorskip("rosbags.rosbag2")

from rosbags.rosbag1 import Writer as Writer1  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

COLUMNS = table(3.0)
ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
TYPE = "sensor_msgs/msg/JointState"
BEGIN = 1_700_000_000
JOINTS = [
    {key: {"column": f"{part}/{joint}", "unit": unit}
     for key, part, unit in (("position", "position", "rad"), ("velocity", "velocity", "rad/s"),
                             ("torque", "effort", "N m"))}
    for joint in ("shoulder", "elbow")
]  # fmt: skip


def messages(types):
    """Return joint states including the gripper's, names in changing order."""
    kinds = types.types
    stamp_of, header_of = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    for k, t in enumerate(COLUMNS["t"]):
        stamp = stamp_of(sec=BEGIN + int(t), nanosec=round(t % 1 * 1e9))
        header = {"stamp": stamp, "frame_id": ""} | ({"seq": k} if types is ROS1 else {})
        joints = [("shoulder", 1), ("elbow", 2)][:: 1 if k % 2 else -1]
        values = {
            part: np.array([COLUMNS[f"{letter}{j}"][k] for _, j in joints])
            for part, letter in (("position", "q"), ("velocity", "v"), ("effort", "m"))
        }
        yield kinds[TYPE](header=header_of(**header), name=[n for n, _ in joints], **values)
        if k % 5 == 0:
            yield kinds[TYPE](
                header=header_of(**header), name=["finger"], position=np.zeros(1),
                velocity=np.zeros(0), effort=np.zeros(0),
            )  # fmt: skip


def write_bag(path, plugin):
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/joint_states", TYPE, typestore=ROS2)
        other = writer.add_connection("/other", TYPE, typestore=ROS2)
        for k, message in enumerate(messages(ROS2)):
            data = ROS2.serialize_cdr(message, TYPE)
            writer.write(topic, BEGIN * 10**9 + k, data)
            if not k:
                writer.write(other, BEGIN * 10**9, data)


def make(folder, name):
    """Write a bag in one of its formats; return the file or folder for a map."""
    if name == "rosbag":
        with Writer1(folder / "bag.bag") as writer:
            topic = writer.add_connection("/joint_states", TYPE, typestore=ROS1)
            for k, message in enumerate(messages(ROS1)):
                writer.write(topic, BEGIN * 10**9 + k, ROS1.serialize_ros1(message, TYPE))
        return folder / "bag.bag"
    plugin = rosbag2.StoragePlugin
    write_bag(folder / "bag", plugin.MCAP if name == "mcap" else plugin.SQLITE3)
    return next((folder / "bag").glob("*.mcap")) if name == "mcap" else folder / "bag"


@pytest.mark.parametrize("name", ["mcap", "rosbag2", "rosbag"])
def test_joint_states_become_a_run(tmp_path, name):
    bag = make(tmp_path, name).relative_to(tmp_path)
    topic = None if name == "rosbag" else {"topic": "/joint_states"}
    content = a_map(str(bag), time=None, joints=JOINTS, format=topic)
    recording = import_recordings([write_map(tmp_path, content)], tmp_path / "run")["map-01"]
    recording = recording.recording
    np.testing.assert_array_equal(recording.q[:, 0], COLUMNS["q1"])
    np.testing.assert_array_equal(recording.tau[:, 1], COLUMNS["m2"])
    np.testing.assert_allclose(np.diff(recording.time), 0.005, atol=1e-6)


def test_columns_go_by_the_names_of_joints(tmp_path):
    found = open_table(make(tmp_path, "rosbag"), Format())
    assert found.names[:4] == ("time", "received", "sec", "nanosec")
    assert found.names[4:6] == ("position/elbow", "position/shoulder")
    assert "effort/elbow" in found.names
    assert "effort/finger" not in found.names


def test_one_of_several_topics_must_be_named(tmp_path):
    bag = make(tmp_path, "mcap")
    with pytest.raises(FileError, match=r"on /joint_states and /other; name one in format: top"):
        open_table(bag, Format())
    with pytest.raises(FileError, match=r"no joint states on /joints, but on /joint_states"):
        open_table(bag, Format(topic="/joints"))


def test_a_draft_is_of_the_topic_that_its_option_names(tmp_path):
    bag = make(tmp_path, "mcap")
    with pytest.raises(FileError, match=r"with --draft by --format topic=/joint_states"):
        draft_map(bag, "bag.mcap")
    text = draft_map(bag, "bag.mcap", layout=Format(topic="/joint_states"))
    assert 'format:\n  topic: "/joint_states"\n' in text


def write_mcap(path, compression, chunk_size, states=None):
    """Write joint states as MCAP."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=CompressionType[compression],
                        use_chunking=chunk_size > 0)  # fmt: skip
        writer.start(profile="ros2")
        schema = writer.register_schema(TYPE, "ros2msg", ROS2.generate_msgdef(TYPE)[0].encode())
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for k, message in enumerate(states or messages(ROS2)):
            data, t = bytes(ROS2.serialize_cdr(message, TYPE)), BEGIN * 10**9 + k
            writer.add_message(channel, t, data, t)
        writer.finish()


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
@pytest.mark.parametrize("chunk_size", [0, 3000, 10**7])
@pytest.mark.parametrize("share", [0.6, 0.95])
def test_an_mcap_of_a_killed_recorder_is_read_as_far_as_it_goes(
    tmp_path, compression, chunk_size, share
):
    path = tmp_path / "cut.mcap"
    write_mcap(path, compression, chunk_size)
    whole = read(path, "effort/elbow", "position/shoulder")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    if (compression, chunk_size, share) == ("ZSTD", 10**7, 0.6):  # its only block is cut
        with pytest.raises(FileError, match=r"it is truncated .* before the cut it has no topics"):
            open_table(path, Format())
        return
    found = read(path, "effort/elbow", "position/shoulder")
    assert open_table(path, Format()).notes == (
        "it is truncated (recorder killed?): all complete messages are read",
    )
    n = len(found)
    assert n > 0.5 * share * len(whole)  # summary and index are a third of a small file
    np.testing.assert_array_equal(found, whole[:n])


def test_the_statement_of_an_import_says_that_the_end_is_missing(tmp_path):
    write_mcap(tmp_path / "cut.mcap", "LZ4", 3000)
    content = (tmp_path / "cut.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[:-20])
    stated = []
    the_map = write_map(tmp_path, a_map("cut.mcap", time=None, joints=JOINTS))
    import_recordings([the_map], tmp_path / "run", lambda s: stated.extend(s.lines()))
    assert "cut.mcap: it is truncated (recorder killed?): all complete messages" in "\n".join(
        stated
    )


def read(path, *names):
    table = open_table(path, Format(topic="/joint_states"))
    return np.concatenate(list(table.blocks([table.names.index(name) for name in names])))


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("rosbag", "rosbag reindex FILE.bag"), ("rosbag2", r"sqlite3 FILE.db3 .rec")],
)
def test_a_damaged_bag_is_refused_with_the_command_that_mends_it(tmp_path, name, remedy):
    bag = make(tmp_path, name)
    file = bag if bag.is_file() else next(bag.glob("*.db3"))
    file.write_bytes(file.read_bytes()[:5000])
    with pytest.raises(
        FileError, match=f"cannot be read as a bag: .*repair the bag with: {remedy}"
    ):
        open_table(file, Format(topic="/joint_states"))


def test_a_damaged_chunk_of_a_whole_mcap_names_mcap_recover(tmp_path):
    write_mcap(tmp_path / "a.mcap", "LZ4", 3000)
    content = bytearray((tmp_path / "a.mcap").read_bytes())
    content[3000:3100] = bytes(100)
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(FileError, match=r"cannot be read as a bag: .*mcap recover FILE.mcap"):
        list(open_table(tmp_path / "a.mcap", Format()).blocks([4]))


def test_a_folder_without_its_metadata_is_its_only_file(tmp_path):
    bag = make(tmp_path, "rosbag2")
    whole = read(bag, "position/elbow")
    (bag / "metadata.yaml").unlink()
    np.testing.assert_array_equal(read(bag, "position/elbow"), whole)
    (bag / "more.db3").write_bytes(b"SQLite")
    with pytest.raises(FileError, match=r"without metadata.yaml .*bag/bag.db3, .*bag/more.db3"):
        open_table(bag, Format())


def empty_parts(*parts):
    """Return joint states with empty parts."""
    for message in messages(ROS2):
        if len(message.name) > 1:
            for part in parts:
                setattr(message, part, [] if part == "name" else np.zeros(0))
            yield message


def test_messages_that_name_no_joints_have_columns_by_number(tmp_path):
    write_mcap(tmp_path / "a.mcap", "NONE", 3000, [*empty_parts("name")])
    write_mcap(tmp_path / "b.mcap", "NONE", 3000, [*empty_parts()])
    found = open_table(tmp_path / "a.mcap", Format())
    assert found.names[4:] == tuple(f"{p}/{j}" for p in ("position", "velocity", "effort")
                                    for j in (1, 2))  # fmt: skip
    shoulder, elbow = read(tmp_path / "b.mcap", "effort/shoulder", "effort/elbow").T
    swapped = np.arange(len(elbow)) % 2 == 0
    np.testing.assert_array_equal(
        read(tmp_path / "a.mcap", "effort/1")[:, 0], np.where(swapped, elbow, shoulder)
    )
    with pytest.raises(
        NoColumn, match=r"'position/elbow'.*its messages have no joint names: columns are"
    ):
        column_of(found, "position/elbow")


def test_a_part_without_values_is_named(tmp_path):
    write_mcap(tmp_path / "a.mcap", "NONE", 3000, [*empty_parts("effort")])
    found = open_table(tmp_path / "a.mcap", Format())
    with pytest.raises(
        NoColumn, match=r"effort is without values in the messages on /joint_states"
    ):
        column_of(found, "effort/elbow")


def add_gripper(message):
    """Add two joints without efforts."""
    message.name = [*message.name, "left", "right"]
    for part in ("position", "velocity"):
        setattr(message, part, np.append(getattr(message, part), [0.02, 0.02]))


@pytest.mark.parametrize("name", ["mcap", "rosbag"])
def test_efforts_that_are_fewer_than_names_are_columns_by_number(tmp_path, monkeypatch, name):
    def some(types):
        for message in every(types):
            if len(message.name) > 1:
                if message.name[0] == "elbow":
                    for part in ("position", "velocity", "effort"):
                        setattr(message, part, getattr(message, part)[::-1].copy())
                message.name = ["shoulder", "elbow"]
                add_gripper(message)
                yield message

    every = messages
    monkeypatch.setattr(f"{__name__}.messages", some)
    bag = make(tmp_path, name)
    if name == "rosbag":
        found = open_table(bag, Format())
    else:
        found = open_table(bag, Format(topic="/joint_states"))
    note = (
        "its messages have 2 values of effort for 4 names: columns effort/1 to effort/2, in order;"
        " the names are shoulder, elbow, left, right"
    )
    assert found.notes == (note,)
    with pytest.raises(NoColumn, match=r"no column 'effort/elbow'.*2 values of effort for 4 names"):
        column_of(found, "effort/elbow")
    wanted = ("position/elbow", "velocity/shoulder", "effort/1", "effort/2")
    values = np.concatenate(list(found.blocks([column_of(found, each) for each in wanted])))
    expected = [COLUMNS[each] for each in ("q2", "v1", "m1", "m2")]
    np.testing.assert_array_equal(values, np.stack(expected, axis=1))
