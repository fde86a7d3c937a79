"""Fuzzing of all readers with modified valid files.

The format and a number define an example and reproduce it. `attempt` reads an example in a separate
process and reports whether the reader returned or refused it, the memory used, and any file written
outside of the given folder.
"""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import sys
import traceback
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from data_sheets import sheet
from mjcf_robots import WHOLE
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat
from small_recording import ROBOT, a_map, table, write_csv, write_map
from small_run import write_run
from typer.testing import CliRunner
from urdf_robots import ROBOTS, urdf

from checked_files import budget
from checked_files.errors import HilError
from drivers.canopen.eds_file import read_eds
from drivers.ethercat.esi_file import read_esi
from hil.imports.draft import draft_map
from hil.imports.map_file import Format, load_map
from hil.imports.readers import open_table
from hil.model.readers.dh_table import read_dh
from hil.model.readers.robot_draft import draft_robot, robot_as_stated
from hil.model.readers.urdf import read_urdf
from hil.model.robot import Robot, parse_robot
from hil.runs.journal import read_journal
from hil.runs.run import Run
from sim_plant.__main__ import app as plant

if TYPE_CHECKING:
    from collections.abc import Callable

GRAVITY = (0.0, 0.0, -9.81)
TYPE = "sensor_msgs/msg/JointState"
PATIENCE = 20
"""Processor time for one file of some kilobytes [s]; thirty times as long on a busy machine."""
WORDS = [
    b"", b"0", b"-1", b"1e308", b"-1e-320", b"nan", b"inf", b"9" * 60, b"null", b"true", b"\x00",
    b"\x1b[2J", b"\xff\xfe", b"\n", b"\r", b'"', b"'", b"<", b">", b"{", b"}", b"[", b"]", b"!!x",
    b"&a", b"*a", b"../..", b"/", b"%s", b"\xe2\x80\xa8", b":", b"#", b",", b";", b"$NODEID",
    b"0x7FFFFFFFFFFFFFFFFF", b"\xed\xa0\x80", b"a" * 5000,
]  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """File format: writer of a valid file, and reader."""

    write: Callable[[Path], Path]
    read: Callable[[Path], object]
    changed: str = ""
    """Pattern of the modified files in a folder, for readers of folders."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of an example.

    Attributes
    ----------
    how : str
        ``read``, ``refused``, ``traceback``, or ``died`` of a signal.
    text : str
        The refusal, or the traceback.
    memory : int
        Additional memory [bytes]; `bound` is the budget of the file.
    bound : int
    outside : list of str
        Files written, moved or removed outside of the folder.
    """

    how: str
    text: str
    memory: int
    bound: int
    outside: list[str]

    @property
    def wrong(self) -> str:
        """Violated requirement; empty if there is none."""
        if self.how not in {"read", "refused"}:
            return f"{self.how}: {self.text}"
        if self.memory > self.bound:
            return f"{self.memory / 1e6:.0f} MB, at most {self.bound / 1e6:.0f} MB allowed"
        return f"written outside: {', '.join(self.outside)}" if self.outside else ""


def changed(content: bytes, chance: random.Random) -> bytes:
    """Change, move, double or remove some bytes or words of a file."""
    data = bytearray(content)
    for _ in range(chance.choice([1, 1, 1, 2, 3, 8])):
        at = chance.randrange(len(data) + 1)
        end = min(len(data), at + chance.choice([1, 1, 2, 4, 8, 64, 1024]))
        match chance.randrange(7):
            case 0:
                data[at:end] = chance.choice(WORDS)
            case 1:
                data[at:end] = bytes(chance.randrange(256) for _ in range(end - at))
            case 2:
                data[at:at] = data[at:end]
            case 3:
                del data[at:end]
            case 4:
                number = chance.choice([0, 1, 2**15, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1])
                data[at : at + 8] = number.to_bytes(8, "little")
            case 5:
                to = chance.randrange(len(data) + 1)
                data[to:to] = data[at:end]
            case _:
                if at < len(data):
                    data[at] ^= 1 << chance.randrange(8)
        if chance.random() < 0.02:
            del data[at:]
    return bytes(data)


def made(kind: str, number: int, folder: Path) -> Path:
    """Create an example in a new folder; return the file or folder to be read."""
    chance = random.Random(f"{kind} {number}")
    shutil.copytree(_valid(kind).parent, folder)
    path = folder / _valid(kind).name
    pattern, file = KINDS[kind].changed, path
    if pattern:
        file = chance.choice([each for each in sorted(path.glob(pattern)) if each.is_file()])
    file.write_bytes(changed(file.read_bytes(), chance))
    return path


