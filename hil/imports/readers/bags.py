"""Bags of ROS, opened without unpacking more than the budget of the file.

A bag is read from its storage files. The list in a folder's ``metadata.yaml`` is read here, and the
sizes of everything that rosbags unpacks at once (a file, a chunk or a message) are checked before.
"""

from __future__ import annotations

import shutil
import tempfile
import weakref
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from checked_files.budget import allowed, refuse_beyond
from checked_files.yaml_file import FileError, FileModel, load_yaml
from hil.imports.readers.cut_mcap import CutMcap, lacks_end
from hil.imports.readers.unpacked import (
    Chunk,
    mcap_chunks,
    pieces,
    refuse_inflated_tables,
    refuse_overlapping_chunks,
    unpacked,
    unpackers,
)
from hil.optional_packages import needed_for
from hil.runs.atomic_file import file_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

MESSAGE_MAX = 1 << 17
"""Maximum size of a message of joint states [bytes]: 30 joints have about 2 kB."""
_COMPRESSED = (".zstd", ".zst")
_MENDED = {
    ".mcap": "mcap recover FILE.mcap -o MENDED.mcap",
    ".bag": "rosbag reindex FILE.bag",
    ".db3": "sqlite3 FILE.db3 .recover | sqlite3 MENDED.db3",
}
"""Commands that repair a damaged file, by its ending."""


class _Information(FileModel, extra="ignore"):
    relative_file_paths: tuple[str, ...]
    compression_format: str = ""
    compression_mode: str = ""


class _Listing(FileModel, extra="ignore"):
    rosbag2_bagfile_information: _Information


