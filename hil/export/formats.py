"""The formats that a model can be exported to, by the names that the command takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import UnknownName
from hil.export.json_file import write_json

if TYPE_CHECKING:
    from hil.export.exported import Exported, Writer
    from hil.results.model import Model

FORMATS: dict[str, Writer] = {
    "json": write_json,
}


def export(model: Model, name: str, origin: tuple[str, ...]) -> Exported:
    """Return the model in a format by its name; nothing is written.

    Raises
    ------
    UnknownName
        There is no such format.
    """
    if name not in FORMATS:
        raise UnknownName(f"{name}: unknown format; available: {', '.join(FORMATS)}")
    return FORMATS[name](model, origin)
