"""Measurement as an HDF5 file: arrays with units, planned motion, findings.

The file is made in memory and written as a whole, at the cost of two copies of a small array,
instead of staying open while the robot moves. A checksum over names, types, shapes and content is
verified at every reading; any HDF5 tool can read the file.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from dataclasses import MISSING, asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from pydantic import TypeAdapter, ValidationError

from checked_files.budget import refuse_beyond
from checked_files.foreign_text import whole_line
from checked_files.yaml_file import FileError, refuse_endless
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import RecordedMotion
from hil.runs.atomic_file import write_file
from hil.runs.recording import IDLE, UNITS, Finding, Recording

if TYPE_CHECKING:
    from pathlib import Path

    from hil.model.robot import Robot

FORMAT = 3
_EARLIER = {1: "``stroke`` holds groups unless an axis goes back and forth", 2: "without ``along``"}
"""Formats of earlier versions, with the differences."""
_RUN = "run"
PER_JOINT = ("q", "tau", "qd")
"""Arrays with a column for each joint, in the joint's unit."""
_measurement: TypeAdapter[RecordedMotion] = TypeAdapter(RecordedMotion)


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Measurement in a run folder.

    Attributes
    ----------
    measurement : RecordedMotion
        Planned or imported motion.
    recording : Recording
        Recorded samples.
    attempts : int
        Number of attempts.
    findings : tuple of Finding
        Findings of the checks; empty if passed.
    session : int
        Session of the run, from 0; time restarts in each.
    run : str, optional
        Id of the run; None for runs of earlier versions and imports.
    """

    measurement: RecordedMotion
    recording: Recording
    attempts: int = 1
    findings: tuple[Finding, ...] = ()
    session: int = 0
    run: str | None = None


def write_measured(path: Path, measured: Measured, robot: Robot) -> None:
    """Write a measurement, completely or not at all.

    Parameters
    ----------
    robot : Robot
        Robot, for the units of its joints.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    arrays = measured.recording.arrays
    meta: dict[str, str | int] = {
        "format": FORMAT,
        "measurement": measured.measurement.model_dump_json(),
        "attempts": measured.attempts,
        "findings": json.dumps([asdict(finding) for finding in measured.findings]),
        "session": measured.session,
    }
    if measured.run is not None:
        meta[_RUN] = measured.run
    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        for name, array in arrays.items():
            file.create_dataset(name, data=array).attrs["unit"] = _units(name, robot)
        file.attrs.update(meta)
        file.attrs["checksum"] = checksum(arrays, meta)
    write_file(path, image.getbuffer())


def read_measured(path: Path) -> Measured:
    """Read a measurement and verify the checksum.

    Raises
    ------
    FileError
        The file is missing, damaged or of another format.
    """
    try:
        refuse_endless(path)
        with h5py.File(path, "r") as file:
            there = set(file)  # `in` would follow links
            names = [f.name for f in fields(Recording) if f.default is MISSING or f.name in there]
            arrays = {name: _array(*_dataset(path, file, name)) for name in names}
            # read the scalar attributes but no arrays, which can repeat texts without bound
            attributes: dict[str, object] = {}
            for index in range(h5py.h5a.get_num_attrs(file.id)):
                attribute = h5py.h5a.open(file.id, index=index)
                if not attribute.shape:
                    value = np.empty((), attribute.dtype)
                    attribute.read(value)
                    text = value[()]
                    attributes[attribute.name.decode()] = (
                        text.decode() if isinstance(text, bytes) else text
                    )
        return _decode(path, arrays, attributes)
    except FileNotFoundError as error:
        raise FileError(f"{path}: cannot be read: no such file") from error
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, ValidationError) as error:
        raise FileError(
            f"{path}: is damaged: {str(error).splitlines()[0]}; {replace_or_leave_out(path)}"
        ) from error


def replace_or_leave_out(path: Path) -> str:
    """Return the remedy for an unusable recording in the folder of a run."""
    return (
        "measure it again with --resume, or identify the run without it:"
        f" hil identify {path.parent.parent} --without {path.stem}"
    )


