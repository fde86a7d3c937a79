"""Known keys of a model at a place of a file, for messages about mistyped keys.

pydantic states the place of an unknown key, but not the known keys at this place. The known keys
follow from the annotations of the fields that lead to the place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args

from pydantic import BaseModel

if TYPE_CHECKING:
    from collections.abc import Iterable


def known_keys(model: type[BaseModel], place: Iterable[str | int]) -> list[str]:
    """Return the known keys at `place`.

    Parameters
    ----------
    model : type
        Model of the whole file.
    place : iterable of str or int
        Location in an error of pydantic, with a separate step for a union's tag.
    """
    here = _models(model)
    for step in place:
        inner = [each.model_fields[step] for each in here if step in each.model_fields]
        if inner:
            here = [found for field in inner for found in _models(field.annotation)]
    return [field for each in here for field in each.model_fields]


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Yield the models in an annotation, through unions, tuples and dictionaries."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for part in get_args(annotation) for found in _models(part)]
