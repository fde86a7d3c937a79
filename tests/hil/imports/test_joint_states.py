"""Joint states of ROS, from MCAP, rosbag2 and rosbag, without ROS."""

import numpy as np
import pytest
from small_recording import a_map, table, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings
from hil.imports.map_file import Format
from hil.imports.readers import open_table

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
    """Joint states with the gripper's among them, names in changing order."""
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
    """Write a bag as one of its formats; return the file or folder that a map names."""
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
    with pytest.raises(FileError, match=r"as /joint_states and /other; name one in format: topic"):
        open_table(bag, Format())
    with pytest.raises(FileError, match=r"no joint states as /joints, but as /joint_states"):
        open_table(bag, Format(topic="/joints"))


@pytest.mark.parametrize("name", ["mcap", "rosbag"])
def test_a_bag_without_its_end_is_refused(tmp_path, name):
    bag = make(tmp_path, name)
    bag.write_bytes(bag.read_bytes()[:5000])
    with pytest.raises(FileError, match=r"cannot be read as a bag: .*reindex it"):
        open_table(bag, Format(topic="/joint_states"))