def _units(name: str, robot: Robot) -> str | list[str]:
    """Return the unit of an array, or of the columns for robots with both kinds of joints."""
    stated = UNITS[name]
    if name not in PER_JOINT or robot.revolute.all():
        return stated
    slides = stated.replace("N m", "N").replace("rad", "m")
    each = [stated if turns else slides for turns in robot.revolute]
    return each if robot.revolute.any() else slides


def _dataset(
    path: Path, file: h5py.File, name: str
) -> tuple[h5py.h5d.DatasetID, tuple[int, ...], np.dtype[Any]]:
    """Open an array, with shape and type; refuse arrays in other files or beyond the size limit.

    HDF5's own calls take a third of the time of h5py's views.
    """
    key, links = name.encode(), file.id.links
    here = links.exists(key) and links.get_info(key).type == h5py.h5l.TYPE_HARD
    dataset: Any = h5py.h5o.open(file.id, key) if here else None
    made = dataset.get_create_plist() if isinstance(dataset, h5py.h5d.DatasetID) else None
    if not made or made.get_external_count() or made.get_layout() == h5py.h5d.VIRTUAL:
        raise ValueError(
            f"{name} is missing, not an array, or a link to another file (links are not followed)"
        )
    chunk = made.get_chunk() if made.get_layout() == h5py.h5d.CHUNKED else ()
    shape, dtype = dataset.shape, dataset.dtype
    refuse_beyond(path, max(math.prod(shape), math.prod(chunk)) * dtype.itemsize, name)
    return dataset, shape, dtype


def _array(dataset: h5py.h5d.DatasetID, shape: tuple[int, ...], dtype: np.dtype[Any]) -> np.ndarray:
    array = np.empty(shape, dtype)
    dataset.read(h5py.h5s.ALL, h5py.h5s.ALL, array)
    return array


def _decode(path: Path, arrays: dict[str, np.ndarray], attributes: dict[str, object]) -> Measured:
    keys = ["format", "measurement", "attempts", "findings", "session"]
    keys += [_RUN] if _RUN in attributes else []
    meta = {
        key: value if isinstance(value := attributes[key], str) else int(str(value)) for key in keys
    }
    if meta["format"] not in (*_EARLIER, FORMAT):
        raise FileError(
            f"{path}: format {meta['format']} must be {min(_EARLIER)} to {FORMAT}; use the"
            " version that wrote it"
        )
    if attributes["checksum"] != checksum(arrays, meta):
        raise FileError(
            f"{path}: content does not match its checksum; {replace_or_leave_out(path)}"
        )
    measurement = _measurement.validate_json(str(meta["measurement"]))
    recording = Recording(**arrays)
    return Measured(
        measurement=measurement,
        recording=_separate_groups(measurement, recording) if meta["format"] == 1 else recording,
        attempts=int(meta["attempts"]),
        findings=tuple(_finding(**item) for item in json.loads(str(meta["findings"]))),
        session=int(meta["session"]),
        run=str(meta[_RUN]) if _RUN in meta else None,
    )


def _finding(check: str, message: str, value: float, bound: float) -> Finding:
    return Finding(whole_line(check), whole_line(message), value, bound)


def _separate_groups(measurement: RecordedMotion, recording: Recording) -> Recording:
    """Return a recording of the first format with strokes and groups separated."""
    if not measurement.streamed:
        return recording
    if isinstance(measurement, FreeMotion) and measurement.alone is not None:
        return replace(recording, group=recording.pair)
    return replace(recording, stroke=np.full_like(recording.stroke, IDLE), group=recording.stroke)


def checksum(arrays: dict[str, np.ndarray], meta: dict[str, str | int]) -> str:
    """Return the digest of a recording's arrays and attributes, in hexadecimal."""
    digest = hashlib.blake2b()
    for name, array in sorted(arrays.items()):
        little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        digest.update(f"{name} {little.dtype.str} {little.shape}\n".encode())
        digest.update(little.data)
    digest.update(json.dumps(meta, sort_keys=True).encode())
    return digest.hexdigest()
