"""What the library refuses, as a family of errors: whoever catches `HilError` catches all of it.

Those about an argument are `ValueError` too, as users of numpy expect. Errors of drives and of the
bus, which are of the family as well, stand in `drivers.drive_bus`.
"""

from __future__ import annotations

from checked_files.errors import HilError
from checked_files.yaml_file import FileError

__all__ = [
    "AsymmetricFriction",
    "FileError",
    "FrictionUnknown",
    "HilError",
    "InvalidArray",
    "InvalidValue",
    "Mismatch",
    "NoLoad",
    "NotEnoughData",
    "NotIdentifiable",
    "NotRealisable",
    "UnknownName",
]


class FrictionUnknown(UserWarning):
    """Torques lack the friction of an axis of which too little was measured for a law."""


class InvalidArray(HilError, ValueError):
    """An array of another shape than is wanted, or with values that are no finite numbers."""


class InvalidValue(HilError, ValueError):
    """Values that a robot cannot have; one line a problem, each with its key."""


class UnknownName(HilError, ValueError):
    """A name that nothing has: of a robot, a method or a measurement."""


class Mismatch(HilError, ValueError):
    """Runs or models that cannot be used together, such as those of different robots."""


class NotEnoughData(HilError):
    """A recording without enough usable samples, or a run without the measurements asked for."""


class NotIdentifiable(HilError):
    """Measurements that do not determine the parameters asked for."""


class NotRealisable(HilError):
    """Bounds that no bodies meet."""


class NoLoad(HilError):
    """Two runs from which no load can be estimated."""


class AsymmetricFriction(HilError):
    """Friction that differs by direction more than is accepted, or was never tested for it."""
