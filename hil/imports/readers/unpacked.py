"""What files unpack to, counted before a library unpacks them, and where it would read it from.

Libraries unpack a chunk, an array or a variable as a whole, whatever size it has, and HDF5 reads
other files that a file names. Counting unpacks piece by piece and keeps nothing.
"""

from __future__ import annotations

import math
import struct
import sys
import zlib
from importlib import import_module
from typing import TYPE_CHECKING, Any, BinaryIO

from checked_files.budget import allowed, refuse_beyond
from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

_PIECE = 1 << 20
_MCAP_MAGIC, _MCAP_CHUNK = b"\x89MCAP0\r\n", 6
_CHUNK_HEAD = struct.Struct("<QQQIL")
"""Start, end, size unpacked, checksum, length of the compression's name (MCAP, Chunk)."""
_MATLAB_HEAD, _MATLAB_COMPRESSED = 128, 15
"""Bytes before the first element, and the type of a compressed one (MAT-File Format, level 5)."""


def refuse_inflated_chunks(path: Path) -> None:
    """Refuse an MCAP of which a chunk unpacks to more than the file may become (`FileError`)."""
    with path.open("rb") as file:
        if file.read(8) != _MCAP_MAGIC:
            return
        most, unpackers = allowed(path), _unpackers()
        for kind, length in _records(file):
            begin = file.tell()
            if kind == _MCAP_CHUNK and length > _CHUNK_HEAD.size:
                *_, size, _, n = _CHUNK_HEAD.unpack(file.read(_CHUNK_HEAD.size))
                refuse_beyond(path, size, "a chunk")
                unpacker = unpackers.get(file.read(min(n, 16)).decode("ascii", "replace"))
                (packed,) = struct.unpack("<Q", file.read(8).ljust(8, b"\0"))
                if unpacker:
                    left = max(0, begin + length - file.tell())
                    found = _counted(file, min(packed, left), unpacker, most)
                    refuse_beyond(path, found, "a chunk")
            file.seek(begin + length)


def refuse_inflated_variables(path: Path) -> None:
    """Refuse a file of MATLAB whose variables unpack to more than it may become (`FileError`)."""
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
    """Refuse a dataset of HDF5 whose values are in other files, or unpack to too much.

    Raises
    ------
    FileError
    """
    if dataset.is_virtual or dataset.external:
        raise FileError(
            f"{path}: {name} has its values in other files, which are not read; write them into"
            " this one (h5repack)"
        )
    if dataset.chunks:
        size = math.prod(dataset.chunks) * dataset.dtype.itemsize
        refuse_beyond(path, size, f"a chunk of {name}")


def _records(file: BinaryIO) -> Iterator[tuple[int, int]]:
    """Kinds and lengths of records; the caller goes to the end of each."""
    while len(head := file.read(9)) == 9:
        yield struct.unpack("<BQ", head)


def _counted(file: BinaryIO, length: int, unpacker: Callable[[], Any], most: int) -> int:
    """Bytes that `length` bytes of a file unpack to, or some as soon as they are more than `most`.

    zlib gives back what of its input waits, the others keep it.
    """
    found, one, waiting = 0, unpacker(), b""
    while found <= most and (length or waiting or not getattr(one, "needs_input", True)):
        if one.eof:  # another frame follows
            one, waiting = unpacker(), waiting or one.unused_data
        if not waiting and getattr(one, "needs_input", True):
            waiting = file.read(min(length, _PIECE))
            length = length - len(waiting) if waiting else 0
            if not waiting:
                break
        found += len(one.decompress(waiting, _PIECE))
        waiting = one.unused_data if one.eof else getattr(one, "unconsumed_tail", b"")
    return found


def _unpackers() -> dict[str, Callable[[], Any]]:
    """Unpackers of the compressions that MCAP has, by their names there."""
    from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - optional

    zstd = import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")
    return {"lz4": LZ4FrameDecompressor, "zstd": zstd.ZstdDecompressor}