class Bag:
    """Bag of ROS: a file, or a folder with ``metadata.yaml``.

    Raises
    ------
    FileError
        The bag is damaged, exceeds its budget when unpacked, or links to files outside of its
        folder.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._compressed = path, False
        self._files: tuple[Path, ...] = (path,)
        with needed_for(path), mendable(path), file_errors(path, "read"):
            if path.is_dir():
                self._read_listing()
            for file in self._files:
                refuse_overlapping_chunks(file)
                refuse_inflated_tables(file)
            self._chunks = [mcap_chunks(file) for file in self._files]

    @property
    def lacks_end(self) -> bool:
        """Return True if a file of the bag is an MCAP without its end."""
        return any(map(lacks_end, self._files))

    @contextmanager
    def opened(self) -> Iterator[OpenBag]:
        """Open the bag; any error inside means that the bag is damaged."""
        with needed_for(self._path), mendable(self._path), ExitStack() as stack:
            with file_errors(self._path, "read"):
                readers = []
                for file, chunks in zip(self._files, self._chunks, strict=True):
                    readers.append(_reader(file, chunks))
                    stack.callback(readers[-1].close)
            yield OpenBag(self._path, readers, compressed=self._compressed)

    def _read_listing(self) -> None:
        """Read the list of storage files; unpack compressed files."""
        _refuse_links(self._path)
        about = load_yaml(self._path / "metadata.yaml", _Listing).rosbag2_bagfile_information
        files = [self._path / Path(name).name for name in about.relative_file_paths]
        for number, file in enumerate(files):
            if file in files[:number]:
                raise FileError(f"{file}: is listed twice in metadata.yaml; list it once")
            if not file.is_file():
                raise FileError(f"{file}: is missing; metadata.yaml lists it as a part of the bag")
        mode = about.compression_mode.lower()
        if mode in {"file", "message"} and about.compression_format != "zstd":
            raise FileError(
                f"{self._path}: is compressed as {about.compression_format!r}, not as zstd; unpack"
                " it, and name its files in the map"
            )
        self._compressed = mode == "message"
        self._files = tuple(self._unpack(files) if mode == "file" else files)

    def _unpack(self, files: Sequence[Path]) -> Iterator[Path]:
        """Unpack files into a temporary folder, removed together with the bag."""
        folder = Path(tempfile.mkdtemp(prefix="bag-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        most, size = allowed(self._path), 0
        for file in files:
            plain = folder / (file.stem if file.suffix in _COMPRESSED else file.name)
            with file.open("rb") as packed, plain.open("wb") as out:
                for piece in pieces(packed, file.stat().st_size, unpackers()["zstd"]):
                    if (size := size + len(piece)) > most:
                        refuse_beyond(self._path, size, "its unpacked content")
                    out.write(piece)
            yield plain


class OpenBag:
    """Open bag.

    Parameters
    ----------
    readers : sequence of object
        Readers of the files, by rosbags or `CutMcap`.
    compressed : bool
        True if messages are compressed separately.
    """

    def __init__(self, path: Path, readers: Sequence[Any], *, compressed: bool) -> None:
        self._path, self._readers, self._compressed = path, readers, compressed
        self.is_cdr = all(reader.is2 for reader in readers)

    @property
    def topics(self) -> dict[str, str]:
        """Message type of each topic."""
        return {each.topic: each.msgtype for reader in self._readers for each in reader.connections}

    def messages(self, topic: str, kind: str) -> Iterator[tuple[int, bytes]]:
        """Yield stamp [ns] and content of the messages of a topic."""
        for reader in self._readers:
            here = [c for c in reader.connections if (c.topic, c.msgtype) == (topic, kind)]
            for _, received, data in reader.messages(here) if here else ():
                yield received, self._whole(data)

    def deserialize(self, data: bytes, kind: str) -> Any:
        """Return a message as an object."""
        return self._readers[0].deserialize(data, kind)

    def _whole(self, data: bytes) -> bytes:
        if self._compressed:
            data = unpacked(data, unpackers()["zstd"], MESSAGE_MAX)
        if len(data) > MESSAGE_MAX:
            raise FileError(
                f"{self._path}: has a message of more than {MESSAGE_MAX} bytes, too long for "
                "joint states; name another topic in format: topic"
            )
        return data


def _reader(file: Path, chunks: dict[int, Chunk]) -> Any:
    """Open a file with bounded unpacking."""
    from rosbags.highlevel import AnyReader  # noqa: PLC0415 - optional
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    store = get_typestore(Stores.LATEST)
    # rosbags keeps all chunks with overlapping times; here they are read one after the other
    if lacks_end(file) or sum(chunk.size for chunk in chunks.values()) > allowed(file):
        return CutMcap(file, store)
    reader = AnyReader([file], default_typestore=store)
    reader.open()
    try:
        inner: Any = reader.readers[0]
        if reader.is2:
            _refuse_other_chunks(getattr(inner.storage, "chunks", ()), chunks)
        else:
            for at, chunk in inner.chunks.items():
                bounded = partial(_unpacked_chunk, file, chunk.decompressor)
                inner.chunks[at] = chunk._replace(decompressor=bounded)
    except BaseException:
        reader.close()
        raise
    return reader


def _refuse_other_chunks(indexed: Sequence[Any], there: dict[int, Chunk]) -> None:
    """Refuse an MCAP index with unknown or repeated chunks."""
    found = {
        each.chunk_start_offset: Chunk(
            each.compression, each.compressed_size, each.uncompressed_size
        )
        for each in indexed
    }
    if len(found) < len(indexed) or not found.items() <= there.items():
        raise ValueError("its index lists a missing chunk, or a chunk twice")


def _unpacked_chunk(file: Path, otherwise: Callable[[bytes], bytes], data: bytes) -> bytes:
    """Unpack a chunk of ROS 1 within the budget of its file."""
    most = allowed(file)
    for mark, name in ((b"BZh", "bz2"), (b"\x04\x22\x4d\x18", "lz4")):
        if data.startswith(mark):
            found = unpacked(data, unpackers()[name], most)
            if len(found) > most:
                refuse_beyond(file, len(found), "a chunk")
            return found
    return otherwise(data)


def _refuse_links(folder: Path) -> None:
    """Refuse a rosbag2 with files that are links to outside of its folder."""
    inside = folder.resolve()
    for each in folder.iterdir():
        if not each.resolve().is_relative_to(inside):
            raise FileError(
                f"{each}: is a link to {each.resolve()}, outside the bag's folder; copy the file "
                "into the folder, or name it in the map in place of the folder"
            )


@contextmanager
def mendable(path: Path) -> Iterator[None]:
    """Raise any error of a bag's reader as a `FileError` with the repair command."""
    try:
        yield
    except (OSError, FileError, ModuleNotFoundError):
        raise
    except Exception as error:
        mended = _MENDED.get(path.suffix, _MENDED[".db3"])
        raise FileError(
            f"{path}: cannot be read as a bag: {error or type(error).__name__}; if the recorder "
            f"was killed, repair the bag with: {mended}"
        ) from error