def attempt(kind: str, path: Path) -> Outcome:
    """Read an example in a separate process."""
    reading, writing = os.pipe()
    if not (child := os.fork()):
        os.close(reading)
        _report_child(kind, path, writing)
    os.close(writing)
    with os.fdopen(reading, "rb") as answer:
        said = answer.read()
    status = os.waitpid(child, 0)[1]
    if said:
        return Outcome(**json.loads(said), bound=_bound(path))
    ended = os.waitstatus_to_exitcode(status)
    return Outcome(
        "died", f"ended by {ended} within {PATIENCE} s of processor time", 0, _bound(path), []
    )


def _bound(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    size = sum(each.stat().st_size for each in files if each.is_file())
    return budget.BASE + budget.SHARE * size


def _report_child(kind: str, path: Path, writing: int) -> None:
    """Read an example, report the outcome, and exit."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(30 * PATIENCE)
    resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    outside: list[str] = []
    inside = str(path.parent.resolve())
    os.chdir(path.parent)

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & 3
        if writes or event in {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.symlink"}:
            place = arguments[0]
            if isinstance(place, (str, bytes)):
                full = os.path.realpath(os.fsdecode(place))
                nameless = event == "open" and Path(full).is_dir()  # gone with its process
                if not nameless and not full.startswith((inside, os.devnull)):
                    outside.append(f"{event} {full}")

    sys.dont_write_bytecode = True
    sys.addaudithook(watch)
    before = _resident()
    try:
        KINDS[kind].read(path)
        how, text = "read", ""
    except HilError as error:
        how, text = "refused", str(error)
    except BaseException:
        how, text = "traceback", traceback.format_exc()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before
    # the child process has a copy of this process until it starts its own program
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    memory = max(memory, children - before)
    answer = {"how": how, "text": text[-4000:], "memory": memory, "outside": outside}
    with os.fdopen(writing, "wb") as out:
        out.write(json.dumps(answer).encode())
    os._exit(0)


def _resident() -> int:
    pages = Path("/proc/self/statm").read_text().split()[1]
    return int(pages) * resource.getpagesize()


@cache
def _valid(kind: str) -> Path:
    """Return a valid file of a format, written once per process and not modified."""
    folder = Path(os.environ["FUZZING_FOLDER"]) / "valid" / kind
    folder.mkdir(parents=True, exist_ok=True)
    return KINDS[kind].write(folder)


def _text(name: str, content: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / name).write_text(content)
        return folder / name

    return write


def _columns() -> dict[str, np.ndarray]:
    return {name: np.asarray(values) for name, values in table(duration=0.5).items()}


def _csv(folder: Path) -> Path:
    write_csv(folder / "a.csv", _columns())
    return folder / "a.csv"


def _lists(folder: Path) -> Path:
    columns = _columns()
    q, tau = (np.column_stack([columns[f"{name}{j}"] for j in (1, 2)]) for name in "qm")
    rows = zip(columns["t"].tolist(), q, tau, strict=True)
    lines = [f'{t},"{each}","{other.tolist()}"' for t, each, other in rows]
    (folder / "a.csv").write_text("\n".join(["t,q,tau", *lines]))
    return folder / "a.csv"


def _npz(folder: Path) -> Path:
    np.savez_compressed(folder / "a.npz", **_columns())
    return folder / "a.npz"


def _npz_stored(folder: Path) -> Path:
    np.savez(folder / "a.npz", **_columns())
    return folder / "a.npz"


def _npy(folder: Path) -> Path:
    np.save(folder / "a.npy", np.stack(list(_columns().values()), axis=1))
    return folder / "a.npy"


def _mat(folder: Path) -> Path:
    savemat(folder / "a.mat", {"data": _columns(), "n": 1.0}, do_compression=True)
    return folder / "a.mat"


def _mat_stored(folder: Path) -> Path:
    savemat(folder / "a.mat", {"data": _columns(), "n": 1.0})
    return folder / "a.mat"


def _h5(folder: Path) -> Path:
    with h5py.File(folder / "a.h5", "w") as file:
        for name, values in _columns().items():
            file.create_dataset(f"data/{name}", data=values, chunks=True, compression="gzip")
    return folder / "a.h5"


def _parquet(folder: Path) -> Path:
    from pyarrow import parquet
    from pyarrow import table as arrow_table

    parquet.write_table(arrow_table(_columns()), folder / "a.parquet")
    return folder / "a.parquet"


def _messages(types: Any, ros1: bool) -> Any:
    kinds = types.types
    stamp_of, header_of = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    for k in range(40):
        header = {"stamp": stamp_of(sec=k, nanosec=0), "frame_id": ""} | (
            {"seq": k} if ros1 else {}
        )
        yield kinds[TYPE](
            header=header_of(**header), name=["a", "b"], position=np.ones(2) * k,
            velocity=np.ones(2), effort=np.ones(2),
        )  # fmt: skip


def _bag(folder: Path, plugin: str) -> Path:
    types = get_typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Writer(
        folder / "bag", version=9, storage_plugin=rosbag2.StoragePlugin[plugin]
    ) as writer:
        topic = writer.add_connection("/joint_states", TYPE, typestore=types)
        for k, message in enumerate(_messages(types, ros1=False)):
            writer.write(topic, k, types.serialize_cdr(message, TYPE))
    return folder / "bag"


def _mcap(folder: Path) -> Path:
    return next(_bag(folder, "MCAP").glob("*.mcap")).rename(folder / "a.mcap")


def _rosbag1(folder: Path) -> Path:
    types = get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(folder / "a.bag") as writer:
        topic = writer.add_connection("/joint_states", TYPE, typestore=types)
        for k, message in enumerate(_messages(types, ros1=True)):
            writer.write(topic, k, types.serialize_ros1(message, TYPE))
    return folder / "a.bag"


def _esi(folder: Path) -> Path:
    done = CliRunner().invoke(plant, ["esi", "--axis", "1", "-o", str(folder / "a.xml")])
    assert not done.exit_code, done.output
    return folder / "a.xml"


def _map(folder: Path) -> Path:
    return Path(write_map(folder, a_map()))


def _run(folder: Path) -> Path:
    write_run(folder / "run", Robot.load("manutec-r15"))
    for path in sorted((folder / "run" / "recordings").iterdir())[4:]:
        path.unlink()
    return folder / "run"


def _journal(folder: Path) -> Path:
    return (_run(folder) / "run.json").rename(folder / "run.json")


def _read_urdf(path: Path) -> None:
    chain = read_urdf(path)
    draft_robot(chain, GRAVITY)
    parse_robot(robot_as_stated(chain, GRAVITY), "robot.yaml")


def _read_table(path: Path) -> None:
    """Draft a map, and read all columns: together where possible, and one by one."""
    draft_map(path, path.name)
    found = open_table(path, Format())
    for columns in (range(len(found.names)), *([k] for k in range(min(20, len(found.names))))):
        try:
            for _ in found.blocks(list(columns)):
                pass
        except HilError:
            continue


def _read_run(path: Path) -> None:
    for _ in Run.open(path):
        pass


_ROWS = [f'{{"t": {k}, "arm": {{"q": [{k}, 0.5]}}, "mode": "run"}}' for k in range(40)]
KINDS = {
    "robot": Kind(_text("robot.yaml", ROBOT), Robot.load),
    "urdf": Kind(_text("arm.urdf", urdf("SCARA", ROBOTS["SCARA"])), _read_urdf),
    "mjcf": Kind(_text("arm.xml", WHOLE), Robot.load),
    "dh": Kind(
        _text("dh.csv", "alpha [rad],a [m],d,theta\n0,0,0.1,q1\npi/2,0.3,0,q2\n"),
        lambda path: draft_robot(read_dh(path, "modified"), GRAVITY),
    ),
    "map": Kind(_map, load_map),
    "eds": Kind(_text("drive.eds", sheet()), read_eds),
    "dcf": Kind(
        _text("drive.dcf", sheet() + "\n[DeviceComissioning]\nNodeID=3\nBaudrate=1000\n"), read_eds
    ),
    "esi": Kind(_esi, read_esi),
    "run": Kind(_run, _read_run, changed="**/*"),
    "journal": Kind(_journal, read_journal),
    "npy": Kind(_npy, _read_table),
    "npz": Kind(_npz, _read_table),
    "npz-stored": Kind(_npz_stored, _read_table),
    "mat": Kind(_mat, _read_table),
    "mat-stored": Kind(_mat_stored, _read_table),
    "h5": Kind(_h5, _read_table),
    "parquet": Kind(_parquet, _read_table),
    "mcap": Kind(_mcap, _read_table),
    "rosbag2": Kind(lambda folder: _bag(folder, "SQLITE3"), _read_table, changed="*"),
    "rosbag": Kind(_rosbag1, _read_table),
    "csv": Kind(_csv, _read_table),
    "lists": Kind(_lists, _read_table),
    "jsonl": Kind(_text("a.jsonl", "\n".join(_ROWS)), _read_table),
    "json": Kind(_text("a.json", f"[{','.join(_ROWS)}]"), _read_table),
    "xml-rows": Kind(_text("a.xml", '<r><q A1="1"/><t>2</t></r>\n' * 40), _read_table),
}
"""All readers of foreign files."""
