"""MCAP files without an end, left by recorders that were killed or lost power.

The end holds an index; everything else is in consecutive records (mcap.dev/spec): a byte for the
kind, eight for the length, and the content. Complete records are read in order, also within an
incomplete chunk, as far as its compressed data go.
"""

from __future__ import annotations

import struct
from typing import IO, TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"
"""Mark at the start of every file, and at the end of complete files."""
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F
_MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Head of a message: channel, sequence number, log time and publish time [ns]."""
_CHUNK_HEAD = struct.Struct("<QQQI")
"""Head of a chunk: first and last time [ns], size before compression, checksum."""


class Connection(NamedTuple):
    """Topic and type of the messages of a channel."""

    id: int
    topic: str
    msgtype: str


class CutMcap:
    """Complete messages of a file, with the interface of a reader of rosbags.

    Parameters
    ----------
    typestore : object
        Type store of rosbags, with the types of messages.
    """

    is2 = True

    def __init__(self, path: Path, typestore: Any) -> None:
        self._path, self._typestore = path, typestore
        schemas: dict[int, str] = {}
        found: dict[int, Connection] = {}
        for kind, content in self._records():
            number = int.from_bytes(content[:2], "little")
            if kind == _SCHEMA:
                schemas[number] = _string(content, 2)[0]
            elif kind == _CHANNEL:
                schema = schemas.get(int.from_bytes(content[2:4], "little"), "")
                found[number] = Connection(number, _string(content, 4)[0], schema)
        self.connections = list(found.values())

    def messages(
        self, connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, log time [ns] and content of the complete messages of some channels."""
        wanted = {each.id: each for each in connections}
        for kind, content in self._records():
            if kind == _MESSAGE and len(content) >= _MESSAGE_HEAD.size:
                channel, _, received, _ = _MESSAGE_HEAD.unpack_from(content)
                if channel in wanted:
                    yield wanted[channel], received, content[_MESSAGE_HEAD.size :]

    def deserialize(self, content: bytes, kind: str) -> Any:
        """Return a message of CDR as an object."""
        return self._typestore.deserialize_cdr(content, kind)

    def close(self) -> None:
        """Do nothing, since no file stays open."""

    def _records(self) -> Iterator[tuple[int, bytes]]:
        with self._path.open("rb") as file:
            file.seek(len(MAGIC))
            yield from _read_file(file, self._path.stat().st_size)


def lacks_end(path: Path) -> bool:
    """Return True if a file starts as MCAP without ending as one."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return False
        file.seek(-len(MAGIC), 2)
        return file.read() != MAGIC


def _read_file(file: IO[bytes], size: int) -> Iterator[tuple[int, bytes]]:
    while len(head := file.read(9)) == 9:
        kind, length = head[0], int.from_bytes(head[1:], "little")
        if kind == _DATA_END:
            return
        if kind == _CHUNK:
            yield from _read_chunk(file.read(min(length, size)))
        elif kind in {_SCHEMA, _CHANNEL, _MESSAGE} and length <= size - file.tell():
            yield kind, file.read(length)
        else:
            file.seek(min(length, size), 1)


def _read_chunk(chunk: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the complete records of a chunk, which may be cut."""
    if len(chunk) < _CHUNK_HEAD.size + 4:
        return
    compression, begin = _string(chunk, _CHUNK_HEAD.size)
    records, at = _unpacked(chunk[begin + 8 :], compression), 0
    while at + 9 <= len(records):
        end = at + 9 + int.from_bytes(records[at + 1 : at + 9], "little")
        if end > len(records):
            return
        yield records[at], records[at + 9 : end]
        at = end


def _unpacked(data: bytes, compression: str) -> bytes:
    """Decompress data as far as possible; the data may be cut."""
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - comes with mcap

        return bytes(LZ4FrameDecompressor().decompress(data))
    if compression == "zstd":
        from zstandard import ZstdDecompressor  # noqa: PLC0415 - comes with mcap

        return bytes(ZstdDecompressor().decompressobj().decompress(data))
    return data


def _string(content: bytes, at: int) -> tuple[str, int]:
    """Return a text with a length before the text, and the position after the text."""
    end = at + 4 + int.from_bytes(content[at : at + 4], "little")
    return content[at + 4 : end].decode("utf-8", "replace"), end
