"""Whatever goes wrong inside a file, in whichever library, means that the file is damaged."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from checked_files.errors import HilError
from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Array
    from hil.imports.tables import Table

_SHOWN = 120


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Raise any error of a reader, or of what it uses, as a `FileError` that names the file."""
    try:
        yield
    except HilError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:_SHOWN] or type(error).__name__
        raise FileError(
            f"{path}: cannot be read: {reason}; it seems damaged: copy or download it again"
        ) from error


class SoundTable:
    """A table whose errors are `FileError`s; see `hil.imports.tables.Table`."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self.path, self.names, self.time = table.path, table.names, table.time

    def blocks(self, columns: Sequence[int]) -> Iterator[Array]:
        """Read columns block by block."""
        with sound(self.path):
            yield from self._table.blocks(columns)
