"""Processor time and memory of an import of ROS joint states, against reading by rosbags alone.

Bags of a Panda at 1 kHz are made on the fly, as MCAP (plain and compressed) and as rosbag2::

    python benchmarks/joint_states.py
    python benchmarks/joint_states.py --seconds 3600 --storage mcap
"""

from __future__ import annotations

import argparse
import resource
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from itertools import islice
from pathlib import Path

import numpy as np
from figures import Figure, keep
from rosbags import rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot

PANDA = Path(__file__).parents[1] / "tests" / "robots" / "panda.yaml"
ROS = get_typestore(Stores.ROS2_HUMBLE)
TYPE = "sensor_msgs/msg/JointState"
NAMES = [f"panda_joint{joint}" for joint in range(1, 8)]
RATE = 1000
BEGIN = 1_700_000_000
STORAGES = ("mcap", "mcap zstd", "rosbag2")
ONE_BY_ONE = 20_000


def values(t: np.ndarray) -> np.ndarray:
    """Return positions, velocities and torques of a motion, shape (n, 21)."""
    robot = Robot.load(str(PANDA))
    middle = (robot.q_min + robot.q_max) / 2
    w = 2 * np.pi * np.linspace(0.11, 0.37, 7)
    turn = np.outer(t, w)
    q, qd, qdd = middle + 0.4 * np.sin(turn), 0.4 * w * np.cos(turn), -0.4 * w**2 * np.sin(turn)
    p = np.random.default_rng(0).uniform(0.1, 0.5, len(base_parameters(robot)))
    tau = inverse_dynamics(robot, p, q, qd, qdd) + 2 * np.tanh(qd / 0.01)
    return np.hstack([q, qd, tau])


def write_bag(folder: Path, seconds: int, storage: str) -> None:
    """Write a bag with messages of all seven joints."""
    kinds = ROS.types
    stamp = kinds["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="base")
    zeros = dict.fromkeys(("position", "velocity", "effort"), np.zeros(7))
    raw = bytearray(ROS.serialize_cdr(kinds[TYPE](header=header, name=NAMES, **zeros), TYPE))
    plugin = rosbag2.StoragePlugin
    kind = plugin.SQLITE3 if storage == "rosbag2" else plugin.MCAP
    writer = rosbag2.Writer(folder, version=9, storage_plugin=kind)
    if storage.endswith("zstd"):
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
    size = len(raw)
    first = [size - 8 * 7 - (2 - part) * (8 + 8 * 7) for part in range(3)]
    with writer:
        topic = writer.add_connection("/joint_states", TYPE, typestore=ROS)
        for second in range(seconds):
            rows = values(second + np.arange(RATE) / RATE)
            for k, row in enumerate(rows):
                nanosec = k * (10**9 // RATE)
                struct.pack_into("<iI", raw, 4, BEGIN + second, nanosec)
                for part, at in enumerate(first):
                    struct.pack_into("<7d", raw, at, *row[7 * part : 7 * part + 7])
                writer.write(topic, (BEGIN + second) * 10**9 + nanosec, bytes(raw))


def write_map(folder: Path, bag: str) -> Path:
    """Write the map of a bag."""
    joints = "".join(
        f"  - position: {{column: position/{name}, unit: rad}}\n"
        f"    velocity: {{column: velocity/{name}, unit: rad/s}}\n"
        f"    torque: {{column: effort/{name}, unit: N m}}\n"
        for name in NAMES
    )
    text = f"robot: {PANDA}\nfiles: [{bag}]\njoints:\n{joints}accept: [range, shape, friction]\n"
    (folder / "map.yaml").write_text(text)
    return folder / "map.yaml"


def imported(the_map: Path) -> tuple[float, float]:
    """Import in a separate process; return processor time [s] and peak memory [GB]."""
    output = the_map.with_name("run")
    command = [sys.executable, "-m", "hil", "import", str(the_map), "-o", str(output)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    shutil.rmtree(output)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return spent, after.ru_maxrss / 1e6


def one_by_one(bag: Path) -> tuple[float, float]:
    """Return the time per message in the container, and in reading by rosbags [us]."""
    with AnyReader([bag]) as reader:
        begun = time.process_time()
        raw = [data for _, _, data in islice(reader.messages(), ONE_BY_ONE)]
        unpacked = time.process_time()
        for data in raw:
            reader.deserialize(data, TYPE)
        read = time.process_time()
    return 1e6 * (unpacked - begun) / len(raw), 1e6 * (read - unpacked) / len(raw)


def main() -> None:
    """Print and keep a line for each kind of bag."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=120, help="duration of the recording")
    parser.add_argument("--storage", choices=STORAGES, action="append")
    stated = parser.parse_args()
    kept: dict[str, Figure] = {}
    for storage in stated.storage or STORAGES:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            write_bag(folder / "bag", stated.seconds, storage)
            spent, memory = imported(write_map(folder, "bag"))
            container, general = one_by_one(folder / "bag")
            n = stated.seconds * RATE
            each, name = 1e6 * spent / n, storage.replace(" ", "-")
            print(
                f"{storage:10s} {n} messages: import {spent:.1f} s of processor time,"
                f" {each:.1f} us a message, {memory:.2f} GB; of a message"
                f" {container:.1f} us are the container's; one by one {general:.1f} us more"
            )
            kept |= {
                f"{name}-over-one-by-one": Figure(each / (container + general)),
                f"{name}-message": Figure(each, "us"),
                f"{name}-container": Figure(container, "us"),
                f"{name}-processor-time": Figure(spent, "s"),
                f"{name}-memory": Figure(memory, "GB"),
            }
    chosen = "".join(f" --storage '{storage}'" for storage in stated.storage or ())
    keep(
        "joint-states", kept, depends=("hil/imports",),
        command=f"python benchmarks/joint_states.py --seconds {stated.seconds}{chosen}",
    )  # fmt: skip


if __name__ == "__main__":
    main()
