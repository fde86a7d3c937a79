"""Checks of the unpacked size of files, and of links to other files, before reading.

Libraries unpack a chunk, an array or a variable as a whole, of any size, and HDF5 follows
references to other files. The check unpacks piece by piece and keeps nothing.
"""

from __future__ import annotations

import io
import math
import sqlite3
import struct
import sys
import zipfile
import zlib
from bz2 import BZ2Decompressor
from contextlib import closing
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

from checked_files.budget import allowed, refuse_beyond
from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

_PIECE = 1 << 20
_MCAP_MAGIC, _MCAP_CHUNK = b"\x89MCAP0\r\n", 6
_CHUNK_HEAD = struct.Struct("<QQQIL")
"""Start, end, size unpacked, checksum, length of the compression's name (MCAP, Chunk)."""
_CHUNK_READ = 2000
"""Bytes of a chunk of MCAP in the indices of two readers; by RSS 1300, for 10 000 chunks."""
_INDEX_HEAD, _ENTRY, _ENTRY_READ = 55, 12, 200
"""Bytes of a ROS 1 index: of its head, of an entry, and of an entry as kept by rosbags."""
_ZIP_ENTRY, _ZIP_ENTRY_READ = b"PK\1\2", 2000
"""Mark of an entry in the directory of an archive, and an entry as kept by two readers [bytes]; by
RSS 1710, for 20 000 entries."""
_SQLITE_MAGIC = b"SQLite format 3\0"
_COLUMNS = 20
"""Maximum number of columns of a table of a bag; rosbag2 has six. Each needs a separate sum."""
_DEFLATE, _LZF, _PLAIN_FILTERS = 1, 32000, (2, 3)
"""Filters of HDF5: compression, and filters that keep the size (shuffle, checksum)."""
_RATIOS = {_DEFLATE: 1032, _LZF: 88}
"""Maximum ratio of unpacking: 258 bytes from two bits, 264 bytes from three."""
_MATLAB_HEAD, _MATLAB_COMPRESSED = 128, 15
"""Bytes before the first element, and the type of a compressed element (MAT-File Format, level
5)."""


class Chunk(NamedTuple):
    """Chunk of MCAP: name of the compression, and sizes before and after unpacking [bytes]."""

    compression: str
    packed: int
    size: int


def mcap_chunks(path: Path) -> dict[int, Chunk]:
    """Return the chunks of an MCAP by start position; none for a file of another kind.

    Raises
    ------
    FileError
        A chunk exceeds the file's budget when unpacked.
    """
    found: dict[int, Chunk] = {}
    with path.open("rb") as file:
        if file.read(8) != _MCAP_MAGIC:
            return found
        most = allowed(path)
        for kind, length in _records(file):
            begin = file.tell()
            if kind == _MCAP_CHUNK and length > _CHUNK_HEAD.size:
                *_, declared, _, n = _CHUNK_HEAD.unpack(file.read(_CHUNK_HEAD.size))
                size = declared
                compression = file.read(min(n, 16)).decode("ascii", "replace")
                (packed,) = struct.unpack("<Q", file.read(8).ljust(8, b"\0"))
                if compression and (unpacker := unpackers().get(compression)):
                    left = max(0, begin + length - file.tell())
                    size = _counted(file, min(packed, left), unpacker, most)
                if (largest := max(declared, size)) > most:
                    refuse_beyond(path, largest, "a chunk")
                found[begin - 9] = Chunk(compression, packed, size)
                if _CHUNK_READ * len(found) > most:
                    refuse_beyond(path, _CHUNK_READ * len(found), f"{len(found)} chunks")
            file.seek(begin + length)
    return found


def refuse_overlapping_chunks(path: Path) -> None:
    """Refuse a bag of ROS 1 with an overlapping or excessive index.

    Raises
    ------
    FileError
    """
    with path.open("rb") as file:
        if not file.readline(16).startswith(b"#ROSBAG V2.0"):
            return
        head = _fields(file)
        if not (index := _number(head, b"index_pos")):
            return  # rosbags refuses a bag without an index
        file.seek(index)
        for _ in range(_number(head, b"conn_count")):
            _fields(file)
            _fields(file)
        places = []
        for _ in range(_number(head, b"chunk_count")):
            about = _fields(file)
            n = _number(about, b"count")
            places.append((_number(about, b"chunk_pos"), n))
            file.seek(4 + 8 * n, 1)
        end, entries = 0, 0
        for begin, n in sorted(places):
            if begin < end:
                raise ValueError("its index refers twice to one place")
            file.seek(begin)
            _fields(file)
            file.seek(_size(file), 1)
            for _ in range(n):
                file.seek(_INDEX_HEAD - 4, 1)
                size = _size(file)
                entries += size // _ENTRY
                file.seek(size, 1)
            end = file.tell()
        refuse_beyond(path, entries * _ENTRY_READ, "its index")


