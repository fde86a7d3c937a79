"""Messages of ROS 2 by their definitions, serialised as CDR without ROS."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hil.optional_packages import needed_for

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

JOINT_STATE = "sensor_msgs/msg/JointState"
LOG = "rcl_interfaces/msg/Log"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
INFO, WARN, ERROR = 20, 30, 40
"""Levels of a log message."""
OK, WARNING, FAULT, STALE = range(4)
"""Levels of a diagnosis."""
SECOND = 1_000_000_000
"""Second [ns], the unit of all stamps."""


class Diagnosis(NamedTuple):
    """A line of diagnostics.

    Attributes
    ----------
    name : str
        Subject of the diagnosis.
    level : int
        One of the levels above.
    values : mapping of str to str
        Values by key; keys include units.
    """

    name: str
    level: int
    text: str
    values: Mapping[str, str]


class RosMessages:
    """Factory of ROS 2 messages.

    Parameters
    ----------
    what : str
        Option that needs the messages, for the error if rosbags is not installed.
    extra : str
        Extra of the package that installs rosbags.

    Raises
    ------
    FileError
        rosbags is not installed.
    """

    def __init__(self, what: str, extra: str) -> None:
        with needed_for(what, extra):
            from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415 - optional
        self._store = get_typestore(Stores.ROS2_HUMBLE)

    def definition(self, kind: str) -> bytes:
        """Return the text of a type's definition, including nested types."""
        text, _ = self._store.generate_msgdef(kind, ros_version=2)
        return str(text).encode()

    def joint_state(
        self,
        stamp: int,
        names: Sequence[str],
        position: ArrayLike,
        effort: ArrayLike = (),
        velocity: ArrayLike = (),
    ) -> bytes:
        """Return a joint state; omitted quantities are empty, meaning unknown."""
        return self._message(
            JOINT_STATE,
            header=self._header(stamp),
            name=list(names),
            position=np.array(position, dtype=np.float64),
            velocity=np.array(velocity, dtype=np.float64),
            effort=np.array(effort, dtype=np.float64),
        )

    def log(self, stamp: int, level: int, name: str, text: str) -> bytes:
        """Return a log message about `name`."""
        where = {"file": "", "function": "", "line": 0}
        return self._message(
            LOG, stamp=self._stamp(stamp), level=level, name=name, msg=text, **where
        )

    def diagnostics(self, stamp: int, diagnoses: Sequence[Diagnosis]) -> bytes:
        """Return the diagnoses at one instant."""
        types = self._store.types
        status = types["diagnostic_msgs/msg/DiagnosticStatus"]
        value = types["diagnostic_msgs/msg/KeyValue"]
        found = [
            status(
                level=each.level,
                name=each.name,
                message=each.text,
                hardware_id="",
                values=[value(key=key, value=text) for key, text in each.values.items()],
            )
            for each in diagnoses
        ]
        return self._message(DIAGNOSTICS, header=self._header(stamp), status=found)

    def _message(self, kind: str, **content: Any) -> bytes:
        return bytes(self._store.serialize_cdr(self._store.types[kind](**content), kind))

    def _header(self, stamp: int) -> Any:
        return self._store.types["std_msgs/msg/Header"](stamp=self._stamp(stamp), frame_id="")

    def _stamp(self, stamp: int) -> Any:
        seconds, nanoseconds = divmod(stamp, SECOND)
        return self._store.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
