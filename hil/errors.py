"""Errors of the library, derived from `HilError`.

Errors of arguments are subclasses of `ValueError` too, as users of numpy expect. Errors of drives
and of the bus, derived from `HilError` as well, are in `drivers.drive_bus`.

Examples
--------
>>> issubclass(hil.errors.InvalidArray, (hil.errors.HilError, ValueError))
True
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
    """Warning about torques without the friction of an axis, for lack of measurements for a law."""


class InvalidArray(HilError, ValueError):
    """Array of a wrong shape, or with values that are not finite numbers."""


class InvalidValue(HilError, ValueError):
    """Impossible arguments or values of a robot; a line per problem, with the key."""


class UnknownName(HilError, ValueError):
    """Unknown name of a robot, a method or a measurement."""


class Mismatch(HilError, ValueError):
    """Runs or models that cannot be combined, such as results of different robots."""


class NotEnoughData(HilError):
    """Recording without enough usable samples, or run without the requested measurements."""


class NotIdentifiable(HilError):
    """Measurements that do not determine the requested parameters."""


class NotRealisable(HilError):
    """Bounds without any possible bodies."""


class NoLoad(HilError):
    """Two runs from which no load can be estimated."""


class AsymmetricFriction(HilError):
    """Direction-dependent friction beyond the accepted bound, or friction without a test."""