def refuse_inflated_tables(path: Path) -> None:
    """Refuse a bag of SQLite with computed or repeated values.

    Raises
    ------
    FileError
        Views and computed columns can have any size. Default values are stored once for all rows,
        and topics of one number multiply the rows.
    """
    with path.open("rb") as file:
        if file.read(len(_SQLITE_MAGIC)) != _SQLITE_MAGIC:
            return
    if any(mark in str(path.absolute()) for mark in "%?#"):
        raise FileError(
            f"{path}: has one of % ? # in its path, by which SQLite opens other files; rename it"
        )
    most = max(path.stat().st_size, 1_000_000)
    with closing(sqlite3.connect(f"file:{path.absolute()}?mode=ro&immutable=1", uri=True)) as bag:
        bag.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, most)
        bag.execute("PRAGMA trusted_schema = OFF")
        # columns of each table, and True for tables with computed columns
        made = "SELECT name FROM sqlite_master WHERE type = 'view' OR sql LIKE '%virtual%'"
        tables = "SELECT name FROM sqlite_master WHERE type = 'table'"
        columns = "SELECT name, hidden FROM pragma_table_xinfo(?)"
        computed, total = [name for (name,) in bag.execute(made)], 0
        for (table,) in bag.execute(tables).fetchall() if not computed else ():
            held = bag.execute(columns, (table,)).fetchall()
            if len(held) > _COLUMNS:
                raise FileError(
                    f"{path}: table {table!r} has {len(held)} columns, at most {_COLUMNS} allowed;"
                    " record the bag anew"
                )
            for column, hidden in held:
                if hidden:
                    computed.append(f"{table}.{column}")
                    continue
                names = [each.replace('"', '""') for each in (column, table)]
                length = 'SELECT total(length("{}")) FROM "{}"'.format(*names)  # noqa: S608 - read only
                total += int(bag.execute(length).fetchone()[0])
                refuse_beyond(path, total, "its values")
        if computed:
            raise FileError(
                f"{path}: {computed[0]!r} is computed, not stored as in a bag; record the bag anew"
            )
        (n, different) = bag.execute("SELECT count(*), count(DISTINCT id) FROM topics").fetchone()
        if n != different:
            raise ValueError("two topics have the same id")


def refuse_inflated_archive(path: Path) -> None:
    """Refuse an archive of arrays with too many or too large entries, or with two equal names.

    Raises
    ------
    FileError
    """
    entries, last = 0, b""
    with path.open("rb") as file:
        while piece := last + file.read(_PIECE):
            entries += piece.count(_ZIP_ENTRY)
            if len(piece) < _PIECE:
                break
            last = piece[-3:]
    refuse_beyond(path, _ZIP_ENTRY_READ * entries, f"{entries} entries")
    with zipfile.ZipFile(path) as archive:
        names = {each.filename for each in archive.infolist()}
        if len(names) < len(archive.infolist()):
            raise FileError(f"{path}: has two arrays of one name; write it anew")
        refuse_beyond(path, sum(each.file_size for each in archive.infolist()), "its arrays")


def refuse_inflated_variables(path: Path) -> None:
    """Refuse a file of MATLAB with variables beyond its memory budget (`FileError`)."""
    with path.open("rb") as file:
        head = file.read(_MATLAB_HEAD)
        order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
        if order is None:
            return
        most, total = allowed(path), 0
        while len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            begin = file.tell()
            if kind == _MATLAB_COMPRESSED:
                total += _counted(file, length, zlib.decompressobj, most)
                refuse_beyond(path, total, "its variables")
            file.seek(begin + length)


def refuse_elsewhere(path: Path, name: str, dataset: Any) -> None:
    """Refuse a dataset of HDF5 with values in other files or excessive unpacked size.

    Raises
    ------
    FileError
    """
    if dataset.is_virtual or dataset.external:
        raise FileError(
            f"{path}: {name} has its values in other files, which are not read; copy the values "
            "into this file (h5repack)"
        )
    if dataset.chunks:
        size = math.prod(dataset.chunks) * dataset.dtype.itemsize
        refuse_beyond(path, size, f"a chunk of {name}")
        _refuse_inflated_filters(path, name, dataset)


