"""Messages read at once have the values that rosbags reads one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rosbags.typesys")

from rosbags.typesys import Stores, get_typestore

from hil.imports.readers.joint_state_layout import PARTS, OtherLayout, layout_of
from hil.imports.readers.joint_states import LAYOUTS, Rows

ROS = get_typestore(Stores.ROS2_HUMBLE)
TYPE = "sensor_msgs/msg/JointState"
WANTED = [("sec", ""), ("nanosec", ""), ("time", ""), ("received", "")]
WANTED += [(part, joint) for part in PARTS for joint in ("a", "elbow", "né")]

words = st.text("aeλ_ /", max_size=6)
joints = st.lists(st.sampled_from(["a", "elbow", "né", "finger", ""]), max_size=5)
numbers = st.floats(allow_nan=False, width=64)


@st.composite
def joint_states(draw):
    """Return a message: joints in any order, also twice; incomplete or surplus parts."""
    names = draw(joints)
    counts = st.sampled_from([len(names), len(names), 0, len(names) + 1])
    values = {
        part: np.array(draw(st.lists(numbers, min_size=n, max_size=n)), float)
        for part in PARTS
        for n in [draw(counts)]
    }
    stamp = ROS.types["builtin_interfaces/msg/Time"](
        sec=draw(st.integers(-(2**31), 2**31 - 1)), nanosec=draw(st.integers(0, 2**32 - 1))
    )
    header = ROS.types["std_msgs/msg/Header"](stamp=stamp, frame_id=draw(words))
    return ROS.types[TYPE](header=header, name=names, **values)


def general(data):
    return ROS.deserialize_cdr(data, TYPE)


def rows(messages, *, cdr, read=general):
    received = np.arange(len(messages), dtype=float)
    return Rows(WANTED, read, cdr=cdr).convert(messages, received)


@settings(max_examples=50)
@given(st.lists(joint_states(), min_size=1, max_size=12), st.booleans(), st.randoms())
def test_at_once_is_as_one_by_one(states, little, random):
    messages = [bytes(ROS.serialize_cdr(s, TYPE, little_endian=little)) for s in states * 3]
    random.shuffle(messages)
    np.testing.assert_array_equal(rows(messages, cdr=True), rows(messages, cdr=False))


def message(names=("a", "elbow"), frame="base", values=(1.0, 2.0), **parts):
    header = ROS.types["std_msgs/msg/Header"](
        stamp=ROS.types["builtin_interfaces/msg/Time"](sec=1_700_000_000, nanosec=7), frame_id=frame
    )
    every = dict.fromkeys(PARTS, np.array(values)) | parts
    return bytes(ROS.serialize_cdr(ROS.types[TYPE](header=header, name=list(names), **every), TYPE))


def refuse(_):
    raise AssertionError("was read one by one")


SENT = {
    "alike": [message()] * 4,
    "names in turn": [message(), message(("elbow", "a"))] * 2,
    "frames of all lengths": [message(frame="x" * n) for n in range(9)],
    "positions alone": [message(velocity=np.zeros(0), effort=np.zeros(0))] * 2,
    "another publisher's among them": [message(), message(("finger",), values=(0.5,))] * 2,
}


@pytest.mark.parametrize("case", SENT)
def test_what_publishers_send_is_never_read_one_by_one(case):
    messages = SENT[case]
    np.testing.assert_array_equal(rows(messages, cdr=True, read=refuse), rows(messages, cdr=False))


def test_padding_may_hold_anything():
    clean = message(names=("a", "b"))  # 2 bytes of text: padding of 2 before the next length
    at = clean.index(b"a\0") + 2
    dirty = clean[:at] + b"\xff\xee" + clean[at + 2 :]
    assert general(dirty).name == ["a", "b"]
    found = rows([clean, dirty], cdr=True, read=refuse)
    np.testing.assert_array_equal(found[0, 4:], found[1, 4:])


def test_more_layouts_than_are_looked_for_are_read_all_the_same():
    messages = [message(frame="x" * n) for n in range(LAYOUTS + 9)]
    np.testing.assert_array_equal(rows(messages, cdr=True), rows(messages, cdr=False))


OTHER = {
    "nothing": b"",
    "no content": b"\0\1\0\0",
    "cut in the names": message()[:60],
    "cut at its end": message()[:-1],
    "too long": message() + b"\0\0\0\0",
    "big-endian": b"\0\0" + message()[2:],
    "of another encoding": b"\0\7" + message()[2:],
}


@pytest.mark.parametrize("case", OTHER)
def test_bytes_that_are_no_such_message_have_no_layout(case):
    with pytest.raises(OtherLayout):
        layout_of(OTHER[case])


def test_counts_that_no_message_can_hold_are_refused_at_once():
    data = bytearray(message())
    at = data.index(b"base\0") + 8  # the number of names
    data[at : at + 4] = b"\xff\xff\xff\x7f"
    with pytest.raises(OtherLayout):
        layout_of(bytes(data))