def _refuse_inflated_filters(path: Path, name: str, dataset: Any) -> None:
    """Refuse chunks larger than declared: the filters of HDF5 unpack without a bound."""
    pipeline = dataset.id.get_create_plist()
    filters = [pipeline.get_filter(k)[0] for k in range(pipeline.get_nfilters())]
    unpacking = [each for each in filters if each not in _PLAIN_FILTERS]
    if len(unpacking) > 1 or not set(unpacking) <= _RATIOS.keys():
        raise FileError(
            f"{path}: {name} is compressed by filter {' and '.join(map(str, unpacking))}, whose "
            "unpacked size is unknown in advance; compress it otherwise: h5repack -f GZIP=4 FILE "
            "MENDED"
        )
    most = allowed(path)
    large = []

    def look(chunk: Any) -> None:
        if chunk.size * _RATIOS[unpacking[0]] > most:
            large.append(chunk)

    if unpacking and hasattr(dataset.id, "chunk_iter"):  # HDF5 1.12.3
        dataset.id.chunk_iter(look)
    for chunk in large:
        size = chunk.size * _RATIOS[unpacking[0]]
        if unpacking[0] == _DEFLATE:
            _, packed = dataset.id.read_direct_chunk(chunk.chunk_offset)
            size = len(zlib.decompressobj().decompress(packed, most + 1))
        refuse_beyond(path, size, f"a chunk of {name}")


def _records(file: BinaryIO) -> Iterator[tuple[int, int]]:
    """Yield kinds and lengths of records; the caller seeks the end of every record."""
    while len(head := file.read(9)) == 9:
        yield struct.unpack("<BQ", head)


def _counted(file: BinaryIO, length: int, unpacker: Callable[[], Any], most: int) -> int:
    """Return the unpacked size of a part of a file; counting ends above `most`."""
    found = 0
    for piece in pieces(file, length, unpacker):
        if (found := found + len(piece)) > most:
            break
    return found


def pieces(file: BinaryIO, length: int, unpacker: Callable[[], Any]) -> Iterator[bytes]:
    """Unpack `length` bytes of a file piece by piece.

    zlib returns unused input, other libraries keep it.
    """
    one, waiting = unpacker(), b""
    while length or waiting or not getattr(one, "needs_input", True):
        if one.eof:  # another frame follows
            one, waiting = unpacker(), waiting or one.unused_data
        if not waiting and getattr(one, "needs_input", True):
            waiting = file.read(min(length, _PIECE))
            length = length - len(waiting) if waiting else 0
            if not waiting:
                return
        yield one.decompress(waiting, _PIECE)
        waiting = one.unused_data if one.eof else getattr(one, "unconsumed_tail", b"")


def unpacked(data: bytes, unpacker: Callable[[], Any], most: int) -> bytes:
    """Unpack data; stop soon after `most` bytes."""
    found = bytearray()
    for piece in pieces(io.BytesIO(data), len(data), unpacker):
        found += piece
        if len(found) > most:
            break
    return bytes(found)


@cache
def unpackers() -> dict[str, Callable[[], Any]]:
    """Return the unpackers of the compressions of bags, by name."""
    from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - optional

    zstd = import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")
    return {"bz2": BZ2Decompressor, "lz4": LZ4FrameDecompressor, "zstd": zstd.ZstdDecompressor}


def _fields(file: BinaryIO) -> dict[bytes, bytes]:
    """Return the fields of a record of ROS 1: a length, then lengths, names and values."""
    content, begin = file.read(_size(file)), 0
    found: dict[bytes, bytes] = {}
    while begin < len(content):
        end = begin + 4 + int.from_bytes(content[begin : begin + 4], "little")
        name, _, value = content[begin + 4 : end].partition(b"=")
        found[name], begin = value, end
    return found


def _size(file: BinaryIO) -> int:
    """Return a length; fail at the end of the file."""
    if len(found := file.read(4)) < 4:
        raise ValueError("it ends within its index")
    return int.from_bytes(found, "little")


def _number(fields: dict[bytes, bytes], name: bytes) -> int:
    return int.from_bytes(fields.get(name, b""), "little")
